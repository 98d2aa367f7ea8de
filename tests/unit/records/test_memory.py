"""Data frames, arrays and files of the same numbers give the same records."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from sma_bayes.errors import SmaBayesError
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.memory import campaign_of
from sma_bayes.records.types import Campaign

T = np.r_[np.linspace(25.0, 90.0, 80), np.linspace(90.0, 25.0, 80)]
F = 0.5 + 2.5 / (1.0 + np.exp(-0.3 * (T - 55.0))) + 0.01 * np.random.default_rng(0).standard_normal(T.size)
S = 0.5 * np.arange(T.size)
FRAME = pd.DataFrame({"time_s": S, "temperature_C": T, "force_N": F})


class Interchange:
    """A frame that knows nothing but the interchange protocol."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._frame = frame

    def __dataframe__(self, nan_as_null: bool = False, allow_copy: bool = True) -> Any:
        return self._frame.__dataframe__(nan_as_null, allow_copy)


class Convertible:
    """A frame that can be made one of pandas."""

    def to_pandas(self) -> pd.DataFrame:
        return FRAME


FORMS = {
    "pandas": FRAME,
    "interchange": Interchange(FRAME),
    "to_pandas": Convertible(),
    "arrays": {"time_s": S, "temperature_C": T, "force_N": F},
    "lists": {"time_s": S.tolist(), "temperature_C": T.tolist(), "force_N": F.tolist()},
    "series": {name: FRAME[name] for name in FRAME},
    "named index": FRAME.set_index("time_s"),
    "another index": FRAME.set_index(np.arange(1000, 1160)),
    "condition": {"data": FRAME},
}


def same(found: Campaign, expected: Campaign) -> None:
    for a, b in zip(found.records, expected.records, strict=True):
        assert (a.branch, a.units) == (b.branch, b.units)
        for name, values in b.inputs.items():
            assert a.inputs[name] == pytest.approx(values, abs=1e-6)
        assert a.observed["force"] == pytest.approx(b.observed["force"])


@pytest.fixture(scope="module")
def from_file(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    path = tmp_path_factory.mktemp("memory") / "data.csv"
    FRAME.to_csv(path, index=False)
    return read_campaign(path)


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_what_a_file_gives(from_file: Campaign, form: str) -> None:
    found = campaign_of(FORMS[form])
    same(found, from_file)
    assert [r.key for r in found.records] == ["data-heating", "data-cooling"]


@pytest.mark.parametrize("where", ["column", "index", "timedelta"])
def test_times_of_pandas_are_seconds(from_file: Campaign, where: str) -> None:
    start = pd.Timestamp("2024-12-31 23:59:30")
    stamps = start + pd.to_timedelta(S, unit="s")
    plain = FRAME.drop(columns="time_s")
    if where == "index":
        same(campaign_of(plain.set_index(stamps)), from_file)
    else:
        same(campaign_of(plain.assign(time=stamps if where == "column" else stamps - start)), from_file)


def test_columns_and_conditions_say_what_a_campaign_file_says() -> None:
    frames = {"1A": FRAME.rename(columns={"force_N": "F"}), "2A": FRAME.rename(columns={"force_N": "F"})}
    columns = {"temperature": {"name": "temperature_C", "unit": "degC"}, "force": {"name": "F", "unit": "mN"}}
    found = campaign_of(frames, columns=columns, conditions={"2A": {"current_A": 2.0, "load_g": 100}})
    first, _, second, _ = found.records
    assert first.observed["force"] == pytest.approx(1e-3 * F[:80])
    assert (first.condition.current, second.condition.current) == (None, 2.0)
    assert second.condition.load == pytest.approx(0.980665)


def test_what_is_missing_is_kept_out_and_counted() -> None:
    force = F.copy()
    force[[5, 100]] = np.nan
    found = campaign_of({"temperature_C": T, "force_N": force})
    assert sum(f.dropped for f in found.findings) == 2
    assert sum(r.n for r in found.records) == T.size - 2


def test_the_digest_depends_on_numbers_and_declaration() -> None:
    one = campaign_of(FRAME).sha256
    assert campaign_of(FRAME.copy()).sha256 == one
    assert campaign_of(FRAME.assign(force_N=F + 1e-9)).sha256 != one
    assert campaign_of(FRAME, conditions={"data": {"current_A": 1.0}}).sha256 != one


@pytest.mark.parametrize(
    ("data", "told"),
    [
        ({}, "no data"),
        (np.ones((3, 2)), "found ndarray"),
        ("run.csv", "found str"),
        ({"temperature_C": T, "force_N": F[:-1]}, "columns of lengths"),
        ({"temperature_C": T, "force_N": np.c_[F, F]}, "an array of shape"),
        ({"temperature_C": T, "note": F}, "a channel is not among the columns"),
        ({"force_N": F}, "the temperature is not among the columns"),
        ({"temperature_C": T, "force_N": ["x", *F[1:]]}, "found 'x'"),
    ],
)
def test_what_can_not_be_used(data: Any, told: str) -> None:
    with pytest.raises(SmaBayesError, match=told):
        campaign_of(data)


def test_settings_of_no_condition() -> None:
    with pytest.raises(SmaBayesError, match="which is no condition"):
        campaign_of(FRAME, conditions={"2A": {"current_A": 2.0}})
    with pytest.raises(SmaBayesError, match="unknown key 'amps'"):
        campaign_of(FRAME, conditions={"data": {"amps": 2.0}})


def test_a_path_goes_to_read_campaign() -> None:
    with pytest.raises(SmaBayesError, match=r"found \w+Path") as caught:
        campaign_of(Path("run.csv"))  # type: ignore[arg-type]
    assert "read_campaign" in str(caught.value)
