"""The registry of errata: whole, tied to the tables, and every effect against a number got another way.

Numbers below are worked out from digits typed from the text and from equations written out here, so that the
registry and these tests share nothing but the paper.
"""

from __future__ import annotations

import dataclasses
import re
from math import exp, log, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import null_space
from scipy.optimize import approx_fprime
from scipy.stats import pearsonr

from sma_bayes.paper.effects import EFFECTS, Amount
from sma_bayes.paper.errata import PRINTED_TABLES, address, errata
from sma_bayes.paper.tables import CellStatus

ROOT = Path(__file__).resolve().parents[3]
PAPER = ROOT.parent / "shared" / "paper"

ROWS = np.fromstring(
    """
    0.7226 4.5500 2.0000 0.5411 4.769 2.5380    0.6515 23.2500 2.7090 0.5031 23.7700 2.7210
    0.7870 2.4730 2.4900 0.6307 2.6761 3.0040   1.2250 1.8290 2.0730 0.9400 2.0660 2.5280
    0.9778 1.1350 2.7540 1.0730 1.0940 3.7330   0.4069 2.6930 2.2230 0.4126 2.4880 2.6490
    0.6590 3.0290 3.390 0.5196 3.2510 3.5260    0.9557 2.0950 3.4870 0.7279 2.2940 3.6950
    0.7096 2.1240 3.1430 0.6893 2.2130 3.5590   1.3810 1.4950 3.5890 1.3070 1.5740 4.1420
    0.3156 2.0740 2.5720 0.3409 1.9810 3.1600   0.6976 1.8010 3.0450 0.7277 1.8040 3.6190
    0.4415 2.9600 2.7100 0.3995 3.0550 2.9520   0.8171 1.2270 2.9350 0.7851 1.2280 3.7020
    0.4187 10.0800 3.0550 0.4096 10.4900 3.0920 0.3599 2.1780 2.7650 0.3578 2.2530 3.1750
    0.2222 5.7580 2.2850 0.2107 5.8630 2.4340   1.4930 2.9890 2.5090 1.4170 3.2350 2.7540
    """,
    sep=" ",
).reshape(18, 6)
"""Tables 3 to 5: A1 A2 A3 B1 B2 B3, heating and cooling by turns."""

EXTREMES = np.fromstring(
    """
    30.08 71.87 24.39 146.54    25.01 123.04 21.78 159.07   29.22 130.77 29.96 180.26
    35.5 141.25 34.78 153.97    36.73 159.21 25.38 184.99   27.24 146.20 23.16 189.52
    """,
    sep=" ",
).reshape(6, 4)
"""Tables 9 and 10, in the order of the first six conditions of `ROWS`."""


ERRATA = {e.id: e for e in errata()}


def eq7(t, row):
    """Eq. (7) as printed, in N/m."""
    a1, a2, a3, b1, b2, b3 = row
    ea, eb = np.exp(-a2 * (t - a3)), np.exp(-b2 * (t - b3))
    return 100 * b1 * b2 * eb * (1 + ea) ** 2 / (a1 * a2 * ea * (1 + eb) ** 2)


def values(identifier: str) -> list[float]:
    return [a.value for a in ERRATA[identifier].effect()]


def named(identifier: str, words: str) -> float:
    found = [a.value for a in ERRATA[identifier].effect() if words in a.name]
    assert len(found) == 1, (words, [a.name for a in ERRATA[identifier].effect()])
    return found[0]


# --- the registry -------------------------------------------------------------------------------------


def test_it_has_the_49_and_those_beyond() -> None:
    ids = [e.id for e in errata()]
    assert ids == [f"E{n:02d}" for n in range(1, 50)] + [f"N{n:02d}" for n in range(1, 7)]
    assert set(EFFECTS) == {e.id for e in errata() if not e.note_only}


@pytest.mark.parametrize("one", errata(), ids=lambda e: e.id)
def test_an_erratum_is_complete(one) -> None:
    assert one.lines
    assert all(n in {t.number for t in PRINTED_TABLES} for n in one.tables)
    assert all(len(words) > 3 for words in (one.printed, one.problem, one.correction))
    assert bool(one.effect()) != one.note_only
    assert all(np.isfinite(a.value) for a in one.effect())
    for pattern in one.cells:
        lone = dataclasses.replace(one, cells=(pattern,)).doubted()
        assert lone, f"{pattern} names no cell"
        assert {table.number for table, _ in lone} <= set(one.tables)
        assert {cell.line for _, cell in lone} <= set(one.lines)


def test_every_doubted_cell_has_an_erratum_and_no_other_has() -> None:
    doubted = {address(t, c) for t in PRINTED_TABLES for c in t.cells if c.status is not CellStatus.OK}
    assert {address(t, c) for e in errata() for t, c in e.doubted()} == doubted


def test_a_note_has_no_effect_and_all_else_has() -> None:
    with pytest.raises(ValueError, match="E03"):
        dataclasses.replace(ERRATA["E03"], note_only=False)
    with pytest.raises(ValueError, match="E01"):
        dataclasses.replace(ERRATA["E01"], note_only=True)


def test_lines_stand_in_the_text() -> None:
    path = PAPER / "modified-sigmoid-sma-spring.txt"
    if not path.is_file():
        pytest.skip("the text of the paper is not at ../shared/paper beside the checkout")
    text = path.read_text(encoding="utf-8").split("\n")
    assert not [(e.id, n) for e in errata() for n in e.lines if not text[n - 1].strip()]


def test_claims_are_those_of_the_list() -> None:
    """Where the list says in words what is a number here, the words stand in its place."""
    path = PAPER / "errata.md"
    if not path.is_file():
        pytest.skip("the list of errata is not at ../shared/paper beside the checkout")
    rows, _, closing = path.read_text(encoding="utf-8").partition("Also worth knowing")
    in_words = {"1.00": "K_A=Kmax everywhere", "10.0": "x10", "0.000": "R2 equal 0.998", "8e-7": "8e-7"}
    for one in errata():
        entry = next((r for r in rows.split("\n") if r.startswith(f"| {one.id} ")), "")
        for amount in one.effect():
            if amount.claimed:
                words = in_words.get(amount.claimed, amount.claimed)
                assert words in entry or re.search(rf"(?<![\d.]){re.escape(words)}", closing), (
                    one.id,
                    amount,
                )


def test_these_claims_do_not_reproduce() -> None:
    differing = {(e.id, a.claimed) for e in errata() for a in e.effect() if a.agrees is False}
    assert differing == {
        ("E07", "1.0000"),
        ("E11", "1.00"),
        ("E31", "-6300"),
        ("E31", "2600"),
        ("E33", "1000"),
        ("E34", "3"),
        ("E36", "10.0"),
    }


@pytest.mark.parametrize(
    ("value", "claimed", "agrees"),
    [
        (0.99788, "0.9979", True),
        (0.9978, "0.9979", False),
        (53.5, "54", True),
        (2.0, "", None),
        (8.1e-7, "8e-7", True),
    ],
)
def test_a_claim_agrees_where_the_value_rounds_to_it(value: float, claimed: str, agrees: bool | None) -> None:
    assert Amount("x", value, claimed=claimed).agrees is agrees


# --- equations ----------------------------------------------------------------------------------------


def test_eq_1_is_not_the_equation_of_eq_2() -> None:
    _, _, _, b1, b2, b3 = ROWS[0]
    t = np.linspace(b3 - 2, b3 + 2, 41)
    logistic = b1 / (1 + np.exp(-b2 * (t - b3)))

    def solve(slope):
        return solve_ivp(slope, (t[0], t[-1]), logistic[:1], t_eval=t, rtol=1e-9, atol=1e-12).y[0]

    np.testing.assert_allclose(solve(lambda _, f: b2 * f * (1 - f / b1)), logistic, rtol=1e-5)
    printed = solve(lambda _, f: b2 * (1 - f / b1))
    assert np.all(np.diff(printed) > -1e-9)
    assert np.all(np.diff(printed, 2) < 1e-9)  # no inflection
    step = 1e-5
    ratios = [
        r[4] * 0.5 / ((1 / (1 + exp(-r[4] * step)) - 1 / (1 + exp(r[4] * step))) * r[3] / (2 * step))
        for r in ROWS
    ]
    assert values("E01") == pytest.approx([min(ratios), max(ratios)], rel=1e-6)


def test_largest_slopes() -> None:
    t = np.linspace(0, 8, 400_001)
    for letter, amounts in ((3, values("E02")[:2]), (0, values("E02")[2:])):
        slopes = [
            np.gradient(r[letter] / (1 + np.exp(-r[letter + 1] * (t - r[letter + 2]))), t).max()
            / r[letter + 1]
            for r in ROWS[[8, 9, 16, 17]]  # among them the least and the greatest spans
        ]
        assert amounts == pytest.approx([min(slopes), max(slopes)], rel=1e-4)


def test_asymptotes_and_midpoints() -> None:
    assert ROWS[:, 2].min() > ROWS[:, 0].max()
    assert values("E04") == [18]
    assert values("E05") == [pytest.approx(0.5)]
    assert np.all(ROWS[:, 5] > ROWS[:, 2])
    assert values("N02") == [18]


def test_what_eq_7_identifies() -> None:
    for row in ROWS:
        t = np.linspace(row[2] - 5 / row[1], row[5] + 5 / row[4], 30)
        sensitivity = approx_fprime(row, lambda p, t=t: np.log(eq7(t, p)), 1e-7)
        scaled = sensitivity / np.linalg.norm(sensitivity, axis=0)
        singular = np.linalg.svd(scaled, compute_uv=False)
        assert singular[5] < 1e-5 * singular[0] < singular[4] * 10
        np.testing.assert_allclose(eq7(t, row * [1, -1, 1, 1, -1, 1]), eq7(t, row), rtol=1e-9)
    assert values("E06") == [5, 5, 18]


def test_shapes() -> None:
    def falls_outwards(row, side):
        near, far = (row[5] + side * distance / row[1] for distance in (100.0, 101.0))
        return eq7(far, row) < eq7(near, row)

    humps = [falls_outwards(row, -1) and falls_outwards(row, 1) for row in ROWS]
    unbounded = [not falls_outwards(row, -1) and not falls_outwards(row, 1) for row in ROWS]
    assert [sum(humps), sum(unbounded)] == [15, 3] == values("E07")[:2]


def test_correlation_of_the_rates() -> None:
    def correlation(row, reach):
        ends = [(row[i + 1] + s * reach / row[i]) for i in (1, 4) for s in (-1, 1)]
        t = np.linspace(min(ends), max(ends), 100)
        free = np.array([0, 1, 2, 4, 5])

        def k(p):
            full = row.copy()
            full[free] = p
            return eq7(t, full)

        j = np.stack(
            [
                (k(row[free] + h) - k(row[free] - h)) / (2 * h[i])
                for i, h in enumerate(np.diag(1e-5 * row[free]))
            ],
            axis=1,
        )
        c = np.linalg.pinv(j / np.linalg.norm(j, axis=0))
        c = c @ c.T
        return c[1, 3] / sqrt(c[1, 1] * c[3, 3])

    found = [correlation(row, 5.0) for row in ROWS]
    assert values("E07")[2:4] == pytest.approx([min(found), max(found)], abs=2e-5)
    assert values("E07")[5] == pytest.approx(max(correlation(row, 20.0) for row in ROWS), abs=2e-5)


def test_the_path_has_the_slope_of_its_bias() -> None:
    assert values("E08") == pytest.approx([24.39, 146.54, 130, 130])


def test_constant_load() -> None:
    assert values("E09")[:2] == [23.16, 189.52]
    shares = ROWS[6:12, 3] / np.repeat([0.1, 0.15, 0.2], 2) / 9.80665
    assert values("E09")[2:] == pytest.approx([shares.min(), shares.max()])


def test_arrangements() -> None:
    k = np.array([21.78, 180.26])
    assert values("E10")[:2] == pytest.approx(k - 130)
    assert values("E10")[2:4] == pytest.approx(k + 130)
    assert values("E10")[4:6] == pytest.approx(1 / (1 / k + 1 / 130))
    assert values("E10")[6] == pytest.approx(np.mean(np.linspace(*k, 1_000_001) < 130), abs=1e-5)


def test_the_logistic_baseline() -> None:
    def eq9(t, centre):
        return 1 - 1 / (1 + np.exp(6.2 / (80.4 - 73.83) * (t - centre)))

    printed, meant = values("E11")[:2]
    assert (printed, meant) == pytest.approx((-3.285, 77.115))
    assert values("E11")[2:] == pytest.approx([eq9(0.0, -3.285), eq9(25.01, -3.285)])
    assert eq9(np.array([73.83, 80.4]), meant) == pytest.approx(np.array(values("E13")) / 100)
    t = np.linspace(60, 95, 3_500_001)
    rise = eq9(t, meant)
    width = t[np.searchsorted(rise, 0.9)] - t[np.searchsorted(rise, 0.1)]
    assert values("E12")[2] == pytest.approx(width / (123.04 - 25.01), rel=1e-4)
    assert values("E12")[:2] == pytest.approx([6.2 / 6.57, 6.2 / 2.76])
    assert values("E12")[3] == pytest.approx(values("E12")[2] * 2.76 / 6.57)


def test_the_polynomial_at_one_frequency() -> None:
    t = np.arange(25.0, 120.0)
    one = np.stack([np.ones_like(t), 0.01 * np.ones_like(t), 1e-4 * np.ones_like(t), t], axis=1)
    assert null_space(one / np.linalg.norm(one, axis=0), rcond=1e-10).shape[1] == 4 - values("E14")[0]
    assert values("E14") == [2, 4]


def test_no_linear_map_of_temperature_does_better() -> None:
    def miss(scale, offset):
        found = []
        for i, (cold, hot, low, high) in enumerate(EXTREMES):
            t = np.linspace(cold, hot, 60) / scale + offset
            k = np.concatenate([eq7(t, ROWS[2 * i]), eq7(t, ROWS[2 * i + 1])])
            found += [log(k.min() / low), log(k.max() / high)]
        return exp(sqrt(np.mean(np.square(found))))

    factor, scale, offset, best, at_25 = values("E15")
    assert factor == 100
    assert miss(scale, offset) == pytest.approx(best, rel=1e-9)
    assert miss(25.0, 0.0) == pytest.approx(at_25, rel=1e-9)
    grid = [miss(s, o) for s in np.arange(15.0, 150.0, 7.5) for o in np.arange(-2.0, 3.01, 0.2)]
    assert best <= min(grid) <= 1.02 * best


def test_the_repeated_run() -> None:
    one, other = ROWS[[4, 5]], ROWS[[12, 13]]
    ratio = np.maximum(one / other, other / one)
    rates, middles = ratio[:, [0, 1, 3, 4]], ratio[:, [2, 5]]
    assert values("E16")[:4] == pytest.approx([rates.min(), rates.max(), middles.min(), middles.max()])
    assert values("E16")[4:] == pytest.approx([eq7(3.0, ROWS[5]), eq7(3.0, ROWS[13])])


def test_the_loop_does_not_close() -> None:
    heating, cooling = eq7(130.77 / 25, ROWS[4]), eq7(130.77 / 25, ROWS[5])
    assert values("E17") == pytest.approx([heating, cooling, cooling / heating])


def test_nearly_equal_steps() -> None:
    assert values("E18") == pytest.approx([exp(47.02 * 0.012), 146.54 / 24.39, exp(20.57 * 0.037)])
    a, middle, shift = 23.51, 2.715, 0.012  # the same two steps with one rate are bounded by exp(2 a shift)
    k = eq7(middle + np.array([-20 / a, 20 / a]), [1, a, middle - shift / 2, 1, a, middle + shift / 2])
    assert k[1] / k[0] == pytest.approx(values("E18")[0], rel=1e-4)


def test_ratio_of_spans() -> None:
    def farthest(x):
        pair = x.reshape(9, 2)
        return max(max(a / b, b / a) for a, b in pair)

    spans = [100 * (farthest(ROWS[:, 3] / ROWS[:, 0]) - 1), farthest(ROWS[:, 0]), farthest(ROWS[:, 3])]
    assert values("N01") == pytest.approx(spans)


# --- fits ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("identifier", "sse", "rmse", "r2", "printed"),
    [
        ("E20", 0.0536, 0.0251, 0.9980, 0.9880),
        ("E21", 0.0073, 0.0108, 0.9978, 0.9986),
        ("N03", 0.0087, 0.0103, 0.9973, 0.9973),
    ],
)
def test_adjusted_r2(identifier: str, sse: float, rmse: float, r2: float, printed: float) -> None:
    """From the variances: adjusted R2 is one less residual over total variance, with their own divisors."""
    dof = sse / rmse**2
    total = sse / (1 - r2)
    assert values(identifier)[:2] == pytest.approx([printed, 1 - rmse**2 / (total / (dof + 5))])
    needed = values(identifier)[2]
    assert 1 - (sse / dof) / (total / (dof + needed - 1)) == pytest.approx(printed)


def test_the_misplaced_point() -> None:
    printed, p_printed, moved, p_moved = values("E22")
    assert printed == pytest.approx(0.0580 / 0.0175**2)
    assert moved == pytest.approx(printed / 10)
    for dof, p in ((printed, p_printed), (moved, p_moved)):
        assert 1 - 0.0018 * (dof + p - 1) / dof == pytest.approx(0.9977)


def test_points() -> None:
    sse = np.array([0.0536, 0.0087, 0.0118, 0.0159, 0.0059, 0.0073, 0.0016, 0.0023, 0.0067, 0.0041, 0.0218])
    rmse = np.array([0.0251, 0.0103, 0.0133, 0.0114, 0.0164, 0.0108, 0.0089, 0.0095, 0.0138, 0.0065, 0.0289])
    dof = sse / rmse**2
    assert values("E23")[:4] == pytest.approx(
        [dof.min(), dof.max(), round(dof.min()) + 6, round(dof.max()) + 6]
    )
    sound = [2, 3, 4, 6, 7, 8, 9, 10]  # without the three doubted ones of 1 A and 2 A
    r2 = np.array([0.9980, 0.9987, 0.9980, 0.9992, 0.9989, 0.9986, 0.9981, 0.9950])
    adjusted = np.array([0.9979, 0.9986, 0.9976, 0.9990, 0.9987, 0.9984, 0.9980, 0.9940])
    p = dof[sound] * ((1 - adjusted) / (1 - r2) - 1) + 1
    assert values("E23")[4] == pytest.approx(np.median(p))


def test_lost_columns() -> None:
    assert values("E24") == values("E25") == [3, 12]
    assert values("E26") == [6, 30.71, 169.58]
    assert values("E27") == pytest.approx([29.96 / 30.71, 180.26 / 169.58])


def test_correlation_factors() -> None:
    r2 = np.array(
        [0.9980, 0.9973, 0.9980, 0.9987, 0.9980, 0.9978, 0.9992, 0.9989, 0.9982, 0.9986, 0.9981, 0.9950]
    )
    r = r2**0.5
    z = 0.5 * np.log((1 + r) / (1 - r))
    fisher = 1 - 2 / (np.exp(2 * z.mean()) + 1)
    assert values("E28") == pytest.approx([0.998**0.5, r.min(), r.max(), r.mean(), fisher, 0.9025])


def test_errors_over_their_range() -> None:
    shares = [100 * 2.51 / 122.15, 100 * 1.33 / 137.29, 100 * 1.64 / 150.30]
    assert values("E30") == pytest.approx([*shares, 0])


def test_a_quotient_of_noisy_differences() -> None:
    rng = np.random.default_rng(7)
    # 100 steps of a unit each; a sample has noise of 1 % of 100 units, that is of a whole step
    force, displacement = 1 + rng.normal(size=(2, 1_000_000)) - rng.normal(size=(2, 1_000_000))
    low, high = np.quantile(130 * force / displacement, [0.01, 0.99])
    assert values("E31") == pytest.approx([130, low, high], rel=0.04)


# --- rig ----------------------------------------------------------------------------------------------

D, COIL, N = 5.0e-4, 3.0e-3, 45
LENGTH = pi * COIL * N
RESISTANCE = 8e-7 * LENGTH / (pi / 4 * D**2)
COOLING = 54.5 * pi * D * LENGTH
"""Heat that a degree carries off [W/K]."""


def test_joule_heat() -> None:
    assert values("E33") == pytest.approx(
        [950, 8e-7, 950 * RESISTANCE, RESISTANCE, 950 * RESISTANCE / COOLING, RESISTANCE / COOLING]
    )
    steady = 25 + np.array([1, 2.25, 4]) * RESISTANCE / COOLING
    assert values("E35") == pytest.approx([*steady, *(steady - [71.87, 123.04, 130.77])])
    assert values("E43") == pytest.approx([duty * 4 * RESISTANCE for duty in (0.4, 0.6, 0.8)])
    assert values("N04") == pytest.approx([41.79 / 1, 98.03 / 2.25, 101.55 / 4])


def test_specific_heat() -> None:
    joule = 0.44 * 4.184
    assert values("E34") == pytest.approx([joule, joule / 0.84, joule / 0.45, 2.2], rel=1e-4)


def test_volume() -> None:
    geometry = (pi * D / 2) ** 2 * COIL * N
    assert values("E36") == pytest.approx([geometry, 81.67e-8 / geometry])


def test_shear_moduli() -> None:
    per_stiffness = 8 * COIL**3 * N / D**4
    assert values("E37") == pytest.approx(
        [28e9 / 2.66 / per_stiffness, 41e9 / 2.66 / per_stiffness, 189.52 * per_stiffness / 1e9]
    )
    assert values("E38") == pytest.approx([k * per_stiffness / 1e9 for k in (235.46, 495.68, 519.28)])


def test_temperatures() -> None:
    rises = [146.54 / 24.39, 235.46 / 16.80, 495.68 / 16.96, 519.28 / 16.30]
    assert values("E39") == pytest.approx([*rises, 73.80 - 73.83])
    assert values("E40") == pytest.approx([71.38, 126.13, 54.75])
    hottest, stiffest = EXTREMES[:, 1], EXTREMES[:, 3]
    assert values("E41") == pytest.approx([71.87, 159.21, pearsonr(hottest, stiffest).statistic])
    assert values("N06") == pytest.approx([0.4])


def test_stresses() -> None:
    section_modulus = pi * D**3 / 16

    def stress(gram):
        return gram * 1e-3 * 9.80665 * COIL / 2 / section_modulus / 1e6

    assert values("E42")[:3] == pytest.approx([stress(100), stress(150), stress(200)])
    assert named("E42", "curvature") == pytest.approx(23 / 20 + 0.615 / 6)
    assert stress(named("E42", "75 MPa")) == pytest.approx(75)
    assert stress(named("E42", "56 MPa")) == pytest.approx(56)


def test_ratios_and_trends() -> None:
    ratios = EXTREMES[:, 3] / EXTREMES[:, 2]
    assert values("E44") == pytest.approx([ratios.min(), ratios.max(), 235.46 / 16.80, 519.28 / 16.30])
    slopes = [218.66 / 27.40, 478.72 / 37.49, 502.98 / 40.10]
    assert values("E45") == pytest.approx([0.4415, 0.2222, *slopes])
    assert values("N05") == [0.6590, 0.3156, 0.9557, 0.6976, 0.5196, 0.3409, 0.7279, 0.7277]


def test_quantisation_and_counts() -> None:
    assert values("E47") == pytest.approx([20_000 / 16_384, 20_000 / 16_384, 20_000 / 8_192])
    assert values("E49") == [6, 108, 0]
