"""What a study file declares, checked: a campaign, where the results go, and which steps run with which options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from sma_bayes.errors import StudyError, require_known
from sma_bayes.limits import DEGREES, SEED
from sma_bayes.records.declaration import CHANNEL_OF
from sma_bayes.records.toml_table import StrictTable, as_toml, checked, declared_bytes, parsed_toml
from sma_bayes.response import AUTO_MODEL, DEFAULT_MODEL
from sma_bayes.studies.ask.workflow import PROBABILITY, TOLERANCE, WANTED
from sma_bayes.studies.registry import study_steps
from sma_bayes.studies.study_step import DrawnTable, Figures, Texts


class StudyTable(StrictTable):
    """``[study]``: what all steps share. Paths are relative to the folder of the study file.

    Attributes
    ----------
    campaign : str
        Campaign folder, campaign file or data file.
    out : str
        Folder for the results, one below it for each step.
    data : str, optional
        Folder of the data files, where it is not the campaign's own.
    seed : int
    jobs : int, optional
    model : str
        Name of the response model.
    priors : str, optional
        Name of a shipped set or of a model, or a TOML file; those of the model by default.
    noise : str
        Of fit and compare; a gap study estimates the noise by itself.
    pool : str
        ``none`` or ``campaign``.
    figures : str
        ``report``, ``all`` or ``none``, see `figures_for`.
    strict : bool
        Whether a fit that is not adequate makes the exit status 1.
    """

    campaign: str
    out: str
    data: str | None = None
    seed: int = Field(default=0, ge=0, le=int(SEED.value))
    jobs: int | None = Field(default=None, ge=1)
    model: str = DEFAULT_MODEL
    priors: str | None = None
    noise: str = "auto"
    pool: Literal["none", "campaign"] = "none"
    figures: Figures = "report"
    strict: bool = False


class AskTable(StrictTable):
    """One ``[[ask]]``; values with their units, as `ask` takes them. Those of a specimen have its names, too."""

    at: Texts = ()
    unit: Texts = ()
    stiffness: str | None = None
    force: str | None = None
    displacement: str | None = None
    overall_stiffness: str | None = None
    tolerance: str = TOLERANCE
    probability: float = Field(default=PROBABILITY, gt=0.0, le=1.0)
    condition: str | None = None
    branch: Literal["heating", "cooling"] | None = None
    extrapolate: float = Field(default=0.0, ge=0.0, le=DEGREES.value)
    temperature_sd: float = Field(default=0.0, ge=0.0, le=DEGREES.value)
    temperature_unit: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _of_a_specimen(cls, values: Mapping[str, Any]) -> Mapping[str, Any]:
        return {k if (channel := CHANNEL_OF.get(k, k)) in values else channel: v for k, v in values.items()}

    @model_validator(mode="after")
    def _one_value(self) -> AskTable:
        if sum(getattr(self, name) is not None for name in WANTED) + bool(self.at) != 1:
            raise ValueError(f"exactly one of {', '.join(WANTED)}, at")
        if self.unit and not self.at:
            raise ValueError("unit beside `at` only")
        return self


@dataclass(frozen=True, slots=True)
class Study:
    """A study as declared, with its paths resolved.

    Attributes
    ----------
    file : Path
    campaign, out : Path
    data : Path or None
    seed : int
    jobs : int or None
    steps : mapping of str to mapping
        Options of each step by its verb, those of ``[study]`` filled in; a step that is not there does not run.
    needs : mapping of str to str
        Verb to the step whose results it reads, where it reads any.
    asks : tuple of mapping
        Arguments of each `ask`.
    strict : bool
    """

    file: Path
    campaign: Path
    out: Path
    data: Path | None
    seed: int
    jobs: int | None
    steps: Mapping[str, Mapping[str, Any]]
    needs: Mapping[str, str]
    asks: tuple[Mapping[str, Any], ...]
    strict: bool


def read_study(path: Path) -> Study:
    """Read and check a study file; names of priors and noise models are left to the steps.

    Raises
    ------
    StudyError
        If it is not there or wrong, with the key.
    """
    try:
        content = declared_bytes(path)
    except OSError as error:
        raise StudyError(
            f"can't be read: {error.strerror}", file=path, expected="a study file", remedy="check the path"
        ) from None
    document = parsed_toml(content, path, StudyError)
    verbs = study_steps()
    known = ("study", *verbs, "ask")
    for key in document:
        require_known(key, known, f"unknown table {key!r}", StudyError, file=path, column=key)
    tables = {name: _table(document, name, path) for name in ("study", *verbs) if name in document}
    study = checked(StudyTable, tables.get("study", {}), file=path, where="study", kind=StudyError)
    asks = _asks(document.get("ask", []), path)
    declared = {
        name: checked(step.table, tables[name], file=path, where=name, kind=StudyError)
        for name, step in verbs.items()
        if name in tables
    }
    steps = {name: _options(study, table, path) for name, table in declared.items()}
    if not steps:
        raise StudyError("no step is declared", file=path, expected="at least one of [fit], [compare], [gap]")
    needs = {name: table.reads for name, table in declared.items() if table.reads}
    needs |= {"ask": "fit"} if asks else {}
    _refuse_without_start(steps, needs, [n for n, table in declared.items() if table.separate], path)
    if "conditions" in steps:
        own = tables["conditions"].get("model")
        chosen = AUTO_MODEL if steps["fit"]["model"] == AUTO_MODEL else None
        steps["conditions"]["model"] = own or chosen
    folder = path.parent
    return Study(
        file=path,
        campaign=folder / study.campaign,
        out=folder / study.out,
        data=None if study.data is None else folder / study.data,
        seed=study.seed,
        jobs=study.jobs,
        steps=steps,
        needs=needs,
        asks=asks,
        strict=study.strict,
    )


def _refuse_without_start(
    steps: Mapping[str, Mapping[str, Any]], needs: Mapping[str, str], separate: Sequence[str], path: Path
) -> None:
    """Refuse what starts from another step where that is not there, or one that can't serve it."""
    for name, start in needs.items():
        if start not in steps:
            raise StudyError(
                f"{name} without a {start}",
                file=path,
                column=name,
                expected=f"a [{start}], from whose results it starts",
            )
    apart = next((name for name in separate if needs[name] == "fit"), None)
    if apart and steps["fit"]["pool"] != "none":
        raise StudyError(
            f"{apart} after a fit in which all conditions share A and B",
            file=path,
            column="fit.pool",
            expected='pool = "none" under [fit], so that conditions may differ',
        )


def _table(document: Mapping[str, Any], name: str, path: Path) -> Mapping[str, Any]:
    values = document[name]
    if not isinstance(values, Mapping):
        raise StudyError(f"found {as_toml(values)}", file=path, column=name, expected=f"a table: [{name}]")
    return values


def _asks(values: Any, path: Path) -> tuple[Mapping[str, Any], ...]:
    if not isinstance(values, list) or not all(isinstance(v, Mapping) for v in values):
        raise StudyError(
            f"found {as_toml(values)}",
            file=path,
            column="ask",
            expected="a list of tables: each begins with [[ask]]",
        )
    return tuple(
        checked(AskTable, v, file=path, where=f"ask {number}", kind=StudyError).model_dump()
        for number, v in enumerate(values, start=1)
    )


def _options(study: StudyTable, table: DrawnTable, path: Path) -> dict[str, Any]:
    """Options of a step, with those that all steps share where it has none of its own."""
    own = {name: value for name, value in table.model_dump().items() if value is not None}
    shared = {name: getattr(study, name) for name in type(table).model_fields if hasattr(study, name)}
    options = {**shared, **own}
    priors = options.get("priors") or ""
    if priors.endswith(".toml") or Path(priors).name != priors:
        options["priors"] = str(path.parent / priors)
    for name in table.paths:
        told = options.get(name)
        if told:
            one = isinstance(told, str)
            options[name] = str(path.parent / told) if one else [str(path.parent / t) for t in told]
    return options
