"""From a declaration and its files to runs and records, and each mistake told where it was made."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import CampaignError, MeasurementError, QuantityError, SmaBayesError
from sma_bayes.quantities import STANDARD_GRAVITY
from sma_bayes.records.campaign import digest, read_campaign
from sma_bayes.records.declaration import read_declaration
from sma_bayes.records.mapping import read_run
from sma_bayes.records.run import Run
from sma_bayes.records.split import SplitSettings
from sma_bayes.records.types import Branch, Calibration, Finding
from sma_bayes.runs.documents import RUN_MARKER

COLUMNS = """
[columns]
time = { name = "time_s", unit = "s" }
temperature = { name = "temperature_C", unit = "degC" }
force = { name = "force_N", unit = "N" }
"""

CONDITION = """
[[condition]]
id = "a"
file = "a.csv"
"""


def sweep(cycles: int = 2, n: int = 120) -> str:
    """A spring heated and cooled between 25 and 85 degC, with a hysteresis of 6 K, as CSV."""
    rng = np.random.default_rng(3)
    lines = ["time_s,temperature_C,force_N,displacement_mm"]
    up = np.linspace(25, 85, n)
    for cycle in range(cycles):
        for heating in (True, False):
            for i, temperature in enumerate(up if heating else up[::-1]):
                fraction = 1 / (1 + np.exp(-0.3 * (temperature - (58 if heating else 52))))
                time = 0.1 * (i + n * (2 * cycle + (not heating)))
                force = 1 + 2 * fraction + rng.normal(0, 0.01)
                stroke = 5 + 10 * fraction + rng.normal(0, 0.05)
                lines.append(f"{time:.2f},{temperature:.3f},{force:.5f},{stroke:.5f}")
    return "\n".join(lines) + "\n"


SWEEP = sweep()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.csv").write_text(SWEEP)
    (tmp_path / "campaign.toml").write_text(COLUMNS + CONDITION)
    return tmp_path


def declare(folder: Path, text: str, data: str | None = None) -> Path:
    """Write a campaign file, and its data file a.csv."""
    if data is not None:
        (folder / "a.csv").write_text(data)
    path = folder / "campaign.toml"
    path.write_text(text)
    return path


def run_of(path: Path) -> tuple[Run, tuple[Finding, ...]]:
    return read_run(read_declaration(path, None, SplitSettings()).conditions[0])


def refused(kind: type[SmaBayesError], path: Path) -> SmaBayesError:
    with pytest.raises(kind) as caught:
        read_campaign(path)
    return caught.value


class TestWays:
    def test_a_folder_a_file_and_a_single_data_file_give_the_same_records(self, folder: Path) -> None:
        by_folder = read_campaign(folder)
        by_file = read_campaign(folder / "campaign.toml")
        single = read_campaign(folder / "a.csv")
        assert [r.key for r in by_folder.records] == ["a-heating", "a-cooling"]
        assert by_folder.name == folder.name
        assert by_folder.source == by_file.source == str(folder / "campaign.toml")
        assert by_folder.sha256 == by_file.sha256 != single.sha256
        assert (single.name, single.source) == ("a", str(folder / "a.csv"))
        for one, two, three in zip(by_folder.records, by_file.records, single.records, strict=True):
            assert one.channels == two.channels == ("force",)
            assert three.channels == ("force", "displacement")
            np.testing.assert_array_equal(one.row, two.row)
            np.testing.assert_array_equal(one.temperature, three.temperature)
        assert by_folder.record("a-heating").branch is Branch.HEATING

    def test_a_single_file_says_what_was_recognised(self, folder: Path) -> None:
        path = folder / "b.csv"
        path.write_text(SWEEP.replace("force_N", "force_raw"))
        seen = {f.kind: f for f in read_campaign(path).findings}["recognised"]
        assert seen.message == (
            "known by their names: 'time_s' as time [s], 'temperature_C' as temperature [degC], "
            "'displacement_mm' as displacement [mm]; not used: 'force_raw' ('raw' is no unit of force)"
        )
        assert (seen.file, seen.condition) == ("b.csv", "b")

    @pytest.mark.parametrize(
        ("channel", "unit", "load", "reason"),
        [
            ("stress_MPa", "N", None, "the load of a specimen is a stress"),
            ("force_N", "MPa", None, "the load of a spring is a force or a mass"),
            ("stress_MPa", "MPa", 5e6, ""),
            ("force_N", "N", 5.0, ""),
        ],
    )
    def test_a_load_known_by_its_name_is_taken_in_its_own_kind_only(
        self, folder: Path, channel: str, unit: str, load: float | None, reason: str
    ) -> None:
        head, *rows = SWEEP.replace(",displacement_mm", ",note").splitlines()
        table = [head.replace("force_N", channel) + f",load_{unit}", *(row + ",5" for row in rows)]
        path = folder / "b.csv"
        path.write_text("\n".join(table))
        found = read_campaign(path)
        assert {r.condition.load for r in found.records} == {load}
        told = [f.message for f in found.findings if f.kind == "unused-column"]
        assert told == ([f"not used: 'load_{unit}' [{unit}]; {reason}"] if reason else [])

    def test_a_campaign_without_columns_knows_the_default_names_too(self, folder: Path) -> None:
        run, seen = run_of(declare(folder, CONDITION))
        assert run.columns.keys() == {"time", "temperature", "force", "displacement"}
        assert run.units["displacement"] == "m"
        assert [f.kind for f in seen] == ["recognised"]

    def test_the_data_folder_is_beside_the_campaign_declared_or_given(self, tmp_path: Path) -> None:
        (tmp_path / "data").mkdir()
        (tmp_path / "data" / "a.csv").write_text(SWEEP)
        bare = tmp_path / "bare.toml"
        bare.write_text('[campaign]\nname = "bench"\n' + COLUMNS + CONDITION)
        with pytest.raises(CampaignError, match=re.escape(f"there is no file {str(tmp_path / 'a.csv')!r}")):
            read_campaign(bare)
        given = read_campaign(bare, data_dir=tmp_path / "data")
        named = tmp_path / "named.toml"
        named.write_text('[campaign]\nname = "bench"\ndata = "data"\n' + COLUMNS + CONDITION)
        declared = read_campaign(named)
        assert (given.data_dir, declared.data_dir) == (str(tmp_path / "data"), "")
        assert given.name == declared.name == "bench"
        np.testing.assert_array_equal(given.records[0].row, declared.records[0].row)
        with pytest.raises(CampaignError, match="there is no folder"):
            read_campaign(named, data_dir=tmp_path / "nowhere")

    def test_the_digest_is_of_the_content_and_not_of_the_place(self, folder: Path, tmp_path: Path) -> None:
        def sha(path: Path) -> str:
            return digest(read_declaration(path, None, SplitSettings()))

        first = sha(folder)
        moved = tmp_path / "moved"
        moved.mkdir()
        for name in ("a.csv", "campaign.toml"):
            (moved / name).write_bytes((folder / name).read_bytes())
        assert sha(moved) == first
        (moved / "a.csv").write_text(SWEEP.replace("25.000", "25.001"))
        assert sha(moved) != first
        (moved / "a.csv").write_text(SWEEP)
        (moved / "campaign.toml").write_text(COLUMNS + CONDITION + "# a remark\n")
        assert sha(moved) != first

    def test_nothing_heavy_is_imported_with_the_package(self) -> None:
        code = (
            "import sys, sma_bayes, sma_bayes.records.campaign\n"
            "print(sorted({'pandas', 'openpyxl', 'nptdms', 'pint'} & set(sys.modules)))"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"


class TestColumns:
    def test_units_become_canonical(self, folder: Path) -> None:
        text = """
        [columns]
        time = { name = "t", unit = "min" }
        temperature = { name = "T", unit = "kelvin", sd = 0.5 }
        force = { name = "F", unit = "mN" }
        displacement = { name = "X", unit = "inch" }
        stiffness = { name = "K", unit = "N/mm" }
        current = { name = "I", unit = "mA" }
        ambient_temperature = { name = "Ta", unit = "degF" }
        cycle = { name = "N" }
        branch = { name = "b" }
        drive = { name = "u", unit = "V" }
        """
        data = "t,T,F,X,K,I,Ta,N,b,u\n1,300,1500,1,2,500,77,1,heating,5\n2,301,1600,2,3,600,77,1,Cooling,0\n"
        run, seen = run_of(declare(folder, text + CONDITION, data))
        expected = {
            "time": [60, 120],
            "temperature": [26.85, 27.85],
            "force": [1.5, 1.6],
            "displacement": [0.0254, 0.0508],
            "stiffness": [2000, 3000],
            "current": [0.5, 0.6],
            "ambient_temperature": [25, 25],
            "cycle": [1, 1],
            "branch": [1, -1],
            "drive": [5, 0],
        }
        assert run.columns.keys() == expected.keys()
        for name, values in expected.items():
            np.testing.assert_allclose(run.columns[name], values, rtol=1e-12, err_msg=name)
        assert run.units["drive"] == "V"
        assert run.units["stiffness"] == "N/m"
        assert run.temperature_sd == pytest.approx(0.5)
        assert (run.row.tolist(), run.file, run.specimen, seen) == ([2, 3], "a.csv", False, ())

    def test_a_specimen_is_kept_in_the_channels_of_a_spring(self, folder: Path) -> None:
        text = """
        [columns]
        temperature = { column = 1, unit = "degC" }
        strain = { column = 2, unit = "percent" }
        stress = { column = 3, unit = "MPa" }
        modulus = { column = 4, unit = "GPa" }
        """
        run, _ = run_of(declare(folder, text + CONDITION + "stress_MPa = 50", "20 1 50 30\n21 2 51 31\n"))
        assert run.specimen
        assert run.condition.load == 50e6
        np.testing.assert_allclose(run.columns["displacement"], [0.01, 0.02])
        np.testing.assert_allclose(run.columns["force"], [50e6, 51e6])
        np.testing.assert_allclose(run.columns["stiffness"], [30e9, 31e9])
        assert run.units == {"temperature": "degC", "displacement": "1", "force": "Pa", "stiffness": "Pa"}

    def test_arbitrary_units_are_kept(self, folder: Path) -> None:
        text = """
        [columns]
        temperature = { name = "T", unit = "arbitrary" }
        force = { name = "F", unit = "count", scale = 2, offset = 1, to = "arbitrary" }
        """
        run, _ = run_of(declare(folder, text + CONDITION, "T,F\n1,2\n3,4\n"))
        assert run.units == {"temperature": "arbitrary", "force": "arbitrary"}
        assert run.columns["temperature"].tolist() == [1, 3]
        assert run.columns["force"].tolist() == [5, 9]

    def test_a_raw_channel_and_its_uncertainty(self, folder: Path) -> None:
        text = """
        [columns]
        displacement = { name = "X", unit = "mm", offset = -5 }
        temperature = { name = "T", unit = "V", scale = 100, offset = -20, to = "degF", sd = 1.8 }
        [columns.force]
        name = "F"
        unit = "V"
        scale = -12.5
        offset = 300
        to = "mN"
        scale_sd = 0.25
        offset_sd = 10
        """
        run, _ = run_of(declare(folder, text + CONDITION, "T,F,X\n1,2,3\n2,4,6\n"))
        np.testing.assert_allclose(run.columns["temperature"], (np.array([80, 180]) - 32) / 1.8)
        assert run.temperature_sd == pytest.approx(1.0)
        np.testing.assert_allclose(run.columns["force"], [0.275, 0.25])
        np.testing.assert_allclose(run.columns["displacement"], [-0.002, 0.001])
        assert run.calibration.keys() == {"force"}
        seen = run.calibration["force"]
        assert (seen.relative_scale_sd, seen.offset, seen.offset_sd) == pytest.approx((0.02, 0.3, 0.01))

    def test_the_errors_of_a_thermometer_are_those_of_its_canonical_unit(self, folder: Path) -> None:
        """An offset in K is one in degF over 1.8; at 0 degF, where scale and offset err apart, it is -17.8 degC."""
        text = """
        [columns]
        temperature = { name = "T", unit = "degF", offset_sd = 0.9, scale_sd = 0.01 }
        force = { name = "F", unit = "N" }
        """
        run, _ = run_of(declare(folder, text + CONDITION, "T,F\n80,2\n180,4\n"))
        seen = run.calibration["temperature"]
        assert (seen.relative_scale_sd, seen.offset, seen.offset_sd) == pytest.approx((0.01, -32 / 1.8, 0.5))
        assert run.temperature_sd == 0.0

    def test_a_reference_reading_makes_the_errors_of_a_fitted_line_independent(self, folder: Path) -> None:
        """The declared numbers give back the error of a least-squares line, covariance included."""
        rng = np.random.default_rng(5)
        raw = rng.uniform(700, 1000, 27)
        design = np.column_stack([np.ones_like(raw), raw])
        truth = 9.6 - 0.0087 * raw + rng.normal(0, 0.5, 27)
        (offset, scale), rss, *_ = np.linalg.lstsq(design, truth)
        covariance = np.linalg.inv(design.T @ design) * rss / 25
        text = f"""
        [columns]
        temperature = {{ name = "T", unit = "degC" }}
        force = {{ name = "F", unit = "count", scale = {scale}, offset = {offset}, to = "mN",
                  scale_sd = {covariance[1, 1] ** 0.5}, offset_sd = {float(np.sqrt(rss[0] / 25 / 27))},
                  reference = {raw.mean()} }}
        """
        data = "T,F\n" + "".join(f"{i},{700 + 30 * i}\n" for i in range(10))
        run, _ = run_of(
            declare(folder, text.replace(",\n", ", ").replace("                  ", "") + CONDITION, data)
        )
        calibration: Calibration = run.calibration["force"]
        force = run.columns["force"]
        points = np.column_stack([np.ones(10), 700 + 30 * np.arange(10)])
        expected = 1e-6 * np.einsum("ni,ij,nj->n", points, covariance, points)
        variance = (
            calibration.offset_sd**2 + (calibration.relative_scale_sd * (force - calibration.offset)) ** 2
        )
        np.testing.assert_allclose(variance, expected, rtol=1e-9)

    def test_time_from_the_row_or_from_a_sample_count(self, folder: Path) -> None:
        columns = (
            '[columns]\ntemperature = { column = 2, unit = "degC" }\nforce = { column = 3, unit = "N" }\n'
        )
        data = "10 20 1\n11 21 2\n12 22 3\n"
        for time in (
            '{ row_interval = 0.5, unit = "min" }',
            '{ column = 1, unit = "1", scale = 0.5, to = "min" }',
        ):
            run, _ = run_of(declare(folder, f"{columns}time = {time}\n" + CONDITION, data))
            np.testing.assert_allclose(run.columns["time"] - run.columns["time"][0], [0, 30, 60])

    def test_missing_codes_and_valid_limits_of_one_column(self, folder: Path) -> None:
        text = """
        [reading]
        missing = ["ERR"]
        [columns]
        temperature = { name = "T", unit = "degC", missing = [0.0] }
        force = { name = "F", unit = "N", valid = [0, 10] }
        """
        data = "T,F\n0.0,0\n21,0.0\n22,ERR\n23,10\n24,10.5\n25,-1\n"
        run, seen = run_of(declare(folder, text + CONDITION, data))
        np.testing.assert_array_equal(run.columns["temperature"], [np.nan, 21, 22, 23, 24, 25])
        np.testing.assert_array_equal(run.columns["force"], [0, 0, np.nan, 10, np.nan, np.nan])
        assert [(f.kind, f.column, f.rows, f.condition, f.file) for f in seen] == [
            ("missing-code", "T", (2,), "a", "a.csv"),
            ("missing-code", "F", (4,), "a", "a.csv"),
            ("out-of-range", "F", (6, 7), "a", "a.csv"),
        ]

    def test_a_condition_may_have_columns_reading_and_segmentation_of_its_own(self, folder: Path) -> None:
        (folder / "b.txt").write_text("20;1,5\n21;2,5\n22;3,5\n")
        text = (
            "[segmentation]\nmax_samples = 50\n"
            + COLUMNS
            + CONDITION
            + """
            [[condition]]
            id = "b"
            file = "b.txt"
            reading = { decimal = ",", last_row = 2 }
            segmentation.max_samples = 70
            [condition.columns]
            time = { row_interval = 1, unit = "s" }
            temperature = { column = 1, unit = "degC" }
            force = { column = 2, unit = "N" }
            """
        )
        first, second = read_declaration(declare(folder, text), None, SplitSettings()).conditions
        assert (first.settings.max_samples, second.settings.max_samples) == (50, 70)
        run, seen = read_run(second)
        assert run.columns["force"].tolist() == [1.5, 2.5]
        assert [(f.kind, f.dropped) for f in seen] == [("cut", 1)]
        assert read_run(first)[0].n == 480

    def test_limits_of_time_cut_rows_and_say_so(self, folder: Path) -> None:
        text = COLUMNS + "[segmentation]\ntime_from = 1.0\ntime_to = 46.95\n" + CONDITION
        run, seen = run_of(declare(folder, text))
        assert (run.columns["time"].min(), run.columns["time"].max()) == (1.0, 46.9)
        assert [(f.kind, f.count, f.dropped) for f in seen] == [("cut", 20, 20)]
        assert seen[0].rows == tuple(range(2, 12))


class TestConditions:
    @pytest.mark.parametrize(
        ("declared", "attribute", "value"),
        [
            ("current_A = 2.0", "current", 2.0),
            ("load_g = 150", "load", 0.150 * STANDARD_GRAVITY),
            ("load_N = 1.5", "load", 1.5),
            ("frequency_mHz = 10", "frequency", 0.010),
            ("frequency_Hz = 0.2", "frequency", 0.2),
            ("duty_cycle_pct = 50", "duty_cycle", 0.5),
        ],
    )
    def test_what_was_set_on_the_rig(self, folder: Path, declared: str, attribute: str, value: float) -> None:
        run, _ = run_of(declare(folder, COLUMNS + CONDITION + declared))
        assert getattr(run.condition, attribute) == pytest.approx(value, rel=1e-15)

    @pytest.mark.parametrize(
        ("declared", "key", "expected"),
        [
            ("load_g = 1\nload_N = 2", "condition 'a'", "one of load_g, load_N, stress_MPa"),
            ("frequency_mHz = 1\nfrequency_Hz = 2", "condition 'a'", "one of frequency_mHz, frequency_Hz"),
            ("duty_cycle_pct = 120", "condition 'a'.duty_cycle_pct", "less than or equal to 100"),
            ("load_g = -1", "condition 'a'.load_g", "greater than or equal to 0"),
            ("load_kg = 1", "condition 'a'.load_kg", "did you mean 'load_g'"),
            ('current_A = "2 A"', "condition 'a'.current_A", "a valid number"),
            ("current_A = nan", "condition 'a'.current_A", "a finite number"),
        ],
    )
    def test_wrong_settings(self, folder: Path, declared: str, key: str, expected: str) -> None:
        error = refused(CampaignError, declare(folder, COLUMNS + CONDITION + declared))
        assert (error.file, error.column) == (str(folder / "campaign.toml"), key)
        assert expected in str(error.expected)

    def test_a_load_of_the_wrong_kind(self, folder: Path) -> None:
        error = refused(CampaignError, declare(folder, COLUMNS + CONDITION + "stress_MPa = 50"))
        assert error.expected == "load_g or load_N, because force, displacement or stiffness were measured"
        specimen = COLUMNS.replace("force =", "stress =").replace('"N"', '"MPa"')
        error = refused(CampaignError, declare(folder, specimen + CONDITION + "load_g = 50"))
        assert error.expected == "stress_MPa, because stress, strain or modulus of a specimen were measured"

    @pytest.mark.parametrize(
        "name", ["", "a/b", "50 MPa?", "..", " a", "a.", "con", "LPT1.x", "x" * 81, "a\\tb"]
    )
    def test_an_id_that_cannot_name_a_file(self, folder: Path, name: str) -> None:
        error = refused(CampaignError, declare(folder, COLUMNS + CONDITION.replace('"a"', f'"{name}"')))
        assert "an id that can stand in a file name" in str(error.expected)

    @pytest.mark.parametrize(("second", "how"), [("a", ""), ("A", ", which differs from 'a' only by case")])
    def test_equal_ids(self, folder: Path, second: str, how: str) -> None:
        again = CONDITION.replace('id = "a"', f'id = "{second}"')
        error = refused(CampaignError, declare(folder, COLUMNS + CONDITION + again))
        assert error.found == f"two conditions have the id {second!r}{how}"


class TestMistakes:
    """Each is told with the file, the key, what was found, what was expected."""

    @pytest.mark.parametrize(
        ("text", "key", "found", "expected"),
        [
            ("[colums]\n", "colums", "unknown key 'colums'", "did you mean 'columns'"),
            ('[campaign]\nnme = "x"\n', "campaign.nme", "unknown key 'nme'", "did you mean 'name'"),
            ("[columns]\nforse = { }\n", "columns.forse", "unknown quantity 'forse'", "did you mean 'force'"),
            ('[columns]\nforce = "F"\n', "columns.force", 'found "F"', "a table such as"),
            ('[columns]\nforce = { name = "F" }\n', "columns.force", "no unit", 'unit = "N"'),
            (
                '[columns]\nforce = { name = "F", unt = "N" }\n',
                "columns.force.unt",
                "unknown key 'unt'",
                "did you mean 'unit'",
            ),
            (
                '[columns]\nforce = { name = "F", column = 2, unit = "N" }\n',
                "columns.force",
                'found { name = "F", column = 2, unit = "N" }',
                "exactly one of name, column, row_interval",
            ),
            (
                '[columns]\nforce = { column = 0, unit = "N" }\n',
                "columns.force.column",
                "found 0",
                "greater than or equal to 1",
            ),
            (
                '[columns]\nforce = { name = "F", unit = "V", to = "N" }\n',
                "columns.force",
                'found { name = "F", unit = "V", to = "N" }',
                "a scale or an offset beside `to`",
            ),
            (
                '[columns]\nforce = { name = "F", unit = "N", valid = [5, 1] }\n',
                "columns.force",
                'found { name = "F", unit = "N", valid = [5, 1] }',
                "low below high",
            ),
            (
                '[columns]\nforce = { name = "F", unit = "N", sd = 1 }\n',
                "columns.force",
                "sd",
                "temperature only",
            ),
            (
                '[columns]\ntime = { name = "t", unit = "s", offset_sd = 1 }\n',
                "columns.time",
                "scale_sd or offset_sd",
                "these for temperature, force",
            ),
            (
                '[columns]\nforce = { row_interval = 1, unit = "N" }\n',
                "columns.force",
                "row_interval",
                "for time only",
            ),
            (
                '[columns]\nforce = { name = "F", unit = "N" }\n',
                "columns",
                "the temperature is not declared",
                "temperature and at least one of force",
            ),
            (
                '[columns]\ntemperature = { name = "T", unit = "degC" }\n',
                "columns",
                "a channel is not declared",
                "temperature and at least one of force",
            ),
            (
                COLUMNS + 'strain = { name = "e", unit = "1" }\n',
                "columns",
                "force, strain are declared together",
                "of a spring, or stress, strain, modulus of a specimen",
            ),
            (
                "[reading]\nskiprows = 2\n",
                "reading.skiprows",
                "unknown key 'skiprows'",
                "did you mean 'skip_rows'",
            ),
            (
                "[segmentation]\nmax_sample = 2\n",
                "segmentation.max_sample",
                "unknown key 'max_sample'",
                "did you mean 'max_samples'",
            ),
            ("[segmentation]\nmax_samples = 2\n", "segmentation", "max_samples is 2", "10 or more"),
            (
                '[segmentation]\nmax_samples = "many"\n',
                "segmentation.max_samples",
                'found "many"',
                "a valid integer",
            ),
            ('[segmentation]\ntime_to = "1 h"\n', "segmentation.time_to", 'found "1 h"', "a valid number"),
        ],
    )
    def test_in_the_campaign_file(self, folder: Path, text: str, key: str, found: str, expected: str) -> None:
        path = declare(folder, text + CONDITION)
        error = refused(CampaignError, path)
        assert (error.file, error.column, error.found) == (str(path), key, found)
        assert expected in str(error.expected)

    def test_a_condition_without_its_file_or_id(self, folder: Path) -> None:
        error = refused(CampaignError, declare(folder, COLUMNS + '[[condition]]\nid = "a"\n'))
        assert (error.column, error.found) == ("condition 'a'.file", "the key 'file' is not there")
        error = refused(CampaignError, declare(folder, COLUMNS + '[[condition]]\nfile = "a.csv"\n'))
        assert (error.column, error.found) == ("condition 1.id", "the key 'id' is not there")

    def test_no_condition(self, folder: Path) -> None:
        assert refused(CampaignError, declare(folder, COLUMNS)).found == "no condition is declared"

    @pytest.mark.parametrize(
        ("text", "row"),
        [("[campaign]\nname = bench\n", 2), ("[columns\n", 1), ("[[condition]]\nid = 'a'\nid = 'b'\n", 3)],
    )
    def test_a_slip_in_toml_is_told_with_its_line(self, folder: Path, text: str, row: int) -> None:
        error = refused(CampaignError, declare(folder, text))
        assert (error.file, error.row) == (str(folder / "campaign.toml"), row)

    def test_a_campaign_file_that_is_not_utf8(self, folder: Path) -> None:
        (folder / "campaign.toml").write_bytes('[campaign]\nname = "Prüfstand"\n'.encode("latin-1"))
        error = refused(CampaignError, folder)
        assert (error.found, error.row) == ("the file is not UTF-8", 2)

    def test_a_place_where_nothing_is(self, folder: Path) -> None:
        error = refused(CampaignError, folder / "campain.toml")
        assert (error.found, error.remedy) == (
            "there is no such file or folder",
            "did you mean 'campaign.toml'?",
        )
        (folder / "campaign.toml").unlink()
        error = refused(CampaignError, folder)
        assert error.found == "the folder has no campaign.toml"
        assert "a.csv" in str(error.remedy)

    def test_a_data_file_that_is_not_there(self, folder: Path) -> None:
        error = refused(CampaignError, declare(folder, COLUMNS + CONDITION.replace("a.csv", "A1.csv")))
        assert error.column == "condition 'a'.file"
        assert str(folder / "A1.csv") in error.found
        assert "'a.csv'" in str(error.remedy)
        for i in range(20):
            (folder / f"run{i:02}.dat").touch()
        error = refused(CampaignError, declare(folder, COLUMNS + CONDITION.replace("a.csv", "Q")))
        assert str(error.remedy).startswith(
            f"the folder {str(folder)!r} holds a.csv, campaign.toml, run00.dat"
        )
        assert str(error.remedy).endswith("run07.dat and 12 more")
        (folder / RUN_MARKER).touch()
        error = refused(CampaignError, declare(folder, COLUMNS + CONDITION.replace("a.csv", "Q")))
        assert "is what a run has written; name the folder of the measurements" in str(error.remedy)

    def test_a_column_that_is_not_there(self, folder: Path) -> None:
        error = refused(CampaignError, declare(folder, COLUMNS.replace('"force_N"', '"Force_N"') + CONDITION))
        assert (error.column, error.found) == ("columns.force", "'a.csv' has no column 'Force_N'")
        assert error.expected == "did you mean 'force_N'?"
        assert "'time_s', 'temperature_C', 'force_N', 'displacement_mm'" in str(error.remedy)

    def test_a_column_number_beyond_the_last(self, folder: Path) -> None:
        text = COLUMNS.replace('name = "force_N"', "column = 7") + CONDITION
        error = refused(CampaignError, declare(folder, text))
        assert error.found == "'a.csv' has no column 7"
        assert "a number from 1 to 4" in str(error.expected)

    def test_a_name_without_a_header(self, folder: Path) -> None:
        text = '[columns]\ntemperature = { column = 1, unit = "degC" }\nforce = { name = "F", unit = "N" }\n'
        error = refused(CampaignError, declare(folder, text + CONDITION, "1 2\n3 4\n"))
        assert error.found == "'a.csv' has no header, so no column 'F'"
        assert "header = true" in str(error.remedy)

    def test_a_header_that_occurs_twice(self, folder: Path) -> None:
        text = '[columns]\ntemperature = { name = "T", unit = "degC" }\nforce = { name = "F", unit = "N" }\n'
        error = refused(CampaignError, declare(folder, text + CONDITION, "T,F,F\n1,2,3\n4,5,6\n"))
        assert error.found == "'a.csv' has 2 columns called 'F'"
        assert error.remedy == "give the column by its number: 2 and 3"

    @pytest.mark.parametrize(
        ("unit", "found"),
        [
            ("mm", "unit 'mm' of force is of the wrong kind"),
            ("Newtn", "unit 'Newtn' of force is not known"),
        ],
    )
    def test_a_unit_that_does_not_fit(self, folder: Path, unit: str, found: str) -> None:
        error = refused(QuantityError, declare(folder, COLUMNS.replace('"N"', f'"{unit}"') + CONDITION))
        assert (error.file, error.column, error.found) == (
            str(folder / "campaign.toml"),
            "columns.force.unit",
            found,
        )

    def test_text_in_a_number_column(self, folder: Path) -> None:
        data = SWEEP.replace("time_s", "time_s", 1).splitlines()
        data[41] = data[41].rsplit(",", 2)[0] + ",oops,1.0"
        error = refused(MeasurementError, declare(folder, COLUMNS + CONDITION, "\n".join(data)))
        assert (error.file, error.row, error.column) == (str(folder / "a.csv"), 42, "force_N")
        assert (error.found, error.expected) == ("found 'oops'", "a number")

    def test_a_branch_that_is_neither(self, folder: Path) -> None:
        text = COLUMNS.replace("time = { name", "branch = { name").replace('"s"', '"1"') + CONDITION
        head = "time_s,temperature_C,force_N\n"
        error = refused(MeasurementError, declare(folder, text, head + "heating,1,2\nup,3,4\n"))
        assert (error.row, error.found, error.expected) == (3, "found 'up'", "heating or cooling, or 1 or -1")
        error = refused(MeasurementError, declare(folder, text, head + "1,1,2\n-1,3,4\n2,3,4\n"))
        assert (error.row, error.found, error.expected) == (4, "found 2", "heating or cooling, or 1 or -1")

    def test_an_empty_data_file(self, folder: Path) -> None:
        error = refused(MeasurementError, declare(folder, COLUMNS + CONDITION, ""))
        assert (error.file, error.found) == (str(folder / "a.csv"), "the file is empty")

    def test_nan_and_inf_are_refused_unless_declared(self, folder: Path) -> None:
        lines = SWEEP.splitlines()
        for row, word in ((10, "nan"), (20, "inf"), (30, "-inf"), (40, "")):
            time, temperature, _, stroke = lines[row - 1].split(",")
            lines[row - 1] = f"{time},{temperature},{word},{stroke}"
        text = "\n".join(lines) + "\n"
        error = refused(MeasurementError, declare(folder, COLUMNS + CONDITION, text))
        assert (error.row, error.found) == (10, "found 'nan' (and 2 more in this column)")
        codes = '[reading]\nmissing = ["nan", inf, -inf]\n'
        campaign = read_campaign(declare(folder, COLUMNS + codes + CONDITION, text))
        seen = {f.kind: f for f in campaign.findings}
        assert seen["missing-code"].rows == (10, 20, 30)
        assert seen["empty"].rows == (40,)
        assert all(np.isfinite(r.observed["force"]).all() for r in campaign.records)
        kept = np.concatenate([r.row for r in campaign.records])
        assert not {10, 20, 30, 40} & set(kept.tolist())

    def test_limits_of_time_need_a_time_and_must_leave_something(self, folder: Path) -> None:
        limits = "[segmentation]\ntime_from = 1e6\n"
        error = refused(MeasurementError, declare(folder, COLUMNS + limits + CONDITION))
        assert error.expected == "limits within 0 s to 47.9 s"
        without = COLUMNS.replace('time = { name = "time_s", unit = "s" }', "")
        error = refused(CampaignError, declare(folder, without + limits + CONDITION))
        assert error.expected == "a column of time"

    def test_columns_of_different_lengths(self, tmp_path: Path) -> None:
        import scipy.io

        scipy.io.savemat(tmp_path / "a.mat", {"T": np.arange(9.0), "F": np.arange(5.0)})
        text = '[columns]\ntemperature = { name = "T", unit = "degC" }\nforce = { name = "F", unit = "N" }\n'
        error = refused(MeasurementError, declare(tmp_path, text + CONDITION.replace("a.csv", "a.mat")))
        assert error.found == "columns of different lengths: temperature 9, force 5"

    def test_a_single_file_whose_names_say_nothing(self, folder: Path) -> None:
        path = folder / "b.csv"
        path.write_text("T,F\n1,2\n3,4\n")
        error = refused(CampaignError, path)
        assert error.found == "the temperature is not among the columns"
        assert "the file has 'T', 'F'" in str(error.expected)
        path.write_text("temperature_C,strain,force_mm\n1,2,3\n4,5,6\n")
        error = refused(CampaignError, path)
        assert error.found == "a channel is not among the columns"
        assert "'temperature_C', 'strain' (which unit?), 'force_mm' ('mm' is no unit of force)" in str(
            error.expected
        )
        assert "write the unit behind the name, as in force_N or strain_percent ('strain')" in str(
            error.remedy
        )
        path.write_text("time,temperature_C,note\n10:00:01,2,3\n10:00:02,5,6\n")
        error = refused(CampaignError, path)
        assert "the file has 'time', 'temperature_C', 'note'" in str(error.expected)
        assert "write the unit" not in str(error.remedy)  # a clock has one
        path.write_text("temperature_C,temperature_K,force_N\n1,2,3\n4,5,6\n")
        error = refused(CampaignError, path)
        assert error.found == "the columns 'temperature_C' and 'temperature_K' are both a temperature"


class TestExamples:
    """The worked examples read the data they were written for."""

    EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"

    def runs(self, shared_data: Path, name: str) -> dict[str, tuple[Run, tuple[Finding, ...]]]:
        declaration = read_declaration(self.EXAMPLES / f"{name}.toml", shared_data / name, SplitSettings())
        return {c.table.id: read_run(c) for c in declaration.conditions}

    def test_each_example_gives_records(self, shared_data: Path) -> None:
        names = sorted(path.stem for path in self.EXAMPLES.glob("*.toml"))
        assert len(names) == 7
        for name in names:
            campaign = read_campaign(self.EXAMPLES / f"{name}.toml", data_dir=shared_data / name)
            declared = read_declaration(self.EXAMPLES / f"{name}.toml", shared_data / name, SplitSettings())
            ids = {c.table.id for c in declared.conditions}
            assert {r.condition.id for r in campaign.records} == ids, name
            assert all(r.n >= 15 for r in campaign.records), name
            assert re.fullmatch("[0-9a-f]{64}", campaign.sha256)

    def test_guarneros(self, shared_data: Path) -> None:
        runs = self.runs(shared_data, "guarneros_spring_force")
        stray = {
            name: sum(f.count for f in seen if f.kind == "out-of-range") for name, (_, seen) in runs.items()
        }
        assert stray == {"AB0": 32, "AB1": 25, "AB2": 35, "AB3": 34}
        run, _ = runs["AB0"]
        assert run.n == 30_000
        assert run.columns["force"][0] == pytest.approx(9.586899 - 2.1 - 0.008694436 * 797)
        np.testing.assert_allclose(np.diff(run.columns["time"]), 0.01, rtol=1e-9)
        assert np.nanmax(run.columns["drive"]) == 25

    def test_the_declared_calibration_of_guarneros_is_the_least_squares_line(self, shared_data: Path) -> None:
        pairs = np.loadtxt(
            shared_data / "guarneros_spring_force" / "force_calibration_points.csv", delimiter=",", skiprows=1
        )
        force, counts = pairs.T
        slope, intercept = np.polyfit(counts, force, 1)
        s = np.sqrt(((force - intercept - slope * counts) ** 2).sum() / (len(force) - 2))
        declared = read_declaration(
            self.EXAMPLES / "guarneros_spring_force.toml",
            shared_data / "guarneros_spring_force",
            SplitSettings(),
        )
        (column,) = declared.conditions[0].columns["force"]
        assert column.scale == pytest.approx(slope, rel=1e-6)
        assert column.offset == pytest.approx(intercept - 2.1, abs=1e-6)
        assert column.reference == pytest.approx(counts.mean(), abs=0.05)
        assert column.scale_sd == pytest.approx(s / np.sqrt(((counts - counts.mean()) ** 2).sum()), rel=1e-3)
        assert column.offset_sd == pytest.approx(s / np.sqrt(len(force)), rel=1e-3)

    def test_isobaric_files(self, shared_data: Path) -> None:
        run, _ = self.runs(shared_data, "flexinol_isobaric")["200MPa"]
        assert (run.n, run.specimen, run.condition.load) == (499, True, 200e6)
        assert run.columns["force"].mean() == pytest.approx(200e6, rel=0.01)
        assert run.columns["displacement"].max() == pytest.approx(0.0456, abs=1e-4)
        run, _ = self.runs(shared_data, "smareact_nitico_isobaric")["7MPa"]
        assert (run.n, run.condition.load) == (351, 7e6)
        run, _ = self.runs(shared_data, "nitihf_sparse_isobaric")["300MPa"]
        assert (run.n, run.columns["displacement"].max()) == (55, pytest.approx(0.0468221))

    def test_seven_cycles(self, shared_data: Path) -> None:
        run, seen = self.runs(shared_data, "smareact_isobaric_7cycle")["1096N"]
        assert {f.kind: f.count for f in seen} == {"preamble": 3, "missing-code": 10, "cut": 568}
        assert run.columns["time"][0] == pytest.approx(0.201 * 3600)
        assert run.n == 1176 - 568
        assert run.columns["displacement"].max() == pytest.approx(0.026373)

    def test_load_frame(self, shared_data: Path) -> None:
        runs = self.runs(shared_data, "niti_raw_isobaric")
        run, seen = runs["80MPa"]
        assert {f.kind: f.count for f in seen} == {"cut": 127, "missing-code": 22}
        assert run.columns["force"].min() > 74
        run, seen = runs["100MPa"]
        assert {f.kind: f.count for f in seen} == {"missing-code": 52}
        assert run.columns["displacement"][0] == pytest.approx(0.0362 * 0.0254)

    def test_wire_in_water(self, shared_data: Path) -> None:
        runs = self.runs(shared_data, "wire_in_water")
        assert {r.units["displacement"] for name, (r, _) in runs.items() if name[:3] == "hyd"} == {
            "arbitrary"
        }
        run, seen = runs["ele_hys_4"]
        assert run.temperature_sd == 0.0
        assert run.calibration["temperature"].offset_sd == 3.0
        assert [(f.kind, f.count) for f in seen] == [("out-of-range", 58)]
        assert run.columns["time"][-1] == pytest.approx(47.9)
        run, _ = runs["hyd_stp_1_cold"]
        assert run.row[[0, -1]].tolist() == [3120, 3225]
