"""Checkpoints: chains in emcee's own HDF format, appended a block at a time.

emcee's backend opens the file anew for every step, which would take longer than the steps themselves; here a
block of steps is written at once. The file stays what `emcee.backends.HDFBackend` reads. emcee resumes a chain
under another log-probability without complaint, so the file carries a fingerprint of data, priors, model and
versions, and a mismatch is refused.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from emcee.backends import HDFBackend
from numpy.typing import NDArray

from sma_bayes.arrays import Floats
from sma_bayes.disk import NEEDED, reason, unwritable, writing
from sma_bayes.errors import ResumeError

HELD_BACK_S: Final = 1.0
"""Time from the start of a run in which its blocks are kept in memory alone [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class StepBlock:
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
    evaluations : int
        Evaluations of the density that the block took.
    """

    chain: Floats
    log_prob: Floats
    accepted: Floats
    log_weight: Floats
    random_state: tuple[Any, ...]
    evaluations: int


class Checkpoint:
    """Chains of one posterior in one file, a group for each stage, and for each ensemble where they run apart.

    Blocks are held back for the first `HELD_BACK_S`: what is killed by then is soon made again, and writing takes a
    tenth of the time of a short record. A file that can't be read, because the process was killed while it wrote, is
    set aside as ``*.unreadable`` and the chains are begun again; they come out the same.

    Parameters
    ----------
    path : Path
    fingerprint : str
        Of the posterior, the seed and the plan of the run.

    Raises
    ------
    ResumeError
        If the file holds chains of another posterior.
    OutputError
        If it can't be written.
    """

    def __init__(self, path: Path, fingerprint: str) -> None:
        self.path = path
        self.fingerprint = fingerprint
        self._write_from = time.monotonic() + HELD_BACK_S
        self._held: list[tuple[str, StepBlock]] = []
        if path.exists() and not _whole(path):
            with writing(path):
                path.replace(path.with_name(f"{path.name}.unreadable"))
        if not path.exists():
            return
        with h5py.File(path, "r") as file:
            found = str(file.attrs["fingerprint"])
        if found != fingerprint:
            raise ResumeError(
                "was left by a run with other data, priors, model, seed or versions",
                file=path,
                expected="the same on resuming",
                remedy="resume with what the run was started with, or choose another --out",
            )

    def blocks(self, name: str) -> Iterator[StepBlock]:
        """Blocks that are stored for one ensemble, in order.

        They are read at once: while the file is open for reading, another ensemble couldn't append to it.
        """
        if not self.path.exists():
            return iter(())
        with h5py.File(self.path, "r") as file:
            return iter(_blocks(file[name]) if name in file else [])

    def append(self, name: str, block: StepBlock) -> None:
        """Add a block to one ensemble's chain, and those that were held back.

        What an interrupted call has left behind the last whole block is written over.

        Raises
        ------
        OutputError
            If it can't be written, for instance because the disk is full.
        """
        self._held.append((name, block))
        if not self.path.exists():
            if time.monotonic() < self._write_from:
                return
            _create(self.path, self.fingerprint)
        for each in self._held:
            self._write(*each)
        self._held.clear()

    def _write(self, name: str, block: StepBlock) -> None:
        steps, walkers, dimension = block.chain.shape
        with writing(self.path, nbytes=block.chain.nbytes + block.log_prob.nbytes):
            backend = HDFBackend(str(self.path), name=name, compression="gzip", compression_opts=1)
            if not backend.initialized:
                backend.reset(walkers, dimension)
            with self._open() as file:
                group = file[name]
                number = len(group["block_end"]) if "block_end" in group else 0
                done = int(group["block_end"][-1]) if number else 0
                total = done + steps
                for key, values in (("chain", block.chain), ("log_prob", block.log_prob)):
                    group[key].resize(total, axis=0)
                    group[key][done:total] = values
                _, keys, position, has_gauss, gauss = block.random_state
                if f"log_weight_{number}" in group:
                    del group[f"log_weight_{number}"]
                group.create_dataset(f"log_weight_{number}", data=block.log_weight)
                _put(group, "block_accepted", number, np.asarray(block.accepted, dtype=float))
                _put(group, "random_keys", number, np.asarray(keys))
                _put(group, "random_position", number, np.array([position, has_gauss]))
                _put(group, "random_gauss", number, np.array(gauss))
                _put(group, "evaluations", number, np.array(block.evaluations))
                _put(group, "digest", number, _digest(block))
                group["accepted"][...] = group["block_accepted"][()].sum(axis=0)
                for i, part in enumerate(block.random_state):
                    group.attrs[f"random_state_{i}"] = part
                group.attrs["iteration"] = total
                _put(
                    group, "block_end", number, np.array(total)
                )  # last: a block counts once all of it is there

    @contextmanager
    def _open(self) -> Iterator[h5py.File]:
        with h5py.File(self.path, "a") as file:
            yield file
            file.flush()


def _blocks(group: h5py.Group) -> list[StepBlock]:
    chain, log_prob = group["chain"][()], group["log_prob"][()]
    ends = group["block_end"][()].astype(int) if "block_end" in group else np.empty(0, dtype=int)
    out = []
    for i, (start, end) in enumerate(zip((0, *ends), ends, strict=False)):
        position, has_gauss = group["random_position"][i]
        random_state = (
            "MT19937", group["random_keys"][i], int(position), int(has_gauss), float(group["random_gauss"][i])
        )  # fmt: skip
        block = StepBlock(
            chain[start:end],
            log_prob[start:end],
            group["block_accepted"][i],
            group[f"log_weight_{i}"][()],
            random_state,
            int(group["evaluations"][i]),
        )
        if not np.array_equal(_digest(block), group["digest"][i]):
            raise ValueError("a block is not as it was written")
        out.append(block)
    return out


def _digest(block: StepBlock) -> NDArray[np.uint8]:
    """SHA-256 of all that a block holds, shape (32,)."""
    _, keys, position, has_gauss, gauss = block.random_state
    rest = [position, has_gauss, gauss, block.evaluations]
    digest = hashlib.sha256()
    for part in (block.chain, block.log_prob, block.accepted, block.log_weight, keys, rest):
        digest.update(np.ascontiguousarray(part, dtype=float).tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)


def _create(path: Path, fingerprint: str) -> None:
    """Make the file under another name first: it never lacks its fingerprint."""
    temporary = path.with_name(f".{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, reason(error), NEEDED) from None
    try:
        with writing(path, nbytes=1):
            with h5py.File(temporary, "w") as file:
                file.attrs["fingerprint"] = fingerprint
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _whole(path: Path) -> bool:
    """Whether all that a file says it holds can be read; a process that is killed while it writes may spoil it."""
    try:
        with h5py.File(path, "r") as file:
            for group in file.values():
                _blocks(group)
            return "fingerprint" in file.attrs
    except (OSError, KeyError, ValueError, RuntimeError, AttributeError, TypeError):
        return False


def _put(group: h5py.Group, name: str, number: int, value: Floats | NDArray[np.uint8]) -> None:
    """Write an entry behind `number` others."""
    if name not in group:
        group.create_dataset(name, data=value[None], maxshape=(None, *value.shape))
        return
    data = group[name]
    data.resize(number + 1, axis=0)
    data[number] = value
