"""Catalogues: look-up, near matches, and entries from other distributions."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from importlib.metadata import EntryPoint

import pytest

from sma_bayes import catalogue as module
from sma_bayes.catalogue import Catalogue, not_a
from sma_bayes.errors import SmaBayesError, UnknownNameError

GROUP = "sma_bayes.tests"


@pytest.fixture
def shapes() -> Catalogue[int]:
    return Catalogue("shape", {"triangle": 3, "square": 4})


@pytest.fixture
def provide(monkeypatch: pytest.MonkeyPatch):
    """Let other distributions provide entries; returns the list of groups that were asked for."""

    def install(points: Iterable[EntryPoint]) -> list[str]:
        asked: list[str] = []

        def entry_points(*, group: str) -> tuple[EntryPoint, ...]:
            asked.append(group)
            return tuple(points)

        monkeypatch.setattr(module, "entry_points", entry_points)
        return asked

    return install


def test_it_is_a_mapping_in_the_order_of_its_table(shapes: Catalogue[int]) -> None:
    assert list(shapes) == ["triangle", "square"]
    assert dict(shapes) == {"triangle": 3, "square": 4}
    assert len(shapes) == 2
    assert "square" in shapes
    assert "circle" not in shapes
    assert 4 not in shapes


def test_a_failed_look_up_names_the_nearest(shapes: Catalogue[int]) -> None:
    with pytest.raises(UnknownNameError) as caught:
        shapes["sqare"]
    assert str(caught.value) == "no shape is called 'sqare'\nexpected: did you mean 'square'?"


def test_a_failed_look_up_is_not_a_key_error(shapes: Catalogue[int]) -> None:
    with pytest.raises(UnknownNameError, match="known: 'square', 'triangle'"):
        shapes.get("xyz")


def test_later_changes_of_the_table_do_not_leak_in() -> None:
    table = {"triangle": 3}
    shapes = Catalogue("shape", table)
    table["square"] = 4
    assert "square" not in shapes


def test_other_distributions_join_by_entry_point(provide) -> None:
    asked = provide([EntryPoint("tau", "math:tau", GROUP)])
    numbers = Catalogue("number", {"one": 1.0}, entry_point_group=GROUP)
    assert asked == []  # nothing is loaded before it is needed
    assert list(numbers) == ["one", "tau"]
    assert numbers["tau"] == pytest.approx(6.283185307179586)
    assert asked == [GROUP]


@pytest.mark.parametrize("first_use", [len, list, lambda c: "tau" in c, lambda c: c["tau"]])
def test_entries_of_others_are_there_at_the_first_use_of_any_kind(provide, first_use) -> None:
    provide([EntryPoint("tau", "math:tau", GROUP)])
    assert first_use(Catalogue("number", {}, entry_point_group=GROUP))


def test_two_providers_of_one_name_are_an_error(provide) -> None:
    provide([EntryPoint("one", "math:tau", GROUP)])
    numbers = Catalogue("number", {"one": 1.0}, entry_point_group=GROUP)
    with pytest.raises(UnknownNameError, match=r"two packages provide the number 'one'(.|\n)*math:tau"):
        numbers["one"]


def test_a_clash_does_not_go_away_when_asked_again(provide) -> None:
    provide([EntryPoint("one", "math:tau", GROUP)])
    numbers = Catalogue("number", {"one": 1.0}, entry_point_group=GROUP)
    for _ in range(2):
        with pytest.raises(UnknownNameError, match="two packages"):
            len(numbers)


def test_an_entry_that_can_not_be_imported_is_told_with_its_package(provide) -> None:
    provide([EntryPoint("circle", "there_is_no_such_module:CIRCLE", GROUP)])
    with pytest.raises(
        SmaBayesError, match="the shape 'circle' of another package can't be loaded"
    ) as caught:
        Catalogue("shape", {"square": 4}, GROUP)["square"]
    assert "there_is_no_such_module:CIRCLE" in str(caught.value)


@pytest.mark.parametrize(
    ("fault", "value", "why"),
    [
        (not_a(float), "math:tau", ""),
        (not_a(Fraction), "math:tau", "math:tau is a float, not a Fraction"),
        (not_a(Fraction), "fractions:Fraction", r"is a class, not an instance: append \(\).*, Fraction\(\)"),
        (not_a(type), "fractions:Fraction", ""),
        (not_a(type), "math:tau", "is a float, not a class"),
        (not_a(type, "__name__"), "fractions:Fraction", "has the __name__ 'Fraction', not .*, 'mine'"),
        (not_a(object, "id"), "math:tau", "has the id None, not the name of its entry point, 'mine'"),
    ],
)
def test_an_entry_of_another_kind_or_name_is_refused(provide, fault, value: str, why: str) -> None:
    provide([EntryPoint("mine", value, GROUP)])
    entries = Catalogue("thing", {}, GROUP, fault)
    if not why:
        assert list(entries) == ["mine"]
        return
    with pytest.raises(SmaBayesError, match=f"the thing 'mine' of another package can't be used: .*{why}"):
        list(entries)
