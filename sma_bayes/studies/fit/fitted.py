"""Fits in memory as people use them: tables, bands, plots, answers and InferenceData of one record."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import numpy.typing as npt

from sma_bayes.arrays import Floats
from sma_bayes.arviz_bridge import open_posterior
from sma_bayes.assess.at import credible_at, predictive_at
from sma_bayes.assess.bands import band_channels, credible_band
from sma_bayes.assess.correlation import correlation_factors
from sma_bayes.assess.draws import RecordDraws, record_draws
from sma_bayes.errors import MeasurementError, SmaBayesError, UnknownNameError, near_matches
from sma_bayes.fitting.fit import Fit
from sma_bayes.fitting.least_squares import LeastSquares, least_squares_at
from sma_bayes.progress import Progress, silent
from sma_bayes.records.types import Record
from sma_bayes.runs.declared_units import Shown, shown_as, shown_units
from sma_bayes.runs.fit_document import FitFindings, RecordSummary, SelfCheckSummary
from sma_bayes.runs.shown import in_shown_units
from sma_bayes.runs.store import write_posterior
from sma_bayes.studies.ask.workflow import PROBABILITY, FitSource, Question, ask
from sma_bayes.studies.fit.summary import record_summary

if TYPE_CHECKING:
    import pandas as pd

    from sma_bayes.report.figures.on_axes import Axes

SHOWN = (
    "unit",
    "median",
    "mean",
    "sd",
    "q05",
    "q95",
    "rhat",
    "ess_bulk",
    "ess_tail",
    "identified",
    "fixed",
    "meaning",
)
"""Columns of the table of parameters."""


@dataclass(frozen=True, eq=False, repr=False)
class RecordFit(Fit):
    """The fit of one record: a `Fit`, and what files hold of it.

    Attributes
    ----------
    index : int
        Which of the records that share the posterior.
    self_check : SelfCheckSummary or None
        Of ``fit(..., self_check=True)``.
    """

    index: int = 0
    self_check: SelfCheckSummary | None = None

    @classmethod
    def of(cls, fit: Fit, index: int) -> RecordFit:
        """The fit of one of the records that share a posterior."""
        return cls(**{f.name: getattr(fit, f.name) for f in fields(Fit) if f.init}, index=index)

    @property
    def record(self) -> Record:
        """What was set and measured."""
        return self.records[self.index]

    @property
    def adequate(self) -> bool:
        """Whether curve and noise describe the data; ``document["why"]`` says why not."""
        return self.summarised.adequate

    @cached_property
    def _replicated(self) -> dict[str, Floats]:
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, 4, *self.record.key.encode()]))
        return dict(self.posterior.replicate(rng, self.flat, record=self.index, weights=self.discrepancy))

    @cached_property
    def summarised(self) -> RecordSummary:
        """What ``summary.json`` says of the record."""
        measured, again = correlation_factors(self, self._replicated, self.index)
        found = record_summary(self, self.index, measured, again)
        return found if self.self_check is None else found.but(self_check=self.self_check)

    @cached_property
    def _units(self) -> Shown:
        return shown_units([self.record])

    @property
    def _shown(self) -> RecordSummary:
        """What the summary says, in the units in which the measurements were declared."""
        return in_shown_units(_summary_of([self]), self._units).records[0]

    @cached_property
    def document(self) -> dict[str, Any]:
        """The same as JSON has it."""
        return self.summarised.as_json()

    @cached_property
    def least_squares(self) -> LeastSquares:
        """Least-squares estimate of the curve, with standard errors: what the sampling started from."""
        posterior = self.posterior
        theta = self.warm_start.theta
        return least_squares_at(posterior.records, posterior.model, theta, posterior.sampled_model)

    def summary(self, *, declared: bool = False) -> pd.DataFrame:
        """Parameters with their units, medians, intervals and diagnostics, one a row.

        Parameters
        ----------
        declared : bool
            Whether they are in the units in which the measurements were declared, such as mm, and not in those of
            ``summary.json``.
        """
        import pandas as pd

        parameters = (self._shown if declared else self.summarised).parameters
        rows = [[getattr(p, name) for name in SHOWN] for p in parameters.values()]
        return pd.DataFrame(rows, index=pd.Index(list(parameters), name="parameter"), columns=list(SHOWN))

    def to_inference_data(self) -> Any:
        """The posterior as arviz has it, with the groups of ``posterior/*.nc``.

        Returns
        -------
        arviz.InferenceData or xarray.DataTree
            With arviz 0.23 and 1.x.
        """
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "posterior.nc"
            write_posterior(path, self, self.index, self._replicated)
            return open_posterior(path).load()

    def band(self, channel: str = "stiffness", *, extrapolate: float = 0.0) -> pd.DataFrame:
        """Bands of a channel against temperature, with the columns of ``bands/*.csv``.

        Parameters
        ----------
        channel : str
        extrapolate : float
            How far to go beyond the observed temperatures [unit of temperature].

        Raises
        ------
        MeasurementError
            If the record does not tell of the channel.
        """
        import pandas as pd

        self._require(channel)
        found = credible_band(self, channel, self.index, extrapolate)
        return pd.DataFrame(found.columns(self.record.units["temperature"]))

    def values(
        self,
        channel: str,
        temperature: npt.ArrayLike,
        *,
        probability: float = PROBABILITY,
        declared: bool = False,
    ) -> pd.DataFrame:
        """A channel at given temperatures: interval of the curve, and of a new reading.

        Parameters
        ----------
        channel : str
        temperature : float or array_like, shape (m,)
            [unit of temperature of the record]; beyond what was observed the curve is extrapolated, and marked.
        probability : float
            That the intervals hold [1].
        declared : bool
            Whether the channel is in the unit in which the measurements were declared, such as N/mm, and not in that of
            ``summary.json``. Temperatures are the same either way.

        Returns
        -------
        pandas.DataFrame
            A row for each temperature: ``low``, ``median``, ``high``, ``pred_low``, ``pred_median``, ``pred_high`` (NaN
            where the channel was not measured itself) [``unit``, also ``attrs["unit"]``], ``extrapolated`` and
            ``unit``.

        Raises
        ------
        MeasurementError
            If the record does not tell of the channel.
        SmaBayesError
            If a temperature is no finite number, or the probability not between 0 and 1.
        """
        import pandas as pd

        self._require(channel)
        at = _numbers(temperature)
        if at.ndim != 1 or not np.isfinite(at).all():
            unit = self.record.units["temperature"]
            raise SmaBayesError(
                f"temperature {temperature!r}",
                expected=f"finite numbers in {unit}, one or a sequence of them",
                remedy=f"give them without a unit; `ask` takes texts such as '60 {unit}'",
            )
        if not 0.0 < probability <= 1.0:
            raise SmaBayesError(f"probability {probability}", expected="more than 0 and at most 1")
        curves = self.curves(self.index)
        curve = credible_at(lambda t: curves.curve(channel, t), at, probability)
        new = predictive_at(curves, channel, at, probability, self.seed)
        observed = self.record.temperature
        columns = {"low": curve.low, "median": curve.median, "high": curve.high}
        for name in ("low", "median", "high"):
            columns[f"pred_{name}"] = np.full(at.size, np.nan) if new is None else getattr(new, name)
        beyond = (at < observed.min()) | (at > observed.max())
        units = self._units if declared else {}
        shown = shown_as(self.summarised.quantities[channel].unit, units, self.record.quantity(channel))
        told = {name: shown.values(y) for name, y in columns.items()}
        frame = pd.DataFrame(told, index=pd.Index(at, name="temperature"))
        frame.attrs["unit"] = shown.shown
        return frame.assign(extrapolated=beyond, unit=shown.shown)

    def stiffness(
        self, temperature: npt.ArrayLike, *, probability: float = PROBABILITY, declared: bool = False
    ) -> pd.DataFrame:
        """Stiffness, or the modulus of a specimen, at given temperatures; see `values`."""
        return self.values("stiffness", temperature, probability=probability, declared=declared)

    def force(
        self, temperature: npt.ArrayLike, *, probability: float = PROBABILITY, declared: bool = False
    ) -> pd.DataFrame:
        """Force, or the stress of a specimen, at given temperatures; see `values`."""
        return self.values("force", temperature, probability=probability, declared=declared)

    def displacement(
        self, temperature: npt.ArrayLike, *, probability: float = PROBABILITY, declared: bool = False
    ) -> pd.DataFrame:
        """Displacement, or the strain of a specimen, at given temperatures; see `values`."""
        return self.values("displacement", temperature, probability=probability, declared=declared)

    def ask(self, **question: Unpack[Question]) -> dict[str, Any]:
        """Answer what `sma_bayes.ask` answers of a folder, with the same arguments."""
        return Fits({self.record.key: self}).ask(**question)

    def plot(self, channel: str | None = None, *, ax: Axes | None = None, declared: bool = True) -> Axes:
        """Draw measurements and credible bands of a channel against temperature.

        Parameters
        ----------
        channel : str, optional
            The first observed one by default.
        ax : matplotlib.axes.Axes, optional
            Where to draw; the current axes of pyplot by default.
        declared : bool
            Whether in the units in which the measurements were declared, as reports have them, or in those of
            ``summary.json``.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        MeasurementError
            If the record does not tell of the channel.
        """
        from sma_bayes.report.figures.on_axes import draw_band

        channel = self.record.channels[0] if channel is None else channel
        self._require(channel)
        return draw_band(
            self.record, credible_band(self, channel, self.index), ax, self._units if declared else {}
        )

    def _require(self, channel: str) -> None:
        known = band_channels(self.record)
        if channel not in known:
            raise MeasurementError(
                f"{self.record.key} does not tell of {channel!r}", expected=", ".join(known)
            )

    def __repr__(self) -> str:
        state = "converged" if self.converged else "NOT CONVERGED"
        channels = ", ".join(self.record.quantity(c) for c in self.record.channels)
        model, noise = self.posterior.model.name, self.posterior.noise.name
        return (
            f"<RecordFit {self.record.key}: {channels}, {self.record.n} samples, {model}, {noise}, {state}>"
        )

    def _repr_html_(self) -> str:
        table = self.summary(declared=True)[["unit", "median", "q05", "q95", "identified"]].to_html(
            float_format="{:.5g}".format
        )
        state = "converged" if self.converged else "<strong>not converged</strong>"
        described = "adequate" if self.adequate else "<strong>not adequate</strong>"
        return f"<p>{self.record.key}: {self.record.n} samples, {state}, {described}</p>{table}"


class UnknownRecordError(UnknownNameError, KeyError):
    """A campaign has no such record."""


class Fits(dict[str, RecordFit]):
    """Fits of a campaign by the keys of their records, ``<condition>-<branch>``."""

    def __missing__(self, key: object) -> RecordFit:
        raise UnknownRecordError(f"there is no fit of {key!r}", remedy=near_matches(str(key), self))

    def summary(self, *, declared: bool = False) -> pd.DataFrame:
        """Parameters of all records, by record and parameter; see `RecordFit.summary`."""
        import pandas as pd

        tables = {key: fit.summary(declared=declared) for key, fit in self.items()}
        return pd.concat(tables, names=["record", "parameter"])

    def ask(self, **question: Unpack[Question]) -> dict[str, Any]:
        """Answer what `sma_bayes.ask` answers of a folder, with the same arguments."""
        return ask(self._source(), **question)

    def sensitivity(
        self, at: str | Sequence[str] = (), *, seed: int = 0, jobs: int | None = None
    ) -> dict[str, Any]:
        """Tell what the numbers rest on, as `sma_bayes.sensitivity` tells of a folder."""
        from sma_bayes.studies.sensitivity.workflow import sensitivity_of

        return sensitivity_of(self._source(), at, seed, jobs)

    def _source(self) -> FitSource:
        summary = _summary_of(list(self.values()))

        def draws(entry: RecordSummary) -> RecordDraws:
            fit = self[entry.key]
            return record_draws(fit, fit.index)

        return FitSource("the fit", summary, draws)

    def __repr__(self) -> str:
        return "\n".join(map(repr, self.values())) or "<no fits>"

    def _repr_html_(self) -> str:
        return "".join(fit._repr_html_() for fit in self.values())


def _summary_of(fits: Sequence[RecordFit]) -> FitFindings:
    """What ``summary.json`` says of some records."""
    records = tuple(fit.summarised for fit in fits)
    return FitFindings(
        schema="sma-bayes/fit/1",
        seed=fits[0].seed,
        converged=all(r.converged for r in records),
        adequate=all(r.adequate for r in records),
        records=records,
    )


@contextmanager
def shown_progress(progress: bool | Progress, total: int) -> Iterator[Progress]:
    """What is told of the progress: nothing, a bar that notebooks and terminals show, or a function of the caller."""
    if callable(progress):
        yield progress
    elif not progress:
        yield silent
    else:
        from rich.progress import Progress as Bar

        with Bar() as bar:
            task = bar.add_task("fit", total=total)
            yield lambda done, total, message: bar.update(
                task, completed=done, total=total, description=message
            )


def by_record(fits: Sequence[Fit]) -> Fits:
    """Fits of records by their keys; records that share a posterior each have their own view of it."""
    return Fits({r.key: RecordFit.of(fit, i) for fit in fits for i, r in enumerate(fit.records)})


def _numbers(values: npt.ArrayLike) -> Floats:
    """One number or a sequence as an array; NaN for what is none."""
    try:
        return np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        return np.array([np.nan])
