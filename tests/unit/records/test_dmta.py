"""Exports of dynamic mechanical analysis: names, units and layout of each instrument, and input that can't be used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from sma_bayes.errors import MeasurementError, QuantityError, SmaBayesError
from sma_bayes.records.dmta import DmtaCampaign, DmtaOptions, read_dmta
from sma_bayes.records.types import Branch

T = np.concatenate([np.arange(0.0, 100.0, 2.0), np.arange(100.0, 0.0, -2.0)])
"""One heating and one cooling [degC]."""


def storage(t: np.ndarray, frequency: float = 1.0) -> np.ndarray:
    """[Pa]"""
    return 30e9 + 40e9 / (1.0 + np.exp(-0.2 * (t - 50.0 - 3.0 * np.log10(frequency))))


def loss(t: np.ndarray) -> np.ndarray:
    """[Pa]"""
    return 0.4e9 + 1e9 * np.exp(-0.5 * ((t - 50.0) / 8.0) ** 2)


def rows(
    *columns: Callable[[np.ndarray], np.ndarray], frequencies: Sequence[float] = (1.0,), delimiter: str = ","
) -> list[str]:
    return [
        delimiter.join(f"{c(np.array([t]))[0] if c is not None else f:.6g}" for c in columns)
        for t in T
        for f in frequencies
    ]


def ident(t: np.ndarray) -> np.ndarray:
    return t


def in_mpa(f: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda t: f(t) / 1e6


def tan(t: np.ndarray) -> np.ndarray:
    return loss(t) / storage(t)


def write(path: Path, lines: Sequence[str], encoding: str = "utf-8") -> Path:
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def require_known(found: DmtaCampaign, *, frequency: float | None = 1.0) -> None:
    """Both branches with both moduli, in canonical units."""
    assert [s.branch for s in found.sweeps] == [Branch.HEATING, Branch.COOLING]
    for s in found.sweeps:
        assert s.frequency == frequency
        np.testing.assert_allclose(s.storage.observed["stiffness"], storage(s.storage.temperature), rtol=1e-5)
        assert s.loss is not None
        np.testing.assert_allclose(s.loss.observed["stiffness"], loss(s.loss.temperature), rtol=1e-5)
        assert s.storage.units["stiffness"] == "Pa"
        assert s.storage.specimen


def test_trios_has_a_row_of_units_below_the_names(tmp_path: Path) -> None:
    head = ["Filename,strip.tri", "Instrument,DMA850", "Temperature ramp",
            "Temperature,Storage modulus,Loss modulus,Tan(delta),Frequency", "°C,MPa,MPa,,Hz"]  # fmt: skip
    path = write(tmp_path / "strip.csv", [*head, *rows(ident, in_mpa(storage), in_mpa(loss), tan, None)])
    found = read_dmta([path])
    require_known(found)
    assert [s.id for s in found.sweeps] == ["strip-1Hz-heating", "strip-1Hz-cooling"]
    damping = found.sweeps[0].damping
    assert damping is not None
    assert damping.compared == T.size
    assert damping.disagree == 0


def test_trios_steps_are_tests_of_their_own(tmp_path: Path) -> None:
    half = T.size // 2
    body = rows(ident, in_mpa(storage), in_mpa(loss), None, delimiter="\t")
    step = ["Temperature\tStorage modulus\tLoss modulus\tFrequency", "°C\tMPa\tMPa\tHz"]
    lines = ["Filename\tstrip.tri", "[step]", "Conditioning", "Time\tForce", "s\tN", "1\t2",
             "[step]", "Ramp up", *step, *body[:half], "", "[step]", "Ramp down", *step, *body[half:]]  # fmt: skip
    found = read_dmta([write(tmp_path / "strip.txt", lines)])
    assert [s.id for s in found.sweeps] == ["strip-Ramp_up-1Hz-heating", "strip-Ramp_down-1Hz-cooling"]
    assert found.left_out == ("strip-Conditioning: no table of temperature and storage modulus",)
    assert "one-branch" not in {f.kind for f in found.findings}  # each ramp is a step


def test_universal_analysis_numbers_its_signals_above_the_data(tmp_path: Path) -> None:
    signals = ("Temperature (°C)", "Storage Modulus (MPa)", "Loss Modulus (MPa)", "Frequency (Hz)")
    head = ["Version\tpublic", "Instrument\tDMA Q800", "Nsig\t4"]
    head += [*(f"Sig{i}\t{name}" for i, name in enumerate(signals, start=1)), "StartOfData"]
    body = rows(ident, in_mpa(storage), in_mpa(loss), None, delimiter="\t")
    require_known(read_dmta([write(tmp_path / "q800.txt", [*head, *body], "utf-16")]))
    found = read_dmta([write(tmp_path / "q800.txt", [*head, *body], "cp1252")])
    require_known(found)
    assert "encoding" in {f.kind for f in found.findings}


def test_universal_analysis_states_the_size_and_marks_events(tmp_path: Path) -> None:
    """Settings are sentences with numbers among them, and rows of codes stand between the readings."""
    signals = (
        "Time (min)",
        "Temperature (°C)",
        "Storage Modulus (MPa)",
        "Loss Modulus (MPa)",
        "Frequency (Hz)",
        "Amplitude (µm)",
    )
    head = ["CLOSED\t1", "Run\t1", "Size\t17.5000 x 5.0000 x 0.5000 mm", "Nsig\t6"]
    head += [*(f"Sig{i}\t{name}" for i, name in enumerate(signals, start=1))]
    head += ["OrgMethod\t1: Equilibrate at 20.00 °C", "StartOfData"]
    body = [
        f"{i / 60:.5f}\t{row}\t15.0"
        for i, row in enumerate(rows(ident, in_mpa(storage), in_mpa(loss), None, delimiter="\t"))
    ]
    marked = ["-2.00000" + "\t0.00000" * 5, *body[:20], "\t".join(["-3.00000"] * 6), *body[20:]]
    found = read_dmta([write(tmp_path / "q800.txt", [*head, *marked], "utf-16")])
    require_known(found)
    (marks,) = [f for f in found.findings if f.kind == "marker"]
    assert marks.message == "2 rows that mark an event, left out"
    assert list(marks.rows) == [len(head) + 1, len(head) + 22]


def test_a_negative_time_of_other_programs_is_no_mark(tmp_path: Path) -> None:
    head = ["time_s,temperature_C,storage_modulus_MPa,loss_modulus_MPa,frequency_Hz"]
    body = [f"{i - 3},{row}" for i, row in enumerate(rows(ident, in_mpa(storage), in_mpa(loss), None))]
    found = read_dmta([write(tmp_path / "own.csv", [*head, *body])])
    require_known(found)
    assert "marker" not in {f.kind for f in found.findings}


def test_proteus_states_unit_and_frequency_in_the_name(tmp_path: Path) -> None:
    head = [
        "#INSTRUMENT:;NETZSCH DMA 242",
        "##Temp./°C;E'(1.000 Hz)/MPa;E''(1.000 Hz)/MPa;E'(10.00 Hz)/MPa;E''(10.00 Hz)/MPa",
    ]
    body = rows(
        ident, in_mpa(storage), in_mpa(loss), in_mpa(lambda t: storage(t, 10.0)), in_mpa(loss), delimiter=";"
    )
    found = read_dmta([write(tmp_path / "netzsch.csv", [*head, *body])])
    assert [(s.frequency, s.branch.value) for s in found.sweeps] == [
        (1.0, "heating"), (1.0, "cooling"), (10.0, "heating"), (10.0, "cooling"),
    ]  # fmt: skip
    ten = found.sweeps[2].storage
    np.testing.assert_allclose(ten.observed["stiffness"], storage(ten.temperature, 10.0), rtol=1e-5)


@pytest.mark.parametrize(("delimiter", "decimal"), [(";", ","), ("\t", ".")])
def test_proteus_writes_what_it_measured_above_the_names(
    tmp_path: Path, delimiter: str, decimal: str
) -> None:
    """A line for each setting, padded with blanks, some with a number; Western Windows text."""
    settings = {
        "#EXPORTTYPE:": "DATA ALL", "#FILE:": "strip.ngb-dm2", "#FORMAT:": "NETZSCH5", "#FTYPE:": "ANSI",
        "#IDENTITY:": "1", "#DECIMAL:": "COMMA" if decimal == "," else "POINT",
        "#SEPARATOR:": "SEMICOLON" if delimiter == ";" else "TAB", "#MTYPE:": "DMA",
        "#INSTRUMENT:": "NETZSCH DMA 242 E Artemis", "#SEG. 1:": "0.0°C/2.0(K/min)/100.0°C",
        "#SAMPLE LENGTH /mm:": f"10{decimal}000",
    }  # fmt: skip
    head = [f"{key:<20}{delimiter}{value:<30}{2 * delimiter}" for key, value in settings.items()]
    frequency = f"1{decimal}000 Hz"
    names = ["##Temp./°C", f"E'({frequency})/MPa", f"E''({frequency})/MPa", f"tan d({frequency})"]
    body = [
        r.replace(".", decimal) for r in rows(ident, in_mpa(storage), in_mpa(loss), tan, delimiter=delimiter)
    ]
    lines = [*head, "", delimiter.join(names), *body]
    require_known(read_dmta([write(tmp_path / "netzsch.csv", lines, "cp1252")]))


@pytest.mark.parametrize(("encoding", "delimiter"), [("utf-16", "\t"), ("utf-8-sig", ";")])
def test_rheocompass_writes_the_names_of_each_interval_anew(
    tmp_path: Path, encoding: str, delimiter: str
) -> None:
    """An interval for each branch; names, an empty line, units in brackets, and an empty cell before each row."""
    names = [
        "Interval data:",
        "Point No.",
        "Temperature",
        "Storage Modulus",
        "Loss Modulus",
        "Frequency",
        "Status",
    ]
    units = ["", "", "[°C]", "[MPa]", "[MPa]", "[Hz]", ""]
    half = T.size // 2
    body = [
        delimiter.join(["", str(i % half + 1), r.replace(".", ","), "Dy_auto"])
        for i, r in enumerate(rows(ident, in_mpa(storage), in_mpa(loss), None, delimiter=delimiter))
    ]
    part = [delimiter.join(names), 6 * delimiter, delimiter.join(units)]
    head = [f"Project:{delimiter}NiTi", f"Test:{delimiter}strip 1", "",
            delimiter.join(["Interval and data points:", "2", "50", "50"])]  # fmt: skip
    lines = [*head, *part, *body[:half], "", *part, *body[half:], ""]
    found = read_dmta([write(tmp_path / "strip.csv", lines, encoding)])
    require_known(found)
    assert [s.id for s in found.sweeps] == ["strip-interval-1-1Hz-heating", "strip-interval-2-1Hz-cooling"]


def test_pyris_and_decimal_commas(tmp_path: Path) -> None:
    head = ["Temp. (°C)\tFrequency (Hz)\tModulus E' (Pa)\tModulus E\" (Pa)"]
    body = [r.replace(".", ",") for r in rows(ident, None, storage, loss, delimiter="\t")]
    body = [r.replace("\t1\t", "\t1,0\t") for r in body]
    require_known(read_dmta([write(tmp_path / "pyris.txt", [*head, *body])]))


def test_stare_has_units_in_brackets_and_two_temperatures(tmp_path: Path) -> None:
    head = ["Index t Ts Tr M' M'' f", "[#] [s] [°C] [°C] [MPa] [MPa] [Hz]"]
    body = [
        f"{i} {10 * i} {r}"
        for i, r in enumerate(
            rows(ident, lambda t: t + 3.0, in_mpa(storage), in_mpa(loss), None, delimiter=" ")
        )
    ]
    require_known(read_dmta([write(tmp_path / "stare.txt", [*head, *body])]))


def test_rheocompass_has_the_loss_factor_alone_and_angular_frequency(tmp_path: Path) -> None:
    head = ["Temperature\tStorage Modulus\tLoss Factor\tAngular Frequency", "[°C]\t[GPa]\t[1]\t[rad/s]"]
    body = [
        f"{t:g}\t{storage(np.array([t]))[0] / 1e9:.6g}\t{tan(np.array([t]))[0]:.6g}\t{2.0 * np.pi:.8g}"
        for t in T
    ]
    found = read_dmta([write(tmp_path / "anton.csv", [*head, *body], "utf-16")])
    require_known(found)
    assert all(s.loss_from_tan_delta for s in found.sweeps)


def test_sheets_of_a_workbook(tmp_path: Path) -> None:
    from openpyxl import Workbook

    book = Workbook()
    book.active.title = "Details"
    book.active.append(["Operator", "nobody"])
    sheet = book.create_sheet("Ramp")
    for row in (
        ["Temperature ramp"],
        ["Temperature", "Storage modulus", "Loss modulus", "Frequency"],
        ["K", "Pa", "Pa", "Hz"],
    ):
        sheet.append(row)
    for t in T:
        at = np.array([t])
        sheet.append([t + 273.15, float(storage(at)[0]), float(loss(at)[0]), 1.0])
    sheet.append(["Onset 40.1 °C"])
    sheet.append([None, "Operator", 7])
    book.save(tmp_path / "trios.xlsx")
    found = read_dmta([tmp_path / "trios.xlsx"])
    require_known(found)
    assert [(f.kind, f.rows) for f in found.findings] == [("below", (T.size + 4, T.size + 5))]
    assert found.sweeps[0].id == "trios-Ramp-1Hz-heating"
    assert found.left_out == ("trios-Details: no table of temperature and storage modulus",)


def test_frequencies_in_turn_and_one_that_is_stated(tmp_path: Path) -> None:
    head = ["temperature_C,frequency_Hz,storage_modulus_MPa"]
    path = write(
        tmp_path / "turns.csv", [*head, *rows(ident, None, in_mpa(storage), frequencies=(0.1, 1.0, 10.0))]
    )
    assert [s.frequency for s in read_dmta([path]).sweeps] == [0.1, 0.1, 1.0, 1.0, 10.0, 10.0]
    path = write(tmp_path / "one.csv", ["temperature_C,storage_modulus_MPa", *rows(ident, in_mpa(storage))])
    assert read_dmta([path]).sweeps[0].frequency is None
    assert read_dmta([path], DmtaOptions(frequency="500 mHz")).sweeps[0].frequency == 0.5


def test_columns_and_units_that_are_declared(tmp_path: Path) -> None:
    path = write(tmp_path / "own.csv", ["oven,stiff", *rows(ident, in_mpa(storage))])
    said = DmtaOptions(
        {"temperature": "oven", "storage_modulus": "stiff"}, {"temperature": "degC", "storage_modulus": "MPa"}
    )
    sweep = read_dmta([path], said).sweeps[0]
    np.testing.assert_allclose(
        sweep.storage.observed["stiffness"], storage(sweep.storage.temperature), rtol=1e-5
    )


def test_tan_delta_that_disagrees_is_told(tmp_path: Path) -> None:
    head = ["temperature_C,storage_modulus_MPa,loss_modulus_MPa,tan_delta"]
    body = rows(ident, in_mpa(storage), in_mpa(loss), tan)
    body[7] = ",".join([*body[7].split(",")[:3], "0.9"])
    damping = read_dmta([write(tmp_path / "odd.csv", [*head, *body])]).sweeps[0].damping
    assert damping is not None
    assert (damping.disagree, damping.row) == (1, 9)
    assert damping.greatest == pytest.approx(1.0 - tan(T[7:8])[0] / 0.9, rel=1e-4)


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (["oven,E'", "°C,MPa"], "no column of temperature among 'oven', \"E'\""),
        (["Temperature,stiff", "°C,MPa"], "no column of storage modulus"),
        (["Temperature,Storage modulus"], "column 'Temperature': no unit is stated"),
        (["Temperature (°C),Storage modulus"], "column 'Storage modulus': no unit is stated"),
        (["Temperature (°C),Storage modulus (N)"], "of the wrong kind"),
        (["Temperature (°C),Storage modulus (bananas)"], "is not known"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, lines: list[str], told: str) -> None:
    path = write(tmp_path / "bad.csv", [*lines, *rows(ident, in_mpa(storage))])
    with pytest.raises(SmaBayesError) as error:
        read_dmta([path])
    assert told in str(error.value)


@pytest.mark.parametrize("columns", [{}, {"temperature": "1"}])
def test_columns_without_names_are_told_as_such(tmp_path: Path, columns: dict[str, str]) -> None:
    path = write(tmp_path / "bare.csv", rows(ident, in_mpa(storage)))
    with pytest.raises(MeasurementError, match="its columns have no names") as error:
        read_dmta([path], DmtaOptions(columns))
    assert "--column" not in str(error.value)
    assert "write a line of names with units above the numbers" in str(error.value)


def test_two_columns_of_one_quantity_are_refused_unless_one_is_named(tmp_path: Path) -> None:
    head = ["Temperature (°C),Temp (°C),Storage modulus (MPa)"]
    path = write(tmp_path / "two.csv", [*head, *rows(ident, lambda t: t + 1.0, in_mpa(storage))])
    with pytest.raises(MeasurementError, match="both columns of temperature"):
        read_dmta([path])
    found = read_dmta([path], DmtaOptions({"temperature": "Temperature (°C)"}))
    assert found.sweeps[0].storage.temperature.min() == 0.0


def test_values_that_can_not_be_name_their_row(tmp_path: Path) -> None:
    head = ["temperature_C,storage_modulus_MPa"]
    body = rows(ident, in_mpa(storage))
    body[4] = "8,-3"
    with pytest.raises(MeasurementError, match=r"row 6, column 'storage_modulus_MPa': found -3 MPa"):
        read_dmta([write(tmp_path / "neg.csv", [*head, *body])])
    body[4] = "8,soft"
    with pytest.raises(MeasurementError, match="found 'soft'"):
        read_dmta([write(tmp_path / "word.csv", [*head, *body])])


@pytest.mark.parametrize("cell", ["1e300", "1e55"])
def test_values_beyond_belief_are_refused(tmp_path: Path, cell: str) -> None:
    body = rows(ident, in_mpa(storage))
    body[4] = f"8,{cell}"
    path = write(tmp_path / "large.csv", ["temperature_C,storage_modulus_MPa", *body])
    with pytest.raises(
        MeasurementError, match=r"row 6, column 'modulus'.*\n?expected: a magnitude up to 1e\+50"
    ):
        read_dmta([path])


def test_a_unit_that_can_hardly_be_is_told(tmp_path: Path) -> None:
    path = write(tmp_path / "soft.csv", ["temperature_C,storage_modulus_Pa", *rows(ident, in_mpa(storage))])
    assert any("modulus" in f.message for f in read_dmta([path]).findings if f.kind == "implausible")


def test_long_names_are_cut(tmp_path: Path) -> None:
    path = write(
        tmp_path / f"{'long' * 50}.csv", ["temperature_C,storage_modulus_MPa", *rows(ident, in_mpa(storage))]
    )
    assert read_dmta([path]).sweeps[0].id == f"{'long' * 10}-heating"


def test_a_sweep_of_the_frequency_has_no_curve(tmp_path: Path) -> None:
    lines = ["temperature_C,frequency_Hz,storage_modulus_MPa"]
    lines += [f"{t},{f:g},30000" for t in (20, 90) for f in np.geomspace(0.1, 100.0, 20)]
    with pytest.raises(MeasurementError, match="no sweep of temperature is left") as error:
        read_dmta([write(tmp_path / "sweep.csv", lines)])
    assert "2 rows with temperature and modulus" in str(error.value)


def test_options_that_can_not_be_are_refused() -> None:
    with pytest.raises(SmaBayesError, match="--column modulus=E"):
        DmtaOptions({"modulus": "E"})
    with pytest.raises(QuantityError, match="--unit storage_modulus=N"):
        DmtaOptions(units={"storage_modulus": "N"})


@pytest.mark.parametrize("text", ["1", "0 Hz", "1 s"])
def test_a_frequency_without_its_unit_is_refused(tmp_path: Path, text: str) -> None:
    path = write(tmp_path / "one.csv", ["temperature_C,storage_modulus_MPa", *rows(ident, in_mpa(storage))])
    with pytest.raises(QuantityError):
        read_dmta([path], DmtaOptions(frequency=text))


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("1e300", "found 1e+300 Hz"),
        ("1e400", "1e400"),
        ("-1", "found -1 Hz"),
        ("0", "found 0 Hz"),
        ("fast", "fast"),
    ],
)
def test_a_frequency_that_no_rig_has_is_refused_with_its_row(tmp_path: Path, value: str, told: str) -> None:
    """One row among those of a good frequency."""
    lines = rows(ident, in_mpa(storage), lambda t: np.ones_like(t))
    lines[4] = ",".join([*lines[4].split(",")[:2], value])
    path = write(tmp_path / "one.csv", ["temperature_C,storage_modulus_MPa,frequency_Hz", *lines])
    with pytest.raises(SmaBayesError, match="row 6") as refused:
        read_dmta([path])
    assert told in str(refused.value)


def test_trios_states_the_angular_frequency_beside_the_frequency(tmp_path: Path) -> None:
    head = ["[step]", "Temperature Ramp - 1",
            "Angular frequency,Step time,Temperature,Tan(delta),Storage modulus,Loss modulus,Frequency",
            "rad/s,s,°C,,MPa,MPa,Hz"]  # fmt: skip
    body = [
        f"6.28319,{10 * i},{r}" for i, r in enumerate(rows(ident, tan, in_mpa(storage), in_mpa(loss), None))
    ]
    require_known(read_dmta([write(tmp_path / "strip.csv", [*head, *body])]))


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (
            "Temperature,Tan(delta),Storage modulus,Loss modulus",
            "the header has 4 names, the rows have 3 columns",
        ),
        ("Temperature,Storage modulus", "the header has 2 names, the rows have 3 columns"),
    ],
)
def test_names_that_do_not_fit_the_columns_are_refused(tmp_path: Path, names: str, told: str) -> None:
    """A column that the rows lack, or that has no name, would shift the others to the names of their neighbours."""
    units = {"Tan(delta)": ""}
    under = ",".join(units.get(n, "°C" if n == "Temperature" else "MPa") for n in names.split(","))
    path = write(
        tmp_path / "gap.csv", ["Operator,x", names, under, *rows(ident, in_mpa(storage), in_mpa(loss))]
    )
    with pytest.raises(MeasurementError, match=rf"row 2: {told}"):
        read_dmta([path])


def test_signals_that_do_not_fit_the_columns_are_refused(tmp_path: Path) -> None:
    signals = ("Temperature (°C)", "Tan Delta", "Storage Modulus (MPa)", "Loss Modulus (MPa)")
    head = ["Nsig\t4", *(f"Sig{i}\t{name}" for i, name in enumerate(signals, start=1)), "StartOfData"]
    body = rows(ident, in_mpa(storage), in_mpa(loss), delimiter="\t")
    with pytest.raises(MeasurementError, match="the header has 4 names, the rows have 3 columns"):
        read_dmta([write(tmp_path / "q800.txt", [*head, *body], "utf-16")])


def test_names_stand_over_columns_that_a_spreadsheet_padded(tmp_path: Path) -> None:
    head = ["Operator,x,,,,", "Temperature,Storage modulus,Loss modulus,Frequency,,", "°C,MPa,MPa,Hz,,"]
    body = [r + ",," for r in rows(ident, in_mpa(storage), in_mpa(loss), None)]
    require_known(read_dmta([write(tmp_path / "padded.csv", [*head, *body])]))


def test_rheocompass_begins_its_rows_with_an_empty_cell(tmp_path: Path) -> None:
    head = ["Project:\tstrip", "Interval data:\tPoint No.\tTemperature\tStorage Modulus\tLoss Modulus\tFrequency",
            "\t\t\t\t\t", "\t\t[°C]\t[MPa]\t[MPa]\t[Hz]"]  # fmt: skip
    body = rows(ident, in_mpa(storage), in_mpa(loss), None, delimiter="\t")
    lines = [*head, *(f"\t{i}\t{r}" for i, r in enumerate(body, start=1))]
    require_known(read_dmta([write(tmp_path / "anton.csv", lines, "utf-16")]))


def test_stare_writes_results_below_the_data(tmp_path: Path) -> None:
    head = ["Curve Name:", "  strip", "Curve Values:", "Index   Ts   M'   M''   tan delta   f",
            "[#] [°C] [MPa] [MPa] [] [Hz]"]  # fmt: skip
    body = rows(ident, in_mpa(storage), in_mpa(loss), tan, None, delimiter=" ")
    lines = [*head, *(f"{i} {r}" for i, r in enumerate(body)), "", "Results:", "Sample:", "  NiTi, 12.30 mg"]
    found = read_dmta([write(tmp_path / "stare.txt", lines)])
    require_known(found)
    assert [(f.kind, f.rows, f.count) for f in found.findings if f.kind == "below"] == [
        ("below", (107, 108, 109), 3)
    ]


def test_nothing_is_said_to_be_declared_of_steps(tmp_path: Path) -> None:
    step = ["Temperature,Storage modulus,Frequency", "°C,MPa,Hz", *rows(ident, in_mpa(storage), None)]
    found = read_dmta(
        [write(tmp_path / "two.csv", ["[step]", "first", *step, "", "[step]", "second", *step])]
    )
    assert [s.id for s in found.sweeps][::2] == ["two-first-1Hz-heating", "two-second-1Hz-heating"]
    assert not [f for f in found.findings if "declared" in f.message]


@pytest.mark.parametrize("sign", ["℃", "Cel", "deg C", "Celsius"])
def test_degrees_are_written_in_many_ways(tmp_path: Path, sign: str) -> None:
    head = [f"Temp. ({sign}),E' (MPa),E'' (MPa),Freq. (Hz)"]
    require_known(
        read_dmta([write(tmp_path / "a.csv", [*head, *rows(ident, in_mpa(storage), in_mpa(loss), None)])])
    )
    head = ["Temp.,E',E'',Freq.", f"{sign},MPa,MPa,Hz"]
    require_known(
        read_dmta([write(tmp_path / "b.csv", [*head, *rows(ident, in_mpa(storage), in_mpa(loss), None)])])
    )


def test_a_unit_may_follow_the_name_after_a_blank(tmp_path: Path) -> None:
    head = ["Sample Temp. °C,Storage Modulus Pa,Loss Modulus Pa,Frequency Hz"]
    require_known(read_dmta([write(tmp_path / "p.csv", [*head, *rows(ident, storage, loss, None)])]))


def test_a_unit_that_is_garbled_is_said(tmp_path: Path) -> None:
    """The sign of a degree of another code page."""
    path = write(
        tmp_path / "n.csv", ["##Temp./\x9bC;E'(1.000 Hz)/MPa", *rows(ident, in_mpa(storage), delimiter=";")]
    )
    with pytest.raises(QuantityError, match='--unit "temperature=degC"'):
        read_dmta([path])
    sweep = read_dmta([path], DmtaOptions(units={"temperature": "degC"})).sweeps[0]
    assert sweep.storage.temperature.min() == 0.0


def test_a_unit_that_the_file_states_is_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "n.csv", ["temperature_C,storage_modulus_MPa", *rows(ident, in_mpa(storage))])
    sweep = read_dmta([path], DmtaOptions(units={"storage_modulus": "Pa"})).sweeps[0]
    np.testing.assert_allclose(
        sweep.storage.observed["stiffness"], storage(sweep.storage.temperature), rtol=1e-5
    )


UNKNOWN_TO_MODULUS = (
    "campaign.toml", "[reading]", "[columns]", "condition", "first_row", "skip_rows", "quoted_rows", "`", "valid =",
)  # fmt: skip
"""What a campaign declares, and the command line of `modulus` does not."""
HEAD = "temperature_C,storage_modulus_MPa"


def _body(**cells: str) -> list[str]:
    """Rows of temperature and storage modulus, some of them replaced."""
    body = rows(ident, in_mpa(storage))
    for at, cell in cells.items():
        body[int(at[1:])] = cell
    return [HEAD, *body]


def _long_row(path: Path) -> DmtaOptions:
    write(path, _body(r4="8,30000,7"))
    return DmtaOptions()


def _comma(path: Path) -> DmtaOptions:
    write(path, [line.replace(",", ";") for line in _body()[:-1]] + ["0;30000,5"])
    return DmtaOptions()


def _quoted(path: Path) -> DmtaOptions:
    write(path, [f'"{line}"' for line in _body()])
    return DmtaOptions()


def _open_quote(path: Path) -> DmtaOptions:
    write(path, [HEAD, *rows(ident, in_mpa(storage))[:50], '100,"' + "x" * 200_000])
    return DmtaOptions()


def _two_delimiters(path: Path) -> DmtaOptions:
    write(path, [f"{i}|x;{i}" for i in range(100)])
    return DmtaOptions()


def _text(path: Path) -> DmtaOptions:
    write(path, ["nothing but words", "in several lines"] * 9)
    return DmtaOptions()


def _word(path: Path) -> DmtaOptions:
    write(path, _body(r4="8,soft"))
    return DmtaOptions()


def _no_number(path: Path) -> DmtaOptions:
    write(path, [HEAD + ",frequency_Hz", *(f"{row}," for row in rows(ident, in_mpa(storage)))])
    return DmtaOptions()


def _huge(path: Path) -> DmtaOptions:
    write(path, _body(r4="8,1e300"))
    return DmtaOptions()


def _empty(path: Path) -> DmtaOptions:
    path.write_bytes(b"\n")
    return DmtaOptions()


def _no_text(path: Path) -> DmtaOptions:
    path.write_bytes(b"\0\1\2\3" * 100)
    return DmtaOptions()


def _not_in_encoding(path: Path) -> DmtaOptions:
    write(path, ["Temp. (\u00b0C),storage_modulus_MPa", *rows(ident, in_mpa(storage))], "latin-1")
    return DmtaOptions(encoding="utf-8")


def _no_encoding(path: Path) -> DmtaOptions:
    write(path, _body())
    return DmtaOptions(encoding="latin-99")


@pytest.mark.parametrize(
    ("make", "told", "advised"),
    [
        (_long_row, "the row has 3 cells, the others have 2", "complete the row, or remove it"),
        (_comma, "found '30000,5", "one decimal mark"),
        (_quoted, "each whole row stands in quotation marks", "take the quotation marks"),
        (_open_quote, "can't be split into cells", "close the quotation mark"),
        (_two_delimiters, "the delimiter can't be told", "semicolons or tabs"),
        (_text, "no row of numbers", "table of numbers"),
        (_word, "found 'soft'", "correct the cell"),
        (_no_number, "no number in 100 rows", "fill the column"),
        (_huge, "modulus is 1e+306 Pa", "correct the cell, or the unit"),
        (_empty, "the file has only blank lines", "replace it by the measurements"),
        (_no_text, "of no format that is known", "export it as CSV"),
        (_not_in_encoding, "byte 0xb0 is not utf-8", "--encoding"),
        (_no_encoding, "encoding 'latin-99' is not known", "--encoding"),
    ],
)
def test_what_is_advised_can_be_done(
    tmp_path: Path, make: Callable[[Path], DmtaOptions], told: str, advised: str
) -> None:
    """There is no campaign.toml that could say how an export is read."""
    path = tmp_path / "bad.csv"
    options = make(path)
    with pytest.raises(MeasurementError) as error:
        read_dmta([path], options)
    assert told in error.value.found
    assert advised in str(error.value.remedy)
    assert not [word for word in UNKNOWN_TO_MODULUS if word in str(error.value)]


def test_a_frequency_whose_temperatures_are_missing_is_left_out_and_named(tmp_path: Path) -> None:
    head = HEAD + ",frequency_Hz"
    good = [f"{row},1" for row in rows(ident, in_mpa(storage))]
    blind = [f",{row.split(',')[1]},10" for row in rows(ident, in_mpa(storage))]
    both = [line for pair in zip(good, blind, strict=True) for line in pair]
    found = read_dmta([write(tmp_path / "two.csv", [head, *both])])
    assert [s.frequency for s in found.sweeps] == [1.0, 1.0]
    assert found.left_out == ("two-10Hz: no temperature",)
