"""Profiles of the current: what is read, and what is refused with file, row and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import CampaignError, MeasurementError, SmaBayesError
from sma_bayes.limits import PROFILE_ROWS
from sma_bayes.studies.simulate.profile import read_profile
from sma_bayes.studies.simulate.starts import starts_of


def test_units_are_converted_and_values_hold(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text(
        "time_min;current_mA;ambient_temperature_K;remark\n0;500;300,15;a\n1;0;301,15;b\n", encoding="utf-8"
    )
    found = read_profile(path)
    assert (found.time.tolist(), found.current.tolist(), found.ignored) == (
        [0.0, 60.0],
        [0.5, 0.0],
        ("remark",),
    )
    assert found.ambient is not None
    assert found.ambient == pytest.approx([27.0, 28.0])
    assert found.held(found.current, np.array([0.0, 59.9, 60.0])).tolist() == [0.5, 0.5, 0.0]


@pytest.mark.parametrize(
    ("text", "kind", "told"),
    [
        ("time_s,current_A\n0,1\n", MeasurementError, ("row 2", "a single row")),
        ("time_s,volt\n0,1\n1,1\n", CampaignError, ("no current", "'volt'")),
        ("0,1\n1,1\n", CampaignError, ("no time and no current", "no header")),
        ("time_s,current_A\n0,1\n5,\n9,0\n", MeasurementError, ("row 3", "'current_A'", "no value")),
        ("time_s,current_A\n0,1\n,1\n9,0\n", MeasurementError, ("row 3", "'time_s'", "no value")),
        ("time_s,current_A\n-1,1\n5,0\n", MeasurementError, ("row 2", "'time_s'", "-1 s", "from 0 on")),
        ("time_s,current_A\n0,1\n5,1\n5,0\n", MeasurementError, ("row 4", "5 s after 5 s", "rise")),
        ("time_s,current_A\n0,1\n5,x\n", MeasurementError, ("row 3", "'current_A'")),
        ("time_s,current_A\n0,1e12\n5,0\n", MeasurementError, ("row 2", "1e+12 A")),
        ("time_s,current_A,current_mA\n0,1,1\n5,0,0\n", CampaignError, ("both a current",)),
        (
            "time_s,current_A,ambient_temperature_C\n0,1,20\n5,0,-300\n",
            MeasurementError,
            ("row 3", "-300", "absolute zero"),
        ),
    ],
)
def test_what_cannot_be_is_refused_by_row_and_column(
    text: str, kind: type[SmaBayesError], told: tuple[str, ...], tmp_path: Path
) -> None:
    path = tmp_path / "p.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(kind) as caught:
        read_profile(path)
    for word in ("p.csv", *told):
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("content", "told", "advised"),
    [
        (b"time_s,current_A\n0,1\n5,1,2\n9,0\n", "the row has 3 cells", "complete the row, or remove it"),
        (b"time_s,current_A\n0,1\n5,x\n9,0\n", "found 'x'", "correct the cell"),
        (b"# \xb0\ntime_s,current_A\n0,1\n5,0\n", "byte 0xb0", "save the text as UTF-8"),
        (b"\0\1\2" * 9, "no format that is known", "export it as CSV"),
    ],
)
def test_what_is_advised_can_be_done(content: bytes, told: str, advised: str, tmp_path: Path) -> None:
    """No campaign.toml says how a profile is read."""
    path = tmp_path / "p.csv"
    path.write_bytes(content)
    with pytest.raises(MeasurementError) as caught:
        read_profile(path)
    assert told in caught.value.found
    assert advised in str(caught.value.remedy)
    assert "campaign.toml" not in str(caught.value)


def test_columns_in_memory_are_checked_alike() -> None:
    with pytest.raises(MeasurementError, match="row 2"):
        read_profile({"time_s": [0.0, np.nan, 2.0], "current_A": [1.0, 1.0, 0.0]})
    with pytest.raises(MeasurementError, match="columns of one length"):
        read_profile({"time_s": [0.0, 1.0], "current_A": [1.0]})
    many = np.arange(PROFILE_ROWS.value + 1.0)
    with pytest.raises(MeasurementError, match="at most"):
        read_profile({"time_s": many, "current_A": many})


@pytest.mark.parametrize("text", ["warm", "heating", "heating:", "cold:20 degC", "heating:60"])
def test_a_start_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(SmaBayesError):
        starts_of(text)


def test_starts_are_both_where_none_is_told() -> None:
    assert [s.name for s in starts_of(None)] == ["cold", "hot"]
    assert [(s.name, s.temperature) for s in starts_of(["cooling:333.15 kelvin"])] == [
        ("cooling", pytest.approx(60.0))
    ]
    with pytest.raises(SmaBayesError):
        starts_of(["heating:60 degC", "heating:70 degC"])
