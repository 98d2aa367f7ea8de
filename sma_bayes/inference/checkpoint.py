"""Checkpoints: chains in emcee's own HDF format, appended a block at a time.

emcee's backend opens the file anew for every step, which would take longer than the steps themselves; here a
block of steps is written at once. The file stays what `emcee.backends.HDFBackend` reads. emcee resumes a chain
under another log-probability without complaint, so the file carries a fingerprint of data, priors, model and
versions, and a mismatch is refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from emcee.backends import HDFBackend

from sma_bayes.errors import OutputError, ResumeError
from sma_bayes.quantities import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Consecutive steps of one ensemble.

    Attributes
    ----------
    chain : ndarray, shape (S, W, D)
    log_prob : ndarray, shape (S, W)
    accepted : ndarray, shape (W,)
        Number of accepted proposals of each walker.
    log_weight : ndarray
        Importance weights seen on the way, for the evidence.
    random_state : tuple
        State of the random numbers after the last step.
    """

    chain: Floats
    log_prob: Floats
    accepted: Floats
    log_weight: Floats
    random_state: tuple[Any, ...]


class Checkpoint:
    """Chains of one posterior in one file, a group for each stage and ensemble.

    Parameters
    ----------
    path : Path
    fingerprint : str
        Of the posterior, the seed and the plan of the run.

    Raises
    ------
    ResumeError
        If the file holds chains of another posterior.
    """

    def __init__(self, path: Path, fingerprint: str) -> None:
        self.path = path
        if path.exists():
            try:
                with h5py.File(path, "r") as file:
                    found = str(file.attrs.get("fingerprint", ""))
            except OSError:
                raise ResumeError(
                    "can't be read as a checkpoint",
                    file=path,
                    expected="chains that an earlier run left",
                    remedy="delete the file; only this record is sampled again",
                ) from None
            if found != fingerprint:
                raise ResumeError(
                    "was left by a run with other data, priors, model, seed or versions",
                    file=path,
                    expected="the same on resuming",
                    remedy="resume with what the run was started with, or choose another --out",
                )
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with h5py.File(path, "w") as file:
                file.attrs["fingerprint"] = fingerprint
        except OSError as error:
            raise _unwritable(path, error) from None

    def blocks(self, name: str) -> Iterator[Block]:
        """Blocks that are stored for one ensemble, in order."""
        with h5py.File(self.path, "r") as file:
            if name not in file:
                return
            group = file[name]
            chain, log_prob = group["chain"][()], group["log_prob"][()]
            ends = group["block_end"][()].astype(int) if "block_end" in group else np.empty(0, dtype=int)
            start = 0
            for i, end in enumerate(ends):
                random_state = (
                    "MT19937",
                    group["random_keys"][i],
                    *(int(v) for v in group["random_position"][i][:2]),
                    float(group["random_gauss"][i]),
                )
                yield Block(
                    chain[start:end],
                    log_prob[start:end],
                    group["block_accepted"][i],
                    group[f"log_weight_{i}"][()],
                    random_state,
                )
                start = end

    def append(self, name: str, block: Block) -> None:
        """Add a block to one ensemble's chain.

        Raises
        ------
        OutputError
            If it can't be written, for instance because the disk is full.
        """
        steps, walkers, dimension = block.chain.shape
        try:
            backend = HDFBackend(str(self.path), name=name, compression="gzip", compression_opts=1)
            if not backend.initialized:
                backend.reset(walkers, dimension)
            with self._open() as file:
                group = file[name]
                done = int(group.attrs["iteration"])
                total = done + steps
                for key, values in (("chain", block.chain), ("log_prob", block.log_prob)):
                    group[key].resize(total, axis=0)
                    group[key][done:total] = values
                group["accepted"][...] = group["accepted"][...] + block.accepted
                number = len(group["block_end"]) if "block_end" in group else 0
                _, keys, position, has_gauss, gauss = block.random_state
                group.create_dataset(f"log_weight_{number}", data=block.log_weight)
                _append(group, "block_accepted", np.asarray(block.accepted, dtype=float))
                _append(group, "random_keys", np.asarray(keys))
                _append(group, "random_position", np.array([position, has_gauss]))
                _append(group, "random_gauss", np.array(gauss))
                for i, part in enumerate(block.random_state):
                    group.attrs[f"random_state_{i}"] = part
                group.attrs["iteration"] = total
                _append(group, "block_end", np.array(total))  # last: a block counts once all of it is there
        except OSError as error:
            raise _unwritable(self.path, error) from None

    @contextmanager
    def _open(self) -> Iterator[h5py.File]:
        with h5py.File(self.path, "a") as file:
            yield file
            file.flush()


def _append(group: h5py.Group, name: str, value: Floats) -> None:
    if name not in group:
        group.create_dataset(name, data=value[None], maxshape=(None, *value.shape))
        return
    data = group[name]
    data.resize(len(data) + 1, axis=0)
    data[-1] = value


def _unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(
        f"can't be written: {error.strerror or error}",
        file=path,
        expected="room and permission for the chains",
        remedy="free the disk or choose another --out; then repeat with --resume",
    )
