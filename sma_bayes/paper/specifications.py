"""Tables 1 and 2 and the numbers of the running text, as printed; see `sma_bayes.paper.tables`.

The entries of Tables 1 and 2 mix digits, units and symbols. `PrintedCell.entry` keeps the whole entry,
`PrintedCell.printed` its digits; a range such as "28 – 41 GPa" gives two cells. Units are written as pint knows
them; kCal and J stand without the rest of their unit in some entries, and the heat transfer coefficient without
any: what had to be added is said in the errata.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

from sma_bayes.errors import UnknownNameError, near_matches
from sma_bayes.paper.tables import CellStatus, PrintedCell, PrintedTable
from sma_bayes.quantities import convert

_RESISTIVITY = (
    "950 times the resistivity of martensite on line 190; the spring would measure 1.6 kΩ, and 1 A would heat it "
    "by 45 000 °C at steady state",
    76e-8,
)
_SPECIFIC_HEAT = (
    "2.2 times the 0.20 cal/(g °C) that the maker of the wire prints (Dynalloy, Technical characteristics of "
    "Flexinol actuator wires), and no single slip explains it",
    None,
)
_VOLUME = (
    "unit of an area, and 9.807 times the volume (π/4) d² π D n that the wire diameter, coil diameter and number "
    "of coils of lines 202 to 204 give",
    8.327e-8,
)
_DOUBTS: Final[Mapping[str, tuple[str, float | None]]] = MappingProxyType(
    {
        "resistivity": _RESISTIVITY,
        "specific_heat_joule": _SPECIFIC_HEAT,
        "specific_heat_calorie": _SPECIFIC_HEAT,
        "volume": _VOLUME,
    }
)

_Row = tuple[int, str, str, str, int, str]  # line, quantity, unit, digits, power of ten, entry


def _table(number: int, title: str, rows: Iterable[_Row]) -> PrintedTable:
    cells = []
    for line, quantity, unit, printed, power, entry in rows:
        reason, reconstructed = _DOUBTS.get(quantity, ("", None))
        cells.append(
            PrintedCell(
                quantity,
                unit,
                printed,
                line,
                status=CellStatus.IMPLAUSIBLE if reason else CellStatus.OK,
                reason=reason,
                reconstructed=reconstructed,
                power=power,
                entry=entry,
            )
        )
    return PrintedTable(number, title, tuple(cells))


TABLE_1: Final = _table(
    1,
    "specifications of the SMA spring",
    (
        (182, "melting_point", "degC", "1310", 0, "1310 °C"),
        (183, "resistivity", "ohm*m", "76", -5, "76 x10 ⁻⁵ ohm-m"),
        (184, "young_modulus_least", "GPa", "28", 0, "28 – 41 GPa"),
        (184, "young_modulus_greatest", "GPa", "41", 0, "28 – 41 GPa"),
        (185, "latent_heat", "kcal/kg", "5.78", 0, "5.78 kCal/kg"),
        (186, "thermal_conductivity", "W/m/delta_degC", "18.0", 0, "18.0 W/m°C"),
        (187, "expansion_martensite", "1/delta_degC", "6.6", -6, "Martensite 6.6x10 ⁻⁶ /°C"),
        (
            188,
            "expansion_austenite",
            "1/delta_degC",
            "11.0",
            -6,
            r"Austenite $11.0 \times 10^{-6} / ^{\circ}C$",
        ),
        (189, "poisson_ratio", "1", "0.33", 0, "0.33"),
        (190, "resistivity_martensite", "ohm*cm", "80", -6, r"Martensite 80 $\times 10^{-6}$ ohm-cm"),
        (
            191,
            "specific_heat_joule",
            "J/g/delta_degC",
            "1.84",
            0,
            r"1.84 J or 0.44 kCal/kg $^{\circ}$ C",
        ),
        (
            191,
            "specific_heat_calorie",
            "kcal/kg/delta_degC",
            "0.44",
            0,
            r"1.84 J or 0.44 kCal/kg $^{\circ}$ C",
        ),
        (192, "heat_transfer_coefficient", "W/m**2/delta_degC", "54.50", 0, "54.50"),
        (194, "ingot_Af_least", "degC", "75", 0, "75 to 110°C"),
        (194, "ingot_Af_greatest", "degC", "110", 0, "75 to 110°C"),
        (195, "finished_Af_least", "degC", "50", 0, "50 to 80°C"),
        (195, "finished_Af_greatest", "degC", "80", 0, "50 to 80°C"),
        (197, "tensile_strength_least", "MPa", "1070", 0, "≥ 1070 MPa"),
        (198, "elongation_least", "percent", "10", 0, r"$\geq 10\%$"),
        (199, "plateau_stress_least", "MPa", "100", 0, r"\geq 100 MPa"),
        (200, "memory_strain_greatest", "percent", "8.0", 0, r"$\leq 8.0\%$"),
        (202, "wire_diameter", "m", "5.0", -4, "5.0x10 ⁻⁴ m"),
        (203, "coils", "1", "45", 0, "45"),
        (204, "coil_diameter", "m", "3.0", -3, "3.0×10^{-3} m"),
        (205, "volume", "m**3", "81.67", -8, r"$81.67 \times 10^{-8} \text{ m}^2$"),
    ),
)

TABLE_2: Final = _table(
    2,
    "specifications of the steel bias spring",
    (
        (213, "hardness_greatest", "kgf/mm**2", "220", 0, "220 HV max"),
        (214, "yield_stress_least", "MN/m**2", "290", 0, "290 MN/m ² min"),
        (215, "tensile_strength", "MN/m**2", "640", 0, "640 MN/m ²"),
        (216, "spring_rate", "N/m", "130", 0, "130 N/m"),
    ),
)

TEXT_VALUES: Final = _table(
    0,
    "values printed in the running text",
    (
        (3, "correlation_factor", "1", "0.95", 0, "average correlation factor of 0.95"),
        (210, "thermocouple_sensitivity", "mV/delta_degC", "1", 0, "1 mV/"),
        (339, "Ms", "degC", "61.48", 0, "M_s = 61.48 °C"),
        (339, "Mf", "degC", "58.72", 0, "M_f = 58.72°C"),
        (339, "As", "degC", "73.83", 0, "A_s = 73.83°C"),
        (339, "Af", "degC", "80.4", 0, "A_f = 80.4°C"),
        (339, "stiffness_min_fig9", "N/m", "21.78", 0, "21.78 N/m and 159.07 N/m"),
        (339, "stiffness_max_fig9", "N/m", "159.07", 0, "21.78 N/m and 159.07 N/m"),
        (339, "stiffness_min_fig10", "N/m", "30.71", 0, "30.71 N/m and 169.58 N/m"),
        (339, "stiffness_max_fig10", "N/m", "169.58", 0, "30.71 N/m and 169.58 N/m"),
        (339, "stiffness_min_fig11", "N/m", "34.78", 0, "34.78 N/m and 153.97 N/m"),
        (339, "stiffness_max_fig11", "N/m", "153.97", 0, "34.78 N/m and 153.97 N/m"),
        (385, "stress_greatest", "MPa", "75", 0, "0 to 75 MPa"),
        (449, "prestress_duty_cycle_test", "MPa", "56", 0, "56 MPa pre-stress"),
    ),
)
"""Numbers that the errata need and no table holds. Figs. 9 to 11 are 1.5 A, 2 A, and 100 g at 2 A, all at
10 mHz."""


def specification(table: PrintedTable, quantity: str, unit: str) -> float:
    """Printed value of a specification, in a wanted unit, whatever its status.

    Parameters
    ----------
    table : PrintedTable
        `TABLE_1`, `TABLE_2` or `TEXT_VALUES`.
    quantity : str
    unit : str
        Any unit of the same kind.

    Raises
    ------
    UnknownNameError
        If the table has no such quantity.
    QuantityError
        If the unit is of another kind.

    Examples
    --------
    >>> specification(TABLE_1, "wire_diameter", "mm")
    0.5
    """
    row = table.select("", None)
    if quantity not in row:
        raise UnknownNameError(
            f"table {table.number} has no {quantity!r}", expected=near_matches(quantity, row)
        )
    cell = row[quantity]
    return float(convert(cell.value, cell.unit, unit, what=quantity))
