"""Running a whole study from one file: steps and questions, each in its folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, Final

from sma_bayes.assess.bands import band_channels
from sma_bayes.errors import ResumeError, SmaBayesError, StudyError, UnknownNameError, near_matches
from sma_bayes.fitting.fit_records import AUTO
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.progress import Progress, silent
from sma_bayes.quantities import convert, number_and_unit
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.types import Campaign
from sma_bayes.response.modified_sigmoid import channel_unit
from sma_bayes.runs.documents import (
    CARD,
    COMPARISON,
    CONDITIONS,
    CYCLES,
    FIT,
    GAP,
    MODULUS,
    PLAN,
    SENSITIVITY,
    SIMULATION,
    STUDY,
    WATCH,
    sealed,
)
from sma_bayes.runs.output_folder import claimed_folder
from sma_bayes.runs.store import write_json
from sma_bayes.studies.ask.workflow import AT_SCHEMA, OVERALL, WANTED, ask, asked_temperature, wanted_value
from sma_bayes.studies.card.specimen import modulus_of, size_of
from sma_bayes.studies.card.workflow import card
from sma_bayes.studies.compare.workflow import compare
from sma_bayes.studies.condition_text import condition_at
from sma_bayes.studies.conditions.study import EACH
from sma_bayes.studies.conditions.workflow import study_conditions
from sma_bayes.studies.cycles.workflow import cycles
from sma_bayes.studies.fit.workflow import fit_campaign
from sma_bayes.studies.gap.workflow import study_gap
from sma_bayes.studies.identity import all_versions
from sma_bayes.studies.modulus.workflow import modulus
from sma_bayes.studies.options import (
    DEFAULT_SAMPLER,
    bias_spring,
    check_model_and_noise,
    model_named,
    plan_with,
    prior_set,
)
from sma_bayes.studies.plan.asked import parse_asked
from sma_bayes.studies.plan.candidates import candidate_tables, hours_of, rate_of
from sma_bayes.studies.plan.workflow import plan
from sma_bayes.studies.run.schema import StatedStep, StudyDocument
from sma_bayes.studies.run.study_file import Study, read_study
from sma_bayes.studies.sensitivity.workflow import sensitivity
from sma_bayes.studies.simulate.profile import read_profile
from sma_bayes.studies.simulate.starts import UNIT, starts_of
from sma_bayes.studies.simulate.workflow import simulate
from sma_bayes.studies.watch.remaining import limit_of
from sma_bayes.studies.watch.workflow import watch

DONE, NOT_CONVERGED, WRONG = 0, 1, 2
"""Exit statuses of a step; that of the study is the greatest of them."""
STATUS: Final = {DONE: "done", NOT_CONVERGED: "not converged", WRONG: "failed"}
SKIPPED, INADEQUATE, ALARM = "skipped", "not adequate", "alarm"

FOLDERS: Final = {"compare": "comparison"}
"""Folder of the results of a step, where it is not called as the step is."""
SUMMARIES: Final = {
    d.verb: d.file
    for d in (
        FIT, COMPARISON, GAP, CONDITIONS, SENSITIVITY, CYCLES, SIMULATION, MODULUS, WATCH, CARD, PLAN
    )
}  # fmt: skip
_CALLS: Final[Mapping[str, Callable[..., dict[str, Any]]]] = {
    "fit": fit_campaign, "compare": compare, "gap": study_gap, "conditions": study_conditions,
    "sensitivity": sensitivity, "cycles": cycles, "simulate": simulate, "modulus": modulus, "watch": watch,
    "card": card, "plan": plan,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Step:
    """A step that waits to be run.

    Attributes
    ----------
    name, kind : str
        ``ask 2`` and ``ask``; of the others both are the same.
    summary : str
        Its JSON file, below the folder of the study.
    needs : str
        Kind of the step without which it can't run; empty where there is none.
    run : callable
        Told the progress; gives what the summary holds.
    """

    name: str
    kind: str
    summary: str
    needs: str
    run: Callable[[Progress], dict[str, Any]]


def run_study(
    path: str | Path,
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    resume: bool = False,
    strict: bool | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run all steps that a study file declares.

    A step that fails for want of something in the data does not keep the others from running: its message is in the
    result. What is wrong in the file itself is refused before anything is written.

    Parameters
    ----------
    path : str or Path
        The study file.
    out : str or Path, optional
        Folder for the results, in place of the declared one.
    jobs : int, optional
        Processes, in place of the declared number.
    resume : bool
        Go on with a study that was interrupted, or run steps that were added to its file.
    strict : bool, optional
        Whether a fit that is not adequate makes the exit status 1, in place of what is declared.
    progress : callable, optional

    Returns
    -------
    dict
        What `study.json` holds.

    Raises
    ------
    StudyError
        If the study file can't be read or is wrong.
    ResumeError
        If a step was run with other options, data or versions before.
    SmaBayesError
        If a name in it is unknown, the campaign can't be read, or the folder can't be used.
    """
    clock = time.perf_counter()
    study = read_study(Path(path))
    _check(study)
    campaign = read_campaign(study.campaign, data_dir=study.data)
    _check_questions(study, campaign)
    folder = Path(out) if out is not None else study.out
    tell = progress or silent
    steps = _steps(study, campaign, folder, jobs if jobs is not None else study.jobs, resume)
    results: list[StatedStep] = []
    document: dict[str, Any] = {}
    with claimed_folder(folder, _identity(campaign), resume):
        for step in steps:
            results.append(_result(step, results, tell, strict=study.strict if strict is None else strict))
            found = _document(study, campaign, results, len(results) == len(steps), clock)
            document = sealed(found.as_json())
            write_json(folder / STUDY.file, document)
    return document


def _identity(campaign: Campaign) -> dict[str, Any]:
    """What makes a folder that of this study; options may change, since each step watches over its own."""
    return {"schema": "sma-bayes/run/1", "kind": STUDY.verb, "data": campaign.sha256}


def _check(study: Study) -> None:
    """Refuse names that no step could do with, before the campaign is read."""
    for name, options in study.steps.items():
        model, noise = options.get("model"), options.get("noise", AUTO)
        if model is not None:
            with _place(study, f"{name}.model"):
                model_named(model)
        if "priors" in options:
            with _place(study, f"{name}.priors"):
                prior_set(options["priors"], options["model"])
        with _place(study, f"{name}.noise"):
            NOISE_MODELS["independent" if noise == AUTO else noise]
            check_model_and_noise(str(model), noise)
    with _place(study, "fit.sampler"):
        plan_with(study.steps.get("fit", {}).get("sampler", DEFAULT_SAMPLER))
    with _place(study, "fit.arrangement"):
        _bias(study.steps.get("fit", {}))
    for number, text in enumerate(study.steps.get("conditions", {}).get("at", ()), start=1):
        with _place(study, f"conditions.at, entry {number}"):
            condition_at(text, specimen="stress_MPa" in text)
    for kind, options in study.steps.items():
        if kind in _CHECKS:
            _CHECKS[kind](study, options)
    for number, asked in enumerate(study.asks, start=1):
        for name in (*WANTED, "tolerance"):
            if asked[name] is not None:
                with _place(study, f"ask {number}.{name}"):
                    number_and_unit(asked[name].rstrip("% "), what=name)


def _check_plan(study: Study, options: Mapping[str, Any]) -> None:
    with _place(study, "plan.for"):
        parse_asked(options["asked"])
    with _place(study, "plan.setup"):
        hours_of(options["setup"], "setup")
    if "candidates" in options:
        candidate_tables(Path(options["candidates"]))


def _check_simulate(study: Study, options: Mapping[str, Any]) -> None:
    if "current" in options:
        read_profile(options["current"])
    with _place(study, "simulate.start"):
        starts_of(options["start"])
    with _place(study, "simulate.ambient"):
        asked_temperature(options.get("ambient", "20 degC"), UNIT, UNIT)


def _check_card(study: Study, options: Mapping[str, Any]) -> None:
    with _place(study, "card"):
        size_of(options.get("area"), options.get("length"))
    for key in ("modulus_austenite", "modulus_martensite", "reference_stress"):
        with _place(study, f"card.{key}"):
            modulus_of(options.get(key), key)


def _check_files(kind: str, study: Study, options: Mapping[str, Any]) -> None:
    for number, name in enumerate(options["files"], start=1):
        if not Path(name).is_file():
            raise StudyError(
                f"there is no such file: {name}",
                file=study.file,
                column=f"{kind}.files, entry {number}",
                expected="a file; paths are relative to the folder of the study file",
            )


_CHECKS: Final[Mapping[str, Callable[[Study, Mapping[str, Any]], None]]] = {
    "plan": _check_plan,
    "simulate": _check_simulate,
    "card": _check_card,
    "watch": partial(_check_files, "watch"),
    "modulus": partial(_check_files, "modulus"),
}


def _check_questions(study: Study, campaign: Campaign) -> None:
    """Refuse temperatures, rates, values and conditions that no record could be asked for."""
    record = campaign.records[0]
    degrees = record.units["temperature"]
    for key, condition in _named_conditions(study):
        _require_condition(study, campaign, key, condition)
    for kind in ("sensitivity", "cycles"):
        for number, text in enumerate(study.steps.get(kind, {}).get("at", ()), start=1):
            with _place(study, f"{kind}.at, entry {number}"):
                asked_temperature(text, degrees, degrees)
    for number, text in enumerate(study.steps.get("watch", {}).get("limit", ()), start=1):
        with _place(study, f"watch.limit, entry {number}"):
            limit_of(text, degrees)
    rate = study.steps.get("plan", {}).get("rate")
    if rate is not None:
        with _place(study, "plan.rate"):
            rate_of(rate, degrees)
    for number, asked in enumerate(study.asks, start=1):
        with _place(study, f"ask {number}.temperature_unit"):
            convert(0.0, degrees, asked["temperature_unit"] or degrees, what="temperature")
        for text in asked["at"]:
            with _place(study, f"ask {number}.at"):
                asked_temperature(text, degrees, degrees)
        for name in WANTED:
            channel = "stiffness" if name == OVERALL else name
            if asked[name] is not None and channel in band_channels(record):
                with _place(study, f"ask {number}.{name}"):
                    wanted_value(
                        asked[name], asked["tolerance"], channel_unit(record.units, channel), channel
                    )


def _named_conditions(study: Study) -> Iterator[tuple[str, str]]:
    """Conditions that steps and questions name, each with its key."""
    left_out = study.steps.get("conditions", {}).get("leave_out", ())
    for number, name in enumerate(left_out, start=1):
        if list(left_out) != [EACH]:
            yield f"conditions.leave_out, entry {number}", name
    places = [(kind, study.steps.get(kind, {})) for kind in ("simulate", "watch", "plan")]
    places += [(f"ask {number}", asked) for number, asked in enumerate(study.asks, start=1)]
    for place, options in places:
        if options.get("condition") is not None:
            yield f"{place}.condition", options["condition"]


def _require_condition(study: Study, campaign: Campaign, key: str, condition: str) -> None:
    known = {r.condition.id for r in campaign.records}
    if condition not in known:
        raise UnknownNameError(
            f"unknown condition {condition!r}",
            file=study.file,
            column=key,
            expected=near_matches(condition, known),
        )


@contextmanager
def _place(study: Study, key: str) -> Iterator[None]:
    """Name the key of the study file in an error that knows of no place."""
    try:
        yield
    except SmaBayesError as error:
        raise type(error)(
            error.found,
            file=error.file or study.file,
            row=error.row,
            column=error.column or key,
            expected=error.expected,
            remedy=error.remedy,
        ) from None


def _bias(options: Mapping[str, Any]) -> Any:
    return bias_spring(options.get("arrangement"), options.get("bias"), options.get("bias_sd"))


def _steps(study: Study, campaign: Campaign, folder: Path, jobs: int | None, resume: bool) -> list[_Step]:
    shared: dict[str, Any] = {"seed": study.seed, "jobs": jobs, "resume": resume, "data": study.data}
    steps: list[_Step] = []
    for kind, options in study.steps.items():
        place, needs, given = FOLDERS.get(kind, kind), study.needs.get(kind, ""), dict(options)
        if kind == "fit":
            given["bias"] = _bias(options)
            given = {k: v for k, v in given.items() if k not in ("arrangement", "bias_sd")}
        source = folder / FOLDERS.get(needs, needs) if needs else campaign
        function = _CALLS[kind]
        taken = {k: v for k, v in shared.items() if k in signature(function).parameters}
        call = partial(
            function,
            given.pop("files") if kind == "modulus" else source,
            out=folder / place,
            **taken,
            **given,
        )
        steps.append(_Step(kind, kind, f"{place}/{SUMMARIES[kind]}", needs, partial(_called, call)))
    for number, asked in enumerate(study.asks, start=1):
        summary = f"ask/{number}.json"
        run = partial(_asked, folder / "fit", folder / summary, asked)
        steps.append(_Step(f"ask {number}", "ask", summary, "fit", run))
    return steps


def _called(call: Callable[..., dict[str, Any]], tell: Progress) -> dict[str, Any]:
    return call(progress=tell)


def _asked(fit: Path, summary: Path, asked: Mapping[str, Any], tell: Progress) -> dict[str, Any]:
    tell(0, 1, "asking")
    found = ask(fit, **asked)
    write_json(summary, found)
    return found


def _result(step: _Step, before: Sequence[StatedStep], tell: Progress, *, strict: bool) -> StatedStep:
    clock = time.perf_counter()
    failed = next((r for r in before if r.step == step.needs and r.exit_status == WRONG), None)
    if failed:
        return _not_done(step, SKIPPED, f"{failed.step} failed", 0.0)
    try:
        found = step.run(lambda done, total, message: tell(done, total, f"{step.name}: {message}"))
    except ResumeError:  # options were changed under results that are there: the call is wrong, not the step
        raise
    except SmaBayesError as error:
        return _not_done(step, STATUS[WRONG], str(error), time.perf_counter() - clock)
    status = DONE if found["converged"] else NOT_CONVERGED
    word = STATUS[status]
    if found["converged"] and found.get("exit_status", DONE) != DONE:
        word, status = ALARM, found["exit_status"]
    if strict and found["converged"] and not found.get("adequate", True):
        word, status = INADEQUATE, NOT_CONVERGED
    return StatedStep(
        step=step.name,
        summary=step.summary,
        schema=found["schema"],
        told=_told(step.kind, found),
        error=None,
        status=word,
        exit_status=status,
        wall_s=time.perf_counter() - clock,
    )


def _not_done(step: _Step, status: str, why: str, wall_s: float) -> StatedStep:
    return StatedStep(
        step=step.name,
        summary=None,
        schema=None,
        told=None,
        error=why,
        status=status,
        exit_status=WRONG,
        wall_s=wall_s,
    )


def _told(kind: str, found: Mapping[str, Any]) -> str:
    """What a step found, in a few words."""
    if kind == "fit":
        good = sum(r["converged"] for r in found["records"])
        adequate = sum(r["adequate"] for r in found["records"])
        return f"{good} of {len(found['records'])} records converged, {adequate} adequate"
    if kind == "compare":
        return "; ".join(f"{g['quantity']}: {g['verdict']}" for g in found["overall"])
    if kind == "gap":
        parts = {"": found} | ({"; heating: ": found["heating"]} if found["heating"] else {})
        return "".join(f"{start}{_verdict(part)}" for start, part in parts.items())
    if kind == "conditions":
        counts = {"effects": "effects", "predictions": "predictions", "held_out": "left out"}
        return ", ".join(f"{len(found[key])} {what}" for key, what in counts.items())
    if kind == "plan":
        return f"{len(found['candidates'])} candidates for {found['asked']}"
    if kind == "sensitivity":
        return str(found["conclusion"])
    if kind == "cycles":
        return " ".join(c["stable"]["statement"] for c in found["conditions"])
    if kind == "simulate":
        places = dict.fromkeys(
            r["condition"] for r in (*found["runs"], *(found["reach"] or {"conditions": ()})["conditions"])
        )
        return f"{len(found['runs'])} courses of {len(places)} conditions"
    if kind == "modulus":
        return f"{len(found['sweeps'])} sweeps"
    if kind == "watch":
        return str(found["statement"])
    if kind == "card":
        card = found["constitutive"]
        return (
            f"{len(card['constants']) if card else 0} constants, {len(found['stiffness'])} stiffness tables"
        )
    if found["schema"] == AT_SCHEMA:
        return f"{len(found['answers'])} records at {', '.join(found['at'])}"
    sure = sum(bool(a["within"]["intervals"]) for a in found["answers"])
    return (
        f"{found['quantity'].replace('_', ' ')} {found['value']}: {sure} of {len(found['answers'])} branches give it "
        f"with probability {found['probability']:g}"
    )


def _document(
    study: Study, campaign: Campaign, results: Sequence[StatedStep], finished: bool, clock: float
) -> StudyDocument:
    return StudyDocument(
        schema="sma-bayes/study/1",
        study=str(study.file),
        campaign=campaign.name,
        source=campaign.source,
        seed=study.seed,
        versions=all_versions(),
        data_sha256=campaign.sha256,
        finished=finished,
        converged=all(r.status in (STATUS[DONE], INADEQUATE, ALARM) for r in results),
        exit_status=max(r.exit_status for r in results),
        steps=tuple(results),
        wall_s=time.perf_counter() - clock,
    )


def _verdict(found: Mapping[str, Any]) -> str:
    """Verdict of a gap study with the effects that it names."""
    effects = ", ".join(e["id"] for e in found["effects"])
    return f"{found['verdict']}: {effects}" if effects else str(found["verdict"])
