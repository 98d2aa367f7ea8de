"""The one door to arviz, for both of its generations.

Python 3.11 gets arviz 0.23, newer Pythons get 1.x. Both open the files that `results.store` writes; 0.23 gives
an ``InferenceData``, 1.x an ``xarray.DataTree``.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from sma_bayes.errors import OutputError


def arviz() -> Any:
    """The arviz module, imported without the notice that 0.23 gives of its successor."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=FutureWarning)
        import arviz as az

    return az


def open_posterior(path: str | Path) -> Any:
    """Open a posterior that a run has written.

    Parameters
    ----------
    path : str or Path
        ``posterior/<condition>-<branch>.nc``.

    Returns
    -------
    arviz.InferenceData or xarray.DataTree
        With arviz 0.23 and 1.x.

    Raises
    ------
    OutputError
        If there is no such file, or it is no posterior.
    """
    place = Path(path)
    try:
        return arviz().from_netcdf(place)
    except (OSError, ValueError, KeyError) as error:
        raise OutputError(
            f"can't be opened as a posterior: {error}",
            file=place,
            expected="posterior/<condition>-<branch>.nc of a finished run",
            remedy="run `sma-bayes fit` again with --resume",
        ) from None
