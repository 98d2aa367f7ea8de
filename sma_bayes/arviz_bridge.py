"""The one door to arviz, for both of its generations.

Python 3.11 gets arviz 0.23, newer Pythons get 1.x. Both open the files that `results.store` writes; 0.23 gives
an ``InferenceData``, 1.x an ``xarray.DataTree``.
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any

from sma_bayes.checksum import has_its_checksum
from sma_bayes.errors import OutputError


def arviz() -> Any:
    """The arviz module, imported without the notice that 0.23 gives of its successor once a day.

    The day of the notice is kept in the user's folder of caches, and where that can't be written (a container whose
    files are read-only) the import fails; then it is kept in a folder that lasts for the import.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=FutureWarning)
        try:
            import arviz as az
        except OSError:
            from tempfile import TemporaryDirectory
            from unittest.mock import patch  # slow to import, and seldom needed

            with TemporaryDirectory() as folder, patch.dict(os.environ, XDG_CACHE_HOME=folder):
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
        If there is no such file, it is no posterior, or it was changed since it was written.
    """
    place = Path(path)
    try:
        changed = not has_its_checksum(place)
        # 1.x would guess the engine from the file, and say of one that is no NetCDF what else might be installed
        tree = arviz().from_netcdf(place, engine="h5netcdf")
    except (OSError, ValueError, KeyError) as error:
        raise _no_posterior(place, str(error)) from None
    if "posterior" not in tree:
        raise _no_posterior(place, "it has no group 'posterior'")
    if changed:
        raise _no_posterior(place, "its content does not have the checksum that it states")
    return tree


def _no_posterior(place: Path, reason: str) -> OutputError:
    return OutputError(
        f"can't be opened as a posterior: {reason}",
        file=place,
        expected="posterior/<condition>-<branch>.nc of a finished run",
        remedy="run `sma-bayes fit` again with --resume",
    )
