"""`ask` against the bands that the same fit wrote, and what it refuses."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.errors import (
    MeasurementError,
    OutputError,
    QuantityError,
    SmaBayesError,
    UnknownNameError,
)
from sma_bayes.quantities import convert
from sma_bayes.records.types import Branch, Calibration, Campaign, Record
from sma_bayes.response.arrangement import ArrangedSpring, Arrangement
from sma_bayes.studies.ask.terminal import answer_text


@pytest.fixture(scope="module")
def folder(make_record: Callable[..., Record], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fit of a spring with a bias spring, of a stiffness with an uncertain scale, and of a specimen's strain."""
    stiff = make_record(("stiffness",), n=40, B2=0.45, condition="k")
    strain = make_record(("displacement",), n=40, condition="wire", A1=-0.04)
    records = (
        *(make_record(n=40, branch=b, seed=i, B2=0.45) for i, b in enumerate(Branch)),
        replace(stiff, calibration={"stiffness": Calibration(0.05, 0.0, 2.0)}),
        replace(strain, specimen=True, units={**strain.units, "displacement": "1"}),
    )
    out = tmp_path_factory.mktemp("asked") / "fit"
    campaign = Campaign("spring", "spring", "0" * 64, records)
    bias = ArrangedSpring(Arrangement.PARALLEL)
    fit_campaign(campaign, out, noise="independent", bias=bias, jobs=1, figures=False)
    return out


STORED = {"stiffness": "N/m", "overall_stiffness": "N/m", "force": "N", "displacement": "m"}
"""Units of the bands of a spring."""


def band_of(folder: Path, key: str, channel: str) -> dict[str, Any]:
    with (folder / "bands" / f"{key}-{channel}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        name: np.array([float(r[name] or "nan") for r in rows]) for name in rows[0] if name != "extrapolated"
    }


@pytest.mark.parametrize(
    ("key", "channel", "asked"),
    [
        ("c-heating", "stiffness", {"stiffness": "150 N/m"}),
        ("c-cooling", "stiffness", {"stiffness": "0.15 N/mm"}),
        ("c-heating", "force", {"force": "150 gram_force"}),
        ("c-cooling", "displacement", {"displacement": "12 mm"}),
        ("c-heating", "overall_stiffness", {"overall_stiffness": "280 N/m"}),
        ("k-heating", "stiffness", {"stiffness": "150 N/m"}),
        ("wire-heating", "displacement", {"displacement": "-1.8 percent"}),
    ],
)
def test_where_the_bands_pass_the_value_the_stretches_end(
    folder: Path, key: str, channel: str, asked: dict[str, str]
) -> None:
    """The curve is at least K* with probability 0.95 where its 5 % quantile is: bands are written by other code."""
    condition, branch = key.rsplit("-", 1)
    found = sma_bayes.ask(folder, **asked, condition=condition, branch=branch, probability=0.95)
    (answer,) = found["answers"]
    band = band_of(folder, key, channel)
    t = band["temperature_degC"]
    unit = "1" if condition == "wire" else STORED[channel]
    for kind, quantile, sign in (("at_least", "q05", 1.0), ("at_most", "q95", -1.0)):
        apart = sign * (convert(band[quantile], unit, answer["unit"]) - answer["target"])
        edges = np.flatnonzero(np.diff(np.sign(apart)))
        crossings = [t[i] - apart[i] * (t[i + 1] - t[i]) / (apart[i + 1] - apart[i]) for i in edges]
        assert crossings
        told = [e for s in answer[kind]["intervals"] for e in (s["low"], s["high"])]
        inner = [e for e in told if t[0] + 1e-9 < e < t[-1] - 1e-9]
        np.testing.assert_allclose(inner, crossings, atol=0.03)
    assert answer["reachable"] == 1.0
    low, high = (answer[end][q] for end, q in (("least", "median"), ("greatest", "median")))
    assert low < answer["target"] < high


def test_within_a_tolerance(folder: Path) -> None:
    """Brute force: draws of the stored posterior, counted on a fine grid."""
    found = sma_bayes.ask(folder, stiffness="150 N/m", tolerance="20 N/m", condition="c", branch="heating")
    (answer,) = found["answers"]
    assert answer["bounds"] == [130.0, 170.0]
    draws = next(d for d in sma_bayes.stored_draws(folder) if d.key == "c-heating")
    t = np.linspace(*answer["measured"], 3001)
    sure = np.mean(np.abs(draws.curve("stiffness", t) - 150.0) <= 20.0, axis=0)
    inside = np.flatnonzero(sure >= 0.9)
    assert inside.size > 3
    starts = inside[np.diff(inside, prepend=-2) > 1]
    told = [s["low"] for s in answer["within"]["intervals"]]
    np.testing.assert_allclose(told, t[starts], atol=0.02)
    assert answer["within"]["best"]["probability"] == pytest.approx(sure.max(), abs=0.01)
    passing = answer["passages"][0]
    assert passing["low"] < passing["median"] < passing["high"]
    assert found["converged"]
    json.dumps(found, allow_nan=False)


def test_an_uncertain_temperature_narrows_what_is_sure(folder: Path) -> None:
    """A force that rises is at least F* where T + error is beyond its passage: quantiles of their difference.

    200,000 drawn errors; the 90 % quantile has a standard error of about 0.004 degC.
    """
    asked: dict[str, Any] = {"force": "1.5 N", "condition": "c", "branch": "heating", "tolerance": "30 %"}
    (sure,) = sma_bayes.ask(folder, **asked)["answers"]
    (unsure,) = sma_bayes.ask(folder, **asked, temperature_sd=1.0)["answers"]
    draws = next(d for d in sma_bayes.stored_draws(folder) if d.key == "c-heating")
    b1, b2, b3, b4 = (draws.parameter(f"B{i}") for i in range(1, 5))
    share = (1.5 - b4) / b1
    passage = b3 + np.log(share / (1.0 - share)) / b2
    rng = np.random.default_rng(2)
    needed = rng.choice(passage, 200_000) - rng.standard_normal(200_000)
    assert unsure["at_least"]["intervals"][0]["low"] == pytest.approx(np.quantile(needed, 0.9), abs=0.05)
    assert unsure["passages"] == sure["passages"]
    (narrow,), (wide,) = (a["within"]["intervals"] for a in (unsure, sure))
    assert wide["low"] < narrow["low"] < narrow["high"] < wide["high"]


def test_the_answer_is_in_the_units_of_the_question(folder: Path) -> None:
    """A pound-force is 4.4482216152605 N; a difference of 1 degC is one of 1.8 degF and of 1 K."""
    asked: dict[str, Any] = {"condition": "c", "branch": "heating", "probability": 0.8}
    pound = 4.4482216152605
    (own,) = sma_bayes.ask(
        folder,
        force=f"{0.35 * pound} N",
        tolerance=f"{0.2 * pound} N",
        temperature_sd=1.0,
        extrapolate=5.0,
        **asked,
    )["answers"]
    found = sma_bayes.ask(
        folder, force="0.35 lbf", tolerance=f"{0.2 * pound} N", temperature_sd=1.8, extrapolate=9.0,
        temperature_unit="degF", **asked,
    )  # fmt: skip
    (other,) = found["answers"]
    assert (own["unit"], own["temperature_unit"]) == ("N", "degC")
    assert (other["unit"], other["temperature_unit"]) == ("lbf", "degF")
    assert other["target"] == 0.35
    assert other["bounds"] == pytest.approx([0.15, 0.55])
    assert other["least"] == pytest.approx({k: v / pound for k, v in own["least"].items()})

    def fahrenheit(celsius: Any) -> Any:
        return pytest.approx(32.0 + 1.8 * np.array(celsius), abs=1e-6)

    assert other["searched"] == fahrenheit(own["searched"])
    assert own["passages"]
    for name in ("low", "median", "high"):
        assert [p[name] for p in other["passages"]] == fahrenheit([p[name] for p in own["passages"]])
    for kind in ("within", "at_least", "at_most"):
        assert own[kind]["intervals"]
        for end in ("low", "high"):
            places = [[s[end] for s in a[kind]["intervals"]] for a in (other, own)]
            assert places[0] == fahrenheit(places[1])
    text = answer_text(found)
    assert "temperature set to within 1.8 °F (sd)" in text
    assert "F = 0.35 lbf" in text
    assert "°C" not in text


def test_rare_passages_are_counted_and_not_listed(folder: Path) -> None:
    found = sma_bayes.ask(folder, force="1.5 N", condition="c", branch="heating")
    passages = found["answers"][0]["passages"]
    (passage,) = passages
    assert passage["probability"] > 0.9
    assert "below 0.05" not in answer_text(found)
    passages += [{**passage, "direction": "falling", "probability": p} for p in (0.05, 0.049, 0.001)]
    text = answer_text(found)
    assert (text.count(" rising at "), text.count(" falling at ")) == (1, 1)
    assert "and 2 passages with a probability each below 0.05; --json lists all" in text


def test_a_magnitude_of_a_negative_stiffness_is_answered_by_the_value_to_ask_for(folder: Path) -> None:
    found = sma_bayes.ask(folder, stiffness="150 N/m", condition="c", branch="heating")
    assert "is negative" not in answer_text(found)
    (answer,) = found["answers"]
    for end in ("least", "greatest"):
        answer[end] = {"low": -900.0, "median": -500.0, "high": -100.0}
    told = "the stiffness is negative, force falls where displacement grows: ask for -150 N/m"
    assert told in answer_text(found)
    answer["target"] = -150.0
    assert "is negative" not in answer_text(found)


def test_a_number_without_a_unit_is_in_that_of_the_fit(folder: Path) -> None:
    """A tolerance of 0.004 on a strain of -1.8 percent is 0.4 percent."""
    (answer,) = sma_bayes.ask(folder, displacement="-1.8 percent", tolerance="0.004", condition="wire")[
        "answers"
    ]
    assert answer["bounds"] == pytest.approx([-2.2, -1.4])


def test_what_is_not_reached_is_said_so_and_extrapolation_is_marked(folder: Path) -> None:
    (answer,) = sma_bayes.ask(folder, force="9 N", condition="c", branch="heating")["answers"]
    assert (answer["reachable"], answer["stays_below"], answer["stays_above"]) == (0.0, 1.0, 0.0)
    assert answer["passages"] == answer["within"]["intervals"] == []
    assert answer["within"]["best"] is None
    (answer,) = sma_bayes.ask(folder, force="0.4 N", condition="c", branch="heating")["answers"]
    assert answer["stays_above"] == 1.0
    (answer,) = sma_bayes.ask(folder, stiffness="0.2 N/m", condition="c", branch="heating", extrapolate=60.0)[
        "answers"
    ]
    assert answer["reachable"] < 0.05
    assert answer["passages"]
    assert all(p["extrapolated"] for p in answer["passages"])


def test_a_wide_search_sees_no_less_of_what_was_measured(folder: Path) -> None:
    asked: dict[str, Any] = {"stiffness": "150 N/m", "condition": "c", "branch": "heating"}
    (near,) = sma_bayes.ask(folder, **asked)["answers"]
    (far,) = sma_bayes.ask(folder, **asked, extrapolate=5000.0)["answers"]
    inside = [p for p in far["passages"] if not p["extrapolated"]]
    assert inside == near["passages"]
    assert far["reachable"] == near["reachable"]
    for end in ("least", "greatest"):
        assert far[end] == pytest.approx(near[end], rel=1e-4)


def test_records_that_cannot_tell_are_named(folder: Path) -> None:
    found = sma_bayes.ask(folder, force="1.5 N")
    assert [a["key"] for a in found["answers"]] == ["c-heating", "c-cooling"]
    assert set(found["without"]) == {"k-heating", "wire-heating"}


@pytest.mark.parametrize(
    ("asked", "error", "told"),
    [
        ({}, SmaBayesError, "no value is asked for"),
        ({"force": "1 N", "stiffness": "1 N/m"}, SmaBayesError, "stiffness and force are asked for at once"),
        ({"stiffness": "150"}, QuantityError, "has no unit"),
        ({"stiffness": "150 N"}, QuantityError, "wrong kind"),
        ({"stiffness": "150 N/furlng"}, QuantityError, "not known"),
        ({"stiffness": "stiff"}, QuantityError, "stiffness 'stiff'"),
        ({"stiffness": "150 N/m", "tolerance": "5"}, QuantityError, "tolerance '5' has no unit"),
        ({"stiffness": "150 N/m", "tolerance": "-5 %"}, QuantityError, "tolerance"),
        ({"stiffness": "150 N/m", "tolerance": "5 N %"}, QuantityError, "tolerance"),
        ({"stiffness": "150 N/m", "probability": 0.0}, SmaBayesError, "probability 0"),
        ({"stiffness": "150 N/m", "extrapolate": float("inf")}, SmaBayesError, "extrapolate"),
        ({"stiffness": "150 N/m", "temperature_sd": -1.0}, SmaBayesError, "temperature-sd"),
        (
            {"stiffness": "150 N/m", "temperature_unit": "N"},
            QuantityError,
            "'N' of temperature is of the wrong",
        ),
        ({"stiffness": "150 N/m", "temperature_unit": "degG"}, QuantityError, "'degG' of temperature is not"),
        (
            {"stiffness": "150 N/m", "temperature_unit": ""},
            QuantityError,
            "'' of temperature is of the wrong",
        ),
        ({"stiffness": "150 N/m", "temperature_unit": "F"}, QuantityError, "degC, degF or kelvin"),
        ({"stiffness": "150 N/m", "condition": "d"}, UnknownNameError, "unknown condition 'd'"),
        ({"stiffness": "150 N/m", "branch": "heatin"}, UnknownNameError, "unknown branch"),
        (
            {"stiffness": "150 N/m", "condition": "k", "branch": "cooling"},
            UnknownNameError,
            "no cooling branch",
        ),
        ({"force": "1 N", "condition": "k"}, MeasurementError, "no force follows from k-heating"),
        ({"force": "1 Pa", "condition": "wire"}, MeasurementError, "no stress follows from wire-heating"),
        ({"overall_stiffness": "1 N/m", "condition": "wire"}, MeasurementError, "no overall stiffness"),
    ],
)
def test_what_can_not_be_asked(
    folder: Path, asked: dict[str, Any], error: type[SmaBayesError], told: str
) -> None:
    with pytest.raises(error, match=told):
        sma_bayes.ask(folder, **asked)


def test_a_folder_without_a_fit(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="holds no run"):
        sma_bayes.ask(tmp_path, stiffness="1 N/m")


def test_conditions_that_share_parameters_can_be_asked(
    make_record: Callable[..., Record], tmp_path: Path
) -> None:
    records = tuple(make_record(("force",), n=30, condition=c, seed=i) for i, c in enumerate("ab"))
    shared = Campaign("s", "s", "0" * 64, records)
    fit_campaign(shared, tmp_path / "out", pool="campaign", noise="independent", jobs=1, figures=False)
    found = sma_bayes.ask(tmp_path / "out", force="1.5 N")
    a, b = (answer["passages"][0]["median"] for answer in found["answers"])
    assert a == b
