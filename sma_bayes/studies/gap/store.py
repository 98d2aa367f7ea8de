"""Posterior and series of a study on disk."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from sma_bayes.checksum import add_checksum
from sma_bayes.fitting.posterior import versions
from sma_bayes.runs.store import write_csv, write_file
from sma_bayes.sampling.ensembles import Draws
from sma_bayes.studies.gap.outcome import HEATING, GapOutcome
from sma_bayes.studies.gap.series import joined, series_columns, series_of

DRAWS_PER_ENSEMBLE = 500
"""Draws of each ensemble that are stored at most."""
PRIOR_DRAWS = 2000

POSTERIOR = Path("posterior") / "gap.nc"
POSTERIOR_OF_HEATING = Path("posterior") / f"gap_{HEATING}.nc"
SERIES = Path("series.csv")


def write_study(folder: Path, outcome: GapOutcome, *, seed: int) -> None:
    """Write ``series.csv`` and, where an effect was added, ``posterior/gap.nc``; of the heat balance a file of its own.

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    parts = {POSTERIOR: outcome} | ({POSTERIOR_OF_HEATING: outcome.heating} if outcome.heating else {})
    for place, part in parts.items():
        if part.draws is not None:
            _write_tree(folder / place, posterior_tree(part, part.draws, seed))
    columns = [series_columns(p.study, series_of(p.study, p.flat)) for p in parts.values()]
    write_csv(folder / SERIES, joined(columns), digits=7)


def _write_tree(path: Path, tree: Any) -> None:
    def write(place: Path) -> None:
        tree.to_netcdf(place, engine="h5netcdf")
        add_checksum(place)

    write_file(path, write, nbytes=int(tree.nbytes))


def posterior_tree(outcome: GapOutcome, draws: Draws, seed: int) -> Any:
    """Draws of the final model as `arviz.from_netcdf` opens them.

    Returns
    -------
    xarray.DataTree
        Groups ``posterior`` (chains are the independent ensembles; each parameter with its unit, meaning and prior),
        ``sample_stats`` (``lp``) and ``prior`` (parameters of the effects; left out where there is no effect).
    """
    import xarray as xr

    space = outcome.study.final.hypothesis.space
    groups, steps, walkers, _ = draws.z.shape
    kept = np.linspace(0, steps * walkers - 1, min(DRAWS_PER_ENSEMBLE, steps * walkers)).round().astype(int)
    z = np.swapaxes(draws.z, 1, 2).reshape(groups, steps * walkers, -1)[:, kept]
    theta = space.constrain(z)
    lp = np.swapaxes(draws.log_prob, 1, 2).reshape(groups, -1)[:, kept]
    coords = {"chain": np.arange(groups), "draw": np.arange(z.shape[1])}
    dims = ("chain", "draw")
    posterior = {
        p.name: (
            dims,
            theta[:, :, i],
            {"unit": p.unit, "long_name": p.meaning, "prior": repr(p.prior), "prior_source": p.source},
        )
        for i, p in enumerate(space.parameters)
    }
    tree = {
        "/": xr.Dataset(attrs=_attributes(outcome, draws, seed)),
        "posterior": xr.Dataset(posterior, coords),
        "sample_stats": xr.Dataset({"lp": (dims, lp)}, coords),
    }
    positions = outcome.study.final.hypothesis.effect_positions
    if positions:
        rng = np.random.default_rng(np.random.SeedSequence([seed, 17]))
        prior = space.constrain(space.draw(rng, PRIOR_DRAWS))
        drawn = {space.parameters[i].name: (dims, prior[None, :, i]) for at in positions.values() for i in at}
        tree["prior"] = xr.Dataset(drawn, {"chain": [0], "draw": np.arange(PRIOR_DRAWS)})
    return xr.DataTree.from_dict(tree)


def _attributes(outcome: GapOutcome, draws: Draws, seed: int) -> dict[str, Any]:
    return {
        "title": "posterior of the model with the effects that were added",
        "effects": ", ".join(e.id for e in outcome.study.effects),
        "verdict": outcome.study.verdict,
        "seed": seed,
        "converged": int(draws.convergence.converged),
        "sampler": f"emcee ensembles, {draws.method}",
        "versions": json.dumps(versions()),
        "inference_library": "emcee",
        "inference_library_version": versions()["emcee"],
        "creation_library": "sma_bayes",
        "creation_library_version": versions()["sma-bayes"],
    }
