"""The verbs of the command line: a folder each, and a line each in the order of the help.

A verb's folder has a module `command` with a function `command`, of which typer makes the verb: its
parameters are arguments and options, the first line of its docstring stands in the help. Where the verb writes a
folder that has a report, a module `report` has `build_report`, see `sma_bayes.report.choice.ReportBuilder`. Where it
declares what it writes or prints, a module `schema` has `DOCUMENTS`: by name, the type of each document. Where it can
be a step of a study, a module `workflow` has `STEP`, a `StudyStep`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

from sma_bayes.catalogue import Catalogue
from sma_bayes.errors import SmaBayesError
from sma_bayes.report.choice import ReportBuilder

if TYPE_CHECKING:
    from sma_bayes.runs.schema import DocumentPart
    from sma_bayes.studies.study_step import StudyStep

_SHIPPED: Final = (
    "demo",
    "init",
    "inspect",
    "priors",
    "fit",
    "gap",
    "compare",
    "ask",
    "sensitivity",
    "diff",
    "conditions",
    "simulate",
    "cycles",
    "modulus",
    "watch",
    "card",
    "plan",
    "run",
    "report",
    "paper",
)
VERBS: Final = Catalogue[ModuleType](
    "verb", {name: import_module(f"sma_bayes.studies.{name}") for name in _SHIPPED}, "sma_bayes.studies"
)
"""The folder of each verb, as a package."""


def command_of(verb: str) -> Callable[..., None]:
    """Function of which typer makes the verb.

    Raises
    ------
    SmaBayesError
        If the verb's folder has none.
    """
    command: Callable[..., None] = _in_folder(verb, "command", "command")
    return command


def has_report(verb: str) -> bool:
    """Whether a folder that a verb has written has a report."""
    return find_spec(f"{VERBS[verb].__name__}.report") is not None


def report_builder(verb: str) -> ReportBuilder:
    """What builds the report of a folder that a verb has written.

    Raises
    ------
    SmaBayesError
        If the verb's folder has none.
    """
    build_report: ReportBuilder = _in_folder(verb, "report", "build_report")
    return build_report


def study_steps() -> dict[str, StudyStep]:
    """Verbs that can be steps of a study, in the order of the help."""
    found = {}
    for verb in VERBS:
        place = f"{VERBS[verb].__name__}.workflow"
        step = getattr(import_module(place), "STEP", None) if find_spec(place) else None
        if step is not None:
            found[verb] = step
    return found


def declared_documents() -> dict[str, type[DocumentPart]]:
    """Types of the documents that the verbs of this package declare, by name."""
    places = [f"{VERBS[verb].__name__}.schema" for verb in _SHIPPED]
    return {
        name: document
        for place in places
        if find_spec(place) is not None
        for name, document in import_module(place).DOCUMENTS.items()
    }


def _in_folder(verb: str, module: str, name: str) -> Any:
    place = f"{VERBS[verb].__name__}.{module}"
    try:
        return getattr(import_module(place), name)
    except (ImportError, AttributeError) as error:
        raise SmaBayesError(
            f"the verb {verb!r} can't be loaded: {error}",
            expected=f"a module {place} that can be imported and has {name!r}",
            remedy=f"repair or uninstall the package that provides {place}",
        ) from error
