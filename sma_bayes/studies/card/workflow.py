"""A fit handed on, from its folder to the files that solvers and controllers read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from pydantic import Field

from sma_bayes.account import Account
from sma_bayes.arrays import Floats
from sma_bayes.assess.draws import RecordDraws, as_logged, of_one_rig
from sma_bayes.errors import MeasurementError, SmaBayesError, many, require_seed
from sma_bayes.fitting.curves import interval
from sma_bayes.progress import Progress, silent
from sma_bayes.records.types import Branch
from sma_bayes.report.choice import REPORT, figures_for
from sma_bayes.runs.declared_units import declared_parts
from sma_bayes.runs.documents import CARD
from sma_bayes.runs.fit_document import RecordSummary, refuse_shared_parameters
from sma_bayes.runs.outputs import StoredRun, read_run
from sma_bayes.runs.schema import interval_document
from sma_bayes.runs.store import write_csv, write_json, write_text
from sma_bayes.runs.stored_draws import draws_of
from sma_bayes.studies.card.apart import CROSSED, crossing_of, kept_apart
from sma_bayes.studies.card.exports import covariance_text, simcoon_material, sma_react_solution
from sma_bayes.studies.card.features import GRID, NAMES, curve_of, nearest_law, with_calibration_errors
from sma_bayes.studies.card.header import stiffness_header
from sma_bayes.studies.card.law import Moduli, transformation_strain
from sma_bayes.studies.card.pooling import (
    Constant,
    LoadedSweep,
    PooledConstants,
    distinct,
    pooled,
    transformation_strains,
)
from sma_bayes.studies.card.schema import (
    CardConstant,
    CardFindings,
    CardSweep,
    ConstitutiveCard,
    StiffnessTable,
    StiffnessTables,
    TabulatedQuantiles,
)
from sma_bayes.studies.card.specimen import Loaded, Size, kelvin, loaded, modulus_of, size_of
from sma_bayes.studies.card.stiffness import tabulated
from sma_bayes.studies.identity import fit_identity, of_fit
from sma_bayes.studies.run_context import RunContext
from sma_bayes.studies.study_step import Checks, FromFitTable, StudyStep

DRAWS: Final = 400
POINTS: Final = 65
AUSTENITE: Final = 70e3
"""E_A where the data do not tell it and it is not given [MPa]; it moves the strain of the hot end alone."""
POOR: Final = 0.05
"""Miss of the law, over the range of a curve, from which it is a caution [1]."""
COARSE: Final = 0.02
"""Error of interpolation over the stiffness from which it is a caution [1]."""
EXPANSIONS_ALIKE: Final = 3e-6
"""Greatest difference of the expansions of both phases that simcoon 2.2 integrated with its default tangent [1/K]."""
UNITS: Final = {
    "E_A": ("MPa", "modulus of austenite"), "E_M": ("MPa", "modulus of martensite"),
    "alpha_A": ("1/K", "expansion of austenite"), "alpha_M": ("1/K", "expansion of martensite"),
    "H_min": ("1", "transformation strain without stress"), "H_max": ("1", "its saturation"),
    "k": ("1/MPa", "rate at which it saturates"), "sigma_crit": ("MPa", "stress from which it grows"),
    "C_A": ("MPa/K", "stress influence coefficient of heating"),
    "C_M": ("MPa/K", "stress influence coefficient of cooling"),
    "Ms": ("K", "martensite start without stress"), "Mf": ("K", "martensite finish without stress"),
    "As": ("K", "austenite start without stress"), "Af": ("K", "austenite finish without stress"),
    "Hcur": ("1", "transformation strain"),
    "n1": ("1", "exponent of cooling at its start"), "n2": ("1", "exponent of cooling at its finish"),
    "n3": ("1", "exponent of heating at its finish"), "n4": ("1", "exponent of heating at its start"),
}  # fmt: skip


def card(
    folder: str | Path,
    out: str | Path | None = None,
    *,
    area: str | None = None,
    length: str | None = None,
    modulus_austenite: str | None = None,
    modulus_martensite: str | None = None,
    reference_stress: str | None = None,
    points: int = POINTS,
    draws: int = DRAWS,
    seed: int = 0,
    resume: bool = False,
    figures: str | bool = REPORT,
    progress: Progress | None = None,
    account: Account | None = None,
) -> dict[str, Any]:
    """Write what a fit found for a solver (constitutive card) and for a controller (stiffness table and C header).

    Parameters
    ----------
    folder : str or Path
        Output folder of a finished `fit` or `demo`.
    out : str or Path, optional
        Folder for `card.json` and the files beside it; nothing is written without it.
    area, length : str, optional
        Cross-section and length of a wire whose force and displacement were measured: ``"0.98 mm^2"``, ``"50 mm"``.
    modulus_austenite, modulus_martensite : str, optional
        Young's moduli where they are known: ``"70 GPa"``.
    reference_stress : str, optional
        Where C_A and C_M are the slopes of the phase boundaries; by default the mean of the stresses.
    points : int
        Rows of a stiffness table.
    draws : int
        Draws of the constants.
    seed : int
        Decides which draws, and the scatter between runs.
    resume : bool
        Where `out` holds this very card already, only what is missing of its report is made.
    figures, progress, account
        See `fit_campaign`.

    Returns
    -------
    dict
        What `card.json` holds.

    Raises
    ------
    SmaBayesError, QuantityError
        If an option makes no sense.
    MeasurementError
        If the fit gives neither constants nor a stiffness.
    OutputError, ResumeError
        If `folder` holds no finished fit, or one whose conditions share parameters, or `out` can't be used.
    """
    require_seed(seed)
    if not 9 <= points <= 4097:
        raise SmaBayesError(f"--points {points}", expected="9 to 4097 rows of a stiffness table")
    if not 50 <= draws <= 10_000:
        raise SmaBayesError(f"--draws {draws}", expected="50 to 10,000")
    asked = _Asked(
        size_of(area, length),
        (
            modulus_of(modulus_austenite, "modulus-austenite"),
            modulus_of(modulus_martensite, "modulus-martensite"),
        ),
        modulus_of(reference_stress, "reference-stress"),
        points,
        draws,
        seed,
    )
    work = RunContext(CARD, None, figures_for(figures), progress or silent, account or Account())
    with work.account.timed("read"):
        run = read_run(Path(folder))
    shared = any(r.shares_parameters_with for r in run.summary.records)
    refuse_shared_parameters(shared, run.folder, "whose differences tell what stress does")
    identity = fit_identity(CARD.verb, run.summary, asked.told())
    return work.execute(out, identity, resume, lambda place: _handed_on(run, asked, place, work))


@dataclass(frozen=True, slots=True)
class _Asked:
    size: Size
    moduli: tuple[float | None, float | None]
    reference: float | None
    points: int
    draws: int
    seed: int

    def told(self) -> dict[str, object]:
        return {
            "area": self.size.area, "length": self.size.length, "moduli": list(self.moduli),
            "reference_stress": self.reference, "points": self.points, "draws": self.draws, "seed": self.seed,
        }  # fmt: skip


Read = Callable[[RecordSummary], RecordDraws]


def _handed_on(run: StoredRun, asked: _Asked, folder: Path | None, work: RunContext) -> CardFindings:
    summary = run.summary

    def read(record: RecordSummary) -> RecordDraws:
        return draws_of(run.folder, record, summary.seed)

    with work.account.timed("constants"):
        made, why_not = _constitutive(summary.records, read, asked, work)
    with work.account.timed("stiffness"):
        tables, no_table = _stiffness(summary.records, read, asked.points)
    if made is None and not tables:
        raise MeasurementError(
            f"nothing to export: {why_not}; {no_table}",
            file=run.folder,
            expected="strain (or displacement) on heating and cooling at constant load, or force and displacement from "
            "which a stiffness follows",
        )
    if folder is not None:
        _write(folder, made, tables, summary.campaign, str(getattr(summary, "content_sha256", "")))
    used = {s.key for s in made.stated.sweeps} if made is not None else set()
    used |= {f"{t.condition}-{t.branch}" for t in tables}
    records = [r for r in summary.records if r.key in used]
    return CardFindings(
        schema="sma-bayes/card/1",
        **of_fit(summary, run.folder, asked.seed),
        **declared_parts(records),
        converged=all(r.converged for r in records),
        adequate=all(r.adequate for r in records),
        constitutive=None if made is None else made.stated,
        no_constitutive=why_not,
        stiffness=tuple(map(StiffnessTable.about, tables)),
        no_stiffness=no_table,
        cautions=tuple(_cautions(made, tables)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Made:
    """A card with what figures are drawn from."""

    law: PooledConstants
    stated: ConstitutiveCard
    curves: dict[str, Sequence[object] | Floats]


def _constitutive(
    records: Sequence[RecordSummary], read: Read, asked: _Asked, work: RunContext
) -> tuple[_Made | None, str]:
    left_out, usable = dict[str, str](), list[tuple[RecordSummary, Loaded]]()
    for r in records:
        found = loaded(r, asked.size)
        if isinstance(found, str):
            left_out[r.key] = found
        else:
            usable.append((r, found))
    lacking = [b.value for b in Branch if not any(r.branch == b.value for r, _ in usable)]
    if lacking:
        reasons = list(dict.fromkeys(left_out.values()))
        told = "; ".join(reasons) if reasons else f"there is no {lacking[0]} at constant load"
        return None, told
    common = min(float(kelvin(r.temperature.highest, r.temperature.unit)) for r, _ in usable)
    rng = np.random.default_rng(np.random.SeedSequence([asked.seed, 21]))
    sweeps, seen = list[LoadedSweep](), list[_Seen]()
    work.tell(0, len(usable), "fitting the law")
    of_all = of_one_rig(_evenly(read(r), asked.draws) for r, _ in usable)
    for (r, load), draws in zip(usable, of_all, strict=True):
        one = _seen(draws, load, common)
        if isinstance(one, str):
            left_out[r.key] = one
        else:
            seen.append(one)
            sweeps.append(one.sweep)
        work.tell(len(sweeps), len(usable), f"fitted {r.key}")
    missing = [b.value for b in Branch if not any(s.branch is b for s in sweeps)]
    if missing:
        return None, "; ".join(dict.fromkeys(left_out.values()))
    reference = asked.reference or float(np.mean([s.stress for s in sweeps]))
    stresses = distinct([s.stress for s in sweeps])
    law = kept_apart(pooled(sweeps, reference, common, asked.moduli, AUSTENITE, rng), stresses)
    stated = [_stated_sweep(one, law, common) for one in seen]
    found_card = ConstitutiveCard(
        constants=tuple(_stated(n, c) for n, c in law.constants.items()),
        at_reference=tuple(
            _stated(n, c, f"{UNITS[n][1].replace(' without stress', '')} at the reference stress")
            for n, c in law.at_reference().items()
        ),
        reference_stress=reference,
        common_temperature=common,
        stresses=tuple(stresses),
        sweeps=tuple(stated),
        left_out=left_out,
        draws=asked.draws,
        crossed=crossing_of(law, stresses),
        simcoon="simcoon.json",
        sma_react="sma_react.json",
    )
    return _Made(law, found_card, _curve_columns(seen, law, common)), ""


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A sweep, and what was measured in it [K, 1]."""

    sweep: LoadedSweep
    condition: str
    temperature: Floats
    mean: Floats
    measured: tuple[Floats, Floats]


def _evenly(draws: RecordDraws, count: int) -> RecordDraws:
    """So many of the draws, evenly over all; some several times where there are fewer."""
    return draws.subset(np.linspace(0, draws.size - 1, count).round().astype(int))


def _seen(draws: RecordDraws, load: Loaded, common: float) -> _Seen | str:
    """Numbers of the law for one record; the reason where its strain falls on cooling."""
    at = draws.grid()[:: max(1, draws.grid().size // GRID)]
    curves = load.per * as_logged(draws).curve("displacement", at)
    mean = curves.mean(axis=0)
    if not mean[0] > mean[-1]:
        return "its strain falls on cooling: a wire in tension becomes longer (give a length with the sign in mind)"
    temperature = kelvin(at, draws.units["temperature"])
    (gain, shift), (stretch, up) = (
        draws.calibration.get(c, (np.ones(draws.size), np.zeros(draws.size)))
        for c in ("temperature", "displacement")
    )
    zero = float(kelvin(0.0, draws.units["temperature"]))
    features = with_calibration_errors(
        nearest_law(temperature, curves, common),
        (gain, shift + (1.0 - gain) * zero),
        (stretch, load.per * up),
        common,
    )
    record = draws.record
    measured = (
        kelvin(record.temperature, draws.units["temperature"]),
        load.per * record.observed["displacement"],
    )
    return _Seen(
        LoadedSweep(draws.key, draws.branch, load.stress, features),
        draws.condition.id,
        temperature,
        mean,
        measured,
    )


def _law_numbers(sweep: LoadedSweep, law: PooledConstants) -> Floats:
    """Numbers of a sweep, in the order of `NAMES`, as the card has them."""
    c = {name: one.value for name, one in law.constants.items()}
    moduli, cooling = Moduli(c["E_A"], c["E_M"]), sweep.branch is Branch.COOLING
    strain = (np.asarray(c["H_min"]), np.asarray(c["H_max"]), np.asarray(c["k"]))
    moved = law.shifts(sweep.stress)[0 if cooling else 1]
    upper, lower, p, q = (c[n] for n in (("Ms", "Mf", "n1", "n2") if cooling else ("Af", "As", "n3", "n4")))
    whole = float(transformation_strain(sweep.stress, *strain)) + sweep.stress * moduli.compliance
    return np.array([
        0.5 * (upper + lower) + moved, upper - lower, p, q, sweep.stress / moduli.austenite, c["alpha_A"], whole,
        c["alpha_M"] - c["alpha_A"],
    ])  # fmt: skip


def _card_curve(one: _Seen, law: PooledConstants, common: float, temperature: Floats) -> tuple[Floats, float]:
    """Strain of the card with its zero where the measurements have theirs, and that offset."""
    numbers = _law_numbers(one.sweep, law)
    raw = curve_of(numbers, one.temperature, common)
    offset = float(np.mean(one.mean - raw))
    return curve_of(numbers, temperature, common) + offset, -offset


def _stated_sweep(one: _Seen, law: PooledConstants, common: float) -> CardSweep:
    f = one.sweep.features
    middle, width = f.draws[:, NAMES.index("middle")], f.draws[:, NAMES.index("width")]
    lower, upper = middle - 0.5 * width, middle + 0.5 * width
    heating = one.sweep.branch is Branch.HEATING
    moduli = Moduli(law.constants["E_A"].value, law.constants["E_M"].value)
    curve, offset = _card_curve(one, law, common, one.temperature)
    off = (curve - one.mean) / np.ptp(one.mean)
    return CardSweep.about(
        one.sweep,
        condition=one.condition,
        branch=one.sweep.branch.value,
        middle=interval_document(middle),
        start=interval_document(lower if heating else upper),
        finish=interval_document(upper if heating else lower),
        strain=interval_document(transformation_strains(one.sweep, law.constants, moduli, common)[1]),
        offset=offset,
        finished=f.finished,
        alone=f.miss,
        card=float(np.sqrt(np.mean(off**2))),
        largest=float(np.abs(off).max()),
    )


def _stated(name: str, c: Constant, meaning: str = "") -> CardConstant:
    unit, words = UNITS[name]
    return CardConstant.about(
        c, **interval(c.draws), name=name, unit=unit, meaning=meaning or words, sd=float(c.draws.std())
    )


def _curve_columns(
    seen: Sequence[_Seen], law: PooledConstants, common: float
) -> dict[str, Sequence[object] | Floats]:
    """Measurements and the card beside them, in rows."""
    parts = [(one, _card_curve(one, law, common, one.measured[0])[0]) for one in seen]
    return {
        "condition": [one.condition for one, _ in parts for _ in one.measured[0]],
        "branch": [one.sweep.branch.value for one, _ in parts for _ in one.measured[0]],
        "stress_MPa": np.concatenate([np.full(one.measured[0].size, one.sweep.stress) for one, _ in parts]),
        "temperature_K": np.concatenate([one.measured[0] for one, _ in parts]),
        "strain_measured": np.concatenate([one.measured[1] for one, _ in parts]),
        "strain_card": np.concatenate([curve for _, curve in parts]),
    }


def _stiffness(
    records: Sequence[RecordSummary], read: Read, points: int
) -> tuple[list[TabulatedQuantiles], str]:
    able = [r for r in records if "stiffness" in r.quantities and r.quantities_of_branch]
    if not able:
        if any("stiffness" in r.quantities for r in records):
            return [], "the priors decide the stiffness, so that the fit gives none"
        return [], "no stiffness follows: force and displacement were not both measured where they change"
    whole = [t for r in able if (t := tabulated(read(r), points)) is not None]
    return whole, "" if whole else "the stiffness is not finite over the measured temperatures"


def expansion_caution(austenite: float, martensite: float) -> tuple[str, ...]:
    """What to say of expansions [1/K] whose difference is that of the slopes of the phases, if anything."""
    difference = martensite - austenite
    if abs(difference) <= EXPANSIONS_ALIKE:
        return ()
    return (
        f"The slopes of the phases differ by {1e6 * difference:.2g} microstrain per K, which the card keeps as a "
        "difference of expansions: simcoon needs tangent_mode='closest_point' then, else it ends at the start of the "
        "transformation.",
    )


def crossing_caution(shared: float) -> tuple[str, ...]:
    """What to say of a card whose heating is below its cooling, see `crossing_of`, if anything."""
    if shared <= CROSSED:
        return ()
    return (
        "simcoon does not give this card back: its heating and cooling cross where "
        f"{100.0 * shared:.1f} % or less of a phase is left, also with sharper corners than were measured, and both "
        "transformations then go on at once there. The curves of the card are in constitutive-curves.csv.",
    )


def _cautions(made: _Made | None, tables: Sequence[TabulatedQuantiles]) -> Iterator[str]:
    if made is not None:
        stated = made.stated
        yield from crossing_caution(stated.crossed or 0.0)
        poor = [s for s in stated.sweeps if s.card > POOR]
        if poor:
            worst = max(poor, key=lambda s: s.card)
            yield (
                f"The card misses the curve of {many(len(poor), 'sweep')} by more than {POOR:.0%} of its range, "
                f"{worst.key} by {worst.card:.1%} (root mean square): one law does not hold for all of them."
            )
        short = [s.key for s in stated.sweeps if not s.finished]
        if short:
            yield (
                f"The transformation was not finished within the measured temperatures: {', '.join(short)}."
            )
        held = [c.name for c in stated.constants if not c.identified and c.name != "sigma_crit"]
        if held:
            yield (
                f"Not identified by the data, and held at what card.json states under `why`: {', '.join(held)}."
            )
        values = {c.name: c.value for c in stated.constants}
        yield from expansion_caution(values["alpha_A"], values["alpha_M"])
        if stated.left_out:
            yield f"Left out: {', '.join(f'{k} ({w})' for k, w in stated.left_out.items())}."
    coarse = [t for t in tables if t.relative_error > COARSE]
    if coarse:
        worst_table = max(coarse, key=lambda t: t.relative_error)
        yield (
            f"Linear interpolation errs by up to {worst_table.relative_error:.1%} of the stiffness in "
            f"{worst_table.condition}, {worst_table.branch}: take more --points."
        )
    yield from list(dict.fromkeys(f"{t.condition}: {t.caution}." for t in tables if t.caution))


def _write(
    folder: Path, made: _Made | None, tables: Sequence[TabulatedQuantiles], campaign: str, checksum: str
) -> None:
    if made is not None:
        constants = made.law.constants
        write_csv(
            folder / "constitutive-draws.csv",
            {f"{n} [{UNITS[n][0]}]": c.draws for n, c in constants.items()},
        )
        write_text(folder / "constitutive-covariance.csv", covariance_text(constants))
        write_csv(folder / "constitutive-curves.csv", made.curves)
        cautions = crossing_caution(made.stated.crossed or 0.0)
        material = simcoon_material(made.law, made.stated.common_temperature, cautions)
        write_json(folder / made.stated.simcoon, material)
        write_json(folder / made.stated.sma_react, sma_react_solution(made.law))
    if tables:
        write_csv(folder / "stiffness.csv", _table_columns(tables))
        write_json(folder / "stiffness.json", _table_document(tables, campaign, checksum).as_json())
        write_text(folder / "stiffness.h", stiffness_header(tables, campaign, checksum))


def _table_columns(tables: Sequence[TabulatedQuantiles]) -> dict[str, Sequence[object] | Floats]:
    return {
        "condition": [t.condition for t in tables for _ in t.temperature],
        "branch": [t.branch for t in tables for _ in t.temperature],
        "temperature": np.concatenate([t.temperature for t in tables]),
        "temperature_unit": [t.temperature_unit for t in tables for _ in t.temperature],
        **{
            f"stiffness_{q}": np.concatenate([getattr(t, q) for t in tables])
            for q in ("q05", "median", "q95")
        },
        "stiffness_unit": [t.unit for t in tables for _ in t.temperature],
    }


def _table_document(tables: Sequence[TabulatedQuantiles], campaign: str, checksum: str) -> StiffnessTables:
    return StiffnessTables(
        schema="sma-bayes/stiffness-table/1",
        campaign=campaign,
        fit_sha256=checksum,
        interpolation="linear",
        tables=tuple(tables),
    )


class CardTable(FromFitTable):
    """``[card]``: constants for a solver, and a table of stiffness for a controller."""

    separate: ClassVar[bool] = True
    area: str | None = None
    length: str | None = None
    modulus_austenite: str | None = None
    modulus_martensite: str | None = None
    reference_stress: str | None = None
    points: int = Field(default=POINTS, ge=9, le=4097)
    draws: int = Field(default=DRAWS, ge=50, le=10_000)


def _told(found: Mapping[str, Any]) -> str:
    made = found["constitutive"]
    return f"{len(made['constants']) if made else 0} constants, {len(found['stiffness'])} stiffness tables"


def _checks(o: Mapping[str, Any]) -> Checks:
    yield "", partial(size_of, o.get("area"), o.get("length"))
    for key in ("modulus_austenite", "modulus_martensite", "reference_stress"):
        yield key, partial(modulus_of, o.get(key), key)


STEP: Final = StudyStep(CardTable, CARD, card, _told, _checks)
