"""A bench that declares g, mm, mN and °F: people read these units, programs canonical ones."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest

CAMPAIGN = """\
[campaign]
name = "bench"
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_F", unit = "degF" }
force = { name = "force_mN", unit = "mN" }
displacement = { name = "displacement_mm", unit = "mm" }
"""
LOADS = (100, 150, 200)
UREG = pint.UnitRegistry()


def write_bench(folder: Path, loads: tuple[int, ...] = LOADS, cycles: int = 1, n: int = 40) -> Path:
    """A campaign folder of a spring that is heated and cooled under weights."""
    folder.mkdir()
    text = CAMPAIGN
    for i, load in enumerate(loads):
        rng = np.random.default_rng(i)
        up = np.linspace(30.0, 75.0, n)
        t = np.tile(np.concatenate([up, up[::-1]]), cycles)
        hot = np.tile(np.repeat([0.0, 4.0], n), cycles)
        share = 1.0 / (1.0 + np.exp(-0.35 * (t - 47.0 - 0.04 * load + hot)))
        force = 500.0 + 2500.0 * share + 20.0 * rng.standard_normal(t.size)
        stroke = 1.0 + 20.0 * share + 0.1 * rng.standard_normal(t.size)
        samples = zip(32.0 + 1.8 * t, force, stroke, strict=True)
        rows = [",".join(f"{v:.6g}" for v in (j, *sample)) for j, sample in enumerate(samples)]
        lines = ["time_s,temperature_F,force_mN,displacement_mm", *rows]
        (folder / f"{load}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        text += f'[[condition]]\nid = "w{load}"\nfile = "{load}.csv"\nload_g = {load}\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The measurements."""
    return write_bench(tmp_path_factory.mktemp("declared") / "bench")


@pytest.fixture(scope="module")
def fitted(bench: Path) -> Path:
    """A finished fit of them."""
    from sma_bayes import fit_campaign, read_campaign

    out = bench.parent / "fit"
    fit_campaign(read_campaign(bench), out, noise="independent", jobs=1, figures="none")
    return out


def table(folder: Path, name: str) -> list[dict[str, str]]:
    """Rows of one of the tables."""
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def first_row(path: Path) -> dict[str, str]:
    """First row of a series."""
    with path.open(encoding="utf-8") as file:
        return next(iter(csv.DictReader(file)))


def in_unit(value: float, unit: str, to: str, *, difference: bool = False) -> float:
    """A number in another unit, by pint."""
    if difference:
        unit, to = (re.sub(r"\bdeg", "delta_deg", text) for text in (unit, to))
    return float(UREG.Quantity(value, unit).to(to).magnitude)


def text_of(page: Path) -> str:
    """Words of a page."""
    whole = re.sub(r"(?s)<(style|script).*?</\1>", "", page.read_text(encoding="utf-8"))
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", whole))


def assert_declared(text: str) -> None:
    """No canonical unit stands in what people read."""
    assert "°C" not in text
    assert not re.search(r"[\d\]] (N|m|Pa|N/m)\b", text)


@pytest.fixture(scope="module")
def conditions(fitted: Path) -> tuple[Path, dict[str, Any]]:
    """A study of the conditions."""
    from sma_bayes import study_conditions

    out = fitted.parent / "conditions"
    return out, study_conditions(fitted, out, at=["load_g=125"], leave_out=["w150"], jobs=1)


def test_conditions_are_told_in_declared_units(conditions: tuple[Path, dict[str, Any]]) -> None:
    from sma_bayes.studies.conditions.terminal import conditions_text

    out, found = conditions
    assert found["groups"][0]["varied"]["load"]["unit"] == "N"
    assert found["declared_units"] == {
        "force": "mN", "displacement": "mm", "stiffness": "mN/mm", "temperature": "degF", "load": "g"
    }  # fmt: skip
    text = conditions_text(found)
    assert "load 100 g to 200 g" in text
    assert_declared(text)
    assert_declared(text_of(out / "report.html"))
    shown = {(r["condition"], r["branch"], r["feature"], r["channel"]): r for r in table(out, "features")}
    compared = 0
    for f in found["features"]:
        units = {"degC": ("degF", "°F"), "N/m": ("mN/mm", "mN/mm")}.get(f["unit"])
        names = {"peak_temperature": "peak temperature", "least_stiffness": "least stiffness",
                 "hysteresis_width": "hysteresis width", "midpoint": "midpoint"}  # fmt: skip
        if units is None or f["name"] not in names:
            continue
        row = shown[f["condition"], f["branch"], names[f["name"]], f["channel"]]
        assert row["unit"] == units[1]
        told = float(row["value_median [unit]"])
        difference = f["name"] == "hysteresis_width"
        assert told == pytest.approx(
            in_unit(f["median"], f["unit"], units[0], difference=difference), rel=1e-8
        )
        compared += 1
    assert compared == 3 * (4 + 3 + 1 + 2)  # midpoints, stiffness of both branches and the loop, peak, widths
    assert {r["from"] for r in table(out, "effects")} == {"100 g"}


def test_conditions_are_drawn_in_declared_units(conditions: tuple[Path, dict[str, Any]]) -> None:
    out, found = conditions
    with (out / "held_out" / "w150-heating-displacement.csv").open(encoding="utf-8") as file:
        stored = list(csv.DictReader(file))
    with (out / "figures" / "held-out-w150.csv").open(encoding="utf-8") as file:
        drawn = list(csv.DictReader(file))
    for before, after in zip(stored, drawn, strict=False):
        told = float(after["heating displacement own_median"])
        assert told == pytest.approx(in_unit(float(before["own_median"]), "m", "mm"), rel=1e-8)
        warm = float(after["heating displacement temperature_degF"])
        assert warm == pytest.approx(in_unit(float(before["temperature_degC"]), "degC", "degF"), rel=1e-8)
    wanted = {"feature": "midpoint", "branch": "heating", "channel": "force"}
    (midpoint,) = (e for e in found["effects"] if wanted.items() <= e.items())
    with (out / "figures" / "effects-load.csv").open(encoding="utf-8") as file:
        (row,) = (r for r in csv.DictReader(file) if wanted.items() <= r.items())
    change = in_unit(midpoint["tested"]["median"], "degC", "degF", difference=True)
    assert (row["unit"], float(row["tested_median"])) == ("degF", pytest.approx(change, rel=1e-8))


def test_the_report_of_a_fit_names_the_load_as_it_was_hung(fitted: Path) -> None:
    from sma_bayes.runs.outputs import read_run
    from sma_bayes.studies.fit.report_content import report_content

    summary = json.loads((fitted / "summary.json").read_text(encoding="utf-8"))["records"][0]
    assert summary["settings"]["load"] == pytest.approx(0.980665)
    assert summary["settings_declared_units"] == {"load": "g"}
    assert summary["temperature"]["unit"] == "degC"
    assert summary["temperature"]["declared_unit"] == "degF"
    load = report_content(read_run(fitted)).records[0].settings["load"]
    assert (load.value, load.unit) == (pytest.approx(100.0), "g")


def test_the_first_of_several_units_is_shown_and_told(bench: Path) -> None:
    from sma_bayes import read_campaign
    from sma_bayes.runs.declared_units import declared_parts

    text = (bench / "campaign.toml").read_text(encoding="utf-8")
    other = bench / "mixed.toml"
    other.write_text(text.replace("load_g = 150", "load_N = 1.5"), encoding="utf-8")
    told = declared_parts(read_campaign(other).records)
    other.unlink()
    assert told["declared_units"]["load"] == "g"
    assert told["declared_differently"] == ("load is declared in g and N: shown in g, which is the first",)


def test_a_comparison_is_told_in_declared_units(bench: Path) -> None:
    from sma_bayes import compare, read_campaign

    out = bench.parent / "compared"
    whole = read_campaign(bench)
    found = compare(replace(whole, records=whole.records[:1]), out, noise="independent", jobs=1)
    stored = {(r["quantity"], name): (r, m) for r in found["records"] for name, m in r["models"].items()}
    assert {r["unit"] for r, _ in stored.values()} == {"N", "m"}
    assert_declared(text_of(out / "report.html"))
    compared = 0
    for row in table(out, "models"):
        of = {"force": ("N", "mN"), "displacement": ("m", "mm")}[row["channel"]]
        name = row["model"].replace(", ", "_").replace(" ", "_").replace("A2_=_B2", "tied")
        _, model = stored[row["channel"], name]
        assert row["unit"] == of[1]
        if model["rmse_held_out"] is not None:
            told = float(row["rmse_held_out [unit]"])
            assert told == pytest.approx(in_unit(model["rmse_held_out"], *of), rel=1e-8)
            compared += 1
    assert compared > 4
    before = first_row(out / "curves" / "w100-heating-force.csv")
    drawn = first_row(out / "figures" / "curves-w100-heating-force.csv")
    warm, value = float(before["temperature_degC"]), float(before["logistic_refitted_q50"])
    assert float(drawn["temperature_degF"]) == pytest.approx(in_unit(warm, "degC", "degF"), rel=1e-8)
    assert float(drawn["logistic_refitted_q50"]) == pytest.approx(in_unit(value, "N", "mN"), rel=1e-8)
    (force,) = (g for g in found["overall"] if g["quantity"] == "force")
    average = force["models"]["logistic_refitted"]["correlation_average"]["held_out"][-1]
    wanted = {
        "channel": "force",
        "model": "logistic, refitted",
        "data": "held out",
        "rule": "plain",
        "unit": "mN",
    }
    (row,) = (r for r in table(out, "correlation_average") if wanted.items() <= r.items())
    told = in_unit(average["rmse"]["plain"]["median"], "N", "mN")
    assert float(row["rmse_median [unit]"]) == pytest.approx(told, rel=1e-8)


def test_cycles_are_told_in_declared_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from sma_bayes import cycles, read_campaign
    from sma_bayes.studies.cycles.terminal import show_cycles

    out = tmp_path / "out"
    campaign = read_campaign(write_bench(tmp_path / "bench", (150,), cycles=5))
    found = cycles(campaign, out, at=["126 degF", "180 degF"], ahead=2, jobs=1)
    capsys.readouterr()
    show_cycles(found, out)
    force_alone = {**found, "conditions": [
        {**c, "quantities": [q for q in c["quantities"] if q["channel"] not in ("displacement", "stiffness")]}
        for c in found["conditions"]
    ]}  # fmt: skip
    show_cycles(force_alone, out)
    assert "force at 126 °F" in " ".join(capsys.readouterr().out.split()), "what --at asked for is told"
    show_cycles(found, out)
    for text in (capsys.readouterr().out, text_of(out / "report.html")):
        assert "180 °F is beyond the temperatures of w150-heating, 86 to 167 °F" in text
        assert_declared(text)
        assert " degC" not in text
        assert " K " not in text
    assert found["temperature_unit"] == "degC"
    (one,) = found["conditions"]
    rows = {
        tuple(r[k] for k in ("branch", "channel", "quantity", "at [°F]")): r
        for r in table(out, "quantities")
        if r["cycle"] == "1"
    }
    units = {"N": "mN", "m": "mm", "N/m": "mN/mm", "degC": "degF", "K": "degF", "1": "1"}
    compared = set()
    for q in one["quantities"]:
        at = "" if q["at"] is None else f"{in_unit(q['at'], 'degC', 'degF'):.9g}"
        row, unit = rows[q["branch"], q["channel"], q["name"], at], units[q["unit"]]
        assert row["unit"] == unit.replace("deg", "°")
        if q["median"][0] is not None:
            stored = q["unit"].replace("K", "degC")
            value = in_unit(q["median"][0], stored, unit, difference=q["name"] == "shift")
            assert float(row["pooled_median [unit]"]) == pytest.approx(value, rel=1e-8, abs=1e-12)
            compared.add(q["name"])
    assert compared >= {
        "offset",
        "stroke",
        "shift",
        "width",
        "As",
        "Mf",
        "force",
        "displacement",
        "stiffness",
    }
    before, drawn = (
        first_row(out / "curves" / "w150-heating-force.csv"),
        first_row(out / "figures" / "curves.csv"),
    )
    assert float(drawn["q50"]) == pytest.approx(in_unit(float(before["q50"]), "N", "mN"), rel=1e-8)
    warm = in_unit(float(before["temperature_degC"]), "degC", "degF")
    assert float(drawn["temperature"]) == pytest.approx(warm, rel=1e-8)


def test_a_gap_is_told_in_declared_units(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from sma_bayes import read_campaign, study_gap
    from sma_bayes.report.notation import interval_text
    from sma_bayes.studies.gap.terminal import show_gap

    out = tmp_path / "out"
    found = study_gap(read_campaign(bench), out, pool="campaign", jobs=1)
    (effect,) = found["effects"]
    parameter = effect["parameters"]["c"]
    assert (effect["id"], parameter["unit"]) == ("stress_shift", "K/N")
    capsys.readouterr()
    show_gap(found, out)
    told = capsys.readouterr().out
    size = [in_unit(parameter[k], "delta_degC/N", "delta_degF/mN") for k in ("median", "q05", "q95")]
    assert f"c {interval_text(*size)} °F/mN" in told
    assert "°F/mN" in told
    of_study = text_of(out / "report.html").partition("Priors of the response")[0]
    for text in (told, of_study):
        assert_declared(text)
    places = zip(found["disagreement"], table(out, "disagreement"), strict=True)
    for d, row in ((d, r) for d, r in places if d["covariate"] == "temperature"):
        assert row["unit"] == "°F"
        for end in ("from", "to"):
            assert float(row[f"{end} [unit]"]) == pytest.approx(in_unit(d[end], "degC", "degF"), rel=1e-8)
    for row in table(out, "gap"):
        channel = found["gap"]["channels"][row["channel"]]
        of = (channel["unit"], row["unit"])
        assert of in {("N", "mN"), ("m", "mm")}
        for name in ("before", "after", "noise"):
            assert float(row[f"{name} [unit]"]) == pytest.approx(in_unit(channel[name], *of), rel=1e-8)
    noise = {(n["condition"], n["channel"]): n["sd"] for n in found["noise"]}
    for row in table(out, "noise"):
        stored = {"mN": "N", "mm": "m"}[row["unit"]]
        sd = in_unit(noise[row["condition"], row["channel"]], stored, row["unit"])
        assert float(row["sd [unit]"]) == pytest.approx(sd, rel=1e-8)
    with (out / "series.csv").open(encoding="utf-8") as file:
        series = {(r["condition"], r["channel"], r["branch"], r["row"]): r for r in csv.DictReader(file)}
    with (out / "figures" / "disagreement.csv").open(encoding="utf-8") as file:
        drawn = list(csv.DictReader(file))
    for r in drawn[::17]:
        stored_row, unit = (
            series[r["condition"], r["channel"], r["branch"], r["row"]],
            {"mN": "N", "mm": "m"}[r["unit"]],
        )
        warm = in_unit(float(stored_row["temperature"]), "degC", "degF")
        assert float(r["temperature [degF]"]) == pytest.approx(warm, rel=1e-8)
        for name in ("measured", "before", "after"):
            value = in_unit(float(stored_row[name]), unit, r["unit"])
            assert float(r[f"{name} [unit]"]) == pytest.approx(value, rel=1e-7)
    with (out / "figures" / "effect-stress_shift.csv").open(encoding="utf-8") as file:
        added = np.array([float(r["median"]) for r in csv.DictReader(file) if r["channel"] == "force"])
    largest = min(float(r["stress_shift_median"]) for r in series.values() if r["channel"] == "force")
    assert added.min() == pytest.approx(in_unit(largest, "N", "mN"), rel=1e-7)


def test_sensitivity_is_told_in_declared_units(
    fitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from sma_bayes import sensitivity
    from sma_bayes.studies.sensitivity.terminal import show_sensitivity

    out = tmp_path / "out"
    found = sensitivity(fitted, out, at="125.6 degF", jobs=1)
    capsys.readouterr()
    show_sensitivity(found, out)
    told = capsys.readouterr().out
    assert "stiffness at 125.6 °F" in told
    for text in (told, text_of(out / "report.html")):
        assert_declared(text)
    rows = table(out, "sensitivity")
    units = {"N": "mN", "m": "mm", "N/m": "mN/mm", "degC": "degF", "1/degC": "1/degF", "1": "1"}
    stored = [(r, q) for r in found["records"] for q in r["quantities"]]
    assert len(rows) == len(stored)
    for row, (_, q) in zip(rows, stored, strict=True):
        assert row["unit"] == units[q["unit"]].replace("deg", "°")
        assert row["number"] == q["name"].replace("52 °C", "125.6 °F")
        point = q["name"] in ("A3", "B3", "As", "Af", "Ms", "Mf")
        value = in_unit(q["median"], q["unit"], units[q["unit"]], difference=not point)
        assert float(row["posterior_median [unit]"]) == pytest.approx(value, rel=1e-8)
    assert {q["unit"] for _, q in stored} == set(units) - {"1"}
    decided = [q for _, q in stored if q["reading"] is not None]
    for row, q in zip(table(out, "readings"), decided, strict=True):
        warm = in_unit(q["reading"]["temperature"], "degC", "degF")
        assert float(row["temperature [unit]"]) == pytest.approx(warm, rel=1e-8)
    assert "°F" in found["conclusion"]
    drawn = first_row(out / "figures" / "readings-w100-heating.csv")
    read = first_row(out / "readings" / "w100-heating.csv")
    warm = in_unit(float(read["temperature_degC"]), "degC", "degF")
    assert float(drawn["temperature"]) == pytest.approx(warm, rel=1e-8)


def test_temperatures_of_a_fit_are_told_as_they_were_declared(fitted: Path) -> None:
    """Points with their zero, differences and rates without; draws, bands and readings of figures with them."""
    from sma_bayes.runs.outputs import band_of, posterior_of, read_run
    from sma_bayes.studies.fit.report import branch_data
    from sma_bayes.studies.fit.report_content import report_content

    run = read_run(fitted)
    content, stored = report_content(run).records[0], run.summary.records[0]
    assert content.temperature_unit == "degF"
    assert content.temperature_range == pytest.approx(
        [in_unit(t, "degC", "degF") for t in (stored.temperature.lowest, stored.temperature.highest)]
    )
    units = {"N": "mN", "m": "mm", "degC": "degF", "1/degC": "1/degF"}
    draws, shown = posterior_of(fitted, stored.key, stored.posterior_sha256), branch_data(fitted, content)
    for p in content.parameters:
        before = stored.parameters[p.name]
        point = p.name in ("A3", "B3")
        assert p.unit == units[before.unit]
        for number in ("median", "q05", "q95", "mean", "warm_start"):
            value = in_unit(getattr(before, number), before.unit, p.unit, difference=not point)
            assert getattr(p, number) == pytest.approx(value, rel=1e-9)
        assert p.sd == pytest.approx(
            in_unit(before.sd or 0.0, before.unit, p.unit, difference=True), rel=1e-9
        )
        own = float(np.median(draws.draws[p.name]))
        value = in_unit(own, before.unit, p.unit, difference=not point)
        assert np.median(shown.stored.draws[p.name]) == pytest.approx(value, rel=1e-9)
        if before.prior.get("family") == "normal" and point:
            assert p.prior["mean"] == pytest.approx(
                in_unit(float(before.prior["mean"] or 0.0), "degC", "degF")
            )
            assert p.prior["sd"] == pytest.approx(1.8 * float(before.prior["sd"] or 0.0))
    for name, t in stored.transformation.items():
        told = content.document.transformation[name]
        assert (told.unit, told.median) == ("degF", pytest.approx(in_unit(t.median or 0.0, "degC", "degF")))
    band = band_of(fitted, stored.key, "force", stored.band_sha256["force"])
    assert shown.bands["force"].temperature == pytest.approx(32.0 + 1.8 * band.temperature)
    assert shown.stored.inputs["temperature"] == pytest.approx(32.0 + 1.8 * draws.inputs["temperature"])
    loops = {(q.condition, q.name, q.channel): q for q in run.summary.loops}
    for q in report_content(run).loops:
        stored_q = loops[q.condition, q.name, q.channel]
        if q.name == "hysteresis_width":
            assert q.median == pytest.approx(1.8 * (stored_q.median or 0.0))
        if q.name == "loop_area" and q.channel == "force":
            assert q.median == pytest.approx(1800.0 * (stored_q.median or 0.0))


def test_findings_and_remarks_are_in_declared_units(bench: Path, fitted: Path) -> None:
    from sma_bayes import read_campaign

    campaign = read_campaign(bench)
    (step, *_) = (f.message for f in campaign.findings if f.kind == "quantised" and f.column == "temperature")
    even = 1.8 * 45.0 / 39.0  # degF from one reading to the next
    assert float(step.rpartition(" of ")[2].removesuffix(" °F")) == pytest.approx(even, abs=0.01)
    record = json.loads((fitted / "summary.json").read_text(encoding="utf-8"))["records"][0]
    assert record["path"]["kind"] == "straight_path"
    force, displacement = (campaign.records[0].observed[c] for c in ("force", "displacement"))
    slope = in_unit(float(np.polyfit(displacement, force, 1)[0]), "N/m", "mN/mm")
    assert f"with slope {slope:.4g} mN/mm:" in record["path"]["message"]


def test_a_plan_is_in_declared_units(run: Any, fitted: Path, tmp_path: Path) -> None:
    """Temperatures, rates, loads and what is asked; also those of the sentence that its document holds."""
    out = tmp_path / "plan"
    outcome = run("plan", fitted, "--for", "stiffness@122degF", "--out", out, "--hours", "2", "--jobs", "1")
    assert outcome.status == 0, outcome.err
    document = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    page = (out / "report.html").read_text(encoding="utf-8")
    assert document["temperature_unit"] == "degC"
    assert document["declared_units"]["temperature"] == "degF"
    for text in (outcome.out, page, document["advice"]):
        assert "stiffness at 122 °F" in text
        assert "°F/min" in text
        assert "°C" not in text
        assert "K/min" not in text
    best = document["candidates"][0]
    shown = table(out, "candidates")[0]
    for name in ("lowest", "peak"):
        value, unit = shown[name].split(" ")
        assert (float(value), unit) == (pytest.approx(1.8 * best[name] + 32.0, rel=1e-5), "°F")
    assert shown["rate"] == f"{60.0 * 1.8 * best['rate']:.3g} °F/min"
    known = document["quantities"][0]
    assert (known["at"], known["unit"]) == (pytest.approx(50.0), "N/m")
    told = table(out, "quantities")[0]
    assert told["unit"] == "mN/mm"
    assert float(told["now_median [unit]"]) == pytest.approx(known["median"], rel=1e-6)


def test_a_plan_for_parameters_is_in_declared_units(run: Any, fitted: Path, tmp_path: Path) -> None:
    out = tmp_path / "plan"
    assert run("plan", fitted, "--for", "parameters", "--out", out, "--jobs", "1", "--quiet").status == 0
    document = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    known = {(k["name"], k["key"]): k for k in document["quantities"]}
    shown = {r["quantity"]: r for r in table(out, "quantities")}
    for name, stored, unit, factor, zero in (
        ("A1", "m", "mm", 1000.0, 0.0),
        ("B1", "N", "mN", 1000.0, 0.0),
        ("A3", "degC", "°F", 1.8, 32.0),
        ("B2", "1/degC", "1/°F", 1.0 / 1.8, 0.0),
    ):
        k, row = known[(name, "w100-heating")], shown[f"{name}, w100-heating"]
        assert (k["unit"], row["unit"]) == (stored, unit)
        assert float(row["now_median [unit]"]) == pytest.approx(factor * k["median"] + zero, rel=1e-6)
        assert float(row["half_width [unit]"]) == pytest.approx(1.6449 * factor * k["sd"], rel=1e-4)
