"""What is meant to hurt, or careless beyond belief: one message, status 2, in little time and memory."""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

import sma_bayes
from sma_bayes import fit_campaign
from sma_bayes.limits import LIMITS
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.plausibility import RANGES

Run = Callable[..., object]
ROOT = Path(__file__).resolve().parents[2]
SHIPPED = read_priors("modified_sigmoid").text
LARGEST_MB = 1000.0
QUOTED = ".".join(["'b'"] * 50_000)


def refused(run: Callable[..., object], *arguments: object) -> str:
    """The one message of a call that must be refused."""
    outcome = run(*arguments)
    assert outcome.status == 2, outcome
    assert outcome.out == ""
    assert "Traceback" not in outcome.err
    assert outcome.err.count("error: ") + outcome.err.count("Error: ") == 1
    assert len(outcome.err) < 7000
    return str(outcome.err)


CAMPAIGNS = {
    "a power of powers as a unit": (('unit = "N"', 'unit = "9**9**9**9 N"'), "exponents that no unit has"),
    "superscripts as a unit": (('unit = "N"', 'unit = "9⁹⁹⁹⁹⁹⁹⁹⁹"'), "exponents that no unit has"),
    "600 kB of unit": (('unit = "N"', f'unit = "{"(" * 300_000}{")" * 300_000}"'), "a text of 600000 characters"),
    "200 characters of unit": (('unit = "N"', f'unit = "N{" N" * 100}"'), "has 201 characters"),
    "brackets in a unit": (('unit = "N"', f'unit = "{"(" * 9}N{")" * 9}"'), "9 brackets inside each other"),
    "lists a thousand deep": (('id = "a"', f'id = {"[" * 1000}{"]" * 1000}'), "too deep inside each other"),
    "lists thirty deep": (('id = "a"', f'id = {"[" * 30}{"]" * 30}'), "too deep inside each other"),
    "tables a thousand deep": (('id = "a"', f'id = {"{a=" * 1000}1{"}" * 1000}'), "too deep inside each other"),
    "a key of 50,000 parts": (('id = "a"', f'id = "a"\n{".".join("b" * 50_000)} = 1'), "a key of more than"),
    "a table of 50,000 parts": (("[campaign]", f"[{'.'.join('b' * 50_000)}]\n[campaign]"), "a key of more than"),
    "quoted parts of a key": (('id = "a"', f'id = "a"\n{QUOTED} = 1'), "a key of more than"),
    "3 MB of campaign": (("[campaign]", f"#{'x' * 3_000_000}\n[campaign]"), "more than 2000000 bytes"),
    "an integer of 5,000 digits": (('id = "a"', f'id = "a"\nload_g = {"9" * 5000}'), "is not valid TOML"),
    "an integer of 400 digits": (('id = "a"', f'id = "a"\nload_g = {"9" * 400}'), "a whole number of 1329 bits"),
    "a file name of 5,000 characters": (('"a.csv"', f'"{"a" * 5000}.csv"'), "a text of 5004 characters"),
    "a file name of 3,000 characters": (('"a.csv"', f'"{"a" * 3000}.csv"'), "there is no file"),
    "a null character": (('"a.csv"', '"a\\u0000.csv"'), "null character"),
    "an id of 60 emoji": (('id = "a"', f'id = "{"😀" * 60}"'), "at most 120 bytes"),
    "an error of 1e300 degrees": (('unit = "degC"', 'unit = "degC", sd = 1e300'), "standard deviations up to 1e+50"),
    "an offset_sd of 1e308": (('unit = "degC"', 'unit = "degC", offset_sd = 1e308'), "standard deviations up to 1e+50"),
    "a scale_sd of 1e308": (('unit = "degC"', 'unit = "degC", scale_sd = 1e308'), "standard deviations up to 1e+50"),
    "a scale that overflows": (('unit = "N"', 'unit = "N", scale = 1e308'), "a magnitude up to 1e+50"),
}  # fmt: skip


@pytest.mark.parametrize("what", CAMPAIGNS)
def test_a_campaign(run: Run, make_campaign: Callable[..., Path], tmp_path: Path, what: str) -> None:
    change, told = CAMPAIGNS[what]
    assert told in refused(run, "inspect", make_campaign(tmp_path / "c", change))


def test_forces_that_no_number_can_square(run: Run, measured: Path) -> None:
    lines = measured.read_text(encoding="utf-8").splitlines()
    lines[9] = "8,40,1e308,1"
    measured.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "row 10, column 'force': force is 1e+308 N" in refused(run, "inspect", measured)


def table(name: str) -> str:
    """Table of a parameter in the priors that ship, up to the next."""
    begin = SHIPPED.index(name)
    end = SHIPPED.index("\n[", begin + 1)
    return SHIPPED[begin:end]


B2 = '[both.B2]\nfamily = "{}"\n{}\nunit = "1/degC"'
PRIORS = {
    "sd = 1e300": ("[both.B2]", B2.format("normal", "mean = 0.3\nsd = 1e300"), "a number up to 1e+50"),
    "beta(0.001, 0.001)": (
        "[both.B2]", B2.format("beta", "a = 0.001\nb = 0.001\nlow = 0.0\nhigh = 3.0"), "at an end of its range",
    ),
    "degrees of freedom near 0": ("[both.B2]", B2.format("student_t", "df = 1e-5\nmean = 1\nscale = 1"), "df = 1e-05"),
    "a power of powers": (
        "[both.B2]", B2.format("normal", "mean = 1\nsd = 1").replace("1/degC", "9**9**9**9/degC"), "exponents",
    ),
    "nested": ("[both.B2]", f"[both.B2]\nfamily = {'[' * 5000}{']' * 5000}", "too deep inside each other"),
    "a fixed sd of 0": ("[[noise.sd]]", '[[noise.sd]]\nfixed = 0.0\nunit = "N"', "fixed at 0"),
}  # fmt: skip


@pytest.mark.parametrize("what", PRIORS)
def test_priors(run: Run, measured: Path, tmp_path: Path, what: str) -> None:
    name, new, told = PRIORS[what]
    text = SHIPPED.replace(table(name), new)
    if what.startswith("a fixed"):
        text = SHIPPED[: SHIPPED.index(name)] + new + "\n" + SHIPPED[SHIPPED.index("\n[[noise.phi]]") :]
    (tmp_path / "p.toml").write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    message = refused(
        run, "fit", measured, "--out", out, "--priors", tmp_path / "p.toml", "--noise", "ar1", "--jobs", 1
    )
    assert told in message
    assert not out.exists()


def test_a_prior_a_million_degrees_away_is_fitted_and_shown(run: Run, measured: Path, tmp_path: Path) -> None:
    """Beside a reading a thousand times too large the curve is level, and has no correlation factor to show.

    Under normal noise: heavy tails leave the reading out, and a discrepancy takes the place of the curve.
    """
    far = '[both.B3]\nfamily = "normal"\nmean = 1e6\nsd = 1.0\nunit = "degC"'
    (tmp_path / "p.toml").write_text(SHIPPED.replace(table("[both.B3]"), far), encoding="utf-8")
    lines = measured.read_text(encoding="utf-8").splitlines()
    cells = lines[14].split(",")
    cells[2] = str(1000.0 * float(cells[2]))
    measured.write_text("\n".join([*lines[:14], ",".join(cells), *lines[15:]]) + "\n", encoding="utf-8")
    options = ("--priors", tmp_path / "p.toml", "--noise", "independent", "--no-figures")
    outcome = run("fit", measured, "--out", tmp_path / "o", *options)
    assert outcome.status in (0, 1), outcome.err
    assert "force -" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("fit", "{data}", "--out", "{out}", "--seed", str(2**64)), "--seed"),
        (("fit", "{data}", "--out", "{out}", "--extrapolate", "1e300"), "at most 1e+06"),
        (("fit", "{data}", "--out", "a" * 5000), "File name too long"),
        (("fit", "{data}", "--out", "{out}", "--priors", "a" * 5000 + ".toml"), "File name too long"),
        (("inspect", "a" * 5000), "File name too long"),
        (("ask", "a" * 5000, "--force", "1 N"), "File name too long"),
        (("report", "a" * 5000), "File name too long"),
        (("run", "a" * 5000 + ".toml"), "File name too long"),
        (("conditions", "{out}", "--out", "{out}", "--scatter", "1e300"), "at most 100"),
    ],
)
def test_a_call(run: Run, measured: Path, tmp_path: Path, arguments: tuple[str, ...], told: str) -> None:
    given = [a.format(data=measured, out=tmp_path / "out") for a in arguments]
    assert told in refused(run, *given)
    assert not (tmp_path / "out").exists()


def limited(*arguments: object) -> tuple[int, str, float]:
    """Status, standard error and memory [MB] of a call in a process of its own.

    The kernel's account of its memory, not that of `resource`, which begins with the memory of the process that started
    it: the tests that ran before would be counted.
    """
    program = (
        "import sys\nfrom pathlib import Path\nfrom sma_bayes import cli\n"
        "sys.argv = ['sma-bayes', *sys.argv[1:]]\nstatus = 0\n"
        "try:\n    cli.main()\nexcept SystemExit as end:\n    status = end.code or 0\n"
        "lines = Path('/proc/self/status').read_text().splitlines()\n"
        "print(next(x.split()[1] for x in lines if x.startswith('VmHWM')))\nsys.exit(status)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True, text=True, timeout=240, check=False, cwd=ROOT,
    )  # fmt: skip
    return done.returncode, done.stderr, float(done.stdout.split()[-1]) / 1e3


def workbook(path: Path, lines: list[str], *, cell: str = "", more: bytes = b"", times: int = 0) -> Path:
    """An Excel workbook, with one more cell, or more rows written straight into its sheet."""
    book = openpyxl.Workbook()
    for line in lines:
        book.active.append([float(v) if v[0].isdigit() else v for v in line.split(",")])
    if cell:
        book.active[cell] = 1.0
    book.save(path)
    if not times:
        return path
    with (
        zipfile.ZipFile(path) as old,
        zipfile.ZipFile(path.with_suffix(".more"), "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for part in old.infolist():
            with new.open(part.filename, "w", force_zip64=True) as file:
                head, mark, tail = old.read(part).partition(b"</sheetData>")
                file.write(head)
                if mark:
                    for _ in range(times):
                        file.write(more * 100_000)
                file.write(mark + tail)
    path.with_suffix(".more").replace(path)
    return path


@pytest.mark.skipif(sys.platform == "win32", reason="no resource limits")
@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"cell": "XFD1048576"}, "a sheet has more than"),
        ({"more": b'<row><c t="n"><v>1.2345678901234</v></c></row>', "times": 80}, "bytes when unpacked"),
        ({"more": b"<row/>", "times": 12}, "a sheet has more than"),
    ],
)
def test_a_workbook(
    make_sweep: Callable[..., list[str]], tmp_path: Path, change: dict[str, object], told: str
) -> None:
    path = workbook(tmp_path / "a.xlsx", make_sweep(), **change)
    status, err, megabytes = limited("inspect", path)
    assert status == 2, err
    assert told in err
    assert megabytes < LARGEST_MB


MATLAB_HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def write_bomb(path: Path) -> None:
    """400 MB of nought, packed into less than half a megabyte."""
    packer = zlib.compressobj()
    begin = struct.pack("<7I", 14, 400_000_000, 6, 8, 6, 0, 5)
    packed = packer.compress(begin) + b"".join(packer.compress(bytes(4_000_000)) for _ in range(100))
    packed += packer.flush()
    path.write_bytes(MATLAB_HEAD + struct.pack("<2I", 15, len(packed)) + packed)


def write_many_numbers(path: Path) -> None:
    """As single bytes, which take eight times as much when they are numbers."""
    scipy.io.savemat(path, {"force": np.zeros(31_000_000, dtype=np.uint8)}, do_compression=True)


def write_many_samples(path: Path) -> None:
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("g", "force_N", np.zeros(31_000_000, dtype=np.uint8))])


@pytest.mark.skipif(sys.platform == "win32", reason="no resource limits")
@pytest.mark.parametrize(
    ("name", "write", "told"),
    [
        ("a.mat", write_bomb, "more than 256000000 bytes when unpacked"),
        ("a.mat", write_many_numbers, "more than 30000000 numbers"),
        ("a.tdms", write_many_samples, "more than 30000000 numbers"),
    ],
)
def test_a_binary_file(tmp_path: Path, name: str, write: Callable[[Path], None], told: str) -> None:
    write(tmp_path / name)
    status, err, megabytes = limited("inspect", tmp_path / name)
    assert status == 2, err
    assert told in err
    assert megabytes < LARGEST_MB


def test_rows_beyond_what_a_workbook_says_of_itself_are_read(
    run: Run, make_sweep: Callable[..., list[str]], tmp_path: Path
) -> None:
    path = workbook(tmp_path / "a.xlsx", make_sweep(40))
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(tmp_path / "b.xlsx", "w") as new:
        for part in old.infolist():
            new.writestr(part, old.read(part).replace(b'ref="A1:D81"', b'ref="A1:D31"'))
    whole, said_less = (sma_bayes.read_campaign(p).records[0] for p in (path, tmp_path / "b.xlsx"))
    assert whole.n == said_less.n


# --- stored results -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(make_campaign: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("hostile")
    campaign = sma_bayes.read_campaign(make_campaign(place / "bench"))
    fit_campaign(campaign, place / "out", noise="independent", jobs=1, figures=False)
    return place / "out"


@pytest.fixture
def folder(finished: Path, tmp_path: Path) -> Path:
    shutil.copytree(finished.parent / "bench", tmp_path / "bench")
    return Path(shutil.copytree(finished, tmp_path / "copy"))


def read_by_all(run: Callable[..., object], folder: Path, told: str) -> None:
    for call in (
        ("ask", folder, "--force", "1.5 N"),
        ("report", folder, "--jobs", 1),
        ("conditions", folder, "--out", folder / "conditions"),
        ("plan", folder, "--for", "force@50degC", "--out", folder / "new"),
        ("card", folder, "--out", folder / "new"),
        ("watch", folder, folder.parent / "bench" / "a.csv", "--out", folder / "new"),
    ):
        assert told in refused(run, *call)
        assert not (folder / "new").exists()
    assert not (folder / "report.html").exists()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"schema": "sma-bayes/fit/1", "records": [{}]}', "does not have the checksum"),
        ("[" * 100_000 + "]" * 100_000, "too deep inside each other"),
        ('{"schema": ' + "9" * 5000 + "}", "can't be read"),
    ],
)
def test_a_summary_that_none_wrote(run: Run, folder: Path, text: str, told: str) -> None:
    (folder / "summary.json").write_text(text, encoding="utf-8")
    read_by_all(run, folder, told)


def test_a_summary_that_was_changed(run: Run, folder: Path) -> None:
    path = folder / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["records"][0]["converged"] = False
    path.write_text(json.dumps(summary), encoding="utf-8")
    read_by_all(run, folder, "does not have the checksum")


def test_the_posterior_of_another_branch(run: Run, folder: Path) -> None:
    shutil.copy(folder / "posterior" / "a-cooling.nc", folder / "posterior" / "a-heating.nc")
    read_by_all(run, folder, "is not the posterior that summary.json tells of")


def test_the_band_of_another_branch(run: Run, folder: Path) -> None:
    shutil.copy(folder / "bands" / "a-cooling-force.csv", folder / "bands" / "a-heating-force.csv")
    for call in (("report", folder, "--jobs", 1), ("diff", folder, folder)):
        assert "is not the band that summary.json tells of" in refused(run, *call)


def test_the_posterior_of_another_run(
    run: Run, folder: Path, make_campaign: Callable[..., Path], tmp_path: Path
) -> None:
    campaign = sma_bayes.read_campaign(make_campaign(tmp_path / "other"))
    fit_campaign(campaign, tmp_path / "o", seed=1, noise="independent", jobs=1, figures=False)
    shutil.copy(tmp_path / "o" / "posterior" / "a-heating.nc", folder / "posterior")
    read_by_all(run, folder, "is not the posterior that summary.json tells of")


def test_draws_that_are_no_numbers(run: Run, folder: Path) -> None:
    path = folder / "posterior" / "a-heating.nc"
    with h5py.File(path, "r+") as file:
        file["posterior"]["B1"][0, 0] = np.nan
    read_by_all(run, folder, "or was changed since")
    with pytest.raises(sma_bayes.SmaBayesError, match="checksum"):
        sma_bayes.open_posterior(path)


@pytest.mark.parametrize("seed", range(20))
def test_flipped_bits(run: Run, folder: Path, seed: int) -> None:
    """Of a posterior, 10 bits at random: what is read is what was written, or refused."""
    path = folder / "posterior" / "a-heating.nc"
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    for place in rng.integers(len(content), size=10):
        content[place] ^= 1 << int(rng.integers(8))
    before = run("ask", folder, "--force", "1.5 N", "--json").out
    path.write_bytes(bytes(content))
    after = run("ask", folder, "--force", "1.5 N", "--json")
    assert after.status == 2 or after.out == before


@pytest.mark.parametrize(
    "question",
    [
        ("--force", "9**9**9**9 N"),
        ("--force", "1e308 N"),
        ("--force", "1" * 5000 + " N"),
        ("--force", "1 N", "--tolerance", "9**9**9**9 N"),
        ("--force", "1 N", "--temperature-unit", "9**9**9**9"),
        ("--force", "1 N", "--extrapolate", "1e300"),
        ("--force", "1 N", "--temperature-sd", "1e300"),
        ("--force", "1 N", "--condition", "a" * 5000),
        ("--at", "50 degC", "--unit", "9**9**9**9 N"),
        ("--at", "50 degC", "--unit", "(" * 5000 + "N" + ")" * 5000),
        ("--at", "50 degC", "--unit", "1e308 N"),
        ("--at", "50 degC", "--unit", "\x1b[31m N"),
        ("--at", "-300 degC"),
        ("--at", "-1 kelvin"),
        ("--at", "1e40 degC"),
    ],
)
def test_a_question(run: Run, finished: Path, question: tuple[str, ...]) -> None:
    refused(run, "ask", finished, *question)


FORTY = [f'"{i} degC"' for i in range(40)]
CANDIDATES = {
    "nested": f"[[candidate]]\npeak = {'[' * 1000}{']' * 1000}",
    "a null character": '[[candidate]]\npeak = "\\u0000"',
    "5,000 digits": f"[[candidate]]\nsamples = {'9' * 5000}",
    "a power of powers": '[[candidate]]\npeak = "60 9**9**9**9"',
    "a rate of powers": '[[candidate]]\nrate = "2 9**9**9**9/min"',
    "a rate without end": '[[candidate]]\nrate = "1e400 K/min"',
    "colder than nothing": '[[candidate]]\nlowest = "-375 degC"\npeak = "60 degC"',
    "a billion cycles": "[[candidate]]\ncycles = 1000000000",
    "100 million combinations": f"[[candidate]]\nlowest = [{', '.join(FORTY)}]\npeak = [{', '.join(FORTY * 40)}]\n"
    f"cycles = {list(range(1, 41))}\nsamples = {list(range(2, 42))}",
    "an emoji": f'[[candidate]]\ncondition = "{"😀" * 60}"',
    "no text": "\ud800",
    "nothing": "",
}


@pytest.mark.parametrize("what", CANDIDATES)
def test_candidates_of_a_plan(run: Run, finished: Path, tmp_path: Path, what: str) -> None:
    path, out = tmp_path / "candidates.toml", tmp_path / "out"
    path.write_bytes(CANDIDATES[what].encode(errors="surrogatepass"))
    told = refused(run, "plan", finished, "--for", "force@50degC", "--candidates", path, "--out", out)
    assert "candidates.toml" in told
    assert not out.exists()


@pytest.mark.parametrize(
    "call",
    [
        ("plan", "{fit}", "--for", "force@9**9**9degC"),
        ("plan", "{fit}", "--for", "force@-375degC"),
        ("plan", "{fit}", "--for", "force@" + "5" * 5000 + "degC"),
        ("plan", "{fit}", "--for", "😀@50degC"),
        ("plan", "{fit}", "--for", "force@50degC", "--rate", "9**9**9**9 K/min"),
        ("plan", "{fit}", "--for", "force@50degC", "--rate", "0 K/min"),
        ("plan", "{fit}", "--for", "force@50degC", "--hours", "nan"),
        ("plan", "{fit}", "--for", "force@50degC", "--hours", "-1"),
        ("plan", "{fit}", "--for", "force@50degC", "--condition", "😀" * 60),
        ("watch", "{fit}", "{fit}/summary.json"),
        ("watch", "{fit}", "{data}", "--condition", "😀" * 60),
        ("watch", "{fit}", "{data}", "--alpha", "nan"),
        ("watch", "{fit}", "{data}", "--limit", "9**9**9**9 N"),
        ("card", "{data}"),
        ("modulus", "{data}", "--frequency", "9**9**9**9 Hz"),
        ("modulus", "{data}", "--frequency", "1e400 Hz"),
        ("modulus", "{fit}/summary.json", "--frequency", "1 Hz"),
    ],
)
def test_a_call_of_the_newest_verbs(
    run: Run, finished: Path, measured: Path, tmp_path: Path, call: tuple[str, ...]
) -> None:
    out = tmp_path / "out"
    refused(run, *(a.format(fit=finished, data=measured) for a in call), "--out", out)
    assert not out.exists()


# --- the table ----------------------------------------------------------------------------------------


def rows_of(section: str) -> list[str]:
    """Rows of the table in a section of the page of limits, without its head."""
    page = (ROOT / "docs" / "reference" / "limits.md").read_text(encoding="utf-8")
    (text,) = [part for part in page.split("\n## ") if part.startswith(section)]
    return [line for line in text.splitlines() if line.startswith("|")][2:]


def test_every_limit_is_documented() -> None:
    assert rows_of("# Limits") == [f"| {limit.of} | {limit.value:,.15g} |" for limit in LIMITS]


def test_every_range_that_is_believed_is_documented_with_its_source() -> None:
    assert rows_of("What is believed without a word") == [
        f"| {name} | {r.low:g} | {r.high:g} | {r.unit} | {r.source} |" for name, r in RANGES.items()
    ]


@pytest.fixture
def no_entry(measured: Path, tmp_path: Path) -> Iterator[Path]:
    """A folder with a measurement that `nobody` may not enter, nor the user who runs this, unless that is root."""
    secret = tmp_path / "secret"
    secret.mkdir()
    shutil.copy(measured, secret / "run.csv")
    secret.chmod(0)
    if os.geteuid() == 0:
        for path in (tmp_path, *tmp_path.parents):
            if path.stat().st_uid == 0 and path != Path("/"):
                path.chmod(path.stat().st_mode | 0o055)
    else:
        tmp_path.chmod(0o555)
    yield secret
    tmp_path.chmod(0o755)
    secret.chmod(0o755)


AS_NOBODY = """\
import contextlib, importlib, io, json, os, pkgutil, sys
import email.parser  # which importlib.metadata loads when it is first asked for a version
import sma_bayes
from sma_bayes import cli

for module in pkgutil.walk_packages(sma_bayes.__path__, "sma_bayes."):
    if module.name != "sma_bayes.__main__":
        importlib.import_module(module.name)  # Python itself may lie where only root reads
calls = json.loads(sys.argv[2])
sys.argv = ["sma-bayes", "inspect", sys.argv[1]]
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    cli.main()
if os.geteuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
told = []
for call in calls:
    sys.argv = ["sma-bayes", *call]
    out, err, status = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            cli.main()
        except SystemExit as end:
            status = end.code or 0
    told.append([status, out.getvalue(), err.getvalue()])
print(json.dumps(told))
"""


@pytest.mark.skipif(not hasattr(os, "setuid"), reason="no users")
def test_what_a_user_may_not_read_or_write_is_named(measured: Path, tmp_path: Path, no_entry: Path) -> None:
    """All in one process, which gives up its rights once: to load the package takes longer than all calls."""
    secret = no_entry
    calls = [
        ("inspect", secret / "run.csv"),
        ("inspect", secret),
        ("fit", measured, "--out", secret / "out"),
        ("fit", measured, "--out", tmp_path / "out"),
        ("ask", secret, "--force", "1 N"),
        ("report", secret),
        ("run", secret / "study.toml"),
        ("fit", measured, "--out", tmp_path / "out", "--priors", secret / "p.toml"),
        ("plan", secret, "--for", "force@50degC", "--out", tmp_path / "out"),
        ("card", secret, "--out", tmp_path / "out"),
        ("watch", secret, measured, "--out", tmp_path / "out"),
        ("modulus", secret / "run.csv", "--out", tmp_path / "out"),
    ]
    given = json.dumps([[str(a) for a in call] for call in calls])
    done = subprocess.run(
        [sys.executable, "-c", AS_NOBODY, str(measured), given],
        capture_output=True, text=True, timeout=240, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    for call, (status, out, err) in zip(calls, json.loads(done.stdout), strict=True):
        assert (status, out) == (2, ""), (call, err)
        assert "Permission denied" in err or "is not readable" in err, (call, err)
        assert err.lower().count("error: ") == 1, (call, err)
