"""Reading an output folder back, and refusing what is not one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import OutputError
from sma_bayes.runs.documents import sealed
from sma_bayes.runs.outputs import band_path, posterior_path, read_band, read_record, read_run

KEY = "100g-10mHz-heating"
Edit = Callable[..., Path]


def test_a_finished_run_is_read(finished: Path) -> None:
    run = read_run(finished)
    assert [r.key for r in run.summary.records] == [KEY, "100g-10mHz-cooling"]
    assert run.priors.startswith("#")


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is not a folder"):
        read_run(tmp_path / "nowhere")


def test_a_folder_without_a_run(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="holds no run of sma_bayes"):
        read_run(tmp_path)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("gap.json", "a gap study, no fit"),
        ("comparison.json", "a comparison of models"),
        ("study.json", "a study"),
    ],
)
def test_what_a_folder_holds_instead_of_a_fit(tmp_path: Path, name: str, told: str) -> None:
    for place in (name, "run.json"):
        (tmp_path / place).write_text("{}", encoding="utf-8")
    with pytest.raises(OutputError, match=told):
        read_run(tmp_path)


def test_a_run_that_was_interrupted_says_how_to_finish_it(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}", encoding="utf-8")
    with pytest.raises(OutputError, match="not finished") as caught:
        read_run(tmp_path)
    assert "--resume" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("{ broken", "can't be read"),
        ("[]", "schema None"),
        ('{"schema": "sma-bayes/gap/1", "records": [1]}', "sma-bayes/gap/1"),
        (json.dumps(sealed({"schema": "sma-bayes/fit/1", "records": []})), "no records"),
        ('{"schema": "sma-bayes/fit/1", "records": [{}]}', "not as it was written"),
        ("[" * 100_000 + "]" * 100_000, "too deep inside each other"),
        ('{"schema": ' + "9" * 5000 + "}", "can't be read"),
    ],
)
def test_a_summary_that_is_none(run_copy: Path, text: str, found: str) -> None:
    (run_copy / "summary.json").write_text(text, encoding="utf-8")
    with pytest.raises(OutputError, match=found):
        read_run(run_copy)


def test_missing_files_are_named(run_copy: Path) -> None:
    posterior_path(run_copy, KEY).unlink()
    band_path(run_copy, KEY, "force").unlink()
    with pytest.raises(OutputError) as caught:
        read_run(run_copy)
    assert f"{KEY}.nc" in str(caught.value)
    assert f"{KEY}-force.csv" in str(caught.value)


def test_bands_come_back_as_written(finished: Path) -> None:
    path = band_path(finished, KEY, "force")
    band = read_band(path)
    header = path.read_text(encoding="utf-8").split("\n", 1)[0].split(",")
    raw = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=range(len(header) - 1))
    assert np.array_equal(band.temperature, raw[:, 0])
    assert np.array_equal(band.quantiles["q95"], raw[:, header.index("q95")])
    assert not band.extrapolated.any()


def test_a_derived_channel_has_no_predictive_band(finished: Path) -> None:
    band = read_band(band_path(finished, KEY, "stiffness"))
    assert np.isnan(band.quantiles["pred_q05"]).all()
    assert np.isfinite(band.quantiles["q05"]).all()


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "temperature_degC,q05\n1\n"])
def test_a_broken_band_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "band.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(OutputError, match=r"band\.csv"):
        read_band(path)


def test_posteriors_come_back_with_their_measurements(finished: Path) -> None:
    stored = read_record(posterior_path(finished, KEY))
    summary = json.loads((finished / "summary.json").read_text(encoding="utf-8"))["records"][0]
    assert stored.observed.keys() == {"force", "displacement"}
    assert stored.inputs["temperature"].shape == stored.row.shape == (summary["n"],)
    for name, parameter in summary["parameters"].items():
        assert np.median(stored.draws[name]) == pytest.approx(parameter["median"], rel=1e-9)
    assert stored.prior_curves["force"].shape[1] == stored.prior_temperature.size


def test_a_broken_posterior_is_named(tmp_path: Path) -> None:
    path = tmp_path / "posterior.nc"
    path.write_bytes(b"not NetCDF")
    with pytest.raises(OutputError, match=r"posterior\.nc"):
        read_record(path)
