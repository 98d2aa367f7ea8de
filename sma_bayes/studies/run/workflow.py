"""Running a whole study from one file: steps and questions, each in its folder."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, Final

from sma_bayes.assess.bands import band_channels
from sma_bayes.errors import ResumeError, SmaBayesError, StudyError, require_known
from sma_bayes.fitting.fit_records import AUTO
from sma_bayes.noise import NOISE_MODELS
from sma_bayes.progress import Progress, StepProgress, silent
from sma_bayes.quantities import convert, number_and_unit
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.types import Campaign
from sma_bayes.response.modified_sigmoid import channel_unit
from sma_bayes.runs.documents import STUDY, sealed
from sma_bayes.runs.output_folder import claimed_folder
from sma_bayes.runs.store import write_json
from sma_bayes.studies.ask.workflow import AT_SCHEMA, OVERALL, WANTED, ask, asked_temperature, wanted_value
from sma_bayes.studies.conditions.study import EACH_CONDITION
from sma_bayes.studies.identity import all_versions
from sma_bayes.studies.options import check_model_and_noise, model_named, prior_set
from sma_bayes.studies.registry import study_steps
from sma_bayes.studies.run.schema import StatedStep, StudyDocument
from sma_bayes.studies.run.study_file import Study, read_study
from sma_bayes.studies.study_step import StudyStep

DONE, NOT_CONVERGED, WRONG = 0, 1, 2
"""Exit statuses of a step; that of the study is the greatest of them."""
STATUS: Final = {DONE: "done", NOT_CONVERGED: "not converged", WRONG: "failed"}
SKIPPED, INADEQUATE, ALARM = "skipped", "not adequate", "alarm"


@dataclass(frozen=True, slots=True)
class _Step:
    """A step that waits to be run.

    Attributes
    ----------
    name : str
        ``ask 2``; of the others the verb.
    summary : str
        Its JSON file, below the folder of the study.
    needs : str
        The step without which it can't run; empty where there is none.
    told : callable
        From what the summary holds to what was found, in a few words.
    run : callable
        Told the progress; gives what the summary holds.
    keys : tuple of str
        What its table in a study file may say.
    """

    name: str
    summary: str
    needs: str
    told: Callable[[Mapping[str, Any]], str]
    run: Callable[[Progress], dict[str, Any]]
    keys: tuple[str, ...] = ()


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
    verbs = study_steps()
    _check(study, verbs)
    campaign = read_campaign(study.campaign, data_dir=study.data)
    _check_questions(study, verbs, campaign)
    folder = Path(out) if out is not None else study.out
    tell = progress or silent
    steps = _steps(study, verbs, campaign, folder, jobs if jobs is not None else study.jobs, resume)
    results: list[StatedStep] = []
    document: dict[str, Any] = {}
    identity = {"schema": "sma-bayes/run/1", "kind": STUDY.verb, "data": campaign.sha256}
    with claimed_folder(folder, identity, resume):  # options may change: each step watches over its own
        for step in steps:
            results.append(_result(step, results, tell, strict=study.strict if strict is None else strict))
            found = _document(study, folder, campaign, results, len(results) == len(steps), clock)
            document = sealed(found.as_json())
            write_json(folder / STUDY.file, document)
    return document


def _check(study: Study, steps: Mapping[str, StudyStep]) -> None:
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
    for kind, options in study.steps.items():
        _check_files(kind, study, options)
        for key, check in steps[kind].checks(options):
            with _place(study, f"{kind}.{key}".rstrip(".")):
                check()
    for number, asked in enumerate(study.asks, start=1):
        for name in (*WANTED, "tolerance"):
            if asked[name] is not None:
                with _place(study, f"ask {number}.{name}"):
                    number_and_unit(asked[name].rstrip("% "), what=name)


def _check_files(kind: str, study: Study, options: Mapping[str, Any]) -> None:
    for number, name in enumerate(options.get("files", ()), start=1):
        if not Path(name).is_file():
            raise StudyError(
                f"there is no such file: {name}",
                file=study.file,
                column=f"{kind}.files, entry {number}",
                expected="a file; paths are relative to the folder of the study file",
            )


def _check_questions(study: Study, steps: Mapping[str, StudyStep], campaign: Campaign) -> None:
    """Refuse temperatures, rates, values and conditions that no record could be asked for."""
    record = campaign.records[0]
    degrees = record.units["temperature"]
    known = {r.condition.id for r in campaign.records}
    for key, condition in _named_conditions(study):
        require_known(condition, known, f"unknown condition {condition!r}", file=study.file, column=key)
    for kind, options in study.steps.items():
        for key, check in steps[kind].questions(options, record):
            with _place(study, f"{kind}.{key}"):
                check()
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
        if list(left_out) != [EACH_CONDITION]:
            yield f"conditions.leave_out, entry {number}", name
    places = [*study.steps.items()]
    places += [(f"ask {number}", asked) for number, asked in enumerate(study.asks, start=1)]
    for place, options in places:
        if options.get("condition") is not None:
            yield f"{place}.condition", options["condition"]


@contextmanager
def _place(study: Study, key: str) -> Iterator[None]:
    """Name the key of the study file in an error that knows of no place."""
    try:
        yield
    except SmaBayesError as error:
        raise error.but(file=error.file or study.file, column=error.column or key) from None


def _steps(
    study: Study,
    verbs: Mapping[str, StudyStep],
    campaign: Campaign,
    folder: Path,
    jobs: int | None,
    resume: bool,
) -> list[_Step]:
    shared: dict[str, Any] = {"seed": study.seed, "jobs": jobs, "resume": resume, "data": study.data}
    steps: list[_Step] = []
    for kind, options in study.steps.items():
        step, needs, given = verbs[kind], study.needs.get(kind, ""), dict(options)
        source = folder / (verbs[needs].folder or needs) if needs else given.pop("files", campaign)
        taken = {k: v for k, v in shared.items() if k in signature(step.call).parameters}
        place = step.folder or kind
        call = partial(step.call, source, out=folder / place, **taken, **given)
        keys = tuple(field.alias or name for name, field in step.table.model_fields.items())
        summary = f"{place}/{step.document.file}"
        steps.append(_Step(kind, summary, needs, step.told, partial(_called, call), keys))
    for number, asked in enumerate(study.asks, start=1):
        summary = f"ask/{number}.json"
        run = partial(_asked, folder / "fit", folder / summary, asked)
        steps.append(_Step(f"ask {number}", summary, "fit", _told, run))
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
        return _stated(step, SKIPPED, WRONG, 0.0, error=f"{failed.step} failed")
    of_step = StepProgress(tell, step.name)
    of_step(0, 1, "begins")
    try:
        found = step.run(of_step)
    except ResumeError as error:  # options were changed under results: the call is wrong, not the step
        raise error.but(
            remedy=f"run [{step.name}] with what it was run with before, or remove this folder to run it anew"
        ) from None
    except SmaBayesError as error:
        of_step(1, 1, "failed")
        return _stated(
            step,
            STATUS[WRONG],
            WRONG,
            time.perf_counter() - clock,
            error=in_keys(str(error), step.name, step.keys),
        )
    status = DONE if found["converged"] else NOT_CONVERGED
    word = STATUS[status]
    if found["converged"] and found.get("exit_status", DONE) != DONE:
        word, status = ALARM, found["exit_status"]
    if strict and found["converged"] and not found.get("adequate", True):
        word, status = INADEQUATE, NOT_CONVERGED
    wall_s, told = time.perf_counter() - clock, step.told(found)
    return _stated(step, word, status, wall_s, summary=step.summary, schema=found["schema"], told=told)


def in_keys(message: str, step: str, keys: Sequence[str]) -> str:
    """A message that names options of a command by the keys of a step; commands in backquotes stay as they are.

    Examples
    --------
    >>> in_keys("name it with --condition, or use `sma-bayes watch --condition`", "watch", ["condition"])
    'name it with `condition` in [watch], or use `sma-bayes watch --condition`'
    >>> in_keys("give --rate '2 K/min'", "plan", ["rate"])
    'give `rate = "2 K/min"` in [plan]'
    """
    parts = message.split("`")
    for key in keys:
        option = rf"(?<!\S)--{re.escape(key.replace('_', '-'))}"
        for pattern, told in ((rf"{option} '([^']*)'", rf'{key} = "\1"'), (rf"{option}(?![\w-])", key)):
            parts[::2] = [re.sub(pattern, f"`{told}` in [{step}]", part) for part in parts[::2]]
    return "`".join(parts)


def _stated(step: _Step, status: str, exit_status: int, wall_s: float, **told: str) -> StatedStep:
    """What became of a step; what is not told is null."""
    none = dict.fromkeys(("summary", "schema", "told", "error"))
    return StatedStep(step=step.name, status=status, exit_status=exit_status, wall_s=wall_s, **(none | told))


def _told(found: Mapping[str, Any]) -> str:
    """What was answered, in a few words."""
    if found["schema"] == AT_SCHEMA:
        return f"{len(found['answers'])} records at {', '.join(found['at'])}"
    sure = sum(bool(a["within"]["intervals"]) for a in found["answers"])
    return (
        f"{found['quantity'].replace('_', ' ')} {found['value']}: {sure} of {len(found['answers'])} branches give it "
        f"with probability {found['probability']:g}"
    )


def _document(
    study: Study,
    folder: Path,
    campaign: Campaign,
    results: Sequence[StatedStep],
    finished: bool,
    clock: float,
) -> StudyDocument:
    return StudyDocument(
        schema="sma-bayes/study/1",
        study=str(study.file),
        out=str(folder),
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
