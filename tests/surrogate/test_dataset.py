"""The data set: what it holds, how small it is, and how it survives a kill."""

import os

import pytest
import torch

from femupdate.surrogate import compute_dataset
from tests.helpers import Recorded

PLAN = {"samples": 110, "modes": 2, "top_hz": 12.8, "seed": 3, "shard": 50}
BEFORE = 1e9  # a time of files that are there already


def solved_since(folder):
    """Names of shards that were written since all were made to look old."""
    return sorted(path.name for path in folder.glob("0*.npz") if path.stat().st_mtime != BEFORE)


def aged(folder):
    for path in folder.glob("*.npz"):
        os.utime(path, (BEFORE, BEFORE))


def same(one, other):
    return torch.equal(one.theta, other.theta) and all(
        torch.equal(getattr(one.modal, name), getattr(other.modal, name))
        for name in ("omega", "effect", "residual")
    )


def test_a_seed_gives_one_data_set(model, prior, tmp_path):
    one = compute_dataset(model, prior, tmp_path / "one", **PLAN)
    assert same(compute_dataset(model, prior, tmp_path / "two", **PLAN), one)
    other = {**PLAN, "seed": 4}
    assert not same(compute_dataset(model, prior, tmp_path / "three", **other), one)


def test_shards_that_are_there_are_not_solved_again(model, prior, tmp_path):
    first = compute_dataset(model, prior, tmp_path, **PLAN)
    assert solved_since(tmp_path) == ["0000.npz", "0001.npz", "0002.npz"]
    aged(tmp_path)
    (tmp_path / "0001.npz").unlink()
    told = Recorded()
    again = compute_dataset(model, prior, tmp_path, **PLAN, progress=told)
    assert same(again, first)
    assert solved_since(tmp_path) == ["0001.npz"]
    assert sorted(told.counts) == [10, 50, 50]


def test_a_killed_run_leaves_whole_shards_only(model, prior, tmp_path):
    class Killed(Recorded):
        def advance(self, count=1, note=""):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compute_dataset(model, prior, tmp_path, **PLAN, progress=Killed())
    whole = [path.name for path in tmp_path.iterdir()]
    assert len(whole) == 1  # that of the first step of the progress
    aged(tmp_path)
    resumed = compute_dataset(model, prior, tmp_path, **PLAN)
    assert whole[0] not in solved_since(tmp_path)
    assert len(solved_since(tmp_path)) == 2
    assert same(resumed, compute_dataset(model, prior, tmp_path / "whole", **PLAN))


@pytest.mark.parametrize("damage", ["cut short", "empty", "a bit", "another file"])
def test_a_damaged_shard_is_not_trusted(model, prior, tmp_path, damage, caplog):
    first = compute_dataset(model, prior, tmp_path, **PLAN)
    aged(tmp_path)
    path = tmp_path / "0001.npz"
    content = bytearray(path.read_bytes())
    if damage == "a bit":
        content[len(content) // 2] ^= 4
    wrong = {"cut short": content[: len(content) // 2], "empty": b"", "a bit": content}
    path.write_bytes(wrong.get(damage, b"a,b\n1,2\n"))
    (tmp_path / ".0001-77aa.part.npz").write_bytes(b"half")  # of a kill in the middle of a write
    assert same(compute_dataset(model, prior, tmp_path, **PLAN), first)
    assert solved_since(tmp_path) == ["0001.npz"]
    assert "0001.npz is damaged" in caplog.text
