"""Write the campaign of a test house: many springs, each under several conditions, heated and cooled.

By default 100 springs under 10 conditions, 2,000 branches. Each spring is one of the paper's 9 conditions with its
parameters shifted by a few per cent, each of its conditions shifts them a little more; curves and noise are
those of the twin campaign (`sma_bayes.paper.twin`).

    python scripts/make_test_house.py HOUSE
    sma-bayes fit HOUSE --out RESULTS

`truth.csv` in the folder holds the parameters from which each branch was drawn.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from sma_bayes.paper.twin import RECIPROCAL_RATES, Recipe, curves, recipes
from sma_bayes.records.types import Branch

PARAMETERS = ("A1", "A2", "A3", "B1", "B2", "B3")
OF_SPRING, OF_CONDITION = 0.05, 0.02
"""Relative standard deviations of spans and rates among springs, and among the conditions of one; midpoints move by the
same shares of one over the rate."""

HEAD = """\
[campaign]
name = "test house of {springs} springs"

[columns]
time = {{ name = "time_s", unit = "s" }}
temperature = {{ name = "temperature", unit = "arbitrary" }}
force = {{ name = "force_N", unit = "N" }}
displacement = {{ name = "displacement_cm", unit = "cm" }}
"""
CONDITION = """
[[condition]]
id = "{id}"
file = "{id}.csv"
current_A = {current}
"""


@dataclass(frozen=True, slots=True)
class Sweep:
    """One condition of one spring: a sweep up and one down over the same temperatures.

    Attributes
    ----------
    id : str
    current : float
        [A].
    parameters : dict of Branch to dict of str to float
        From which the curves are drawn.
    columns : dict of str to ndarray, shape (2 n,)
    """

    id: str
    current: float
    parameters: Mapping[Branch, Mapping[str, float]]
    columns: Mapping[str, Any]


def sweeps(springs: int, conditions: int, points: int, seed: int) -> Iterator[Sweep]:
    """Draw the sweeps of a test house, spring by spring."""
    by_key = {recipe.key: recipe for recipe in recipes()}
    ids = list(dict.fromkeys(recipe.condition.id for recipe in recipes()))
    for spring in range(springs):
        of_spring = np.random.default_rng([seed, spring]).standard_normal((2, len(PARAMETERS)))
        kin = ids[spring % len(ids)]
        pair = {branch: by_key[f"{kin}-{branch.value}"] for branch in Branch}
        for condition in range(conditions):
            rng = np.random.default_rng([seed, spring, condition])
            name = f"spring{spring + 1:03d}-{condition + 1:02d}"
            shift = OF_SPRING * of_spring + OF_CONDITION * rng.standard_normal((2, len(PARAMETERS)))
            yield _sweep(name, pair, shift, points, rng)


def _sweep(
    name: str, pair: Mapping[Branch, Recipe], shift: Any, points: int, rng: np.random.Generator
) -> Sweep:
    parameters = {b: _shifted(pair[b], shift[i]) for i, b in enumerate(Branch)}
    both = tuple(parameters.values())
    low = min(p[f"{x}3"] - RECIPROCAL_RATES / p[f"{x}2"] for p in both for x in "AB")
    high = max(p[f"{x}3"] + RECIPROCAL_RATES / p[f"{x}2"] for p in both for x in "AB")
    columns: dict[str, list[Any]] = {"temperature": [], "force_N": [], "displacement_cm": []}
    for branch, recipe in pair.items():
        ends = (low, high) if branch is Branch.HEATING else (high, low)
        temperature = np.linspace(*ends, points)
        drawn = curves(temperature, parameters[branch])
        columns["temperature"].append(temperature)
        for column, channel in (("force_N", "force"), ("displacement_cm", "displacement")):
            noise = recipe.noise_sd[channel] * rng.standard_normal(points)
            columns[column].append(drawn[channel] + noise)
    joined = {name: np.concatenate(parts) for name, parts in columns.items()}
    current = pair[Branch.HEATING].condition.current or 0.0
    return Sweep(name, current, parameters, {"time_s": np.arange(2.0 * points), **joined})


def _shifted(recipe: Recipe, shift: Any) -> dict[str, float]:
    """Printed parameters, spans and rates times exp(shift), midpoints moved by that share of one over the rate."""
    printed = {name: recipe.parameters[name].value for name in PARAMETERS}
    moved = dict(zip(PARAMETERS, shift.tolist(), strict=True))
    return {
        name: value + moved[name] / printed[f"{name[0]}2"] if name[1] == "3" else value * np.exp(moved[name])
        for name, value in printed.items()
    }


def write_test_house(folder: Path, springs: int, conditions: int, points: int, seed: int) -> int:
    """Write `campaign.toml`, a data file for each condition and `truth.csv`; return the number of branches."""
    folder.mkdir(parents=True, exist_ok=True)
    branches = 0
    with (folder / "truth.csv").open("w", newline="", encoding="utf-8") as file:
        truth = csv.writer(file)
        truth.writerow(("condition", "branch", *PARAMETERS))
        parts = [HEAD.format(springs=springs)]
        for sweep in sweeps(springs, conditions, points, seed):
            table = np.column_stack(list(sweep.columns.values()))
            header = ",".join(sweep.columns)
            np.savetxt(folder / f"{sweep.id}.csv", table, "%.8g", ",", header=header, comments="")
            parts.append(CONDITION.format(id=sweep.id, current=sweep.current))
            for branch, values in sweep.parameters.items():
                truth.writerow((sweep.id, branch.value, *(f"{values[name]:.8g}" for name in PARAMETERS)))
                branches += 1
    (folder / "campaign.toml").write_text("".join(parts), encoding="utf-8")
    return branches


def main(
    folder: Annotated[Path, typer.Argument(help="Folder to write; files of the same names are replaced.")],
    springs: Annotated[int, typer.Option(min=1)] = 100,
    conditions: Annotated[int, typer.Option(min=1, help="Conditions a spring, two branches each.")] = 10,
    points: Annotated[int, typer.Option(min=10, help="Samples a branch.")] = 100,
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Write the campaign of a test house."""
    branches = write_test_house(folder, springs, conditions, points, seed)
    typer.echo(f"{branches} branches of {springs} springs in {folder}")


if __name__ == "__main__":
    typer.run(main)
