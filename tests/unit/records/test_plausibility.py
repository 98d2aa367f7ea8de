"""What can't be is refused, what can hardly be is reported, and nothing real is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from sma_bayes.errors import SmaBayesError
from sma_bayes.parameters.priors_file import read_priors
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.memory import campaign_of
from sma_bayes.records.plausibility import DOUBTS, RANGES, doubted_conditions
from sma_bayes.records.severity import severity
from sma_bayes.records.types import Finding
from sma_bayes.studies.fit.tasks import tasks_of
from sma_bayes.studies.options import FitOptions

COLUMNS = {
    "time": '{ name = "t", unit = "s" }',
    "temperature": '{ name = "T", unit = "degC" }',
    "force": '{ name = "F", unit = "N" }',
    "displacement": '{ name = "X", unit = "mm" }',
}
EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"


def measured(n: int = 60, *, seed: int = 0) -> dict[str, np.ndarray]:
    """A spring that is heated and cooled."""
    rng = np.random.default_rng(seed)
    up = np.linspace(30.0, 70.0, n)
    temperature = np.concatenate([up, up[::-1]])
    force = 0.5 + 2.5 / (1.0 + np.exp(-0.35 * (temperature - 52.0)))
    stroke = 1.0 + 20.0 / (1.0 + np.exp(-0.30 * (temperature - 48.0)))
    return {
        "t": np.arange(temperature.size) * 1.0,
        "T": temperature,
        "F": force + 0.02 * rng.standard_normal(force.size),
        "X": stroke + 0.1 * rng.standard_normal(stroke.size),
    }


def campaign(folder: Path, data: dict[str, np.ndarray], condition: str = "", **columns: str) -> Path:
    """A campaign of one condition, with other columns than the usual."""
    table = np.column_stack(list(data.values()))
    text = ",".join(data) + "\n" + "\n".join(",".join(f"{v:.9g}" for v in row) for row in table) + "\n"
    (folder / "a.csv").write_text(text, encoding="utf-8")
    declared = "".join(f"{k} = {v}\n" for k, v in {**COLUMNS, **columns}.items() if v)
    (folder / "campaign.toml").write_text(
        f'[columns]\n{declared}[[condition]]\nid = "a"\nfile = "a.csv"\n{condition}', encoding="utf-8"
    )
    return folder


def warnings_of(folder: Path) -> list[Finding]:
    return [f for f in read_campaign(folder).findings if f.kind in DOUBTS]


def test_a_good_record_is_believed(tmp_path: Path) -> None:
    assert warnings_of(campaign(tmp_path, measured())) == []


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda d: d | {"T": d["T"] - 345.0}, "below absolute zero"),
        (lambda d: d | {"F": d["F"] * 1e60}, "a magnitude up to"),
        (lambda d: d | {"T": d["T"] + 1e300}, "a magnitude up to"),
    ],
)
def test_what_can_not_be_is_refused(tmp_path: Path, change: Callable[[dict], dict], told: str) -> None:
    with pytest.raises(SmaBayesError, match="row") as refused:
        read_campaign(campaign(tmp_path, change(measured())))
    assert told in str(refused.value)


def test_a_declared_channel_without_a_value_is_refused(tmp_path: Path) -> None:
    folder = campaign(tmp_path, measured(), force='{ name = "F", unit = "N", valid = [100.0, 200.0] }')
    with pytest.raises(SmaBayesError, match="force has no value in 120 rows"):
        read_campaign(folder)


def test_a_force_that_is_one_number_is_refused(tmp_path: Path) -> None:
    data = measured()
    folder = campaign(tmp_path, data | {"F": np.full(data["F"].size, 1.5)}, displacement="")
    with pytest.raises(SmaBayesError, match=r"force is 1\.5 N in all 120 rows of the sweeps"):
        read_campaign(folder)


def by_names(**names: str) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    return lambda data: {names.get(key, key): values for key, values in data.items()}


@pytest.mark.parametrize(
    ("change", "columns", "condition", "kind", "told"),
    [
        (None, {"displacement": '{ name = "X", unit = "m" }'}, "", "implausible", "displacement reaches 21"),
        (None, {"force": '{ name = "F", unit = "MN" }'}, "", "implausible", "force reaches 3"),
        (lambda d: d | {"T": d["T"] + 900}, {}, "", "implausible", "temperature reaches"),
        (None, {"temperature": '{ name = "T", unit = "kelvin" }'}, "", "implausible", "temperature reaches -24"),
        (None, {"displacement": '{ name = "F", unit = "mm" }'}, "", "same-column", "are one column"),
        (None, {"displacement": '{ name = "T", unit = "mm" }'}, "", "same-column", "are one column"),
        (
            by_names(F="force_N", X="displacement_mm"),
            {"force": '{ name = "displacement_mm", unit = "N" }', "displacement": '{ name = "force_N", unit = "mm" }'},
            "", "named-otherwise", "its name tells displacement",
        ),
        (
            by_names(X="displacement_mm"), {"displacement": '{ name = "displacement_mm", unit = "m" }'}, "",
            "named-otherwise", "declared in 'm', its name tells 'mm'",
        ),
        (
            lambda d: d | {"t": d["T"], "T": d["t"]}, {}, "", "swapped", "look swapped",
        ),
        (lambda d: d | {"T": 20.0 * d["F"], "F": d["T"]}, {}, "", "swapped", "temperature lingers at both of its ends"),
        (lambda d: d | {"T": d["X"], "X": d["T"]}, {"force": ""}, "", "swapped", "displacement passes evenly"),
        (None, {"force": '{ name = "t", unit = "N" }'}, "", "same-column", "time and force are one column"),
        (
            None, {"force": '{ name = "F", unit = "V", scale = 1.0, to = "N", scale_sd = 2.5 }'}, "",
            "large-sd", "250% of its scale",
        ),
        (None, {"temperature": '{ name = "T", unit = "degC", sd = 20.0 }'}, "", "large-sd", "50% of the sweep"),
        (
            None, {"temperature": '{ name = "T", unit = "degC", sd = 5.0 }'}, "",
            "large-sd", "sd = 5, is more than a quarter of the 12",
        ),
        (None, {}, "duty_cycle_pct = 0.5\n", "implausible", "may be meant as a share, 50 %"),
        (None, {}, "current_A = 2000\n", "implausible", "the current of the condition is 2e+03 A"),
        (None, {}, "load_g = 2e7\n", "implausible", "the load of the condition is 1.96e+05 N"),
        (None, {}, "frequency_mHz = 1e7\n", "implausible", "the frequency of the condition is 1e+04 Hz"),
        (
            None, {"temperature": '{ name = "T", unit = "degC", offset_sd = 300.0 }'}, "",
            "large-sd", "offset_sd of temperature, 300 °C, is more than its readings change by, 40 °C",
        ),
        (None, {"force": '{ name = "F", unit = "N", offset_sd = 100.0 }'}, "", "large-sd", "offset_sd of force, 100 N"),
    ],
)  # fmt: skip
def test_what_can_hardly_be_is_reported(
    tmp_path: Path, change: Callable | None, columns: dict[str, str], condition: str, kind: str, told: str
) -> None:
    data = change(measured()) if change else measured()
    found = warnings_of(campaign(tmp_path, data, condition, **columns))
    assert [f for f in found if f.kind == kind and told in f.message], found


def test_one_file_as_two_conditions_is_reported(tmp_path: Path) -> None:
    (found,) = warnings_of(campaign(tmp_path, measured(), '[[condition]]\nid = "b"\nfile = "./a.csv"\n'))
    assert (found.kind, found.condition) == ("same-file", "b")
    assert "'a' and 'b' are the same rows" in found.message


def test_a_copy_of_a_file_as_another_condition_is_reported(tmp_path: Path) -> None:
    folder = campaign(tmp_path, measured(), '[[condition]]\nid = "b"\nfile = "b.csv"\n')
    (folder / "b.csv").write_bytes((folder / "a.csv").read_bytes())
    (found,) = warnings_of(folder)
    assert (found.kind, found.condition) == ("same-file", "b")


def another(folder: Path, data: dict[str, np.ndarray]) -> Path:
    """A second condition."""
    table = np.column_stack(list(data.values()))
    text = ",".join(data) + "\n" + "\n".join(",".join(f"{v:.6g}" for v in row) for row in table) + "\n"
    (folder / "b.csv").write_text(text, encoding="utf-8")
    return folder


TWO = '[[condition]]\nid = "b"\nfile = "b.csv"\n'


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda d: {"F": 1.3 * d["F"]}, "force is 1.3 times that of condition 'a', reading for reading"),
        (lambda d: {"F": -2.0 * d["F"] + 5.0}, "force is -2 times that of condition 'a' plus 5 N"),
        (lambda d: {"F": np.round(1.3 * d["F"], 3)}, "force is 1.3"),
        (
            lambda d: {"T": 1.1 * d["T"] + 4.0},
            "force is the same as that of condition 'a', reading for reading",
        ),
    ],
)
def test_a_condition_whose_readings_are_those_of_another_is_reported(
    tmp_path: Path, change: Callable, told: str
) -> None:
    data, other = measured(), measured(seed=1)
    copied = {**data, **change(data)}
    if "T" not in change(data):
        copied["X"] = other["X"]
    found = warnings_of(another(campaign(tmp_path, data, TWO), copied))
    assert {(f.kind, f.condition) for f in found} == {("copied-readings", "b")}
    assert told in found[0].message


@pytest.mark.parametrize("digits", [1, 3])
@pytest.mark.parametrize("n", [12, 60])
def test_the_same_spring_measured_again_is_believed(tmp_path: Path, n: int, digits: int) -> None:
    one, two = ({k: np.round(v, digits) for k, v in measured(n, seed=seed).items()} for seed in (0, 1))
    assert warnings_of(another(campaign(tmp_path, one, TWO), two)) == []


def test_curves_without_noise_may_differ_by_a_constant(tmp_path: Path) -> None:
    up = np.linspace(30.0, 70.0, 40)
    t = np.concatenate([up, up[::-1]])
    curve = 1.0 / (1.0 + np.exp(-0.35 * (t - 52.0)))
    data = {
        "t": np.arange(t.size) * 1.0,
        "T": t,
        "F": 1.0 + curve,
        "X": 2.0 + (1.0 + np.exp(0.2 * (48.0 - t))) ** -1,
    }
    folder = another(campaign(tmp_path, data, TWO), {**data, "F": 1.0 + 2.0 * curve})
    assert warnings_of(folder) == []


def test_data_in_memory_are_doubted_as_files_are() -> None:
    data = measured()
    columns = {name: {"name": key, "unit": unit} for name, key, unit in (
        ("time", "t", "s"), ("temperature", "T", "degC"), ("force", "F", "N"), ("displacement", "X", "m"),
    )}  # fmt: skip
    found = campaign_of(
        {"a": data, "b": {**data, "F": 1.2 * data["F"], "T": data["T"] + 1.0}}, columns=columns
    )
    kinds = {f.kind for f in found.findings if f.kind in DOUBTS}
    assert kinds == {"implausible", "copied-readings"}
    with pytest.raises(SmaBayesError, match="below absolute zero"):
        campaign_of({"a": {**data, "T": data["T"] - 400.0}}, columns=columns)


LOST = {
    "a third": lambda n: np.random.default_rng(4).random(n) < 1 / 3,
    "two thirds": lambda n: np.random.default_rng(4).random(n) < 2 / 3,
    "one": lambda n: np.arange(n) == n // 3,
    "a block": lambda n: (np.arange(n) > n // 3) & (np.arange(n) < n // 2),
}


@pytest.mark.parametrize("n", [20, 200])
@pytest.mark.parametrize("which", LOST)
@pytest.mark.parametrize(("column", "unit"), [("F", "N"), ("X", "mm"), ("T", "degC"), ("T", "K")])
def test_lost_decimal_marks_are_reported_with_their_rows(
    tmp_path: Path, column: str, unit: str, which: str, n: int
) -> None:
    """Digits as a file has them, three behind the mark, so that noughts at the end may be gone with it."""
    data = measured(n)
    lost = LOST[which](2 * n)
    if unit == "K":
        data["T"] = data["T"] + 273.15
    written = [f"{v:.3f}".rstrip("0") for v in data[column]]
    lost &= [len(text.partition(".")[2]) > 1 for text in written]
    data[column] = np.array(
        [float(text.replace(".", "") if gone else text) for text, gone in zip(written, lost, strict=True)]
    )
    columns = {"temperature": f'{{ name = "T", unit = "{unit}" }}'} if column == "T" else {}
    folder = campaign(tmp_path, data, **columns)
    rows = ", ".join(map(str, (np.flatnonzero(lost) + 2)[:5]))
    try:
        found = [f for f in warnings_of(folder) if f.kind == "misread-decimals"]
    except SmaBayesError as error:  # nothing is left to split by, and the reason is told
        assert column == "T"
        told = str(error)
    else:
        assert [(f.count, severity(f.kind)) for f in found] == [(np.count_nonzero(lost), "serious")]
        told = found[0].message
    assert f"{np.count_nonzero(lost)} reading" in told
    assert rows in told


def test_channels_that_leave_zero_by_a_step_have_their_decimal_marks(tmp_path: Path) -> None:
    """A slack spring, a steep one, drop-outs, a sign and noise about zero: 1000 times, and of one measurement."""
    rng = np.random.default_rng(8)
    data = measured(200)
    hot = data["T"] > 52.0
    slack = np.where(hot, 3.0, 0.003) + 0.001 * rng.standard_normal(hot.size)
    dropped = np.where(np.arange(hot.size) % 20 == 7, 0.0, data["F"])
    for values in (
        slack,
        dropped,
        rng.standard_normal(hot.size),
        np.where(hot, -3.0, 0.003),
        10.0 ** (hot * 2.5),
    ):
        found = warnings_of(campaign(tmp_path, {**data, "F": values}))
        assert [f for f in found if f.kind == "misread-decimals"] == []


def test_little_is_tried_of_a_condition_whose_columns_are_swapped(tmp_path: Path) -> None:
    data = measured()
    swapped = {**data, "T": data["F"], "F": data["T"]}
    found = read_campaign(another(campaign(tmp_path, data, TWO), swapped))
    assert doubted_conditions(found.findings) == {"b"}
    options = FitOptions(read_priors("modified_sigmoid"))
    tasks = tasks_of([(r,) for r in found.records], options, None, doubted=doubted_conditions(found.findings))
    assert {(t.records[0].condition.id, t.doubted) for t in tasks} == {("a", False), ("b", True)}


def test_little_is_tried_where_the_declared_error_leaves_nothing_of_the_curve(tmp_path: Path) -> None:
    """It took minutes to sample. Of a scale of a channel that is hardly known the fit is as quick as ever."""
    columns = {"temperature": '{ name = "T", unit = "degC", sd = 20.0 }'}
    assert doubted_conditions(warnings_of(campaign(tmp_path, measured(), **columns))) == {"a"}
    columns = {"force": '{ name = "F", unit = "V", scale = 1.0, scale_sd = 2.5, to = "N" }'}
    assert doubted_conditions(warnings_of(campaign(tmp_path, measured(), **columns))) == set()


@pytest.mark.parametrize("sd", [0.5, 2.0])
def test_an_error_of_the_thermometer_that_leaves_the_change_is_believed(tmp_path: Path, sd: float) -> None:
    columns = {"temperature": f'{{ name = "T", unit = "degC", sd = {sd} }}'}
    data = measured()
    data["T"] = data["T"] + sd * np.random.default_rng(3).standard_normal(data["T"].size)
    assert warnings_of(campaign(tmp_path, data, **columns)) == []


@pytest.mark.parametrize("sd", [1.5, 2.5])
def test_an_error_of_the_thermometer_that_the_scatter_contradicts_is_doubted(
    tmp_path: Path, sd: float
) -> None:
    """What two thermometers differ by is an offset of all readings; as the error of each it made a fit take minutes.

    Of 400 sigmoids each whose temperature errs by what was declared, a tenth to a quarter of the change, at most one in
    300 was doubted; of 400 where it errs by a tenth of that, all from 40 readings on.
    """
    columns = {"temperature": f'{{ name = "T", unit = "degC", sd = {sd} }}'}
    found = warnings_of(campaign(tmp_path, measured(), **columns))
    assert {(f.kind, f.column) for f in found} == {("large-sd", "temperature")}
    assert all("is it an offset of all readings (offset_sd)?" in f.message for f in found)
    assert doubted_conditions(found) == {"a"}


def test_a_declared_error_that_hardly_matters_is_not_held_against_the_scatter(tmp_path: Path) -> None:
    columns = {"temperature": '{ name = "T", unit = "degC", sd = 1.0 }'}
    assert warnings_of(campaign(tmp_path, measured(), **columns)) == []


def test_parts_of_one_file_are_two_conditions(tmp_path: Path) -> None:
    rows = "[condition.reading]\nfirst_row = {}\nlast_row = {}\n"
    text = rows.format(2, 61) + '[[condition]]\nid = "b"\nfile = "a.csv"\n' + rows.format(62, 121)
    assert warnings_of(campaign(tmp_path, measured(), text)) == []


@pytest.mark.parametrize(
    ("one", "other"),
    [("Ko\u0308rper", "K\u00f6rper"), ("2A", "\uff12A"), ("2A", "2A\u200b"), ("2A", "2\u00adA")],
)
def test_ids_that_look_alike_are_refused(tmp_path: Path, one: str, other: str) -> None:
    text = f'[[condition]]\nid = "{one}"\nfile = "a.csv"\n[[condition]]\nid = "{other}"\nfile = "a.csv"\n'
    with pytest.raises(SmaBayesError, match="by how Unicode writes it"):
        read_campaign(campaign(tmp_path, measured(), text))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    temperature=st.floats(-80.0, 400.0),
    span=st.floats(10.0, 150.0),
    force=st.floats(-2.0, 3.0),
    stroke=st.floats(-2.0, 2.0),
)
def test_no_unit_that_is_right_is_doubted(
    tmp_path_factory: pytest.TempPathFactory, temperature: float, span: float, force: float, stroke: float
) -> None:
    """Springs of 10 mN to 1 kN and of 10 µm to 100 mm, at temperatures of any shape memory alloy."""
    data = measured()
    data["T"] = temperature + (data["T"] - 30.0) * span / 40.0
    data["F"] = 10.0**force * data["F"] / data["F"].max()
    data["X"] = 10.0**stroke * data["X"] / data["X"].max()
    folder = tmp_path_factory.mktemp("plausible")
    assert [f for f in warnings_of(campaign(folder, data)) if f.kind == "implausible"] == []


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    midpoint=st.floats(25.0, 75.0),
    rate=st.floats(0.05, 2.0),
    steps=st.floats(0.0, 4.0),
    noise=st.floats(0.0, 0.05),
    hysteresis=st.floats(0.0, 15.0),
)
def test_no_transformation_is_taken_for_swapped_columns(
    tmp_path_factory: pytest.TempPathFactory,
    midpoint: float,
    rate: float,
    steps: float,
    noise: float,
    hysteresis: float,
) -> None:
    """Whole or in part, in ramps or in steps that are approached exponentially, with and without a loop."""
    rng = np.random.default_rng(0)
    way = np.linspace(0.0, 1.0, 60)
    approach = way if steps < 0.1 else (1.0 - np.exp(-steps * way)) / (1.0 - np.exp(-steps))
    temperature = 30.0 + 40.0 * np.concatenate([approach, 1.0 - approach])
    shift = np.repeat([0.0, -hysteresis], 60)
    data = {"t": np.arange(120.0), "T": temperature}
    for name, own in (("F", 1.0), ("X", 1.3)):
        curve = 1.0 / (1.0 + np.exp(-own * rate * (temperature - midpoint - shift)))
        data[name] = 1.0 + curve + noise * rng.standard_normal(120)
    folder = campaign(tmp_path_factory.mktemp("whole"), data)
    assert [f.message for f in read_campaign(folder).findings if f.kind == "swapped"] == []


def test_doubts_are_serious() -> None:
    assert {severity(kind) for kind in DOUBTS} == {"serious"}


def test_ranges_have_sources() -> None:
    for name, limits in RANGES.items():
        assert limits.low < limits.high, name
        assert len(limits.source) > 20, name


@pytest.mark.parametrize("example", sorted(p.stem for p in EXAMPLES.glob("*.toml")))
def test_real_measurements_are_believed(shared_data: Path, example: str) -> None:
    folder = shared_data / example
    if not folder.is_dir():
        pytest.skip(f"{example} is not there")
    found = read_campaign(EXAMPLES / f"{example}.toml", data_dir=folder).findings
    assert [f.message for f in found if f.kind in DOUBTS] == []
