"""`sma-bayes card` as a pipeline, a solver and a controller use it."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sma_bayes
from sma_bayes.records.types import Calibration, Campaign


@pytest.fixture(scope="module")
def wire(loaded_fit: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("card") / "wire"
    sma_bayes.card(loaded_fit, out, modulus_martensite="45 GPa", reference_stress="150 MPa", draws=150)
    return out


@pytest.fixture(scope="module")
def spring(heated_fit: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("card") / "spring"
    sma_bayes.card(heated_fit, out, figures=False)
    return out


def read(folder: Path) -> Any:
    return json.loads((folder / "card.json").read_text(encoding="utf-8"))


def test_constants_come_back_from_a_campaign_of_the_law(wire: Path, loaded_wire: Any) -> None:
    card = read(wire)["constitutive"]
    told = {c["name"]: c for c in card["constants"]}
    for name, truth in (("C_A", loaded_wire.c_a), ("C_M", loaded_wire.c_m), ("E_A", loaded_wire.e_a)):
        assert told[name]["identified"], told[name]["why"]
        assert told[name]["value"] == pytest.approx(truth, rel=0.05)
        assert told[name]["q05"] < truth < told[name]["q95"]
    strain = next(c for c in card["at_reference"] if c["name"] == "Hcur")
    assert strain["value"] == pytest.approx(loaded_wire.strain_of_transformation(150.0), rel=0.02)
    assert [round(s) for s in card["stresses"]] == [80, 140, 200]
    assert len(card["sweeps"]) == 6
    for sweep in card["sweeps"]:
        assert sweep["card"] < 0.01
        assert sweep["finished"]


def test_the_card_follows_the_wire_at_a_stress_that_was_not_measured(wire: Path, loaded_wire: Any) -> None:
    ends = json.loads((wire / "sma_react.json").read_text(encoding="utf-8"))["final_solution"]
    for name, key in (("Ms", "M_s"), ("As", "A_s")):
        assert ends[key] == pytest.approx(loaded_wire.zero_stress[name], abs=2.0)
    props = json.loads((wire / "simcoon.json").read_text(encoding="utf-8"))
    law = dict(zip(props["symbols"], props["props"], strict=True))
    other = type(loaded_wire)()
    other.e_a, other.e_m, other.alpha_a, other.alpha_m = (
        law[n] for n in ("E_A", "E_M", "alpha_A", "alpha_M")
    )
    other.h_min, other.h_max, other.k = law["H_min"], law["H_max"], law["k"]
    other.c_a, other.c_m, other.calibration = law["C_A"], law["C_M"], law["sigma_calibration"]
    other.exponents = tuple(law[n] for n in ("n1", "n2", "n3", "n4"))
    other.zero_stress = {
        "Ms": ends["M_s"], "Mf": ends["M_s"] - ends["M_s-M_f"],
        "As": ends["A_s"], "Af": ends["A_s"] + ends["A_f - A_s"],
    }  # fmt: skip
    at = np.linspace(285.0, 385.0, 120)
    for branch in ("heating", "cooling"):
        true, back = (w.strain(at, 170.0, branch) for w in (loaded_wire, other))
        assert np.sqrt(np.mean((true - back) ** 2)) < 0.01 * np.ptp(true)


def test_draws_covariance_and_document_agree(wire: Path, published: Callable[[str], Any]) -> None:
    found = read(wire)
    published("card").validate(found)
    with (wire / "constitutive-draws.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    draws = np.array(rows, dtype=float)
    constants = found["constitutive"]["constants"]
    assert header == [f"{c['name']} [{c['unit']}]" for c in constants]
    assert draws.shape == (150, len(constants))
    for column, c in zip(draws.T, constants, strict=True):
        assert np.std(column) == pytest.approx(c["sd"], rel=1e-5, abs=1e-15)
    with (wire / "constitutive-covariance.csv").open(encoding="utf-8", newline="") as file:
        names, *matrix = csv.reader(file)
    assert names[1:] == [c["name"] for c in constants]
    stated = np.array([row[1:] for row in matrix], dtype=float)
    covariance = np.cov(draws.T)
    # the digits of the draws are those of their sizes, not of a correlation near 0
    sd = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(stated - covariance) <= 1e-6 * np.outer(sd, sd) + 1e-15)
    page = (wire / "report.html").read_text(encoding="utf-8")
    for stem in ("phase-diagram", "transformation-strain", "card-and-data"):
        assert (wire / "figures" / f"{stem}.png").is_file()
    assert "Constitutive card" in page
    assert "no stiffness follows" in page


def test_one_stress_tells_no_slope(loaded_fit: Path, loaded_wire: Any, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    down = np.linspace(390.0, 280.0, 60)
    strain = np.concatenate([
        loaded_wire.strain(down, 140.0, "cooling"), loaded_wire.strain(down[::-1], 140.0, "heating")
    ])  # fmt: skip
    frame = {
        "temperature_K": np.concatenate([down, down[::-1]]),
        "strain_1": strain + 1e-4 * rng.standard_normal(strain.size),
        "stress_MPa": np.full(strain.size, 140.0) + 0.2 * rng.standard_normal(strain.size),
    }
    campaign = sma_bayes.campaign_of({"one": frame}, name="one")
    sma_bayes.fit_campaign(
        campaign, tmp_path / "fit", model="sinh_arcsinh", noise="independent", jobs=1, figures=False
    )
    card = sma_bayes.card(tmp_path / "fit", draws=60)["constitutive"]
    told = {c["name"]: c for c in card["constants"]}
    for name in ("C_A", "C_M", "k", "H_max", "Ms", "Af", "E_A"):
        assert not told[name]["identified"]
        assert (
            "one stress only" in told[name]["why"]
            or "not told" in told[name]["why"]
            or "1 stress" in told[name]["why"]
        )
    assert max(s["card"] for s in card["sweeps"]) < 0.01  # what was measured comes back all the same


def test_an_offset_of_the_thermometer_is_in_all_temperatures_and_in_no_slope(
    loaded_fit: Path, loaded_campaign: Campaign, tmp_path: Path
) -> None:
    """It is one of all runs: drawn for each, it made slopes unsure, and cancelled in the mean over the runs."""
    off = {"temperature": Calibration(0.0, 0.0, 5.0)}
    records = tuple(replace(r, calibration=off) for r in loaded_campaign.records)
    sma_bayes.fit_campaign(
        replace(loaded_campaign, records=records), tmp_path / "fit", model="sinh_arcsinh", noise="independent",
        jobs=1, figures=False,
    )  # fmt: skip
    exact, unsure = (
        {c["name"]: c for c in sma_bayes.card(fit, draws=600)["constitutive"]["constants"]}
        for fit in (loaded_fit, tmp_path / "fit")
    )
    for name in ("C_A", "C_M"):
        assert unsure[name]["sd"] == pytest.approx(exact[name]["sd"], rel=0.2)
    for name in ("Ms", "Af"):
        assert unsure[name]["sd"] == pytest.approx(np.hypot(exact[name]["sd"], 5.0), rel=0.1)


def rows_of(spring: Path) -> Any:
    return json.loads((spring / "stiffness.json").read_text(encoding="utf-8"))["tables"]


def test_tables_hold_the_curve_of_the_fit(spring: Path, heated_fit: Path) -> None:
    tables = rows_of(spring)
    assert [(t["condition"], t["branch"]) for t in tables] == [
        (c, b) for c in ("1.0A", "1.2A") for b in ("heating", "cooling")
    ]
    draws = {d.key: d for d in sma_bayes.stored_draws(heated_fit)}
    with (spring / "stiffness.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    for t in tables:
        own = draws[f"{t['condition']}-{t['branch']}"]
        assert t["temperature"][0] == own.coldest
        assert t["temperature"][-1] == pytest.approx(own.hottest)
        middle = 0.5 * (np.array(t["temperature"][1:]) + t["temperature"][:-1])
        curve = np.quantile(own.curve("stiffness", middle), (0.05, 0.5, 0.95), axis=0)
        for name, exact in zip(("q05", "median", "q95"), curve, strict=True):
            read_back = np.interp(middle, t["temperature"], t[name])
            assert np.abs(read_back - exact).max() <= 1.02 * t["interpolation_error"] + 1e-12
        csv_rows = [r for r in lines if (r["condition"], r["branch"]) == (t["condition"], t["branch"])]
        assert [float(r["stiffness_median"]) for r in csv_rows] == pytest.approx(t["median"], rel=1e-8)


PROGRAM = r"""
#include <stdio.h>
#include <stdlib.h>
#include "stiffness.h"

int main(int argc, char **argv)
{
    int i;
    for (i = 1; i + 1 < argc; i += 2) {
        sma_stiffness_value v = {0.0f, 0.0f, 0.0f};
        const sma_stiffness_table *t = &sma_stiffness_tables[atoi(argv[i])];
        int status = sma_stiffness_at(t, (float)atof(argv[i + 1]), &v);
        printf("%s %s %d %.9g %.9g %.9g\n", t->condition, t->branch, status, (double)v.q05, (double)v.median,
               (double)v.q95);
    }
    return SMA_STIFFNESS_TABLES;
}
"""


def test_the_header_compiles_and_a_program_reads_the_same(spring: Path, tmp_path: Path) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: the header can't be tried")
    (tmp_path / "main.c").write_text(PROGRAM, encoding="utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", f"-I{spring}"]
    subprocess.run([compiler, *flags, "main.c", "-o", "main"], cwd=tmp_path, check=True)
    tables, asked = rows_of(spring), []
    for number, t in enumerate(tables):
        first, last = t["temperature"][0], t["temperature"][-1]
        asked += [(number, float(at)) for at in np.linspace(first + 1e-3, last - 1e-3, 11)]
        asked += [(number, first - 5.0), (number, last + 5.0), (number, float("nan"))]
    words = [str(word) for pair in asked for word in pair]
    done = subprocess.run([str(tmp_path / "main"), *words], capture_output=True, text=True, check=False)
    assert done.returncode == len(tables)
    lines = done.stdout.splitlines()
    assert len(lines) == len(asked)
    for (number, at), line in zip(asked, lines, strict=True):
        t = tables[number]
        condition, branch, status, *values = line.split()
        assert (condition, branch) == (t["condition"], t["branch"])
        inside = t["temperature"][0] <= at <= t["temperature"][-1]
        wanted = 2 if at != at else 0 if inside else -1 if at < t["temperature"][0] else 1
        assert int(status) == wanted
        if wanted != 2:
            for name, value in zip(("q05", "median", "q95"), values, strict=True):
                exact = np.interp(at, t["temperature"], t[name])
                assert float(value) == pytest.approx(exact, rel=1e-4)


def test_the_header_says_what_it_holds_and_asks_for_no_memory(spring: Path) -> None:
    text = (spring / "stiffness.h").read_text(encoding="utf-8")
    assert text.isascii()
    assert "linearly interpolated" in text
    assert not {"malloc", "calloc", "#include"} & set(text.replace("(", " ").split())


def test_people_get_tables_and_reasons(run: Callable[..., Any], loaded_fit: Path, heated_fit: Path) -> None:
    outcome = run("card", loaded_fit, "--draws", "60")
    assert outcome.status == 0
    assert "C_M" in outcome.out
    assert "E_M: at constant stress" in outcome.out
    outcome = run("card", heated_fit)
    assert outcome.status == 0
    assert "no constitutive card: the force was not constant" in outcome.out
    assert run("card", heated_fit, "--quiet").out == ""


def test_the_same_seed_gives_the_same_and_a_finished_card_is_read(
    run: Callable[..., Any], spring: Path, heated_fit: Path
) -> None:
    outcome = run("card", heated_fit, "--out", spring, "--no-figures", "--resume", "--json")
    assert json.loads(outcome.out) == read(spring)
    assert run("card", heated_fit, "--out", spring, "--points", "33", "--resume").status == 2
    again = sma_bayes.card(heated_fit)
    assert again["stiffness"] == read(spring)["stiffness"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--points", "3"), "--points 3"),
        (("--draws", "3"), "--draws 3"),
        (("--area", "1"), "has no unit"),
        (("--area", "1 N"), "area"),
        (("--length", "-5 mm"), "positive"),
        (("--modulus-austenite", "70"), "has no unit"),
        (("--reference-stress", "0 MPa"), "positive"),
        (("--figures", "some"), "no choice of figures"),
    ],
)
def test_bad_calls_end_with_2_and_write_nothing(
    run: Callable[..., Any], heated_fit: Path, tmp_path: Path, arguments: tuple[str, ...], told: str
) -> None:
    out = tmp_path / "out"
    outcome = run("card", heated_fit, "--out", out, *arguments)
    assert outcome.status == 2
    assert told in outcome.err
    assert not out.exists()


def test_folders_without_a_fit_are_refused(run: Callable[..., Any], spring: Path, tmp_path: Path) -> None:
    assert "holds no run" in run("card", tmp_path).err
    assert "holds a card, no fit" in run("card", spring).err
