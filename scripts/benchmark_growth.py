"""How time and memory grow with samples a branch, records of a campaign, and effects of the catalogue.

    python scripts/benchmark_growth.py run samples records effects --out docs/data/growth.csv
    python scripts/benchmark_growth.py plot docs/data/growth.csv docs/images/growth.png

Each size is measured in a process of its own, without figures; rows that are there already are not measured again.
Time is that of the processor, which a machine shared with others distorts least; memory is the most that the process
ever had, less what it had once everything was imported.

- ``samples``: one branch of the test house, read from CSV and fitted, 100 to 1,000,000 samples.
- ``records``: the test house with 100 samples a branch, 2 to 2,000 records, in one process.
- ``effects``: a gap study of a simulated campaign with a lagging thermocouple, 1 to 24 effects to choose from.
"""

from __future__ import annotations

import csv
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table
from scipy.stats import linregress

sys.path.insert(0, str(Path(__file__).parent))

from sma_bayes.account import Account

SIZES = {
    "samples": (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000),
    "records": (2, 10, 40, 100, 400, 2_000),
    "effects": (1, 2, 4, 8, 16, 24),
}
WHAT = {
    "samples": ("samples a branch", "time, memory of one branch"),
    "records": ("records", "time, memory of a campaign"),
    "effects": ("effects in the catalogue", "time, memory of a gap study"),
}
HIDDEN = "thermocouple_lag"
LARGEST = 4
"""Of so many largest sizes the exponent is taken too: there the fixed costs weigh least."""

app = typer.Typer(add_completion=False, help=__doc__)


@dataclass(frozen=True, slots=True)
class Row:
    """What one stage took at one size.

    Attributes
    ----------
    what : str
        Of `SIZES`.
    size : int
    stage : str
        ``all``, or one of the stages of the run's account.
    cpu_s : float
        Processor time [s].
    peak_mb, base_mb : float
        Most memory that the process had, and what it had after imports [MB]; of ``all`` only.
    """

    what: str
    size: int
    stage: str
    cpu_s: float
    peak_mb: float
    base_mb: float


def peak_mb() -> float:
    """Most memory that this process has had [MB]."""
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size / (1e6 if sys.platform == "darwin" else 1e3)


def fit_house(springs: int, conditions: int, points: int, branches: int) -> Account:
    """Write a test house, read it and fit it."""
    from sma_bayes import fit_campaign
    from sma_bayes.arviz_bridge import arviz
    from sma_bayes.records.campaign import read_campaign

    arviz()  # what a run imports counts as base, xarray with it
    import_module("h5py")
    with tempfile.TemporaryDirectory() as place:
        house = Path(place) / "house"
        numbers = map(str, (springs, conditions, points, branches))
        subprocess.run([sys.executable, __file__, "house", str(house), *numbers], check=True)
        account = Account()
        global BASE
        BASE = peak_mb()
        with account.timed("read"):
            campaign = read_campaign(house)
        fit_campaign(campaign, Path(place) / "out", jobs=1, figures="none", account=account)
    return account


def study_gap_with(effects: int) -> Account:
    """Study a campaign in which a thermocouple lags, with the first effects of the catalogue."""
    from gap_benchmark.hide import hide_several

    from sma_bayes.effects import EFFECTS
    from sma_bayes.parameters.priors_file import read_priors
    from sma_bayes.studies.gap.outcome import gap_outcome

    case = hide_several([HIDDEN], 10.0, "white", "standard", seed=0)
    names = [HIDDEN, *(name for name in EFFECTS if name != HIDDEN)][:effects]
    account = Account()
    global BASE
    BASE = peak_mb()
    gap_outcome(
        case.campaign,
        read_priors("modified_sigmoid"),
        pooled=case.pooled,
        effects={name: EFFECTS[name] for name in names},
        jobs=1,
        account=account,
    )
    return account


BASE = 0.0
MEASURED: dict[str, Callable[[int], Account]] = {
    "samples": lambda n: fit_house(1, 1, n, 1),
    "records": lambda n: fit_house(max(1, n // 20), min(n // 2, 10), 100, 2),
    "effects": study_gap_with,
}


@app.command(hidden=True)
def house(folder: Path, springs: int, conditions: int, points: int, branches: int) -> None:
    """Write a test house, with one branch or both, in a process whose memory is nobody's concern."""
    from make_test_house import write_test_house

    write_test_house(folder, springs, conditions, points, 0)
    for file in folder.glob("spring*.csv") if branches == 1 else ():
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        file.write_text("".join(lines[: points + 1]), encoding="utf-8")


@app.command(hidden=True)
def one(what: str, size: int) -> None:
    """Measure one size in this process and print rows as JSON."""
    account = MEASURED[what](size)
    total = sum(account.cpu.values())
    rows = [Row(what, size, "all", total, peak_mb(), BASE)]
    rows += [Row(what, size, stage, cpu, float("nan"), float("nan")) for stage, cpu in account.cpu.items()]
    print(json.dumps([asdict(row) for row in rows]))


@app.command()
def run(
    what: Annotated[list[str], typer.Argument(help="samples, records, effects.")],
    out: Annotated[Path, typer.Option(help="CSV file; rows are added.")],
    largest: Annotated[int, typer.Option(help="Leave out larger sizes.")] = 10**9,
) -> None:
    """Measure all sizes, each in a process of its own."""
    done = {(row.what, row.size) for row in read(out)} if out.exists() else set()
    for kind in what:
        for size in SIZES[kind]:
            if (kind, size) in done or size > largest:
                continue
            told = subprocess.run(
                [sys.executable, __file__, "one", kind, str(size)], check=True, capture_output=True, text=True
            )
            rows = json.loads(told.stdout)
            new = not out.exists()
            with out.open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, [f.name for f in fields(Row)], lineterminator="\n")
                if new:
                    writer.writeheader()
                writer.writerows(
                    {k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()} for row in rows
                )
            print(kind, size, f"{rows[0]['cpu_s']:.2f} s, {rows[0]['peak_mb']:.0f} MB", flush=True)


def read(path: Path) -> list[Row]:
    """Rows of a file that `run` wrote."""
    with path.open(encoding="utf-8", newline="") as file:
        return [
            Row(
                r["what"], int(r["size"]), r["stage"], *(float(r[k]) for k in ("cpu_s", "peak_mb", "base_mb"))
            )
            for r in csv.DictReader(file)
        ]


def exponent(sizes: Any, values: Any) -> tuple[float, float]:
    """Slope of log value over log size, and its standard error."""
    found = linregress(np.log(sizes), np.log(values))
    return float(found.slope), float(found.stderr)


def series(rows: list[Row], what: str, stage: str = "all") -> tuple[Any, Any, Any]:
    """Sizes, processor time [s] and memory over the base [MB]."""
    own = sorted((r for r in rows if r.what == what and r.stage == stage), key=lambda r: r.size)
    sizes, cpu, over = zip(*((r.size, r.cpu_s, r.peak_mb - r.base_mb) for r in own), strict=True)
    return np.array(sizes), np.array(cpu), np.array(over)


@app.command()
def table(path: Path) -> None:
    """Print sizes, time, memory and exponents."""
    rows = read(path)
    shown = Table("what", "size", "CPU s", "MB over imports")
    fitted = Table("what", "of", "exponent, all sizes", f"exponent, largest {LARGEST}")
    for what in dict.fromkeys(r.what for r in rows):
        sizes, cpu, over = series(rows, what)
        for size, seconds, size_mb in zip(sizes, cpu, over, strict=True):
            shown.add_row(what, f"{size:,}", f"{seconds:.3g}", f"{size_mb:.3g}")
        for name, values in (("time", cpu), ("memory", over)):
            ends = [
                exponent(s, np.maximum(v, 0.1))
                for s, v in ((sizes, values), (sizes[-LARGEST:], values[-LARGEST:]))
            ]
            fitted.add_row(what, name, *(f"{p:.2f} +- {e:.2f}" for p, e in ends))
    Console().print(shown, fitted)


@app.command()
def plot(path: Path, picture: Path) -> None:
    """Plot time and memory against size, with exponents."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = read(path)
    kinds = list(dict.fromkeys(r.what for r in rows))
    with mpl.rc_context({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(3.1 * len(kinds), 4.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, len(kinds), squeeze=False, sharex="col")
        for column, what in enumerate(kinds):
            sizes, cpu, over = series(rows, what)
            for ax, values, name in zip(
                axes[:, column], (cpu, over), ("processor time [s]", "memory over imports [MB]"), strict=True
            ):
                slope, error = exponent(sizes[-LARGEST:], np.maximum(values[-LARGEST:], 0.1))
                ax.loglog(sizes, values, "o-", color="#1f6fb2", ms=3.5, lw=1)
                ax.loglog(sizes, values[-1] * sizes / sizes[-1], ":", color="#9a9a9a", lw=1, label="linear")
                ax.set_title(f"exponent {slope:.2f} ± {error:.2f}", fontsize=8)
                ax.set_ylabel(name if column == 0 else "")
                ax.set_ylim(0.5 * values.min(), 3.0 * values.max())
            axes[1, column].set_xlabel(WHAT[what][0])
        axes[0, 0].legend(frameon=False)
        figure.savefig(picture, dpi=120)


if __name__ == "__main__":
    app()
