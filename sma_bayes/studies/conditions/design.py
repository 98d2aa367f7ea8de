"""What was set in each condition: which settings vary, which vary only together, and what varies along with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import groupby

import numpy as np
from pydantic import Field
from scipy.optimize import linprog

from sma_bayes.arrays import Floats
from sma_bayes.document_part import DocumentPart, Number
from sma_bayes.errors import MeasurementError
from sma_bayes.records.types import Condition

SETTINGS = tuple(f.name for f in fields(Condition) if f.name != "id")
"""``current``, ``load``, ``frequency``, ``duty_cycle``."""
CONFOUNDED_CORRELATION = 0.9
"""Correlation from which two things that vary count as confounded."""
SETTING_TOLERANCE = 1e-9
"""Relative difference up to which two settings are the same."""


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """Conditions that state the same settings, so that they can be compared.

    Attributes
    ----------
    conditions : tuple of Condition
    stated : tuple of str
        Settings that all of them state.
    varied : tuple of str
        Those that are not the same in all.
    """

    conditions: tuple[Condition, ...]
    stated: tuple[str, ...]
    varied: tuple[str, ...]

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the conditions."""
        return tuple(c.id for c in self.conditions)

    def values(self, setting: str) -> Floats:
        """A setting in each condition, shape (C,), in its canonical unit."""
        return np.array([float(getattr(c, setting)) for c in self.conditions])

    @property
    def low(self) -> Floats:
        """Least value of each varied setting, shape (V,)."""
        return np.array([self.values(v).min() for v in self.varied])

    @property
    def range(self) -> Floats:
        """Distance from there to the greatest, shape (V,)."""
        return np.array([np.ptp(self.values(v)) for v in self.varied])

    def row(self, condition: Condition) -> Floats:
        """Regressors of a condition, shape (1 + V,): 1, then each varied setting, -1/2 at its least and 1/2 at most."""
        return np.asarray(self._rows([condition])[0])

    @property
    def matrix(self) -> Floats:
        """Rows of all conditions, shape (C, 1 + V)."""
        return self._rows(self.conditions)

    def _rows(self, conditions: Sequence[Condition]) -> Floats:
        x = np.array([[float(getattr(c, v)) for v in self.varied] for c in conditions])
        x = x.reshape(len(conditions), len(self.varied))  # also where nothing varied
        return np.column_stack([np.ones(len(x)), (x - self.low) / self.range - 0.5])

    @property
    def rank(self) -> int:
        """Rank of `matrix`; below its number of columns settings vary only together."""
        return int(np.linalg.matrix_rank(self.matrix))

    @property
    def spare(self) -> int:
        """Conditions beyond those that a line through all settings needs: what scatter is learnt from."""
        return len(self.conditions) - self.rank

    def aliased(self, setting: str) -> tuple[str, ...]:
        """Settings without which the effect of this one could be told, but with which it can't."""
        matrix, column = self.matrix, 1 + self.varied.index(setting)
        rest = np.delete(matrix, column, axis=1)
        if np.linalg.matrix_rank(rest) < self.rank:
            return ()
        part, *_ = np.linalg.lstsq(rest, matrix[:, column], rcond=None)
        others = [v for v in self.varied if v != setting]
        return tuple(v for v, size in zip(others, part[1:], strict=True) if abs(size) > 1e-6)

    def beyond(self, condition: Condition) -> tuple[str, ...]:
        """Why a condition is outside of what was measured; empty where it is a mixture of measured ones.

        Parameters
        ----------
        condition : Condition
            Checked by `check`.

        Returns
        -------
        tuple of str
            Settings outside their range, and ``combination`` where each is inside, but not all together (outside the
            convex hull of the measured conditions).
        """
        x = self.row(condition)
        outside = tuple(
            v for v, at in zip(self.varied, x[1:], strict=True) if abs(at) > 0.5 + SETTING_TOLERANCE
        )
        if outside:
            return outside
        count = len(self.conditions)
        mixture = linprog(np.zeros(count), A_eq=self.matrix.T, b_eq=x, bounds=(0.0, 1.0), method="highs")
        return () if mixture.status == 0 else ("combination",)

    def check(self, condition: Condition) -> None:
        """Refuse a condition that these can say nothing about.

        Raises
        ------
        MeasurementError
            If it lacks a setting that varies, or changes one that never did.
        """
        for setting in SETTINGS:
            asked = getattr(condition, setting)
            if setting in self.varied and asked is None:
                raise MeasurementError(
                    f"{setting} is not given",
                    expected=f"a value for each of {', '.join(self.varied)}, which differ between the conditions",
                )
            if asked is None or setting in self.varied:
                continue
            if setting not in self.stated:
                raise MeasurementError(
                    f"{setting} = {asked:g}: no value of it is stated for {', '.join(self.ids)}",
                    expected=f"settings among {', '.join(self.stated)}" if self.stated else "no settings",
                    remedy=f"state {setting} in campaign.toml, or leave it out",
                )
            usual = float(self.values(setting)[0])
            if not np.isclose(asked, usual, rtol=1e-6, atol=0.0):
                raise MeasurementError(
                    f"{setting} = {asked:g}: it was {usual:g} in all conditions, so its effect is unknown",
                    expected=f"that value, or conditions in which {setting} differs",
                )


def designs(conditions: Sequence[Condition]) -> tuple[Design, ...]:
    """Group conditions by the settings that they state; settings that are not stated can't be compared.

    Returns
    -------
    tuple of Design
        Largest first; those of one condition included.
    """

    def stated(condition: Condition) -> tuple[str, ...]:
        return tuple(s for s in SETTINGS if getattr(condition, s) is not None)

    groups = [
        (names, tuple(members)) for names, members in groupby(sorted(conditions, key=stated), key=stated)
    ]
    order = {c: i for i, c in enumerate(conditions)}
    out = [
        Design(
            tuple(sorted(members, key=order.__getitem__)),
            names,
            tuple(s for s in names if _varies([float(getattr(c, s)) for c in members])),
        )
        for names, members in groups
    ]
    return tuple(sorted(out, key=lambda d: (-len(d.conditions), order[d.conditions[0]])))


def _varies(values: Sequence[float]) -> bool:
    return max(values) - min(values) > SETTING_TOLERANCE * max(abs(v) for v in values)


class Confounder(DocumentPart):
    """Something that varies along with a setting."""

    setting: str = Field(description="the setting")
    other: str = Field(description="setting or feature that varied along")
    correlation: Number = Field(description="over the conditions [1]")
    strong: bool = Field(description="whether the two can't be told apart")


def heating_power(design: Design) -> Floats | None:
    """Mean electrical power over resistance, ``current**2 * duty_cycle`` [A^2], shape (C,); None without currents.

    A duty cycle that is not stated counts as 1: a constant factor, unless it varied unrecorded.
    """
    if "current" not in design.stated:
        return None
    duty = design.values("duty_cycle") if "duty_cycle" in design.stated else 1.0
    return np.asarray(design.values("current") ** 2 * duty)


def confounders(design: Design, measured: Mapping[str, Floats]) -> tuple[Confounder, ...]:
    """What varies along with each setting.

    Parameters
    ----------
    design : Design
    measured : mapping of str to ndarray, shape (C,)
        Quantities of each condition that were not set but came about, such as the peak temperature.
    """
    power = heating_power(design)
    came_about = dict(measured) | ({} if power is None else {"mean_power": power})
    out = []
    for setting in design.varied:
        others = {v: design.values(v) for v in design.varied if v != setting}
        for name, values in (others | came_about).items():
            if _varies(values.tolist()):
                r = float(np.corrcoef(design.values(setting), values)[0, 1])
                out.append(
                    Confounder(
                        setting=setting, other=name, correlation=r, strong=abs(r) >= CONFOUNDED_CORRELATION
                    )
                )
    return tuple(out)
