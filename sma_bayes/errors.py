"""The one family of errors that a user can cause, how each reads, and words that messages are made of.

Every message says what was found, where, what was expected and what to do. The command line turns any
of them into one message and exit status 2.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from numbers import Integral
from pathlib import Path
from typing import Self

MAX_LINE_CHARACTERS = 2000
"""Characters of a line of a message, beyond which it is shortened in its middle."""


class SmaBayesError(Exception):
    """Base of all errors caused by input, by the call or by the place where output goes.

    Parameters
    ----------
    found : str
        What was found, as a sentence without a full stop.
    file : str or Path, optional
        The file in which it was found.
    row : int, optional
        Line of that file, counted from 1.
    column : str, optional
        Column of a data file, or key of a TOML file.
    expected : str, optional
        What would have been right.
    remedy : str, optional
        What to do about it.
    """

    def __init__(
        self,
        found: str,
        *,
        file: str | Path | None = None,
        row: int | None = None,
        column: str | None = None,
        expected: str | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(found)
        self.found = found
        self.file = None if file is None else str(file)
        self.row = row
        self.column = column
        self.expected = expected
        self.remedy = remedy

    def __str__(self) -> str:
        kind = "key" if (self.file or "").lower().endswith(".toml") else "column"
        where = [
            text
            for text, given in (
                (self.file, self.file is not None),
                (f"row {self.row}", self.row is not None),
                (f"{kind} {self.column!r}", self.column is not None),
            )
            if given and text
        ]
        head = f"{', '.join(where)}: {self.found}" if where else self.found
        lines = [head]
        if self.expected:
            lines.append(f"expected: {self.expected}")
        if self.remedy:
            lines.append(f"what to do: {self.remedy}")
        return "\n".join(  # what is quoted in a line may be as long as a file
            line
            if len(line) <= MAX_LINE_CHARACTERS
            else f"{line[: MAX_LINE_CHARACTERS - 200]} ... {line[-150:]}"
            for line in lines
        )

    def but(self, found: str = "", **changed: str | Path | int | None) -> Self:
        """The same error with other words, or another place, expectation or remedy."""
        kept = {name: getattr(self, name) for name in ("file", "row", "column", "expected", "remedy")}
        return type(self)(found or self.found, **(kept | changed))

    def __reduce__(self) -> tuple[object, ...]:  # survives the way back from a worker process
        return type(self), (self.found,), vars(self)


class MeasurementError(SmaBayesError):
    """A data file, or a value in it, can't be used."""


class ReadingError(MeasurementError):
    """A data file can't be read as it is declared; its remedy is in ``campaign.toml``.

    Parameters
    ----------
    found, file, row, column, expected, remedy
        See `SmaBayesError`.
    elsewhere : str
        What to do where no ``campaign.toml`` says how the file is read.
    """

    def __init__(
        self,
        found: str,
        *,
        file: str | Path | None = None,
        row: int | None = None,
        column: str | None = None,
        expected: str | None = None,
        remedy: str | None = None,
        elsewhere: str = "",
    ) -> None:
        super().__init__(found, file=file, row=row, column=column, expected=expected, remedy=remedy)
        self.elsewhere = elsewhere


@contextmanager
def without_campaign() -> Iterator[None]:
    """Let errors advise what helps where no ``campaign.toml`` says how a file is read."""
    try:
        yield
    except ReadingError as error:
        raise error.but(remedy=error.elsewhere or error.remedy) from None


class CampaignError(SmaBayesError):
    """`campaign.toml` is wrong: a typo, a column that is not there, duplicate conditions."""


class StudyError(SmaBayesError):
    """A study file is wrong: a typo, a path that is not there, a step that lacks what it needs."""


class QuantityError(SmaBayesError):
    """A unit is unknown or of the wrong kind."""


class PriorError(SmaBayesError):
    """A prior is missing, names an unknown parameter, or has the wrong dimension or numbers."""


class UnknownNameError(SmaBayesError):
    """A name is not in a catalogue."""


class OutputError(SmaBayesError):
    """The output folder can't be written, or holds something that must not be overwritten."""


class ResumeError(SmaBayesError):
    """What was left by an earlier run belongs to other data, priors, model or versions."""


class WorkerError(SmaBayesError):
    """A process that shared the work was ended from outside, for instance for want of memory."""


def near_matches(name: str, known: Iterable[str]) -> str:
    """Sentence that lists the known names nearest to `name`, else all of them.

    Examples
    --------
    >>> near_matches("forc", ["force", "displacement"])
    "did you mean 'force'?"
    """
    known = sorted(set(known))
    near = get_close_matches(name, known, n=3, cutoff=0.6)
    if near:
        return "did you mean " + " or ".join(repr(n) for n in near) + "?"
    return "known: " + ", ".join(repr(n) for n in known)


def require_known(
    name: str | None,
    known: Collection[str],
    found: str,
    kind: type[SmaBayesError] = UnknownNameError,
    *,
    file: str | Path | None = None,
    column: str | None = None,
    remedy: str | None = None,
) -> None:
    """Refuse a name that is given and is none of those known, the nearest of which are proposed.

    Parameters
    ----------
    name : str or None
    known : collection of str
    found, file, column, remedy
        See `SmaBayesError`.
    kind : type of SmaBayesError
        That is raised.
    """
    if name is not None and name not in known:
        raise kind(found, file=file, column=column, expected=near_matches(name, known), remedy=remedy)


def require_seed(seed: object) -> None:
    """Refuse what is no seed of random draws.

    Raises
    ------
    SmaBayesError
        If it is no whole number, or a negative one.
    """
    if not isinstance(seed, Integral) or seed < 0:
        raise SmaBayesError(f"seed {seed!r}", expected="a whole number, 0 or greater")


def many(count: int, noun: str) -> str:
    """Count with its noun.

    Examples
    --------
    >>> many(1, "row"), many(0, "row")
    ('1 row', '0 rows')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def nats(value: float) -> str:
    """A difference of ln evidence with the decimals that tell something.

    Examples
    --------
    >>> nats(3.06), nats(1148.02)
    ('3.1', '1148')
    """
    return f"{value:.1f}" if abs(value) < 99.95 else f"{value:.0f}"


def first_of(names: Sequence[str], most: int, between: str = ", ") -> str:
    """The first of some names, and how many more there are.

    Examples
    --------
    >>> first_of(["a", "b", "c"], 2), first_of(["a", "b"], 2)
    ('a, b and 1 more', 'a, b')
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return between.join(names[:most]) + more
