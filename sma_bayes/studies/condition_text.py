"""Operating conditions as text, such as ``current_A=2.2,load_g=150``: the names are those of campaign.toml."""

from __future__ import annotations

from typing import Any, Final

from pydantic import ValidationError

from sma_bayes.errors import SmaBayesError, near_matches
from sma_bayes.records.declaration import ConditionTable
from sma_bayes.records.types import Condition

UNITS: Final = ("A", "g", "N", "MPa", "mHz", "Hz", "pct")
KEYS: Final = tuple(n for n in ConditionTable.model_fields if n.rpartition("_")[2] in UNITS)
"""Settings as campaign.toml names them: ``current_A``, ``load_g`` and so on."""


def condition_at(text: str, *, specimen: bool) -> Condition:
    """Condition from text such as ``current_A=2.2,load_g=150``.

    Parameters
    ----------
    text : str
        Settings with the names of campaign.toml.
    specimen : bool
        Whether a specimen was tested, whose load is a stress.

    Raises
    ------
    SmaBayesError
        If a setting is not known, given twice, no number, or of the wrong kind.

    Examples
    --------
    >>> condition_at("current_A=2.2,frequency_mHz=10", specimen=False)
    Condition(id='2.2A-10mHz', current=2.2, load=None, frequency=0.01, duty_cycle=None)
    """
    values: dict[str, Any] = {}
    for part in text.split(","):
        name, equals, number = (p.strip() for p in part.partition("="))
        if name not in KEYS or not equals:
            raise SmaBayesError(
                f"--at {text}: {part.strip()!r} is no setting",
                expected=f"settings such as current_A=2.2,load_g=150; {near_matches(name, KEYS)}",
            )
        if name in values:
            raise SmaBayesError(f"--at {text}: {name} is given twice", expected="each setting once")
        try:
            values[name] = float(number)
        except ValueError:
            raise SmaBayesError(f"--at {text}: {number!r} is no number", expected=f"{name}=NUMBER") from None
    label = "-".join(f"{v:g}{n.rpartition('_')[2]}" for n, v in values.items())
    try:
        return ConditionTable(id=label, file="none", **values).condition(specimen=specimen)
    except ValidationError as error:
        first = error.errors()[0]
        expected = first["msg"].removeprefix("Input should be ")
        wrong = "".join(f": {name} = {values[str(name)]:g}" for name in first["loc"])
        raise SmaBayesError(f"--at {text}{wrong}", expected=expected) from None
    except ValueError as error:
        raise SmaBayesError(f"--at {text}", expected=str(error)) from None


def text_of(condition: Condition, *, specimen: bool) -> str:
    """Condition as `condition_at` takes it.

    Examples
    --------
    >>> text_of(Condition("x", current=2.2, frequency=0.01), specimen=False)
    'current_A=2.2,frequency_Hz=0.01'
    """
    load = None if condition.load is None else condition.load * (1e-6 if specimen else 1.0)
    duty = None if condition.duty_cycle is None else condition.duty_cycle * 100.0
    values = {
        "current_A": condition.current,
        "stress_MPa" if specimen else "load_N": load,
        "frequency_Hz": condition.frequency,
        "duty_cycle_pct": duty,
    }
    return ",".join(f"{name}={value:.12g}" for name, value in values.items() if value is not None)
