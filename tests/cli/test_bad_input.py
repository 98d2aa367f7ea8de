"""Every mistake gets one message with its place, exit status 2, and leaves nothing behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.studies.registry import VERBS, has_report

Run = Callable[..., object]
SHIPPED = read_priors("modified_sigmoid").text


def refused(run: Callable[..., object], *arguments: object, out: Path | None = None) -> str:
    """The one message of a call that must be refused."""
    outcome = run(*arguments)
    assert outcome.status == 2, outcome
    assert outcome.out == ""
    assert outcome.err.startswith(("error: ", "Usage: "))
    assert outcome.err.count("error: ") + outcome.err.count("Error: ") == 1
    assert "Traceback" not in outcome.err
    assert out is None or not out.exists(), "a failed start leaves no folder"
    return str(outcome.err)


def edited(lines: list[str], row: int, column: int, cell: str) -> list[str]:
    cells = lines[row - 1].split(",")
    cells[column - 1] = cell
    return [*lines[: row - 1], ",".join(cells), *lines[row:]]


DATA = {
    "empty": (lambda s: [], ["bad.csv", "the file is empty"]),
    "header only": (lambda s: s()[:1], ["bad.csv", "no row of numbers"]),
    "text in a number column": (
        lambda s: edited(s(), 12, 3, "1.2 N"),
        ["bad.csv, row 12, column 'force_N'", "found '1.2 N'", "expected: a number", "what to do: correct the cell"],
    ),
    "NaN": (lambda s: edited(s(), 7, 3, "NaN"), ["row 7, column 'force_N'", "found 'NaN'", "`missing`"]),
    "inf": (lambda s: edited(s(), 7, 2, "inf"), ["row 7, column 'temperature_C'", "found 'inf'"]),
    "the header again": (
        lambda s: [*s()[:9], s()[0], *s()[9:]],
        ["row 10, column 'time_s'", "found 'time_s', the name of the column again"],
    ),
    "a short row": (lambda s: [*s()[:9], "1,2,3", *s()[9:]], ["row 10", "3 cells, the others have 4"]),
    "no column of temperature": (
        lambda s: ["time_s,T,force_N,displacement_mm", *s()[1:]],
        ["the temperature is not among the columns", "temperature_C", "the file has 'time_s', 'T'"],
    ),
    "constant temperature": (
        lambda s: [s()[0], *(edited([line], 1, 2, "40")[0] for line in s()[1:])],
        ["column 'temperature'", "constant", "expected: a heating or a cooling sweep"],
    ),
    "fewer points than parameters": (
        lambda s: s(7),
        ["no branch has 10 usable rows", "more samples than the model has parameters"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("what", DATA)
def test_a_data_file(
    run: Run, make_sweep: Callable[..., list[str]], tmp_path: Path, what: str, jobs: int
) -> None:
    change, parts = DATA[what]
    path = tmp_path / "bad.csv"
    path.write_text("".join(f"{line}\n" for line in change(make_sweep)), encoding="utf-8")
    message = refused(run, "fit", path, "--out", tmp_path / "out", "--jobs", jobs, out=tmp_path / "out")
    assert [part for part in parts if part not in message] == []


def test_a_missing_file(run: Run, measured: Path, tmp_path: Path) -> None:
    message = refused(run, "fit", tmp_path / "rum.csv", "--out", tmp_path / "out", out=tmp_path / "out")
    assert "there is no such file or folder" in message
    assert "did you mean 'run.csv'?" in message
    assert "there is no folder" in refused(run, "inspect", tmp_path / "no" / "run.csv")


def test_a_folder_without_a_campaign(run: Run, measured: Path, tmp_path: Path) -> None:
    message = refused(run, "inspect", tmp_path)
    assert "has no campaign.toml" in message
    assert f"`sma-bayes init {tmp_path}` writes one" in message


def test_a_folder_in_which_no_campaign_can_be_written_is_not_sent_to_init(run: Run, tmp_path: Path) -> None:
    message = refused(run, "inspect", tmp_path)
    assert "the folder holds no files: name the folder of the measurements" in message
    assert "init" not in message


def test_a_folder_above_the_campaign_is_told_where_it_is(
    run: Run, make_campaign: Callable[..., Path], tmp_path: Path
) -> None:
    folder = make_campaign(tmp_path / "c")
    assert f"there is one in {str(folder)!r}: name that folder" in refused(run, "inspect", tmp_path)


def test_a_copy_of_the_campaign_file_is_told_where_its_data_are(
    run: Run, make_campaign: Callable[..., Path], tmp_path: Path
) -> None:
    """Such as the one in the folder of results, above the measurements of the demo."""
    folder = make_campaign(tmp_path / "measurements")
    copy = tmp_path / "campaign.toml"
    copy.write_bytes((folder / "campaign.toml").read_bytes())
    message = refused(run, "inspect", copy)
    assert "there is no file" in message
    assert (
        f"a file of that name is in {str(folder)!r}; name that folder as the data folder (--data)" in message
    )
    assert run("inspect", copy, "--data", folder).status == 0


CAMPAIGNS = {
    "a column that is not there": (
        ('"force_N"', '"force"'),
        ["campaign.toml, key 'columns.force'", "has no column 'force'", "did you mean 'force_N'?"],
    ),
    "an unknown unit": (('unit = "N"', 'unit = "Nn"'), ["'columns.force.unit'", "unit 'Nn' of force is not known"]),
    "a unit of the wrong kind": (('unit = "N"', 'unit = "K"'), ["unit 'K' of force is of the wrong kind", "into 'N'"]),
    "an open bracket": (('unit = "N"', 'unit = "N/(m"'), ["'columns.force.unit'", "unit 'N/(m' of force is not known"]),
    "a division by zero": (('unit = "N"', 'unit = "N/0"'), ["unit 'N/0' of force is not known"]),
    "a typing error in a table": (("[columns]", "[colums]"), ["unknown key 'colums'", "did you mean 'columns'?"]),
    "a typing error in a key": (("file =", "flie ="), ["condition 'a'", "'flie'"]),
    "no TOML": (("[columns]", "[columns"), ["campaign.toml, row 3", "expected: TOML"]),
    "a single bracket": (("[[condition]]", "[condition]"), ["key 'condition'", "[[name]]"]),
    "a missing data file": (('"a.csv"', '"b.csv"'), ["there is no file", "b.csv", "did you mean 'a.csv'?"]),
    "a whole path to nothing": (('"a.csv"', '"/no/such/place/b.csv"'), ["there is no file '/no/such/place/b.csv'"]),
    "two stars in the middle of a name": (('"a.csv"', '"b**c.csv"'), ["there is no file", "b**c.csv"]),
    "equal ids": (
        ("[[condition]]", '[[condition]]\nid = "a"\nfile = "a.csv"\n[[condition]]'),
        ["two conditions have the id 'a'", "rename one of them"],
    ),
    "an id that is a path": (('id = "a"', 'id = "../a"'), ["found \"../a\"", "file name"]),
}  # fmt: skip


@pytest.mark.parametrize("what", CAMPAIGNS)
def test_a_campaign(run: Run, make_campaign: Callable[..., Path], tmp_path: Path, what: str) -> None:
    change, parts = CAMPAIGNS[what]
    folder = make_campaign(tmp_path / "c", change)
    message = refused(run, "fit", folder, "--out", tmp_path / "out", out=tmp_path / "out")
    assert [part for part in parts if part not in message] == []
    assert refused(run, "inspect", folder) == message


B2 = """\
[both.B2]
family = "lognormal"
median = 20.0
sigma = 1.2
relative_to = "1/span(temperature)"
source = "as A2"
"""
NORMAL = '[both.B2]\nfamily = "normal"\nmean = 0.3\nsd = 0.1\n'
PRIORS = {
    "missing": (B2, "", ["'heating.B2'", "no prior for B2", "what to do: add a table"]),
    "unknown": (B2, B2 + B2.replace("B2", "B22"), ["'both.B22'", "no parameter is called 'B22'", "'B2'"]),
    "wrong dimension": (B2, NORMAL + 'unit = "N"\n', ["'both.B2'", "wrong kind", "B2 is in '1/degC' here"]),
    "open bracket": (B2, NORMAL + 'unit = "1/(K"\n', ["'both.B2'", "unit '1/(K' of B2 is not known"]),
    "no unit": (B2, NORMAL, ["'both.B2'", "neither a unit nor a scale"]),
    "negative width": (B2, B2.replace("1.2", "-1.2"), ["'both.B2'", "sigma = -1.2", "positive"]),
    "NaN": (B2, B2.replace("1.2", "nan"), ["'both.B2'", "sigma = nan", "a finite number"]),
    "no TOML": ("[both.B2]", "[both.B2", ["p.toml, row ", "is not valid TOML"]),
    "typing error": ("family", "famly", ["unknown key 'famly'", "did you mean 'family'?"]),
    "another schema": ("sma-bayes/priors/1", "sma-bayes/priors/9", ["key 'schema'", "'sma-bayes/priors/1'"]),
}  # fmt: skip


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("what", PRIORS)
def test_priors(run: Run, measured: Path, tmp_path: Path, what: str, jobs: int) -> None:
    old, new, parts = PRIORS[what]
    assert SHIPPED.count(old) >= 1
    (tmp_path / "p.toml").write_text(SHIPPED.replace(old, new), encoding="utf-8")
    out = tmp_path / "out"
    message = refused(
        run, "fit", measured, "--out", out, "--priors", tmp_path / "p.toml", "--jobs", jobs, out=out
    )
    assert [part for part in (*parts, "p.toml") if part not in message] == []


@pytest.mark.parametrize(
    ("option", "value", "parts"),
    [
        ("--sampler", "strech", ["--sampler 'strech'", "did you mean 'stretch'?"]),
        ("--noise", "ar2", ["no noise model is called 'ar2'", "did you mean 'ar1'?"]),
        ("--priors", "modified_sigmod", ["no priors are called", "did you mean 'modified_sigmoid'?"]),
        ("--priors", "no.toml", ["no.toml: can't be read", "sma-bayes priors > "]),
        ("--pool", "all", ["--pool 'all'", "'none' or 'campaign'"]),
        ("--seed", "-1", ["--seed"]),
        ("--seed", "x", ["--seed"]),
        ("--jobs", "0", ["--jobs"]),
        ("--extrapolate", "inf", ["--extrapolate inf", "a finite number"]),
        ("--extrapolate", "nan", ["--extrapolate"]),
        ("--nosie", "ar1", ["--nosie", "--noise"]),
        ("--bias", "120", ["without --arrangement", "parallel", "what to do"]),
        ("--arrangement", "paralel", ["did you mean 'parallel'?"]),
        ("--data", "elsewhere", ["--data elsewhere beside a data file", "leave --data out"]),
        (
            "--priors",
            "logistic",
            ["'both.K_min'", "no parameter is called 'K_min'", "these are of 'logistic'"],
        ),
    ],
)
def test_options(run: Run, measured: Path, tmp_path: Path, option: str, value: str, parts: list[str]) -> None:
    out = tmp_path / "out"
    message = refused(run, "fit", measured, "--out", out, option, value, out=out)
    assert [part for part in parts if part not in message] == []


def test_priors_of_an_unknown_set_and_a_report_of_nothing(run: Run, tmp_path: Path) -> None:
    assert "'paper_spring'" in refused(run, "priors", "no_such")
    assert "is not a folder" in refused(run, "report", tmp_path / "no")
    told = refused(run, "report", tmp_path)
    assert "holds no run of sma_bayes" in told
    assert ", ".join(verb for verb in VERBS if has_report(verb)) in told


def test_a_verb_that_is_none_and_a_call_without_a_path(run: Run) -> None:
    assert "No such command 'fti'" in refused(run, "fti")
    assert "Missing argument" in refused(run, "inspect")
