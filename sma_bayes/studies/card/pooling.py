"""The constants of the law from its numbers in all sweeps of a campaign.

Each sweep tells temperatures, a strain and exponents at its stress; over the stresses they follow the law up to a
scatter between runs. Its variance has a scaled inverse chi-squared posterior from what the least-squares law leaves;
for each draw the numbers of all sweeps are moved by that scatter and the law is fitted again ("randomise, then
optimise"), which for a linear law is its posterior under flat priors.

References
----------
J. M. Bardsley, A. Solonen, H. Haario, M. Laine, "Randomize-then-optimize: a method for sampling from posterior
distributions in nonlinear inverse problems", SIAM J. Sci. Comput. 36 (2014) A1895, https://doi.org/10.1137/140964023.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit

from sma_bayes.arrays import Floats
from sma_bayes.records.types import Branch
from sma_bayes.studies.card.features import LEAST as LEAST_EXPONENT, NAMES, SweepFeatures, logits
from sma_bayes.studies.card.law import Moduli, shift, transformation_strain

FREEDOM: Final = 2.0
"""Degrees of freedom of what is held of the scatter between runs before they are seen."""
SCATTER: Final = {"middle": 1.0, "width": 0.05, "exponent": 0.3, "strain": 0.03, "alpha": 1e-6}
"""Its scale: of temperatures [K], of log widths [1], of logits of exponents [1], as a share of the largest strain [1],
of expansions [1/K]."""
ASSUMED_SLOPE: Final = (7.0, 0.4)
"""Median of C_A and C_M [MPa/K] and standard deviation of their logarithm where the data can't tell: 90 % between 3.7
and 14, about the 5 to 10 MPa/K of NiTi (Otsuka and Ren, Prog. Mater. Sci. 50, 2005, 511)."""
RATE: Final = (3.0, 1.0)
"""The same for k times the largest stress [1]."""
LARGEST: Final = (0.05, 0.5)
"""The same for H_max [1]."""
LEAST: Final = 0.2
"""Standard deviation of H_min over the largest strain that was seen, from zero [1]."""
APART: Final = 0.05
"""Stresses count as different where they are apart by this share of the largest [1]."""
SURE: Final = 0.99
"""Probability that a slope is positive from which it counts as identified."""
RATIO: Final = 3.0
"""Greatest ratio of the ends of a 90 % interval of a slope, a rate or a modulus that counts as identified."""
MODULI: Final = (10e3, 200e3)
"""What can be a modulus of NiTi [MPa]."""
EXPANSION: Final = (2e-6, 4e-5)
"""What can be a thermal expansion [1/K]."""
EDGE: Final = 1.2 * LEAST_EXPONENT
"""Exponent up to which it is at the edge of what is allowed [1]."""
WIDE: Final = 0.6
"""Width of a 90 % interval of an exponent from which it does not count as identified [1]."""
POINT: Final = 0.005
"""Share of the largest strain to which the law of the card follows the strains that were seen."""
SOLID: Final = 0.3
"""Spread of H_max or H_min over its prior's below which the data tell it."""


Three = tuple[Floats, Floats, Floats]


class LoadedSweep(NamedTuple):
    """One sweep at constant stress.

    Attributes
    ----------
    key : str
    branch : Branch
    stress : float
        [MPa].
    features : SweepFeatures
    """

    key: str
    branch: Branch
    stress: float
    features: SweepFeatures


@dataclass(frozen=True, slots=True, eq=False)
class Constant:
    """One constant of the law.

    Attributes
    ----------
    value : float
        Of the card: that of the least-squares law.
    draws : ndarray, shape (S,)
    identified : bool
    why : str
        Why it is not; empty where it is.
    """

    value: float
    draws: Floats
    identified: bool = True
    why: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class PooledConstants:
    """All constants by name, [MPa], [K], [1], and the reference stress [MPa]."""

    constants: Mapping[str, Constant]
    reference: float

    def shifts(self, stress: float) -> tuple[float, float]:
        """How far a stress [MPa] moves cooling and heating of the card [K]."""
        c = {name: np.asarray(one.value) for name, one in self.constants.items()}
        strain, slopes = (c["H_min"], c["H_max"], c["k"]), (c["C_A"], c["C_M"])
        moduli = Moduli(float(c["E_A"]), float(c["E_M"]))
        on_cooling, on_heating = (
            float(shift(stress, self.reference, strain, slopes, moduli, cooling=cooling))
            for cooling in (True, False)
        )
        return on_cooling, on_heating

    def at_reference(self) -> dict[str, Constant]:
        """Temperatures [K] and transformation strain [1] at the reference stress."""
        c = self.constants
        moduli = Moduli(c["E_A"].value, c["E_M"].value)
        out = {}
        for name in ("Ms", "Mf", "As", "Af"):
            cooling = name.startswith("M")
            point, draws = (
                shift(
                    self.reference,
                    self.reference,
                    (pick(c["H_min"]), pick(c["H_max"]), pick(c["k"])),
                    (pick(c["C_A"]), pick(c["C_M"])),
                    moduli,
                    cooling=cooling,
                )
                for pick in (_value, _draws)
            )
            out[name] = Constant(float(c[name].value + point), c[name].draws + draws)
        strain, strains = (
            transformation_strain(self.reference, pick(c["H_min"]), pick(c["H_max"]), pick(c["k"]))
            for pick in (_value, _draws)
        )
        return out | {"Hcur": Constant(float(strain), strains)}


def _value(c: Constant) -> Floats:
    return np.asarray(c.value)


def _draws(c: Constant) -> Floats:
    return c.draws


def distinct(stresses: Sequence[float]) -> list[float]:
    """Means of stresses that are the same, lowest first.

    Examples
    --------
    >>> distinct([50.0, 51.0, 100.0, 200.0])
    [50.5, 100.0, 200.0]
    """
    found = np.sort(np.asarray(stresses, dtype=float))
    breaks = np.flatnonzero(np.diff(found) > APART * np.abs(found).max()) + 1
    return [float(group.mean()) for group in np.split(found, breaks)]


def pooled(
    sweeps: Sequence[LoadedSweep],
    reference: float,
    common: float,
    moduli: tuple[float | None, float | None],
    assumed_modulus: float,
    rng: np.random.Generator,
) -> PooledConstants:
    """Constants of the law from all sweeps.

    Parameters
    ----------
    sweeps : sequence of LoadedSweep
        At least one of each branch.
    reference : float
        Stress at which the slopes are told [MPa].
    common : float
        Temperature to which strains refer [K].
    moduli : tuple of float or None
        E_A and E_M that were given [MPa].
    assumed_modulus : float
        E_A where it is neither given nor told by the data [MPa].
    rng : numpy.random.Generator
    """
    work = _Work(tuple(sweeps), reference, common, rng)
    found: dict[str, Constant] = work.moduli(moduli, assumed_modulus)
    elastic = Moduli(found["E_A"].value, found["E_M"].value)
    found |= work.expansions()
    found |= work.strains(elastic, found)
    found |= work.slopes_and_temperatures(found, elastic)
    found |= work.exponents()
    return PooledConstants(found, reference)


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    sweeps: tuple[LoadedSweep, ...]
    reference: float
    common: float
    rng: np.random.Generator

    @property
    def size(self) -> int:
        return len(self.sweeps[0].features.draws)

    def of(self, branch: Branch | None) -> tuple[LoadedSweep, ...]:
        return tuple(s for s in self.sweeps if branch is None or s.branch is branch)

    def told(self, name: str, branch: Branch | None = None) -> tuple[Floats, Floats, Floats]:
        """Stresses (m,), point values (m,) and draws (S, m) of a number of the sweeps."""
        at, chosen = NAMES.index(name), self.of(branch)
        return (
            np.array([s.stress for s in chosen]),
            np.array([s.features.point[at] for s in chosen]),
            np.stack([s.features.draws[:, at] for s in chosen], axis=1),
        )

    def scatter(self, left: Floats, freedom: int, scale: float) -> Floats:
        """Draws (S, 1) of the standard deviation between runs, from what a law leaves."""
        total = FREEDOM * scale**2 + float(left @ left)
        return np.sqrt(total / self.rng.chisquare(FREEDOM + max(freedom, 0), self.size))[:, None]

    def moved(self, draws: Floats, scatter: Floats) -> Floats:
        return np.asarray(draws + scatter * self.rng.standard_normal(draws.shape))

    def mean(self, point: Floats, draws: Floats, scale: float) -> tuple[float, Floats]:
        """A number that does not depend on stress."""
        moved = self.moved(draws, self.scatter(point - point.mean(), point.size - 1, scale))
        return float(point.mean()), moved.mean(axis=1)

    def moduli(self, given: tuple[float | None, float | None], assumed: float) -> dict[str, Constant]:
        stress, offset, draws = self.told("offset")
        out = {}
        if given[0] is not None:
            out["E_A"] = _given(given[0], self.size)
        else:
            out["E_A"] = self._austenite(stress, offset, draws, assumed)
        why = (
            "at constant stress its strain and the transformation strain come together; the card takes E_A, so that H "
            "is the whole change of strain: give --modulus-martensite where it is known"
        )
        e_a = out["E_A"]
        out["E_M"] = (
            _given(given[1], self.size)
            if given[1] is not None
            else Constant(e_a.value, e_a.draws, False, why)
        )
        return out

    def _austenite(self, stress: Floats, offset: Floats, draws: Floats, assumed: float) -> Constant:
        count = len(distinct(stress.tolist()))
        card = f"the card takes {assumed / 1e3:g} GPa, which moves only the strain of the hot end"
        if count < 3:
            why = f"{count} stress{'es' if count > 1 else ''}: three are needed to tell it from the zero of the strain"
            return Constant(assumed, np.full(self.size, assumed), False, f"{why}; {card}")
        design = np.stack([np.ones_like(stress), stress], axis=1)
        back = np.linalg.pinv(design)
        point = back @ offset
        left = offset - design @ point
        freedom = stress.size - 2
        sd = np.sqrt(float(left @ left) / self.rng.chisquare(freedom, self.size))[:, None]
        slope = self.moved(draws, sd) @ back[1]
        low, high = np.quantile(slope, (0.05, 0.95))
        if low <= 0.0 or high / low > RATIO or not MODULI[0] <= 1.0 / point[1] <= MODULI[1]:
            why = (
                f"the strain of the hot end changes by {1e6 * low:.3g} to {1e6 * high:.3g} microstrain per MPa, "
                "which is no elastic strain: the zero was set anew for each run, or it ratchets"
            )
            return Constant(assumed, np.full(self.size, assumed), False, f"{why}; {card}")
        return Constant(float(1.0 / point[1]), 1.0 / np.maximum(slope, 1e-7))

    def expansions(self) -> dict[str, Constant]:
        _, point_a, draws_a = self.told("alpha_A")
        _, point_d, draws_d = self.told("alpha_difference")
        out = {}
        for name, point, draws in (
            ("alpha_A", point_a, draws_a),
            ("alpha_M", point_a + point_d, draws_a + draws_d),
        ):
            value, found = self.mean(point, draws, SCATTER["alpha"])
            fair = EXPANSION[0] <= value <= EXPANSION[1]
            why = "" if fair else (
                f"the slope of that phase, {1e6 * value:.3g} microstrain per K, is not thermal expansion alone; "
                "the card keeps it, as it belongs to the curve"
            )  # fmt: skip
            out[name] = Constant(value, found, fair, why)
        return out

    def strains(self, moduli: Moduli, constants: Mapping[str, Constant]) -> dict[str, Constant]:
        stress = np.array([s.stress for s in self.sweeps])
        seen = [transformation_strains(s, constants, moduli, self.common) for s in self.sweeps]
        point = np.array([p for p, _ in seen])
        draws = np.stack([d for _, d in seen], axis=1)
        top, largest = float(stress.max()), float(point.max())
        if len(distinct(stress.tolist())) == 1:
            value, found = self.mean(point, draws, SCATTER["strain"] * largest)
            one = f"one stress only, {stress.mean():.4g} MPa: H is told there, and how it grows with stress is not"
            return {
                "H_min": Constant(value, found, False, one + "; the card holds it the same at every stress"),
                "H_max": Constant(value, found, False, one),
                "k": Constant(RATE[0] / top, np.full(self.size, RATE[0] / top), False, one),
                "sigma_crit": _convention(self.size),
            }
        fit = _StrainLaw(stress, top, largest)
        best = fit.fitted(point, POINT * largest, np.zeros(3))
        left = point - fit.strain(best)
        scatter = self.scatter(left, stress.size - 3, SCATTER["strain"] * largest)
        moved = self.moved(draws, scatter)
        z = np.stack([
            fit.fitted(y, float(sd[0]), self.rng.standard_normal(3), best) for y, sd in zip(moved, scatter, strict=True)
        ])  # fmt: skip
        least, most, k = fit.constants(z.T)
        point_least, point_most, point_k = (float(v) for v in fit.constants(best))
        spread = {"k": np.log(k).std() / RATE[1], "H_max": np.log(most).std() / LARGEST[1],
                  "H_min": least.std() / (LEAST * largest)}  # fmt: skip
        told = {name: s < SOLID for name, s in spread.items()}
        span = f"stresses of {stress.min():.4g} to {top:.4g} MPa"
        why = {
            "k": f"{span} do not show how H saturates: its interval is {spread['k']:.0%} as wide as what was assumed",
            "H_max": f"{span} do not reach the saturation of H: its interval is {spread['H_max']:.0%} as wide as what "
            "was assumed",
            "H_min": f"{span} do not tell H without stress: its interval is {spread['H_min']:.0%} as wide as what was "
            "assumed",
        }
        values = {"H_min": (point_least, least), "H_max": (point_most, most), "k": (point_k, k)}
        out = {
            name: Constant(v, d, bool(told[name]), "" if told[name] else why[name])
            for name, (v, d) in values.items()
        }
        return out | {"sigma_crit": _convention(self.size)}

    def slopes_and_temperatures(self, found: Mapping[str, Constant], moduli: Moduli) -> dict[str, Constant]:
        values = (_value(found["H_min"]), _value(found["H_max"]), _value(found["k"]))
        draws = (_draws(found["H_min"]), _draws(found["H_max"]), _draws(found["k"]))
        slopes = {b: np.asarray(ASSUMED_SLOPE[0]) for b in Branch}
        drawn = {b: np.full(self.size, ASSUMED_SLOPE[0]) for b in Branch}
        told = {b: len(distinct([s.stress for s in self.of(b)])) > 1 for b in Branch}
        state = self.rng.bit_generator.state
        lines = {}
        for _ in range(
            4
        ):  # the shift depends on the ratio of both slopes where the moduli differ, and hardly
            self.rng.bit_generator.state = state
            for b in Branch:
                lines[b] = self._line(b, values, draws, slopes, drawn, moduli, told[b])
            slopes = {b: lines[b][0] for b in Branch}
            drawn = {b: lines[b][1] for b in Branch}
        out = {}
        for b, (upper, lower), letter in (
            (Branch.HEATING, ("Af", "As"), "C_A"), (Branch.COOLING, ("Ms", "Mf"), "C_M"),
        ):  # fmt: skip
            slope, slope_draws, start, start_draws, why = lines[b]
            out[letter] = Constant(float(slope), slope_draws, not why, why)
            _, width, width_draws = self.told("width", b)
            log_width, log_draws = self.mean(
                np.log(width), np.log(np.maximum(width_draws, 1e-3)), SCATTER["width"]
            )
            half, half_draws = 0.5 * np.exp(log_width), 0.5 * np.exp(log_draws)
            zero = why and f"{letter} is not told, on which the temperature without stress rests"
            out[upper] = Constant(float(start + half), start_draws + half_draws, not why, zero)
            out[lower] = Constant(float(start - half), start_draws - half_draws, not why, zero)
        return {name: out[name] for name in ("C_A", "C_M", "Ms", "Mf", "As", "Af")}

    def _line(
        self, b: Branch, values: Three, draws: Three, slopes: Mapping[Branch, Floats],
        drawn: Mapping[Branch, Floats], moduli: Moduli, told: bool,
    ) -> tuple[Floats, Floats, Floats, Floats, str]:  # fmt: skip
        """Slope and middle of the transformation without stress, of the point and of the draws; and why not."""
        stress, middle, middle_draws = self.told("middle", b)
        cooling = b is Branch.COOLING
        pair = (slopes[Branch.HEATING], slopes[Branch.COOLING])
        pair_draws = (drawn[Branch.HEATING], drawn[Branch.COOLING])
        unit = np.array([
            float(shift(s, self.reference, values, pair, moduli, cooling=cooling) * slopes[b]) for s in stress
        ])  # fmt: skip
        unit_draws = np.stack(
            [shift(s, self.reference, draws, pair_draws, moduli, cooling=cooling) * drawn[b] for s in stress],
            axis=1,
        )
        why = ""
        name = "C_M" if cooling else "C_A"
        if told:
            point = _regressed(unit[None], middle[None])
            left = middle - point[0, 0] - unit * point[0, 1]
            moved = self.moved(middle_draws, self.scatter(left, middle.size - 2, SCATTER["middle"]))
            each = _regressed(unit_draws, moved)
            per = each[:, 1]
            low, high = np.quantile(per, (0.05, 0.95))
            if np.mean(per > 0.0) >= SURE and high / max(low, 1e-12) <= RATIO and point[0, 1] > 0.0:
                per = np.where(per > 0.0, per, np.median(per))
                return np.asarray(1.0 / point[0, 1]), 1.0 / per, np.asarray(point[0, 0]), each[:, 0], ""
            why = (
                f"over stresses of {stress.min():.4g} to {stress.max():.4g} MPa the transformation moves by "
                f"{low:.3g} to {high:.3g} K per MPa, which is too uncertain"
            )
        else:
            why = (
                f"one stress only, {stress.mean():.4g} MPa: nothing tells how stress moves the transformation"
            )
        why += f"; {name} of {ASSUMED_SLOPE[0]:g} MPa/K is assumed, by which temperatures at that stress are kept"
        slope = np.asarray(ASSUMED_SLOPE[0])
        many = ASSUMED_SLOPE[0] * np.exp(ASSUMED_SLOPE[1] * self.rng.standard_normal(self.size))
        moved = self.moved(
            middle_draws, self.scatter(middle - middle.mean(), middle.size - 1, SCATTER["middle"])
        )
        start = float(np.mean(middle - unit / slope))
        return slope, many, np.asarray(start), (moved - unit_draws / many[:, None]).mean(axis=1), why

    def exponents(self) -> dict[str, Constant]:
        out = {}
        for b, number, names in (
            (Branch.COOLING, "p", "n1"), (Branch.COOLING, "q", "n2"),
            (Branch.HEATING, "p", "n3"), (Branch.HEATING, "q", "n4"),
        ):  # fmt: skip
            _, point, draws = self.told(number, b)
            value, found = self.mean(logits(point), logits(draws), SCATTER["exponent"])
            ends = expit(np.quantile(found, (0.05, 0.95)))
            why = ""
            if expit(value) < EDGE:
                why = "the corner is rounder than the law has it: the exponent is the least that is allowed"
            elif ends[1] - ends[0] > WIDE:
                why = f"curves fix it only between {ends[0]:.2g} and {ends[1]:.2g}: the corner is hardly seen"
            out[names] = Constant(
                float(expit(value)), np.clip(expit(found), LEAST_EXPONENT, 1.0), not why, why
            )
        return out


def transformation_strains(
    sweep: LoadedSweep, constants: Mapping[str, Constant], moduli: Moduli, common: float
) -> tuple[float, Floats]:
    """H of a sweep and its draws: the change of strain in the middle, less the elastic part and expansion.

    Where the phases of a sweep have slopes of their own, their distance far from the transformation says nothing of it.

    Parameters
    ----------
    sweep : LoadedSweep
    constants : mapping of str to Constant
        ``alpha_A`` and ``alpha_M``.
    moduli : Moduli
    common : float
        See `pooled`.
    """
    middle, strain, difference = (NAMES.index(n) for n in ("middle", "strain", "alpha_difference"))
    alpha = constants["alpha_M"].value - constants["alpha_A"].value
    point, draws = (
        f[..., strain]
        + (f[..., difference] - alpha) * (f[..., middle] - common)
        - sweep.stress * moduli.compliance
        for f in (sweep.features.point, sweep.features.draws)
    )
    return float(point), np.asarray(draws)


def _regressed(x: Floats, y: Floats) -> Floats:
    """Intercept and slope (S, 2) of lines through points (S, m)."""
    centre, mean = x.mean(axis=1, keepdims=True), y.mean(axis=1, keepdims=True)
    slope = ((x - centre) * (y - mean)).sum(axis=1) / ((x - centre) ** 2).sum(axis=1)
    return np.stack([mean[:, 0] - slope * centre[:, 0], slope], axis=1)


@dataclass(frozen=True, slots=True)
class _StrainLaw:
    """H(s) with 0 <= H_min < H_max, under its priors.

    Coordinates: the root of H_min over H_max less H_min, log H_max, log k. H_min nears H_max without a bound at which
    least squares would stay.
    """

    stress: Floats
    top: float
    largest: float

    def constants(self, z: Floats) -> tuple[Floats, Floats, Floats]:
        most = np.exp(np.clip(z[1], -12.0, 1.0))
        least = most * z[0] ** 2 / (1.0 + z[0] ** 2)
        return np.asarray(least), np.asarray(most), np.asarray(np.exp(np.clip(z[2], -6.0, 6.0)) / self.top)

    def strain(self, z: Floats) -> Floats:
        return transformation_strain(self.stress, *self.constants(z))

    def fitted(self, y: Floats, sd: float, pull: Floats, start: Floats | None = None) -> Floats:
        """Least squares to strains with a scatter; `pull` moves the centres of the priors by standard deviations."""

        def residuals(z: Floats) -> Floats:
            least, most, k = self.constants(z)
            prior = np.array([
                (float(least) / self.largest - LEAST * abs(pull[0])) / LEAST,
                (np.log(most) - np.log(LARGEST[0]) - LARGEST[1] * pull[1]) / LARGEST[1],
                (np.log(k * self.top) - np.log(RATE[0]) - RATE[1] * pull[2]) / RATE[1],
            ])  # fmt: skip
            return np.concatenate([(y - self.strain(z)) / sd, prior])

        begin = np.array([0.2, np.log(1.1 * self.largest), np.log(RATE[0])]) if start is None else start
        return np.asarray(least_squares(residuals, begin, method="lm", max_nfev=300).x)


def _given(value: float, size: int) -> Constant:
    return Constant(value, np.full(size, value), False, "given, not fitted")


def _convention(size: int) -> Constant:
    return Constant(0.0, np.zeros(size), False, "convention: H grows from zero stress on")
