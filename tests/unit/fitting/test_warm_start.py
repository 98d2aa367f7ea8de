"""Least-squares warm start: certified values, the paper's twin, what the data leave free, and mistakes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError
from sma_bayes.fitting.posterior import Posterior, build_posterior
from sma_bayes.fitting.warm_start import WarmStart, warm_start
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.paper.twin import truth, twin_campaign
from sma_bayes.parameters.priors_file import parse_priors, read_priors
from sma_bayes.records.types import Branch, Condition, Record

DEFAULT = read_priors("modified_sigmoid")
FX = ("force", "displacement")
ALL = ("force", "displacement", "stiffness")
KEYS = [r.key for r in twin_campaign(0, ("force",)).records]


def posterior_of(record: Record, text: str | None = None) -> Posterior:
    priors = DEFAULT if text is None else parse_priors(text, "test.toml")
    return build_posterior([record], NOISE_MODELS["independent"], priors)


def start_of(record: Record, text: str | None = None, seed: int = 0) -> WarmStart:
    return warm_start(posterior_of(record, text), np.random.default_rng(seed))


# --- against certified values -------------------------------------------------------------------------

RAT42_PRIORS = """
schema = "sma-bayes/priors/1"
[both.B1]
family = "lognormal"
median = 100.0
sigma = 1.0
unit = "arbitrary"
[both.B2]
family = "lognormal"
median = 0.1
sigma = 1.0
unit = "1/arbitrary"
[both.B3]
family = "normal"
mean = 40.0
sd = 20.0
unit = "arbitrary"
[both.B4]
fixed = 0.0
[noise.sd]
family = "lognormal"
median = 1.0
sigma = 1.0
unit = "arbitrary"
"""


def read_nist(path: Path) -> tuple[np.ndarray, np.ndarray, dict[str, tuple[float, float]], float, float]:
    """Data, certified parameters with standard deviations, and residual statistics of a StRD file."""
    lines = path.read_text().splitlines()
    certified = {}
    for line in lines:
        words = line.split()
        if len(words) == 6 and words[1] == "=" and words[0].startswith("b"):
            certified[words[0]] = (float(words[4]), float(words[5]))
    sums = {k: float(line.split(":")[1]) for line in lines for k in ("Residual Sum", "Residual Standard")
            if line.startswith(k)}  # fmt: skip
    first = max(i for i, line in enumerate(lines) if line.startswith("Data:")) + 1
    y, x = np.array([[float(w) for w in line.split()] for line in lines[first:] if line.split()]).T
    return x, y, certified, sums["Residual Sum"], sums["Residual Standard"]


@pytest.fixture
def rat42(shared_data: Path) -> Path:
    return shared_data / "nist_strd" / "Rat42.dat"


def test_rat42_comes_out_as_certified(rat42: Path) -> None:
    """NIST StRD Rat42, y = b1/(1 + exp(b2 - b3 x)): B1 = b1, B2 = b3, B3 = b2/b3, to 6 digits."""
    x, y, certified, sse, deviation = read_nist(rat42)
    record = Record(
        Condition("rat42"), Branch.HEATING, {"temperature": x}, {"force": y}, np.arange(9) + 61,
        {"temperature": "arbitrary", "force": "arbitrary"},
    )  # fmt: skip
    start = start_of(record, RAT42_PRIORS)
    b1, b2, b3, b4 = start.theta
    assert b4 == 0.0
    assert start.rank == 3
    assert b1 == pytest.approx(certified["b1"][0], rel=1e-6)
    assert b2 == pytest.approx(certified["b3"][0], rel=1e-6)
    assert b2 * b3 == pytest.approx(certified["b2"][0], rel=1e-6)
    assert start.sd[0] == pytest.approx(certified["b1"][1], rel=1e-6)
    assert start.sd[1] == pytest.approx(certified["b3"][1], rel=1e-6)
    assert start.sd[3] == 0.0
    fit = start.fit[0]["force"]
    assert (fit.n, fit.p) == (9, 3)
    assert fit.sse == pytest.approx(sse, rel=1e-9)
    assert fit.rmse == pytest.approx(deviation, rel=1e-9)
    assert fit.r2 == pytest.approx(1.0 - sse / np.sum((y - y.mean()) ** 2), rel=1e-12)
    assert 1.0 - fit.adj_r2 == pytest.approx((1.0 - fit.r2) * 8.0 / 6.0, rel=1e-9)


# --- on the paper's twin ------------------------------------------------------------------------------


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("channels", [FX, ("stiffness",)], ids=["force-displacement", "stiffness"])
def test_the_twins_parameters_are_found_within_their_errors(key: str, channels: tuple[str, ...]) -> None:
    """Five standard errors for each of 6 to 8 parameters of a record; the seeds are fixed."""
    record = twin_campaign(0, channels).record(key)
    start = start_of(record)
    true = truth(key)
    names = posterior_of(record).model.parameter_names
    for name, value, sd in zip(names, start.theta, start.sd, strict=True):
        if np.isfinite(sd):
            assert abs(value - true[name]) < 5.0 * sd, name
    assert start.at_bound == ()
    if channels == FX:
        assert (start.rank, start.free_directions) == (8, ())
        assert np.isfinite(start.sd).all()
    else:
        assert start.rank == 5
        assert start.free_directions == ("0.71 ln A1 + 0.71 ln B1",)
        at = dict(zip(names, start.theta, strict=True))
        assert np.isinf(start.sd[[names.index("A1"), names.index("B1")]]).all()
        assert at["B1"] / at["A1"] == pytest.approx(true["B1"] / true["A1"], rel=0.2)


@pytest.mark.parametrize("key", KEYS)
def test_channels_that_share_parameters_are_weighed_by_their_residuals(key: str) -> None:
    start = start_of(twin_campaign(0, ALL).record(key))
    assert start.rank == 8
    assert all(g.r2 > 0.98 for g in start.fit[0].values())


@pytest.mark.parametrize("seed", range(5))
def test_random_starts_lead_to_one_optimum(seed: int) -> None:
    record = twin_campaign(0, FX).records[0]
    reference = start_of(record, seed=99)
    np.testing.assert_allclose(start_of(record, seed=seed).theta, reference.theta, rtol=1e-5, atol=1e-7)


def test_the_same_seed_gives_the_same_bits() -> None:
    record = twin_campaign(0, ("stiffness",)).records[2]
    first, second = start_of(record), start_of(record)
    np.testing.assert_array_equal(first.theta, second.theta)
    np.testing.assert_array_equal(first.sd, second.sd)


# --- signs --------------------------------------------------------------------------------------------

SIGNS = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]


@pytest.mark.parametrize(("a", "b"), SIGNS)
@pytest.mark.parametrize(
    "channels", [("stiffness",), ("displacement", "stiffness"), ("force", "stiffness"), FX, ALL], ids="-".join
)
def test_curves_may_fall_and_the_slope_may_be_negative(
    make_record: Callable[..., Record], channels: tuple[str, ...], a: float, b: float
) -> None:
    """K = dF/dX is negative where one of force and displacement rises on heating and the other falls."""
    record = make_record(channels, A1=0.02 * a, B1=2.5 * b)
    assert all(g.r2 > 0.99 for g in start_of(record).fit[0].values())


def test_a_prior_of_the_wrong_sign_gives_a_poor_fit_and_no_crash(make_record: Callable[..., Record]) -> None:
    record = make_record(("stiffness",), A1=-0.02)
    text = DEFAULT.text.replace('sign = "trend(displacement)"', "sign = 1").replace(
        'sign = "trend(force)"', "sign = 1"
    )
    start = start_of(record, text)
    assert np.isfinite(start.theta).all()
    assert start.fit[0]["stiffness"].r2 < 0.0


# --- mistakes and edges -------------------------------------------------------------------------------


def test_fewer_samples_than_parameters_is_an_error(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",), n=40)
    few = replace(
        record,
        inputs={k: v[:3] for k, v in record.inputs.items()},
        observed={"force": record.observed["force"][[0, 20, 39]]},
        row=record.row[:3],
        source="short.csv",
    )
    with pytest.raises(MeasurementError, match="3 samples can't determine 4 parameters") as caught:
        start_of(few)
    assert caught.value.file == "short.csv"
    assert "fix parameters" in str(caught.value)


def test_as_many_samples_as_parameters_is_enough(make_record: Callable[..., Record]) -> None:
    fit = start_of(make_record(("force",), n=4)).fit[0]["force"]
    assert (fit.n, fit.p) == (4, 4)
    assert np.isfinite(fit.rmse)


def test_a_constant_channel_has_no_r2(make_record: Callable[..., Record]) -> None:
    record = make_record(("force",))
    fit = start_of(replace(record, observed={"force": np.full(record.n, 2.0)})).fit[0]["force"]
    assert fit.sse == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(fit.r2)
    assert np.isnan(fit.adj_r2)


def test_everything_fixed_leaves_the_curve_as_it_is(make_record: Callable[..., Record]) -> None:
    values = {"B1": 2.5, "B2": 0.35, "B3": 52.0, "B4": 0.5}
    units = {"B1": "N", "B2": "1/degC", "B3": "degC", "B4": "N"}
    text = 'schema = "sma-bayes/priors/1"\n'
    text += "".join(f'[both.{k}]\nfixed = {v}\nunit = "{units[k]}"\n' for k, v in values.items())
    text += '[noise.sd]\nfamily = "half_normal"\nsd = 1.0\nunit = "N"\n'
    start = start_of(make_record(("force",)), text)
    np.testing.assert_array_equal(start.theta, list(values.values()))
    np.testing.assert_array_equal(start.sd, np.zeros(4))
    assert start.rank == 0
    assert start.fit[0]["force"].p == 0
    assert start.fit[0]["force"].r2 > 0.99


def test_pooled_records_are_fitted_together(make_record: Callable[..., Record]) -> None:
    records = [make_record(FX, seed=i, condition=f"c{i}") for i in range(3)]
    pooled = build_posterior(records, NOISE_MODELS["independent"], DEFAULT)
    start = warm_start(pooled, np.random.default_rng(0))
    assert len(start.fit) == len(start.residual) == 3
    alone = start_of(records[0])
    np.testing.assert_allclose(start.sd, alone.sd / np.sqrt(3.0), rtol=0.5)
    for record, residual in zip(records, start.residual, strict=True):
        curve = pooled.model.predict(start.theta, record.inputs)["force"]
        np.testing.assert_allclose(residual["force"], record.observed["force"] - curve, atol=1e-12)


def test_two_equal_steps_leave_more_than_one_optimum(make_record: Callable[..., Record]) -> None:
    """A record with two separate steps: one sigmoid can take either; different starts find both."""
    record = make_record(("force",), n=120, span=(0.0, 100.0))
    t = record.temperature
    steps = 1.0 / (1.0 + np.exp(-3.0 * (t - 30.0))) + 1.0 / (1.0 + np.exp(-3.0 * (t - 70.0)))
    two = replace(record, observed={"force": steps})
    found = {round(float(start_of(two, seed=s).theta[2])) for s in range(6)}
    assert found <= set(range(25, 76))
    assert all(start_of(two, seed=s).fit[0]["force"].r2 > 0.7 for s in range(3))
