"""A campaign measured with the simulated rig: its files, and the truth behind a run of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import require_known, require_seed
from sma_bayes.records.campaign import read_campaign
from sma_bayes.records.types import Branch, Campaign, Finding
from sma_bayes.simulated.rig import DEFAULT_RIG, GRAVITY, HeatingRamp, LoggedRamp, Setup, logged, ramp

SOURCE: Final = "simulated spring rig"
"""How the source of a simulated campaign begins."""
MEASUREMENTS: Final = "measurements"
"""Folder in an output folder of the demo that holds the files."""
LOADS: Final = {"100g": 100.0, "150g": 150.0, "200g": 200.0}
"""Mass that preloads the spring, by condition [g]."""
FIRST_STREAM: Final = 2
"""Added to the seed. With the default seed no record then asks for a discrepancy, so that the demo takes seconds: one
channel in five does by chance, and its posterior takes ten times as long to sample."""
ACCOUNT: Final = (
    "simulated, not measured, so that the truth is known: a heated spring against a conical bias spring, kinetics of "
    "Ivshin and Pence shifted by force, noise with a memory, a thermocouple with a lag of "
    f"{DEFAULT_RIG.lag:g} s and an offset"
)
"""What the measurements are, for a reader of the files and of the report."""
HEADER: Final = ("time (s)", "temperature (degC)", "force (N)", "displacement (mm)")
DECLARATION: Final = f"""# Measurements of `sma-bayes demo`: {ACCOUNT}.

[campaign]
name = "simulated spring, three loads"

[columns]
time = {{ name = "time (s)", unit = "s" }}
force = {{ name = "force (N)", unit = "N" }}
displacement = {{ name = "displacement (mm)", unit = "mm" }}

[columns.temperature]
name = "temperature (degC)"
unit = "degC"
sd = {DEFAULT_RIG.temperature_sd:g}  # error of one reading
offset_sd = {DEFAULT_RIG.calibration_sd:g}  # what all readings may be off by together
"""
CONDITION: Final = """
[[condition]]
id = "{name}"
file = "{name}.csv"
current_A = {current:g}
load_g = {load:g}
"""


@cache
def course_of(condition: str) -> HeatingRamp:
    """What truly happened in a condition.

    Raises
    ------
    UnknownNameError
        If the simulated campaign has no such condition.
    """
    require_known(condition, LOADS, f"the simulated campaign has no condition {condition!r}")
    return ramp(Setup(LOADS[condition] * 1e-3 * GRAVITY))


def log_of(condition: str, seed: int) -> LoggedRamp:
    """What the instruments made of it; each condition has a random stream of its own.

    Raises
    ------
    UnknownNameError
        If the simulated campaign has no such condition.
    """
    course = course_of(condition)
    stream = np.random.SeedSequence(seed + FIRST_STREAM, spawn_key=(round(LOADS[condition]),))
    return logged(course, np.random.default_rng(stream))


def truth_of(condition: str, branch: Branch, temperature: Floats) -> dict[str, Floats]:
    """True curves of a branch: force [N], displacement [m], stiffness [N/m] at temperatures of the spring.

    Parameters
    ----------
    condition : str
    branch : Branch
    temperature : ndarray, shape (n,)
        [degC].

    Raises
    ------
    UnknownNameError
        If the simulated campaign has no such condition.
    """
    course = course_of(condition)
    return course.setup.curves(temperature, branch, course.left)


def measurement_files(seed: int) -> dict[str, str]:
    """``campaign.toml`` and a file for each condition as a logger would have written it, by name.

    Parameters
    ----------
    seed : int
        Decides the errors of the instruments.
    """
    files, declared = {}, DECLARATION
    for name, load in LOADS.items():
        log = log_of(name, seed)
        declared += CONDITION.format(name=name, load=load, current=DEFAULT_RIG.current)
        columns = (log.course.time, log.temperature, log.force, 1e3 * log.displacement)
        rows = (
            f"{t:.1f},{temperature:.2f},{force:.3f},{x:.2f}"
            for t, temperature, force, x in zip(*columns, strict=True)
        )
        files[f"{name}.csv"] = "\n".join((",".join(HEADER), *rows, ""))
    return {"campaign.toml": declared, **files}


def simulated_campaign(seed: int = 0) -> Campaign:
    """Simulate the measurements and read them, as any other campaign is read.

    Parameters
    ----------
    seed : int
        Not negative; decides the errors of the instruments.

    Returns
    -------
    Campaign
        Heating and cooling under three loads, with a finding that says that it was simulated.
    """
    require_seed(seed)
    with TemporaryDirectory() as folder:
        for name, text in measurement_files(seed).items():
            (Path(folder) / name).write_text(text, encoding="utf-8", newline="\n")
        campaign = read_campaign(folder)
    told = Finding(kind="simulated", message=ACCOUNT)
    return replace(campaign, source=f"{SOURCE}, seed {seed}", findings=(told, *campaign.findings))
