"""Checkpoints: what comes back, what an interruption leaves, what is refused."""

from __future__ import annotations

import errno
from pathlib import Path

import h5py
import numpy as np
import pytest
from emcee.backends import HDFBackend

from sma_bayes.errors import OutputError, ResumeError
from sma_bayes.sampling import checkpoint
from sma_bayes.sampling.checkpoint import Checkpoint, StepBlock


def block(seed: int, steps: int = 5, walkers: int = 8, dimension: int = 3) -> StepBlock:
    rng = np.random.default_rng(seed)
    stream = np.random.RandomState(np.random.MT19937(seed))
    stream.standard_normal()  # leaves a second normal number for the next call
    return StepBlock(
        rng.standard_normal((steps, walkers, dimension)),
        rng.standard_normal((steps, walkers)),
        rng.integers(0, steps, walkers).astype(float),
        rng.standard_normal(seed % 4),
        stream.get_state(),
        1000 + seed,
    )


def same(one: StepBlock, other: StepBlock) -> None:
    for name in ("chain", "log_prob", "accepted", "log_weight"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.evaluations == other.evaluations
    a, b = np.random.RandomState(), np.random.RandomState()
    a.set_state(one.random_state)
    b.set_state(other.random_state)
    np.testing.assert_array_equal(a.standard_normal(9), b.standard_normal(9))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "checkpoints" / "c.h5"


def test_blocks_come_back_in_order_to_the_bit(path: Path) -> None:
    stored = [block(seed, steps=3 + seed) for seed in range(4)]
    for b in stored:
        Checkpoint(path, "f").append("a", b)
    for found, b in zip(Checkpoint(path, "f").blocks("a"), stored, strict=True):
        same(found, b)
    assert list(Checkpoint(path, "f").blocks("b")) == []


def test_emcee_reads_the_chain(path: Path) -> None:
    stored = [block(seed) for seed in range(3)]
    for b in stored:
        Checkpoint(path, "f").append("a", b)
    backend = HDFBackend(str(path), name="a", read_only=True)
    np.testing.assert_array_equal(backend.get_chain(), np.concatenate([b.chain for b in stored]))
    np.testing.assert_array_equal(backend.accepted, sum(b.accepted for b in stored))


def test_one_ensemble_is_read_while_another_goes_on(path: Path) -> None:
    first = Checkpoint(path, "f")
    first.append("a", block(0))
    first.append("a", block(1))
    first.append("b", block(2))
    again = Checkpoint(path, "f")
    a, b = again.blocks("a"), again.blocks("b")
    same(next(a), block(0))
    same(next(b), block(2))
    same(next(a), block(1))  # "b" was interrupted here
    again.append("b", block(3))
    same(list(again.blocks("b"))[1], block(3))


@pytest.mark.parametrize(
    "stage",
    ["chain", "log_weight_1", "block_accepted", "random_keys", "random_gauss", "evaluations", "iteration"],
)
def test_half_a_block_is_written_over(path: Path, stage: str) -> None:
    """As where the process was killed after one of the writes of a block."""
    Checkpoint(path, "f").append("a", block(0))
    junk = block(9)
    with h5py.File(path, "a") as file:
        group = file["a"]
        if stage == "iteration":
            group.attrs["iteration"] = 10
        elif stage.startswith("log_weight"):
            group.create_dataset(stage, data=np.zeros(7))
        else:
            group[stage].resize(len(group[stage]) + len(junk.chain), axis=0)
    again = Checkpoint(path, "f")
    assert len(list(again.blocks("a"))) == 1
    again.append("a", block(1))
    again.append("a", block(2))
    for found, seed in zip(again.blocks("a"), range(3), strict=True):
        same(found, block(seed))
    assert HDFBackend(str(path), name="a", read_only=True).iteration == 15


def test_another_run_is_refused_and_left_alone(path: Path) -> None:
    Checkpoint(path, "f").append("a", block(0))
    before = path.read_bytes()
    with pytest.raises(ResumeError, match="left by a run with other data") as caught:
        Checkpoint(path, "g")
    assert str(path) in str(caught.value)
    assert path.read_bytes() == before


@pytest.mark.parametrize("spoil", ["empty", "half", "text", "hole"])
def test_a_spoilt_file_is_set_aside(path: Path, spoil: str) -> None:
    good = Checkpoint(path, "f")
    for seed in range(3):
        good.append("a", block(seed, steps=50))
    content = path.read_bytes()
    spoilt = {"empty": b"", "half": content[: len(content) // 2], "text": b"not HDF5" * 100}.get(spoil)
    if spoilt is not None:
        path.write_bytes(spoilt)
    else:
        with h5py.File(path, "a") as file:
            del file["a/random_keys"]
        spoilt = path.read_bytes()
    again = Checkpoint(path, "f")
    assert list(again.blocks("a")) == []
    again.append("a", block(0))
    same(next(again.blocks("a")), block(0))
    assert path.with_name("c.h5.unreadable").read_bytes() == spoilt


def test_a_full_disk_is_one_message(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Checkpoint(path, "f")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(checkpoint, "_put", full)
    with pytest.raises(OutputError, match="No space left on device") as caught:
        store.append("a", block(0))
    assert "--resume" in str(caught.value)


def test_a_folder_that_can_not_be_made_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="can't be written"):
        Checkpoint(tmp_path / "file" / "c.h5", "f").append("a", block(0))
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_run_that_is_soon_over_writes_nothing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([10.0, 11.9, 12.1, 12.2])
    monkeypatch.setattr(checkpoint, "HELD_BACK_S", 2.0)
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: next(clock))
    run = Checkpoint(path, "f")
    run.append("a", block(0))
    assert not path.parent.exists()
    assert list(run.blocks("a")) == []
    run.append("a", block(1))
    run.append("b", block(2))
    for found, seed in zip(run.blocks("a"), range(2), strict=True):
        same(found, block(seed))
    same(next(run.blocks("b")), block(2))
