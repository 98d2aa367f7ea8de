"""Fits in memory hold what files hold: tables, bands, answers, InferenceData, plots."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import sma_bayes
from sma_bayes.errors import SmaBayesError

T = np.r_[np.linspace(30.0, 70.0, 40), np.linspace(70.0, 30.0, 40)]
RNG = np.random.default_rng(0)
DATA = {
    "temperature_C": T,
    "force_N": 0.5 + 2.5 / (1.0 + np.exp(-0.35 * (T - 52.0))) + 0.02 * RNG.standard_normal(T.size),
    "displacement_mm": 1.0 + 20.0 / (1.0 + np.exp(-0.30 * (T - 48.0))) + 0.1 * RNG.standard_normal(T.size),
}


@pytest.fixture(scope="module")
def fits() -> sma_bayes.Fits:
    return sma_bayes.fit(DATA, noise="independent", jobs=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("fitted") / "out"
    sma_bayes.fit_campaign(sma_bayes.campaign_of(DATA), out, noise="independent", jobs=1, figures="none")
    return out


def test_a_file_is_read_and_fitted(fits: sma_bayes.Fits, tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    rows = zip(*DATA.values(), strict=True)
    path.write_text("\n".join([",".join(DATA), *(",".join(map(repr, map(float, r))) for r in rows)]))
    for place in (path, str(path)):
        found = sma_bayes.fit(place, noise="independent", jobs=1)
        assert found["data-heating"].summary().equals(fits["data-heating"].summary())
    with pytest.raises(SmaBayesError, match="columns or conditions beside a campaign"):
        sma_bayes.fit(path, columns={"force": {"name": "force_N", "unit": "N"}})
    with pytest.raises(SmaBayesError, match=r"nothing\.csv"):
        sma_bayes.fit("nothing.csv")


def test_the_table_of_parameters_is_that_of_the_files(fits: sma_bayes.Fits, folder: Path) -> None:
    stored = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    for entry in stored["records"]:
        fit = fits[entry["key"]]
        table = fit.summary()
        assert list(table.index) == list(entry["parameters"])
        for name, p in entry["parameters"].items():
            assert table.loc[name, "median"] == pytest.approx(p["median"])
            assert table.loc[name, "unit"] == p["unit"]
        assert fit.adequate is entry["adequate"]
    assert fits.summary().loc[("data-heating", "A3"), "median"] == pytest.approx(48.0, abs=0.5)


def test_bands_are_those_of_the_files(fits: sma_bayes.Fits, folder: Path) -> None:
    fit = fits["data-heating"]
    for channel in ("force", "displacement", "stiffness"):
        band = fit.band(channel)
        stored = np.genfromtxt(folder / "bands" / f"data-heating-{channel}.csv", delimiter=",", names=True)
        for name in ("temperature_degC", "q05", "q50", "q95"):
            assert band[name].to_numpy() == pytest.approx(stored[name], rel=1e-6)
    assert fit.band("force", extrapolate=5.0)["extrapolated"].any()


def test_values_at_temperatures_lie_in_the_bands(fits: sma_bayes.Fits) -> None:
    fit = fits["data-heating"]
    at = [45.0, 50.0, 75.0]
    found = fit.stiffness(temperature=at)
    band = fit.band("stiffness", extrapolate=10.0)
    assert found["median"].to_numpy() == pytest.approx(
        np.interp(at, band["temperature_degC"], band["q50"]), rel=1e-2
    )
    assert found["extrapolated"].tolist() == [False, False, True]
    assert found.attrs["unit"] == "N/m"
    force = fit.force(50.0, probability=0.5)
    assert force.loc[50.0, "pred_low"] < force.loc[50.0, "low"] < force.loc[50.0, "high"]
    assert fit.displacement(50.0)["median"].item() == pytest.approx(
        1e-3 * (1 + 20 / (1 + np.exp(-0.6))), rel=0.01
    )


def test_numbers_say_their_unit_and_are_told_as_declared_if_asked(fits: sma_bayes.Fits) -> None:
    fit = fits["data-heating"]
    stored, declared = fit.stiffness(50.0), fit.stiffness(50.0, declared=True)
    assert (stored["unit"].item(), declared["unit"].item()) == ("N/m", "N/mm")
    assert declared["median"].item() == pytest.approx(1e-3 * stored["median"].item(), rel=1e-9)
    assert fit.force(50.0, declared=True)["unit"].item() == "N"
    table = fits.summary(declared=True)
    assert table.loc[("data-heating", "A1"), "unit"] == "mm"
    assert table.loc[("data-heating", "A1"), "median"] == pytest.approx(20.0, abs=0.5)
    assert "<td>mm</td>" in fit._repr_html_()


def test_what_is_asked_of_a_fit_and_of_a_folder_is_one_answer(fits: sma_bayes.Fits, folder: Path) -> None:
    for question in ({"at": ["50 degC", "140 degF"]}, {"stiffness": "0.12 N/mm"}):
        stored = sma_bayes.ask(folder, branch="heating", **question)["answers"]
        told = fits["data-heating"].ask(**question)["answers"]
        assert json.dumps(told, sort_keys=True)[:40] == json.dumps(stored, sort_keys=True)[:40]
        if "at" in question:
            for ours, theirs in zip(told, stored, strict=True):
                for channel, q in theirs["quantities"].items():
                    assert ours["quantities"][channel]["median"] == pytest.approx(q["median"], rel=1e-6)
        else:
            assert told[0]["reachable"] == pytest.approx(stored[0]["reachable"])
    assert [a["key"] for a in fits.ask(at="50 degC")["answers"]] == ["data-heating", "data-cooling"]


def test_inference_data_has_the_groups_of_the_files(fits: sma_bayes.Fits, folder: Path) -> None:
    ours = fits["data-heating"].to_inference_data()
    theirs = sma_bayes.open_posterior(folder / "posterior" / "data-heating.nc")
    assert ours["posterior"]["B3"].values == pytest.approx(theirs["posterior"]["B3"].values)
    for group in ("posterior_predictive", "log_likelihood", "observed_data"):
        assert "force" in ours[group]


def test_a_record_that_is_not_there_names_those_that_are(fits: sma_bayes.Fits) -> None:
    with pytest.raises(KeyError, match="there is no fit of 'data-heatin'") as caught:
        fits["data-heatin"]
    assert "did you mean 'data-heating'" in str(caught.value)
    assert fits.get("data-heatin") is None


def test_a_plot_goes_on_given_axes(fits: sma_bayes.Fits) -> None:
    ax = Figure().subplots()
    for key in fits:
        assert fits[key].plot("displacement", ax=ax) is ax
    assert ax.get_xlabel() == "temperature [°C]"
    assert ax.get_ylabel() == "displacement [mm]"
    curve = next(line for line in ax.lines if line.get_label() == "data-heating")
    assert curve.get_ydata().max() == pytest.approx(21.0, abs=0.5)
    bare = fits["data-heating"].plot("displacement", ax=Figure().subplots(), declared=False)
    assert bare.get_ylabel() == "displacement [m]"
    assert bare.lines[0].get_ydata().max() == pytest.approx(0.021, abs=5e-4)
    assert {line.get_label() for line in ax.lines} >= set(fits)


def test_it_is_told_in_a_line_and_in_a_notebook(fits: sma_bayes.Fits) -> None:
    fit = fits["data-heating"]
    assert repr(fit) == (
        "<RecordFit data-heating: force, displacement, 40 samples, modified_sigmoid, independent, converged>"
    )
    assert repr(fits).count("\n") == 1
    assert "<table" in fit._repr_html_()
    assert "data-cooling: 40 samples, converged" in fits._repr_html_()


def test_progress_is_told_to_a_function_and_to_the_log(caplog: pytest.LogCaptureFixture) -> None:
    told: list[tuple[int, int, str]] = []
    with caplog.at_level(logging.INFO, logger="sma_bayes"):
        sma_bayes.fit(DATA, noise="independent", jobs=1, progress=lambda *step: told.append(step))
    assert told == [(1, 2, "sampled data-heating"), (2, 2, "sampled data-cooling")]
    assert [r.message for r in caplog.records if r.name == "sma_bayes"] == [
        "1 of 2: sampled data-heating",
        "2 of 2: sampled data-cooling",
    ]


def test_progress_can_be_a_bar(capsys: pytest.CaptureFixture[str]) -> None:
    sma_bayes.fit({k: v[:40] for k, v in DATA.items()}, noise="independent", jobs=1, progress=True)
    assert "100%" in capsys.readouterr().out


def test_pooled_records_have_views_of_their_own() -> None:
    frames = {"1A": DATA, "2A": DATA}
    pooled = sma_bayes.fit(frames, noise="independent", pool="campaign", jobs=1)
    assert pooled["2A-heating"].record.key == "2A-heating"
    assert pooled["1A-heating"].summary().index.is_unique
    assert pooled["2A-cooling"].ask(at="50 degC")["answers"][0]["key"] == "2A-cooling"


@pytest.mark.parametrize("wrong", [np.nan, [[50.0]], "60 degC", [[50.0], [60.0, 70.0]]])
def test_temperatures_that_are_none(fits: sma_bayes.Fits, wrong: object) -> None:
    with pytest.raises(
        SmaBayesError, match=r"temperature .*\n.*finite numbers in degC.*\n.*`ask` takes texts"
    ):
        fits["data-heating"].stiffness(wrong)  # type: ignore[arg-type]


def test_a_channel_that_was_not_measured() -> None:
    (fit,) = sma_bayes.fit(
        {k: DATA[k][:40] for k in ("temperature_C", "force_N")}, noise="independent", jobs=1
    ).values()
    with pytest.raises(SmaBayesError, match="does not tell of 'stiffness'"):
        fit.stiffness(50.0)


def test_an_unknown_pool_is_refused() -> None:
    with pytest.raises(SmaBayesError, match="'none' or 'campaign'"):
        sma_bayes.fit(DATA, pool="branch", jobs=1)  # type: ignore[arg-type]


def test_columns_beside_a_campaign() -> None:
    with pytest.raises(SmaBayesError, match="beside a campaign"):
        sma_bayes.fit(sma_bayes.campaign_of(DATA), conditions={"data": {"current_A": 1.0}})


def test_a_fit_tells_its_least_squares_estimate(fits: sma_bayes.Fits) -> None:
    """That of the warm start is that of a search without bounds; its errors are near those of the posterior."""
    fit = fits["data-heating"]
    found = fit.least_squares
    alone = sma_bayes.least_squares(fit.record)
    assert found.converged
    for name, value in alone.estimate.items():
        assert found.estimate[name] == pytest.approx(value, rel=1e-6)
        assert found.standard_error[name] == pytest.approx(alone.standard_error[name], rel=1e-4)
        assert fit.summary().loc[name, "sd"] == pytest.approx(found.standard_error[name], rel=0.25)
    assert found.residual_sd["force"] == pytest.approx(0.02, rel=0.3)
