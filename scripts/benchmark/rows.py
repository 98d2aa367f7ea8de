"""Rows of raw timings: one for each run, and the CSV file that holds them."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass, fields
from pathlib import Path

OWN = "sma_bayes"


@dataclass(frozen=True, slots=True)
class Row:
    """One run of one sampler on one record.

    Attributes
    ----------
    kind : str
        ``warm``: everything imported; ``cold``: a fresh process, from its start to the draws; ``unaided``: warm, but
        with no more help than a user has (see `measure.Task`).
    length : str
        Samples of a record that were asked for: a number, or ``demo``.
    points, parameters : int
        Samples of this record, and sampled parameters.
    reached : bool
        Whether the target was met by draws of the right posterior.
    claimed_s : float
        When R-hat and effective sample size were met for the first time, whatever the draws; NaN if never.
    wall_s, cpu_s : float
        To the target, or to the limit where that was not reached. Finding the least-squares start (`warm_s`) is
        not in it, for nobody, but for ``cold``, for everybody.
    discard : float
        Share of the steps dropped as burn-in.
    share_errors : float
        Greatest difference of a share of the draws from that of a longer run of this package [standard errors]; see
        `judgement`. NaN in rows that were measured when means and standard deviations were compared.
    mean_shift : float
        Greatest difference of a mean from that of a longer run of this package [sd of the posterior].
    sd_low, sd_high : float
        Least and greatest ratio of a standard deviation to that of the longer run.
    ended : str
        ``target``: reached; ``time``: broken off at the limit; ``killed``: its process was ended after the limit,
        since it did not let itself be broken off; ``itself``: the sampler stopped of its own accord.
    """

    session: str
    kind: str
    channels: str
    noise: str
    length: str
    record: str
    points: int
    parameters: int
    sampler: str
    walkers: int
    start: str
    log_prob: str
    repeat: int
    place: int
    limit_s: float
    reached: bool
    claimed_s: float
    wall_s: float
    cpu_s: float
    warm_s: float
    evaluations: int
    steps: int
    discard: float
    rhat: float
    ess_bulk: float
    ess_tail: float
    share_errors: float
    mean_shift: float
    sd_low: float
    sd_high: float
    ended: str

    @staticmethod
    def parse(text: dict[str, str]) -> Row:
        """A row as it was written to a CSV file."""
        read = {"str": str, "int": int, "float": float, "bool": lambda s: s == "True"}
        return Row(**{f.name: read[str(f.type)](text[f.name]) for f in fields(Row)})

    @property
    def case(self) -> tuple[str, str, str, str]:
        """What is measured: rows of the same case are compared."""
        return (self.kind, self.channels, self.noise, self.length)


def read_rows(path: Path) -> list[Row]:
    """Rows of a file, in their order."""
    with path.open(newline="", encoding="utf-8") as file:
        return [Row.parse(row) for row in csv.DictReader(file)]


def add_row(path: Path, row: Row, *, replace: bool) -> None:
    """Add a row to a file; with `replace`, earlier sessions' rows of the same sampler, case and record go."""
    rows = read_rows(path) if path.exists() else []
    if replace:
        rows = [old for old in rows if old.session == row.session or _subject(old) != _subject(row)]
    text = io.StringIO()
    writer = csv.DictWriter(text, [f.name for f in fields(Row)], lineterminator="\n")
    writer.writeheader()
    for each in [*rows, row]:
        writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in asdict(each).items()})
    whole = path.with_suffix(".part")
    whole.write_text(text.getvalue(), encoding="utf-8")
    whole.replace(path)


def _subject(row: Row) -> tuple[str, ...]:
    return (*row.case, row.record, row.sampler)
