"""Every reader, given files that were changed at random: a result, or one of our errors; never another.

Each example starts from one of the files of the corpus: good ones that are made here, and those in `corpus/` that
once failed. ``SMA_BAYES_FUZZ_S`` says for how many seconds each reader is tried, by default 3; a night takes ten
minutes each, and another ``SMA_BAYES_FUZZ_SEED``, which decides the changes.
"""

from __future__ import annotations

import json
import os
import random
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

from sma_bayes.checksum import file_checksum
from sma_bayes.errors import SmaBayesError
from sma_bayes.parameters.priors_file import parse_priors, read_priors
from sma_bayes.quantities import convert, number_and_unit
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.dmta import read_dmta
from sma_bayes.runs.documents import FIT, read_mark, sealed
from sma_bayes.runs.netcdf import Variable, VariableGroup, axes, write_groups
from sma_bayes.runs.outputs import posterior_of, posterior_path, read_columns
from sma_bayes.studies.ask.workflow import asked_temperature
from sma_bayes.studies.condition_text import condition_at
from sma_bayes.studies.conditions.population import PRIOR_MEDIAN_SCATTER
from sma_bayes.studies.plan.asked import parse_asked
from sma_bayes.studies.plan.candidates import Setting, declared
from sma_bayes.studies.run.study_file import read_study
from sma_bayes.studies.watch.state import STATE, empty, read_state

SECONDS = float(os.environ.get("SMA_BAYES_FUZZ_S", "3"))
CORPUS = Path(__file__).parent / "corpus"
SEED = int(os.environ.get("SMA_BAYES_FUZZ_SEED", "20"))
TOKENS = (
    b"", b"0", b"-1", b"1e308", b"1e-320", b"nan", b"inf", b"9" * 40, b"9" * 5000, b"\0", b"\xff\xfe", b"\xef\xbb\xbf",
    b"\n", b"\r", b'"', b"'", b",", b";", b"\t", b"=", b"[", b"]", b"{", b"}", b"[" * 200, b"{a=" * 200, b"." * 50,
    b"a." * 200, b"**9**9", b"degC", b"kelvin", b"arbitrary", b"true", "\u2028".encode(), "😀".encode() * 60, b"../../",
    b"\\u0000", b"#", b"PK\x03\x04",
)  # fmt: skip
CAMPAIGN = """\
[campaign]
name = "bench"
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_C", unit = "degC", sd = 0.1, valid = [-50.0, 200.0] }
force = { column = 3, unit = "V", scale = 12.5, offset = 0.3, to = "N", scale_sd = 0.02 }
displacement = { name = "displacement_mm", unit = "mm", missing = [-999.0, "ERR"] }
[reading]
skip_rows = 0
[segmentation]
time_from = 1.0
[[condition]]
id = "a"
file = "a.csv"
current_A = 2.0
load_g = 150
duty_cycle_pct = 50
"""
STUDY = """\
[study]
campaign = "campaign.toml"
out = "out"
seed = 3
[fit]
noise = "ar1"
extrapolate = 5.0
[conditions]
at = ["current_A=2.2,load_g=150"]
[[ask]]
force = "2.5 N"
tolerance = "5 %"
"""


def table() -> list[list[float]]:
    rng = np.random.default_rng(0)
    up = np.linspace(30.0, 70.0, 30)
    t = np.concatenate([up, up[::-1]])
    force = 0.5 + 2.5 / (1.0 + np.exp(-0.35 * (t - 52.0))) + 0.02 * rng.standard_normal(t.size)
    stroke = 1.0 + 20.0 / (1.0 + np.exp(-0.30 * (t - 48.0))) + 0.1 * rng.standard_normal(t.size)
    return np.column_stack([np.arange(t.size), t, force, stroke]).round(4).tolist()


HEADER = ["time_s", "temperature_C", "force_N", "displacement_mm"]


def csv_file(path: Path) -> None:
    rows = [",".join(HEADER), *(",".join(map(str, row)) for row in table())]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def lvm_file(path: Path) -> None:
    mark = "***End_of_Header***\n"
    head = f"LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n{mark}Channels\t3\n{mark}"
    rows = "\n".join("\t".join(map(str, row)) for row in table())
    path.write_text(head + "\t".join(["X_Value", *HEADER[1:]]) + "\n" + rows + "\n", encoding="utf-8")


def xlsx_file(path: Path) -> None:
    book = openpyxl.Workbook()
    for row in [HEADER, *table()]:
        book.active.append(row)
    book.save(path)


def mat_file(path: Path) -> None:
    scipy.io.savemat(path, dict(zip(HEADER, np.array(table()).T, strict=True)), do_compression=True)


def tdms_file(path: Path) -> None:
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("g", name, column)
                for name, column in zip(HEADER, np.array(table()).T, strict=True)
            ]
        )


def posterior_file(path: Path) -> None:
    chains = axes(chain=np.arange(2), draw=np.arange(5))
    draws = VariableGroup({"B3": Variable(("chain", "draw"), np.ones((2, 5)))}, chains)
    obs = {"obs": Variable(("obs",), np.arange(3))}
    constant = VariableGroup(
        {k: Variable(("obs",), np.arange(3.0)) for k in ("temperature", "row", "segment")}, obs
    )
    curves = VariableGroup(
        {"force": Variable(("chain", "draw", "temperature"), np.ones((1, 5, 3)))},
        axes(chain=[0], draw=np.arange(5), temperature=np.arange(3.0)),
    )
    root = VariableGroup(
        attributes={"model": "modified_sigmoid", "noise": "ar1", "condition": "c", "branch": "heating"}
    )
    write_groups(
        path,
        {
            "/": root, "posterior": draws, "sample_stats": draws, "constant_data": constant,
            "observed_data": VariableGroup({"force": Variable(("obs",), np.ones(3))}, obs), "prior_predictive": curves,
        },
    )  # fmt: skip


def one_campaign(folder: Path, content: bytes) -> None:
    csv_file(folder / "a.csv")
    (folder / "campaign.toml").write_bytes(content)
    read_campaign(folder)


def data_file(name: str) -> Callable[[Path, bytes], None]:
    def read(folder: Path, content: bytes) -> None:
        (folder / name).write_bytes(content)
        read_campaign(folder / name)

    return read


def dmta_file(path: Path) -> None:
    """Two steps, the second with a row of units and two frequencies in turn."""
    lines = ["Filename\ta.tri", "[step]", "Details", "[step]", "Ramp"]
    lines += ["Temperature\tStorage modulus\tTan(delta)\tFrequency", "°C\tMPa\t\tHz"]
    for t in [*range(0, 100, 5), *range(100, 0, -5)]:
        lines += [f"{t}\t{30e3 + 200 * t}\t0.02\t{f}" for f in (1, 10)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def dmta(folder: Path, content: bytes) -> None:
    (folder / "dmta.txt").write_bytes(content)
    read_dmta([folder / "dmta.txt"])


def study(folder: Path, content: bytes) -> None:
    (folder / "study.toml").write_bytes(content)
    read_study(folder / "study.toml")


def document(folder: Path, content: bytes) -> None:
    (folder / "summary.json").write_bytes(content)
    (folder / "run.json").write_bytes(content)
    read_mark(folder)
    FIT.read(folder)


MEASURED = Setting("a", 30.0, 70.0, 0.03, 40, 1.5, "degC", specimen=False)
CANDIDATES = """\
[[candidate]]
name = "slow"
condition = ["a"]
lowest = "30 degC"
peak = ["60 degC", "350 kelvin"]
rate = ["2 K/min", "0.5 K/s"]
load = "150 g"
cycles = [1, 3]
samples = 80
setup = "20 min"
"""
NO_CYCLE = json.dumps(sealed(empty(("a-heating",)).model_dump(mode="json", by_alias=True)))
STATED: dict[str, str] = {}
"""Checksum that the summary of a run states, of the posterior that was read first."""


def watch_state(folder: Path, content: bytes) -> None:
    (folder / STATE.file).write_bytes(content)
    read_state(folder, ("a-heating",))


def candidates(folder: Path, content: bytes) -> None:
    (folder / "candidates.toml").write_bytes(content)
    declared(folder / "candidates.toml", {"a": MEASURED}, ["a"], 0.5, None)


def asked(folder: Path, content: bytes) -> None:
    found = parse_asked(content.decode(errors="replace"))
    asked_temperature(found.temperature, "degC", "degC")


def posterior(folder: Path, content: bytes) -> None:
    path = posterior_path(folder, "c-heating")
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    posterior_of(folder, "c-heating", STATED.setdefault("c-heating", file_checksum(path)))


def columns(folder: Path, content: bytes) -> None:
    (folder / "t.csv").write_bytes(content)
    read_columns(folder / "t.csv", "again")


def unit(folder: Path, content: bytes) -> None:
    convert(1.0, content.decode(errors="replace"), "N")


def value(folder: Path, content: bytes) -> None:
    number_and_unit(content.decode(errors="replace"))


def setting(folder: Path, content: bytes) -> None:
    condition_at(content.decode(errors="replace"), specimen=False)


def priors(folder: Path, content: bytes) -> None:
    parse_priors.__wrapped__(content.decode(errors="replace"), "p.toml")


def made(make: Callable[[Path], None]) -> Callable[[Path], bytes]:
    def content(folder: Path) -> bytes:
        make(folder / "seed")
        written = (folder / "seed").read_bytes()
        (folder / "seed").unlink()
        return written

    return content


def text(of: str) -> Callable[[Path], bytes]:
    return lambda folder: of.encode()


READERS: dict[str, tuple[Callable[[Path, bytes], None], Callable[[Path], bytes]]] = {
    "campaign": (one_campaign, text(CAMPAIGN)),
    "study": (study, text(STUDY)),
    "candidates": (candidates, text(CANDIDATES)),
    "asked": (asked, text("stiffness@60degC")),
    "watch_state": (watch_state, text(NO_CYCLE)),
    "priors": (priors, text(read_priors("modified_sigmoid").text)),
    "csv": (data_file("a.csv"), made(csv_file)),
    "lvm": (data_file("a.lvm"), made(lvm_file)),
    "xlsx": (data_file("a.xlsx"), made(xlsx_file)),
    "mat": (data_file("a.mat"), made(mat_file)),
    "tdms": (data_file("a.tdms"), made(tdms_file)),
    "dmta": (dmta, made(dmta_file)),
    "document": (document, text(json.dumps(sealed({"schema": FIT.schema, "records": [{"key": "a", "n": 1.5}]})))),
    "posterior": (posterior, made(posterior_file)),
    "table": (columns, text("a,b\n1,true\n2.5,\n")),
    "unit": (unit, text("N*m**2/(mm)**2")),
    "value": (value, text("130 N/m")),
    "setting": (setting, text(f"current_A=2.2,load_g={PRIOR_MEDIAN_SCATTER}")),
}  # fmt: skip


def mutated(content: bytes, rng: random.Random) -> bytes:
    """Content with a few changes: bits, cuts, repetitions, and tokens that have hurt readers before."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at = rng.randrange(len(data) + 1)
        length = rng.choice((1, 2, 8, 64, 512))
        kind = rng.randrange(5)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[at : at + length]
        elif kind == 2:
            data[at:at] = data[at : at + length] * rng.choice((1, 2, 20))
        elif kind == 3:
            data[at : at + rng.choice((0, length))] = rng.choice(TOKENS)
        else:
            data[at:at] = bytes(rng.randrange(256) for _ in range(length))
    return bytes(data)


def tried(name: str, folder: Path, content: bytes) -> None:
    """Read a file; what it gives is no matter, but an error must be ours."""
    try:
        READERS[name][0](folder, content)
    except SmaBayesError as error:
        told = str(error)
    else:
        told = "read"
    assert 0 < len(told) < 10_000


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", READERS)
def test_a_file_that_was_changed_at_random(name: str, tmp_path: Path) -> None:
    """Fails with the changed file beside it, to be put into the corpus."""
    rng = random.Random(f"{SEED} {name}")
    good = READERS[name][1](tmp_path)
    READERS[name][0](tmp_path, good)
    end = time.monotonic() + SECONDS
    content = good
    tries = 0
    while time.monotonic() < end or tries < 20:
        content = mutated(good, rng)
        tries += 1
        begun = time.monotonic()
        try:
            tried(name, tmp_path, content)
        except Exception:
            failed = tmp_path / f"{name}-failed"
            failed.write_bytes(content)
            raise
        assert time.monotonic() - begun < 60.0


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", sorted(CORPUS.glob("*-*")), ids=lambda p: p.name)
def test_what_once_failed(path: Path, tmp_path: Path) -> None:
    tried(path.name.partition("-")[0], tmp_path, path.read_bytes())
