"""Scales of a record, in which weakly informative priors are stated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sma_bayes.arrays import Floats
from sma_bayes.errors import PriorError, near_matches
from sma_bayes.quantities import CHANNELS
from sma_bayes.records.quality import digit
from sma_bayes.records.types import Record

TYPICAL = {False: {"displacement": 0.01, "force": 1.0}, True: {"displacement": 0.03, "force": 1e8}}
"""Order of magnitude of a channel that was not observed: a spring's stroke of 1 cm and force of 1 N; a
specimen's transformation strain of 3 % and stress of 100 MPa."""

LEAST_READINGS = 12
"""Readings, differences of which may all be multiples of the least by chance."""

_SERIES = ("temperature", "time", *CHANNELS)


@dataclass(frozen=True, slots=True)
class RecordScales:
    """Robust range of everything in one or several records.

    Attributes
    ----------
    low, span : mapping of str to float
        Of temperature, time and each channel: 1 % quantile, and distance from there to the 99 % quantile.
    level : mapping of str to float
        Median magnitude.
    trend : mapping of str to float
        +1 where a channel rises with temperature, -1 where it falls; of force and displacement also where they
        were not observed, by the sign of the stiffness.
    typical : mapping of str to float
        See `TYPICAL`; 1 where units are not canonical.
    residual : mapping of str to float
        Residual standard error of the least-squares fit, where it is known already.
    memory : mapping of str to float
        Samples that count as one, from the correlation of those residuals.
    correlation, correlation_time : mapping of str to float
        Of neighbouring noise at the longest memory that it may have, and the time in which that is forgotten; of
        channels for which there is such a bound.
    step : mapping of str to float
        Step of each channel whose readings are whole multiples of one; else 0.
    """

    low: Mapping[str, float]
    span: Mapping[str, float]
    level: Mapping[str, float]
    trend: Mapping[str, float]
    typical: Mapping[str, float]
    residual: Mapping[str, float] = field(default_factory=dict)
    memory: Mapping[str, float] = field(default_factory=dict)
    correlation: Mapping[str, float] = field(default_factory=dict)
    correlation_time: Mapping[str, float] = field(default_factory=dict)
    step: Mapping[str, float] = field(default_factory=dict)

    def with_residual(self, residual: Mapping[str, float]) -> RecordScales:
        """The same with the residual standard error of each channel."""
        return replace(self, residual={c: max(v, 1e-9 * self.span[c]) for c, v in residual.items()})

    def with_memory(self, memory: Mapping[str, float]) -> RecordScales:
        """The same with the number of samples of each channel that count as one."""
        return replace(self, memory=dict(memory))

    def with_longest_memory(self, longest: Mapping[str, float], step: float) -> RecordScales:
        """The same with the longest memory that the noise of a channel may have.

        Parameters
        ----------
        longest : mapping of str to float
            Channel to how many samples count as one then, ``m = (1 + r)/(1 - r)`` for neighbours correlated by ``r``;
            more than 1.
        step : float
            Time between samples.
        """
        correlation = {c: (m - 1.0) / (m + 1.0) for c, m in longest.items()}
        forgotten = {c: -step / np.log(r) for c, r in correlation.items()}
        return replace(self, correlation=correlation, correlation_time=forgotten)

    @staticmethod
    def of(records: Sequence[Record]) -> RecordScales:
        """Scales of the records of one posterior, taken together."""
        first = records[0]
        series: dict[str, Floats] = {"temperature": np.concatenate([r.temperature for r in records])}
        if all("time" in r.inputs for r in records):
            series["time"] = np.concatenate([r.inputs["time"] - r.inputs["time"].min() for r in records])
        trend = {}
        for channel in first.channels:
            series[channel] = np.concatenate([r.observed[channel] for r in records])
            falls = np.corrcoef(_ranks(series["temperature"]), _ranks(series[channel]))[0, 1] < 0
            trend[channel] = -1.0 if falls else 1.0
        if "stiffness" in series:  # dF/dX has the sign of both trends; the unobserved one takes what is left
            sign = -1.0 if np.median(series["stiffness"]) < 0.0 else 1.0
            known = trend.get("displacement", sign * trend.get("force", sign))
            trend.setdefault("displacement", known)
            trend.setdefault("force", sign * known)
        low, span, level = {}, {}, {}
        for name, values in series.items():
            bottom, top = np.quantile(values, (0.01, 0.99))
            low[name], span[name] = float(bottom), float(top - bottom)
            level[name] = float(np.median(np.abs(values)))
            if not span[name] > 0.0:
                span[name] = float(np.ptp(values)) or max(abs(level[name]), 1.0) * 1e-6
        canonical = all(first.units.get(c) in (None, "m", "N", "N/m", "1", "Pa") for c in first.channels)
        typical = TYPICAL[first.specimen] if canonical else {"displacement": 1.0, "force": 1.0}
        step = {c: _step(series[c]) for c in first.channels}
        return RecordScales(low, span, level, trend, typical, step=step)

    def resolve(self, expression: str, channel: str = "") -> tuple[float, float]:
        """Scale and shift that an expression stands for.

        Parameters
        ----------
        expression : str
            Products and quotients of ``span(x)``, ``level(x)``, ``typical(x)``, ``residual(x)``, ``memory(x)``,
            ``correlation(x)``, ``correlation_time(x)`` and ``step(x)``, or ``position(x)`` alone: 0 at the bottom of
            the range of ``x`` and 1 at its top. ``x`` is temperature, time or a channel.
        channel : str
            What the word ``channel`` stands for.

        Returns
        -------
        scale, shift : float

        Raises
        ------
        KeyError
            If it speaks of something that was not observed.
        PriorError
            If it can't be understood.
        """
        scale, shift = 1.0, 0.0
        for sign, factor in _factors(expression):
            kind, _, rest = factor.partition("(")
            name = rest.rstrip(")").strip()
            name = channel if name == "channel" else name
            if factor == "1":
                continue
            if name not in _SERIES:  # a typing error must not pass for something that was not observed
                raise PriorError(
                    f"scale {expression!r} can't be understood", expected=near_matches(name, _SERIES)
                )
            if kind == "position" and expression.strip() == factor:
                return self.span[name], self.low[name]
            tables = {
                "span": self.span, "level": self.level, "typical": self.typical, "residual": self.residual,
                "memory": self.memory, "correlation": self.correlation,
                "correlation_time": self.correlation_time, "step": self.step,
            }  # fmt: skip
            if kind not in tables or not rest.endswith(")"):
                raise PriorError(
                    f"scale {expression!r} can't be understood",
                    expected="products of span(x), level(x), typical(x), residual(x), memory(x), correlation(x), "
                    "correlation_time(x), step(x), or position(x) alone; "
                    + near_matches(kind, [*tables, "position"]),
                )
            scale *= tables[kind][name] ** sign
        return scale, shift


def _step(values: Floats) -> float:
    """Step of readings (n,); a few of them are too few to tell, and coarse readings need not come twice."""
    return digit(values, most=1.0) if values.size >= LEAST_READINGS else 0.0


def _factors(expression: str) -> list[tuple[int, str]]:
    parts: list[tuple[int, str]] = []
    sign, word = 1, ""
    for letter in expression + "*":
        if letter in "*/":
            parts.append((sign, word.strip()))
            sign, word = (1 if letter == "*" else -1), ""
        else:
            word += letter
    return parts


def _ranks(values: Floats) -> Floats:
    return np.argsort(np.argsort(values, kind="stable"), kind="stable").astype(float)
