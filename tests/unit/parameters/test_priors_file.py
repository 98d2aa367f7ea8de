"""Priors as TOML: what is understood, and that every mistake gets one clear message with its place."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import PriorError
from sma_bayes.fitting.posterior import build_posterior
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.parameters.distributions import (
    LogNormal,
    Normal,
    StudentT,
    TruncatedNormal,
    Uniform,
    numbers,
)
from sma_bayes.parameters.priors_file import (
    PriorSet,
    parse_priors,
    priors_folder,
    read_priors,
    shipped_priors,
)
from sma_bayes.parameters.space import Parameter
from sma_bayes.records.types import Branch, Record
from sma_bayes.response.modified_sigmoid import ModifiedSigmoid

HEAD = 'schema = "sma-bayes/priors/1"\nmodel = "modified_sigmoid"\n'
FORCE = {
    "both.B1": 'family = "lognormal"\nmedian = 2.0\nsigma = 0.5\nunit = "N"',
    "both.B2": 'family = "lognormal"\nmedian = 0.3\nsigma = 0.5\nunit = "1/degC"',
    "both.B3": 'family = "normal"\nmean = 50.0\nsd = 5.0\nunit = "degC"',
    "both.B4": 'family = "normal"\nmean = 0.0\nsd = 1.0\nunit = "N"',
    "noise.sd": 'family = "half_normal"\nsd = 0.1\nunit = "N"',
}


def priors(changes: dict[str, str | None] | None = None, head: str = HEAD) -> PriorSet:
    tables = FORCE | (changes or {})
    text = head + "".join(f"[{name}]\n{body}\n" for name, body in tables.items() if body is not None)
    return parse_priors(text, "my.toml")


@pytest.fixture
def record(make_record: Callable[..., Record]) -> Record:
    return make_record(("force",))


def parameters(prior_set: PriorSet, record: Record, noise: str = "independent") -> dict[str, Parameter]:
    memory = [dict.fromkeys(record.channels, 5.0)]
    posterior = build_posterior([record], NOISE_MODELS[noise], prior_set, memory=memory)
    return {p.name: p for p in posterior.space.parameters}


def refusal(prior_set: PriorSet, record: Record, noise: str = "independent") -> str:
    with pytest.raises(PriorError) as caught:
        parameters(prior_set, record, noise)
    assert caught.value.file == "my.toml"
    return str(caught.value)


# --- what is understood -------------------------------------------------------------------------------


def test_numbers_are_taken_as_written_where_units_agree(record: Record) -> None:
    found = parameters(priors(), record)
    assert found["B1"].prior == LogNormal(2.0, 0.5)
    assert found["B3"].prior == Normal(50.0, 5.0)
    assert found["B3"].unit == "degC"
    assert list(found) == ["B1", "B2", "B3", "B4", "force_sd"]


def test_units_are_converted_once(make_record: Callable[..., Record]) -> None:
    record = make_record(("force", "displacement"))
    found = parameters(
        priors(
            {
                "both.A1": 'family = "lognormal"\nmedian = 2.0\nsigma = 0.5\nunit = "cm"',
                "both.A2": 'family = "lognormal"\nmedian = 0.3\nsigma = 0.5\nunit = "1/kelvin"',
                "both.A3": 'family = "normal"\nmean = 323.15\nsd = 5.0\nunit = "kelvin"',
                "both.A4": 'family = "uniform"\nlow = -10.0\nhigh = 10.0\nunit = "mm"',
                "both.B2": 'family = "lognormal"\nmedian = 0.2\nsigma = 0.5\nunit = "1/degF"',
                "both.B3": (
                    'family = "truncated_normal"\nmean = 122\nsd = 18\nlow = 32\nhigh = 212\nunit = "degF"'
                ),
                "both.B4": 'family = "student_t"\ndf = 4\nmean = 100\nscale = 50\nunit = "gram*g_0"',
                "noise.sd": 'family = "half_normal"\nsd = 0.1\nrelative_to = "span(channel)"',
            }
        ),
        record,
    )
    expected = {
        "A1": LogNormal(0.02, 0.5),
        "A2": LogNormal(0.3, 0.5),
        "A3": Normal(50.0, 5.0),
        "A4": Uniform(-0.01, 0.01),
        "B2": LogNormal(0.36, 0.5),
        "B3": TruncatedNormal(50.0, 10.0, 0.0, 100.0),
        "B4": StudentT(4.0, 0.980665, 0.4903325),
    }
    for name, prior in expected.items():
        assert type(found[name].prior) is type(prior)
        assert numbers(found[name].prior) == pytest.approx(numbers(prior), rel=1e-9, abs=1e-9), name


def test_scales_follow_the_record(record: Record) -> None:
    body = (
        'family = "lognormal"\nmedian = 2.0\nsigma = 0.5\nrelative_to = "span(force)"\nsign = "trend(force)"'
    )
    position = 'family = "normal"\nmean = 0.5\nsd = 0.25\nrelative_to = "position(temperature)"'
    found = parameters(priors({"both.B1": body, "both.B3": position}), record)
    force, t = record.observed["force"], record.temperature
    assert found["B1"].prior.median == pytest.approx(2.0 * (max(force) - min(force)), rel=0.05)
    assert found["B1"].prior.sign == 1.0
    assert found["B3"].prior.mean == pytest.approx(t.mean(), rel=0.01)
    assert found["B3"].prior.sd == pytest.approx(0.25 * (t.max() - t.min()), rel=0.03)
    falling = replace(record, observed={"force": -force})
    assert parameters(priors({"both.B1": body}), falling)["B1"].prior.sign == -1.0


@pytest.mark.parametrize("sign", [1, -1, 1.0, -1.0])
def test_a_sign_can_be_stated(record: Record, sign: float) -> None:
    body = f'family = "lognormal"\nmedian = 2.0\nsigma = 0.5\nunit = "N"\nsign = {sign}'
    assert parameters(priors({"both.B1": body}), record)["B1"].prior.sign == sign


def test_a_parameter_can_be_fixed(record: Record) -> None:
    found = parameters(priors({"both.B4": 'fixed = 250.0\nunit = "mN"'}), record)
    assert found["B4"].fixed == pytest.approx(0.25)
    posterior = build_posterior([record], NOISE_MODELS["independent"], priors({"both.B4": "fixed = 0"}))
    assert posterior.names == ("B1", "B2", "B3", "force_sd")
    assert posterior.space.constrain(posterior.space.prior_centre())[3] == 0.0


def test_a_branch_overrides_what_is_said_of_both(record: Record) -> None:
    own = {"cooling.B3": 'family = "normal"\nmean = 40.0\nsd = 1.0\nunit = "degC"'}
    assert parameters(priors(own), record)["B3"].prior.mean == 50.0
    assert parameters(priors(own), replace(record, branch=Branch.COOLING))["B3"].prior.mean == 40.0


def test_the_first_belief_whose_scale_was_observed_is_used(make_record: Callable[..., Record]) -> None:
    shipped = read_priors("modified_sigmoid")
    both = parameters(shipped, make_record(("displacement", "stiffness")))
    assert both["A1"].source.startswith("the sigmoid spans")
    assert "displacement sets the scale" in both["B1"].source
    alone = parameters(shipped, make_record(("stiffness",)))
    assert "order of magnitude" in alone["A1"].source
    assert alone["A1"].prior.sigma == alone["B1"].prior.sigma  # so that ln(A1 B1) keeps its prior exactly


# --- mistakes -----------------------------------------------------------------------------------------


def test_an_unknown_parameter_lists_near_ones(record: Record) -> None:
    message = refusal(priors({"both.B33": FORCE["both.B3"]}), record)
    assert "no parameter is called 'B33'" in message
    assert "'both.B33'" in message
    assert "'B3'" in message
    assert "no parameter is called 'sdd'" in refusal(priors({"noise.sdd": FORCE["noise.sd"]}), record)


def test_a_prior_of_another_noise_model_does_no_harm(record: Record) -> None:
    extra = {"noise.phi": 'family = "uniform"\nlow = 0.0\nhigh = 1.0'}
    assert list(parameters(priors(extra), record)) == ["B1", "B2", "B3", "B4", "force_sd"]


def test_a_memory_has_the_reference_prior_of_a_stationary_series(record: Record) -> None:
    """``1/(pi sqrt(1 - phi**2))``: Jeffreys' prior, from the information ``1/(1 - phi**2)`` of a sample about phi."""
    phi = parameters(read_priors("modified_sigmoid"), record, "ar1")["force_phi"].prior
    at = np.array([-0.95, -0.3, 0.0, 0.6, 0.99])
    np.testing.assert_allclose(phi.log_density(at), -np.log(np.pi * np.sqrt(1.0 - at**2)), rtol=1e-12)


def test_a_missing_prior_names_parameter_and_branch(record: Record) -> None:
    message = refusal(priors({"both.B3": None}), record)
    assert "no prior for B3 on the heating branch" in message
    assert "sma-bayes priors" in message
    only_cooling = priors({"both.B3": None, "cooling.B3": FORCE["both.B3"]})
    assert "no prior for B3" in refusal(only_cooling, record)
    assert "no prior for force_phi" in refusal(priors(), record, "ar1")


@pytest.mark.parametrize(
    ("table", "unit", "says"),
    [
        ("both.B1", "m", "wrong kind"),
        ("both.B3", "N", "wrong kind"),
        ("both.B2", "degC", "wrong kind"),
        ("both.B1", "Newtonn", "not known"),
        ("both.B1", "arbitrary", "can't be turned into"),
    ],
)
def test_a_unit_of_the_wrong_kind_is_refused(record: Record, table: str, unit: str, says: str) -> None:
    old = tomllib.loads(FORCE[table])["unit"]
    message = refusal(priors({table: FORCE[table].replace(f'"{old}"', f'"{unit}"')}), record)
    assert says in message
    assert f"key {table!r}" in message


def test_a_prior_with_a_unit_can_not_meet_a_record_in_arbitrary_units(record: Record) -> None:
    unknown = replace(record, units={"temperature": "arbitrary", "force": "arbitrary", "time": "s"})
    assert "arbitrary" in refusal(priors(), unknown)


@pytest.mark.parametrize(
    "body",
    [
        'family = "lognormal"\nmedian = -1.0\nsigma = 0.5',
        'family = "lognormal"\nmedian = 1.0\nsigma = 0.0',
        'family = "lognormal"\nmedian = 1.0\nsigma = 0.5\nsign = 0.5',
        'family = "lognormal"\nmedian = 1.0\nsigma = 0.5\nsign = "rising"',
        'family = "lognormal"\nmedian = 1.0\nsigma = 0.5\nrelative_to = "position(force)"',
        'family = "lognormal"\nmedian = 1.0',
        'family = "normal"\nmean = 1.0\nsd = 1.0\nsign = -1',
        'family = "uniform"\nlow = 2.0\nhigh = 1.0',
        'family = "truncated_normal"\nmean = 0.0\nsd = 1.0\nlow = 0.0\nhigh = 0.0',
        'family = "normal"\nmean = 0.0\nsd = 1.0\nrelative_to = "spam(force)"',
        'family = "normal"\nmean = 0.0\nsd = 1.0\nrelative_to = "span(forse)"',
        'family = "normal"\nrelative_to = "span(force)"',
    ],
)
def test_wrong_numbers_are_refused_when_they_meet_a_record(record: Record, body: str) -> None:
    assert "key 'both.B1'" in refusal(priors({"both.B1": body}), record)


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('family = "norml"\nmean = 0.0\nsd = 1.0', "'normal'"),
        ("mean = 0.0\nsd = 1.0", "family"),
        ("family = 3", "family = 3"),
        ('family = ["normal"]\nmean = 0.0\nsd = 1.0', "family = ['normal']"),
        ('family = "normal"\nmean = 0.0\nsd = 1.0\nmaen = 3.0', "unknown key 'maen'"),
        ('family = "normal"\nmean = 0.0\nsd = 1.0\nsigma = 3.0', "unknown key 'sigma'"),
        ('family = "normal"\nmean = "0"\nsd = 1.0', "a finite number"),
        ('family = "normal"\nmean = true\nsd = 1.0', "a finite number"),
        ('family = "normal"\nmean = nan\nsd = 1.0', "a finite number"),
        ('family = "normal"\nmean = 0.0\nsd = inf', "a finite number"),
        ('family = "normal"\nmean = 0.0\nsd = 1.0\nunit = 3', "a text"),
        ('family = "normal"\nmean = 0.0\nsd = 1.0\nrelative_to = ["span(force)"]', "a text"),
        ('family = "lognormal"\nmedian = 1.0\nsigma = 1.0\nsign = [1]', "sign"),
        ('family = "lognormal"\nmedian = 1.0\nsigma = 1.0\nsign = true', "sign"),
        ('family = "lognormal"\nmedian = 1.0\nsigma = 1.0\nsign = nan', "sign"),
        ('fixed = "zero"', "a finite number"),
        ("fixed = inf", "a finite number"),
        ("fixed = 1.0\nmean = 2.0", "unknown key 'mean'"),
    ],
)
def test_what_can_not_be_understood_is_refused_on_reading(body: str, says: str) -> None:
    with pytest.raises(PriorError) as caught:
        priors({"both.B1": body})
    assert says in str(caught.value)
    assert (caught.value.file, caught.value.column) == ("my.toml", "both.B1")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("schema = \n", "not valid TOML"),
        (HEAD + "[both.B1\n", "not valid TOML"),
        (HEAD + "[both.B1]\nfamily='normal'\n[both.B1]\nfamily='normal'\n", "not valid TOML"),
        ("", "schema = None"),
        ('schema = "sma-bayes/priors/99"\n', "sma-bayes/priors/99"),
        (HEAD + "boht = 3\n", "unknown key 'boht'"),
        (HEAD + "[heatign.B1]\nfixed = 0.0\n", "'heating'"),
        (HEAD + "both = 3\n", "both"),
        (HEAD + 'noise = "little"\n', "noise"),
        (HEAD + "[both]\nB1 = 3\n", "both.B1"),
        (HEAD + "[both]\nB1 = [3]\n", "both.B1"),
    ],
)
def test_a_file_that_is_no_priors_file_is_refused(text: str, says: str) -> None:
    with pytest.raises(PriorError) as caught:
        parse_priors(text, "my.toml")
    assert says in str(caught.value)
    assert caught.value.file == "my.toml"


def test_a_file_that_can_not_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PriorError, match="can't be read"):
        read_priors(tmp_path / "none.toml")
    with pytest.raises(PriorError, match="can't be read"):
        read_priors(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"schema = \xff\xfe\x00")
    with pytest.raises(PriorError, match="can't be read"):
        read_priors(binary)


def test_an_unknown_set_lists_those_that_ship() -> None:
    with pytest.raises(PriorError, match="no priors are called 'modified_sigmiod'") as caught:
        read_priors("modified_sigmiod")
    assert "modified_sigmoid" in str(caught.value)


# --- what ships ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", shipped_priors())
def test_shipped_priors_say_where_each_comes_from(name: str) -> None:
    prior_set = read_priors(name)
    assert prior_set.title
    assert prior_set.text == (priors_folder() / f"{name}.toml").read_text(encoding="utf-8")
    for table in prior_set.entries.values():
        for beliefs in table.values():
            assert all(b.source for b in beliefs)


@pytest.mark.parametrize("noise", list(NOISE_MODELS))
@pytest.mark.parametrize("channels", [("force",), ("displacement",), ("stiffness",), ("displacement", "stiffness"),
                                      ("force", "stiffness"), ("force", "displacement", "stiffness")])  # fmt: skip
def test_the_default_priors_serve_every_model_and_noise(
    make_record: Callable[..., Record], channels: tuple[str, ...], noise: str
) -> None:
    found = parameters(read_priors("modified_sigmoid"), make_record(channels), noise)
    assert set(ModifiedSigmoid(channels).parameter_names) <= set(found)
    assert {f"{c}_sd" for c in channels} <= set(found)


def test_numbers_without_a_unit_or_a_scale_are_refused(record: Record) -> None:
    message = refusal(priors({"both.B2": 'family = "normal"\nmean = 0.3\nsd = 0.1'}), record)
    assert "both.B2" in message
    assert "neither a unit nor a scale" in message
    assert "unit = '1/degC'" in message


def test_a_prior_too_narrow_for_floating_point_numbers_is_refused(record: Record) -> None:
    body = 'family = "normal"\nmean = 1e49\nsd = 1e-49\nunit = "1/degC"'
    message = refusal(priors({"both.B2": body}), record)
    assert "quartiles are one number" in message
    assert "fixed = " in message


def test_a_byte_order_mark_is_no_mistake_and_a_typing_error_has_a_row(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text("\ufeff" + read_priors("modified_sigmoid").text, encoding="utf-8")
    assert read_priors(path).title == read_priors("modified_sigmoid").title
    path.write_text('schema = "sma-bayes/priors/1"\n[both\n', encoding="utf-8")
    with pytest.raises(PriorError, match=r"p\.toml, row 2: is not valid TOML"):
        read_priors(path)
