"""Effects of the errata about the rig, the material and the operating conditions."""

from __future__ import annotations

from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.paper.effects.amount import Amount, Effect
from sma_bayes.paper.effects.equations import between, columns, parameter_rows
from sma_bayes.paper.extremes import (
    EXTREME_CONDITIONS,
    EXTREME_TABLES,
    TABLE_9,
    TABLE_10,
    TABLE_11,
    TABLE_12,
    extremes,
)
from sma_bayes.paper.physics import (
    PUBLISHED_HELIX,
    apparent_shear_modulus,
    quantisation_step,
    shear_modulus,
    shear_stress,
    spring_rate,
    steady_rise,
    wahl_factor,
    wire_resistance,
)
from sma_bayes.paper.specifications import TABLE_1, TEXT_VALUES, specification
from sma_bayes.quantities import STANDARD_GRAVITY, convert
from sma_bayes.records.types import Branch

FLEXINOL_SPECIFIC_HEAT: Final = 0.20
"""[cal/(g °C)]: Dynalloy Inc., Technical characteristics of Flexinol actuator wires, F1140."""

NITI_SPECIFIC_HEAT: Final = (0.45, 0.84)
"""Range for NiTi that the list of errata states [kJ/(kg K)]; its upper end is the maker's 0.20 cal/(g °C)."""

AMBIENT: Final = 25.0
"""Temperature of the surroundings [°C], close to the least one of Table 9, 25.01."""

CONVERTER_SPAN: Final = 20.0
"""Span of the ±10 V range [V] of a USB-1408FS; 14 bits differential, 13 bits single-ended (Measurement
Computing, USB-1408FS User's Guide)."""

CURRENTS: Final = (1.0, 1.5, 2.0)
"""Currents of Tables 3 and 9 [A]."""


def published_resistance() -> float:
    """Resistance of the spring by the martensite's resistivity of line 190 [ohm]."""
    return wire_resistance(specification(TABLE_1, "resistivity_martensite", "ohm*m"), PUBLISHED_HELIX)


def published_rise(current: float, resistance: float) -> float:
    """Steady rise of temperature with the printed heat transfer coefficient, in W/(m² K) [K]."""
    h = specification(TABLE_1, "heat_transfer_coefficient", "W/m**2/delta_degC")
    return steady_rise(current, resistance, h, PUBLISHED_HELIX.surface)


def resistivity() -> tuple[Amount, ...]:
    """Resistivities of lines 183 and 190 and what either makes of the spring."""
    one, other = (specification(TABLE_1, name, "ohm*m") for name in ("resistivity", "resistivity_martensite"))
    high, low = (wire_resistance(rho, PUBLISHED_HELIX) for rho in (one, other))
    return (
        Amount("line 183 over line 190", one / other, claimed="1000"),
        Amount("resistivity of line 190", other, "ohm*m", "8e-7"),
        Amount("resistance of the spring by line 183", high, "ohm"),
        Amount("resistance of the spring by line 190", low, "ohm"),
        Amount("steady rise at 1 A by line 183", published_rise(1.0, high), "delta_degC"),
        Amount("steady rise at 1 A by line 190", published_rise(1.0, low), "delta_degC"),
    )


def specific_heat() -> tuple[Amount, ...]:
    """Specific heat of line 191 beside that of the maker and of NiTi at large."""
    unit = "kJ/kg/delta_degC"
    calorie = specification(TABLE_1, "specific_heat_calorie", unit)
    maker = float(convert(FLEXINOL_SPECIFIC_HEAT, "cal/g/delta_degC", unit))
    low, high = NITI_SPECIFIC_HEAT
    return (
        Amount("0.44 kcal/(kg °C)", calorie, unit, "1.84"),
        Amount("over the greatest value for NiTi", calorie / high, claimed="3"),
        Amount("over the least value for NiTi", calorie / low, claimed="4"),
        Amount("over the value of the maker", calorie / maker),
    )


def heat_transfer() -> tuple[Amount, ...]:
    """Steady temperatures at the three currents beside the greatest ones of Table 9."""
    printed = [row["temperature_max"] for row in extremes(TABLE_9).values()]
    steady = [AMBIENT + published_rise(current, published_resistance()) for current in CURRENTS]
    return (
        *(
            Amount(f"steady temperature at {current:g} A", t, "degC", claimed)
            for current, t, claimed in zip(CURRENTS, steady, ("73", "132", "215"), strict=True)
        ),
        *(
            Amount(f"steady less printed greatest at {current:g} A", t - p, "delta_degC")
            for current, t, p in zip(CURRENTS, steady, printed, strict=True)
        ),
    )


def volume() -> tuple[Amount, ...]:
    """Volume by geometry and the printed one."""
    printed = specification(TABLE_1, "volume", "m**3")
    return (
        Amount("volume (π/4) d² π D n", PUBLISHED_HELIX.volume, "m**3", "8.33e-8"),
        Amount("printed over geometry", printed / PUBLISHED_HELIX.volume, claimed="10.0"),
    )


def martensite_moduli() -> tuple[Amount, ...]:
    """Stiffness that the printed Young's modulus gives, and the shear modulus that the printed stiffness needs."""
    nu = specification(TABLE_1, "poisson_ratio", "1")
    shear = [
        shear_modulus(specification(TABLE_1, f"young_modulus_{end}", "Pa"), nu)
        for end in ("least", "greatest")
    ]
    stiffest = max(r["stiffness_max"] for r in extremes(TABLE_10).values())
    return (
        *between(
            "stiffness by the printed modulus",
            np.array([spring_rate(g, PUBLISHED_HELIX) for g in shear]),
            "N/m",
        ),
        Amount(
            "shear modulus of the stiffest state of Tables 9 and 10",
            apparent_shear_modulus(stiffest, PUBLISHED_HELIX) / 1e9,
            "GPa",
            "29",
        ),
    )


def duty_moduli() -> tuple[Amount, ...]:
    """Shear modulus that the greatest stiffness at each duty cycle needs."""
    claims = {"2A-20mHz-80pct": "81"}
    return tuple(
        Amount(
            f"shear modulus at {100 * (EXTREME_CONDITIONS[condition].duty_cycle or 0):.0f} % duty",
            apparent_shear_modulus(row["stiffness_max"], PUBLISHED_HELIX) / 1e9,
            "GPa",
            claims.get(condition, ""),
        )
        for condition, row in extremes(TABLE_11).items()
    )


def _rises(*tables: int) -> dict[str, dict[str, float]]:
    """Rows of the extreme tables that still have a stiffness."""
    return {
        condition: row
        for table in EXTREME_TABLES
        if table.number in tables
        for condition, row in extremes(table).items()
        if "stiffness_max" in row
    }


def below_austenite_start() -> tuple[Amount, ...]:
    """Rise of the stiffness in rows that never reach As."""
    start = specification(TEXT_VALUES, "As", "degC")
    claims = {"1A-10mHz": "6", "2A-20mHz-40pct": "14"}
    lost = extremes(TABLE_12)["2A-50mHz"]["temperature_max"]
    return (
        *(
            Amount(
                f"rise of the stiffness of {condition}, which stays at {row['temperature_max']:.2f} °C",
                row["stiffness_max"] / row["stiffness_min"],
                claimed=claims.get(condition, ""),
            )
            for condition, row in _rises(9, 10, 11, 12).items()
            if row["temperature_max"] < start
        ),
        Amount("greatest temperature less As, 50 mHz, whose stiffness is lost", lost - start, "delta_degC"),
    )


def inconsistent_drive() -> tuple[Amount, ...]:
    """Greatest temperature at 2 A: 20 mHz with 80 % duty, and 30 mHz."""
    slow = extremes(TABLE_11)["2A-20mHz-80pct"]["temperature_max"]
    fast = extremes(TABLE_12)["2A-30mHz"]["temperature_max"]
    return (
        Amount("20 mHz, 80 %", slow, "degC", "71"),
        Amount("30 mHz", fast, "degC", "126"),
        Amount("difference", fast - slow, "delta_degC"),
    )


def confounded_temperature() -> tuple[Amount, ...]:
    """Greatest temperatures of Tables 9 and 10, and how the greatest stiffness goes with them."""
    rows = _rises(9, 10).values()
    temperature = np.array([r["temperature_max"] for r in rows])
    stiffness = np.array([r["stiffness_max"] for r in rows])
    return (
        *between("greatest temperature of a row", temperature, "degC", ("72", "159")),
        Amount(
            "its correlation with the greatest stiffness", float(np.corrcoef(temperature, stiffness)[0, 1])
        ),
    )


def stresses() -> tuple[Amount, ...]:
    """Shear stress of the loads of Table 4, and the masses that the printed stresses mean."""
    weight = {mass: mass * 1e-3 * STANDARD_GRAVITY for mass in (100, 150, 200)}
    stress = {mass: shear_stress(force, PUBLISHED_HELIX) / 1e6 for mass, force in weight.items()}
    claims = {100: "60", 200: "120"}
    per_gram = stress[100] / 100
    return (
        *(Amount(f"8 F D/(π d³) at {m} g", s, "MPa", claims.get(m, "")) for m, s in stress.items()),
        Amount("factor of curvature (Wahl), not in these", wahl_factor(PUBLISHED_HELIX)),
        Amount("mass at 75 MPa", specification(TEXT_VALUES, "stress_greatest", "MPa") / per_gram, "g"),
        Amount(
            "mass at 56 MPa", specification(TEXT_VALUES, "prestress_duty_cycle_test", "MPa") / per_gram, "g"
        ),
    )


def mean_power() -> tuple[Amount, ...]:
    """Mean Joule power at the duty cycles of Table 11, 2 A."""
    return tuple(
        Amount(
            f"mean power at {100 * c.duty_cycle:.0f} % duty",
            c.duty_cycle * c.current**2 * published_resistance(),
            "W",
        )
        for c in (EXTREME_CONDITIONS[condition] for condition in extremes(TABLE_11))
        if c.duty_cycle is not None and c.current is not None
    )


def stiffness_ratios() -> tuple[Amount, ...]:
    """Greatest over least stiffness in the tables."""

    def ratios(*tables: int) -> Floats:
        return np.array([r["stiffness_max"] / r["stiffness_min"] for r in _rises(*tables).values()])

    return between("Kmax/Kmin, Tables 9 and 10", ratios(9, 10), claimed=("4.4", "8.2")) + between(
        "Kmax/Kmin, Table 11", ratios(11), claimed=("14", "32")
    )


def trends() -> tuple[Amount, ...]:
    """Trends of the text with frequency and with duty cycle, beside the tables."""
    rows = parameter_rows()
    spans = [rows[f"{c}-heating"]["A1"] for c in ("2A-10mHz-table5", "2A-50mHz")]
    slopes = [
        (r["stiffness_max"] - r["stiffness_min"]) / (r["temperature_max"] - r["temperature_min"])
        for r in extremes(TABLE_11).values()
    ]
    return (
        Amount("A1 heating at 10 mHz", spans[0], "cm", "0.44"),
        Amount("A1 heating at 50 mHz", spans[1], "cm", "0.22"),
        *(
            Amount(f"mean slope of the stiffness at {duty} % duty", slope, "N/m/delta_degC", claimed)
            for duty, slope, claimed in zip((40, 60, 80), slopes, ("8.0", "12.8", "12.5"), strict=True)
        ),
    )


def quantisation() -> tuple[Amount, ...]:
    """One step of the converter on ±10 V, in volt and in degrees."""
    sensitivity = specification(TEXT_VALUES, "thermocouple_sensitivity", "V/delta_degC")
    steps = {bits: quantisation_step(CONVERTER_SPAN, bits) for bits in (14, 13)}
    return (
        Amount("step with 14 bits", 1e3 * steps[14], "mV", "1.22"),
        Amount("step with 14 bits, of temperature", steps[14] / sensitivity, "delta_degC", "1.2"),
        Amount("step with 13 bits, of temperature", steps[13] / sensitivity, "delta_degC"),
    )


def fitted_constants() -> tuple[Amount, ...]:
    """Constants fitted to the data by the models that are compared."""
    values = float(sum(column.size for column in columns().values()))
    return (
        Amount("fitted by the modified sigmoid in each branch", values / len(parameter_rows()), claimed="6"),
        Amount("fitted by it in all rows", values),
        Amount("fitted by the logistic curve as printed", 0.0, claimed="0"),
    )


def rise_over_current_squared() -> tuple[Amount, ...]:
    """Rise of temperature in Table 9 over the square of the current, which a steady balance keeps constant."""
    return tuple(
        Amount(
            f"rise over I² at {current:g} A",
            (row["temperature_max"] - row["temperature_min"]) / current**2,
            "delta_degC/A**2",
        )
        for current, row in zip(CURRENTS, extremes(TABLE_9).values(), strict=True)
    )


def load_trends() -> tuple[Amount, ...]:
    """Spans of displacement and force at 100 g and 200 g, heating: the text says that both rise with the load."""
    rows = parameter_rows()
    return tuple(
        Amount(f"{what} at {mass} g, {branch.value}", rows[f"{mass}g-10mHz-{branch.value}"][name], unit)
        for name, what, unit in (("A1", "span of displacement", "cm"), ("B1", "span of force", "N"))
        for branch in Branch
        for mass in (100, 200)
    )


def austenite_finish() -> tuple[Amount, ...]:
    """Af of the calorimeter less the greatest Af of the specification."""
    finish = specification(TEXT_VALUES, "Af", "degC") - specification(TABLE_1, "finished_Af_greatest", "degC")
    return (Amount("Af of line 339 less the upper end of line 195", finish, "delta_degC"),)


EFFECTS: Final[dict[str, Effect]] = {
    "E33": resistivity,
    "E34": specific_heat,
    "E35": heat_transfer,
    "E36": volume,
    "E37": martensite_moduli,
    "E38": duty_moduli,
    "E39": below_austenite_start,
    "E40": inconsistent_drive,
    "E41": confounded_temperature,
    "E42": stresses,
    "E43": mean_power,
    "E44": stiffness_ratios,
    "E45": trends,
    "E47": quantisation,
    "E49": fitted_constants,
    "N04": rise_over_current_squared,
    "N05": load_trends,
    "N06": austenite_finish,
}
"""Effects by id of the erratum."""
