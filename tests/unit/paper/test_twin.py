"""The twin campaign: right curves, right noise, the same every time."""

from __future__ import annotations

import pickle
from decimal import Decimal, localcontext

import numpy as np
import pytest

from sma_bayes.errors import UnknownNameError
from sma_bayes.paper.tables import PARAMETER_TABLES, STATISTICS_TABLES, CellStatus
from sma_bayes.paper.twin import DEFAULT_POINTS, curves, printed_values, recipes, truth, twin_campaign
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.types import Branch

RECIPES = pytest.mark.parametrize("recipe", recipes(), ids=lambda recipe: recipe.key)


def literal(temperature: float, v: dict[str, float]) -> dict[str, Decimal]:
    """Eqs. (2), (4) and (7), symbol by symbol as printed, in 50 digits."""
    with localcontext() as context:
        context.prec = 50
        t = Decimal(temperature)
        a1, a2, a3, a4, b1, b2, b3, b4 = (
            Decimal(v[f"{letter}{number}"]) for letter in "AB" for number in range(1, 5)
        )
        ea, eb = (-a2 * (t - a3)).exp(), (-b2 * (t - b3)).exp()
        return {
            "force": b4 + b1 / (1 + eb),
            "displacement": a4 + a1 / (1 + ea),
            "stiffness": (b1 * b2 * eb * (1 + ea) ** 2) / (a1 * a2 * ea * (1 + eb) ** 2),
        }


@RECIPES
def test_curves_are_the_printed_equations(recipe) -> None:
    value = truth(recipe.key)
    for i, temperature in enumerate(recipe.temperature):
        for channel, expected in literal(float(temperature), value).items():
            assert recipe.curves[channel][i] == pytest.approx(float(expected), rel=1e-10), channel


def test_stiffness_is_the_slope_of_the_path() -> None:
    recipe = recipes()[0]
    fine = np.linspace(1.5, 3.0, 20_001)
    at = curves(fine, truth(recipe.key))
    slope = np.gradient(at["force"], fine) / np.gradient(at["displacement"], fine)
    np.testing.assert_allclose(at["stiffness"][1:-1], slope[1:-1], rtol=1e-6)


def test_there_are_eighteen_records_in_the_order_of_the_tables() -> None:
    campaign = twin_campaign()
    assert [r.key for r in campaign.records][:2] == ["1A-10mHz-heating", "1A-10mHz-cooling"]
    assert [r.key for r in campaign.records] == [recipe.key for recipe in recipes()]
    assert len({r.key for r in campaign.records}) == 18
    assert {"2A-10mHz-table3-heating", "2A-10mHz-table5-heating"} <= {r.key for r in campaign.records}


def test_units_are_those_of_the_paper() -> None:
    for record in twin_campaign().records:
        assert dict(record.units) == {
            "temperature": "arbitrary",
            "force": "N",
            "displacement": "cm",
            "stiffness": "N/cm",
        }


@RECIPES
def test_the_record_shows_both_sigmoids(recipe) -> None:
    value = truth(recipe.key)
    low, high = recipe.temperature.min(), recipe.temperature.max()
    for channel, letter in (("displacement", "A"), ("force", "B")):
        share = recipe.curves[channel] / value[f"{letter}1"]
        assert share.min() <= 1 / (1 + np.exp(5)) + 1e-12
        assert share.max() >= 1 / (1 + np.exp(-5)) - 1e-12
        assert low <= value[f"{letter}3"] - 5 / value[f"{letter}2"]
        assert high >= value[f"{letter}3"] + 5 / value[f"{letter}2"]
    assert np.all(np.diff(recipe.temperature) * (1 if recipe.branch is Branch.HEATING else -1) > 0)


def test_points_and_noise_follow_the_sound_statistics() -> None:
    statistics = {
        f"{cell.condition}-{cell.branch}": table.select(cell.condition, cell.branch)
        for table in STATISTICS_TABLES
        for cell in table.cells
    }
    points = {}
    for recipe in recipes():
        column = statistics[recipe.key]
        if column["rmse"].sound:
            assert recipe.noise_sd["stiffness"] == pytest.approx(column["rmse"].value, rel=1e-12)
        if column["sse"].sound and column["rmse"].sound:
            points[recipe.key] = recipe.temperature.size
        else:
            assert recipe.temperature.size == DEFAULT_POINTS
            assert "assumed" in recipe.points_reason
    assert list(points.values()) == [91, 88, 73, 128, 28, 69, 26, 31, 41, 103, 32]


@RECIPES
def test_noise_is_the_same_share_of_every_span(recipe) -> None:
    shares = [recipe.noise_sd[channel] / np.ptp(recipe.curves[channel]) for channel in CHANNELS]
    np.testing.assert_allclose(shares, shares[0], rtol=1e-12)
    assert f"{shares[0]:.2%}" in recipe.noise_reason


def test_lost_noise_is_the_median_of_the_known() -> None:
    by_status: dict[bool, list[float]] = {True: [], False: []}
    for recipe in recipes():
        by_status["assumed" not in recipe.noise_reason].append(
            recipe.noise_sd["stiffness"] / np.ptp(recipe.curves["stiffness"])
        )
    assert (len(by_status[True]), len(by_status[False])) == (12, 6)
    np.testing.assert_allclose(by_status[False], np.median(by_status[True]), rtol=1e-12)


def test_residuals_have_the_declared_noise() -> None:
    """20 seeds, 18 records, 3 channels: z = (y - curve)/sd is standard normal, to 4.5 standard errors."""
    z = np.concatenate(
        [
            (record.observed[channel] - recipe.curves[channel]) / recipe.noise_sd[channel]
            for seed in range(20)
            for record, recipe in zip(twin_campaign(seed).records, recipes(), strict=True)
            for channel in CHANNELS
        ]
    )
    assert abs(z.mean()) < 4.5 / np.sqrt(z.size)
    assert abs(z.var() - 1) < 4.5 * np.sqrt(2 / z.size)


def test_noise_streams_are_unrelated() -> None:
    campaign = twin_campaign()
    streams = [
        ((record.observed[channel] - recipe.curves[channel]) / recipe.noise_sd[channel])[:26]
        for record, recipe in zip(campaign.records, recipes(), strict=True)
        for channel in CHANNELS
    ]
    correlation = np.corrcoef(streams)
    np.fill_diagonal(correlation, 0.0)
    assert np.abs(correlation).max() < 0.85  # 1431 pairs of 26 samples; equal streams would give 1


def test_the_same_seed_gives_the_same_campaign_and_another_does_not() -> None:
    one, same, other = twin_campaign(3), twin_campaign(3), twin_campaign(4)
    assert one.sha256 == same.sha256 != other.sha256
    for a, b, c in zip(one.records, same.records, other.records, strict=True):
        for channel in CHANNELS:
            np.testing.assert_array_equal(a.observed[channel], b.observed[channel])
            assert np.all(a.observed[channel] != c.observed[channel])


def test_a_channel_does_not_depend_on_its_companions() -> None:
    everything = twin_campaign()
    alone = twin_campaign(channels=("stiffness",))
    assert alone.sha256 != everything.sha256
    for a, b in zip(everything.records, alone.records, strict=True):
        assert b.channels == ("stiffness",)
        assert set(b.units) == {"temperature", "stiffness"}
        np.testing.assert_array_equal(a.observed["stiffness"], b.observed["stiffness"])


@pytest.mark.parametrize("channels", [(), ("torque",), ("force", "torque")])
def test_unknown_or_no_channels_are_refused(channels: tuple[str, ...]) -> None:
    with pytest.raises(UnknownNameError, match="expected: one or more of force, displacement, stiffness"):
        twin_campaign(channels=channels)


def test_truth_is_what_is_printed() -> None:
    printed = printed_values()
    assert len(printed) == 18
    for key, cells in printed.items():
        value = truth(key)
        assert list(value) == ["A1", "A2", "A3", "A4", "B1", "B2", "B3", "B4"]
        assert value["A4"] == value["B4"] == 0.0
        assert {name: value[name] for name in cells} == {name: cell.value for name, cell in cells.items()}
    assert truth("2A-30mHz-heating")["A2"] == 10.08
    assert sum(len(table.cells) for table in PARAMETER_TABLES) == sum(len(c) for c in printed.values())


def test_truth_of_an_unknown_record_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean '1A-10mHz-heating'"):
        truth("1A-10mHz-heat")


def test_every_record_is_accounted_for() -> None:
    campaign = twin_campaign()
    general, *accounts = campaign.findings
    assert "A4 = B4 = 0" in general.message
    for record, finding in zip(campaign.records, accounts, strict=True):
        assert (finding.condition, finding.branch, finding.count) == (
            record.condition.id,
            record.branch.value,
            record.n,
        )
        doubted = {c.status for c in printed_values()[record.key].values()} - {CellStatus.OK}
        assert ("implausible" in finding.message) == bool(doubted)


def test_recipes_and_campaigns_pickle_and_can_not_be_changed() -> None:
    campaign = pickle.loads(pickle.dumps(twin_campaign()))
    assert campaign.sha256 == twin_campaign().sha256
    recipe = pickle.loads(pickle.dumps(recipes()[0]))
    assert recipe.key == recipes()[0].key
    with pytest.raises(ValueError, match="read-only"):
        recipes()[0].temperature[0] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        recipes()[0].curves["force"][0] = 0.0
