"""The data set: what it holds, how small it is, and how it survives a kill."""

import os

import pytest
import torch

from femupdate.surrogate import compute_dataset
from femupdate.surrogate import dataset as room

PLAN = {"samples": 110, "modes": 2, "top_hz": 12.8, "seed": 3}


@pytest.fixture(autouse=True)
def small_shards(monkeypatch):
    monkeypatch.setattr(room, "SHARD", 50)


@pytest.fixture
def solved(monkeypatch):
    """First theta of every shard that is solved, as it is solved."""
    shards, solve = [], room._solve_shard

    def spy(model, theta, **plan):
        shards.append(theta[0].tolist())
        return solve(model, theta, **plan)

    monkeypatch.setattr(room, "_solve_shard", spy)
    return shards


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


def test_shards_that_are_there_are_not_solved_again(model, prior, tmp_path, solved, recorder):
    first = compute_dataset(model, prior, tmp_path, **PLAN)
    paths = sorted(tmp_path.glob("*.npz"))
    assert len(paths) == len(solved) == 3
    for path in paths:
        os.utime(path, (1e9, 1e9))
    paths[1].unlink()
    solved.clear()
    told = recorder()
    again = compute_dataset(model, prior, tmp_path, **PLAN, progress=told)
    assert same(again, first)
    assert solved == [first.theta[50].tolist()]
    assert [path.stat().st_mtime == 1e9 for path in paths] == [True, False, True]
    assert sorted(told.counts) == [10, 50, 50]


def test_a_killed_run_leaves_whole_shards_only(model, prior, tmp_path, monkeypatch, solved):
    solve = room._solve_shard

    def killed(model, theta, **plan):
        found = solve(model, theta, **plan)
        if len(theta) == 10:
            raise KeyboardInterrupt
        return found

    monkeypatch.setattr(room, "_solve_shard", killed)
    with pytest.raises(KeyboardInterrupt):
        compute_dataset(model, prior, tmp_path, **PLAN)
    whole = {path.name for path in tmp_path.iterdir()}
    assert whole <= {"0000.npz", "0001.npz"}  # the last may end before the one beside it
    monkeypatch.setattr(room, "_solve_shard", solve)
    solved.clear()
    resumed = compute_dataset(model, prior, tmp_path, **PLAN)
    assert len(solved) == 3 - len(whole)
    assert same(resumed, compute_dataset(model, prior, tmp_path / "whole", **PLAN))


@pytest.mark.parametrize("damage", ["cut short", "empty", "a bit", "another file"])
def test_a_damaged_shard_is_not_trusted(model, prior, tmp_path, solved, damage, caplog):
    first = compute_dataset(model, prior, tmp_path, **PLAN)
    path = tmp_path / "0001.npz"
    content = bytearray(path.read_bytes())
    if damage == "a bit":
        content[len(content) // 2] ^= 4
    wrong = {"cut short": content[: len(content) // 2], "empty": b"", "a bit": content}
    path.write_bytes(wrong.get(damage, b"a,b\n1,2\n"))
    (tmp_path / ".0001-77aa.part.npz").write_bytes(b"half")  # of a kill in the middle of a write
    solved.clear()
    assert same(compute_dataset(model, prior, tmp_path, **PLAN), first)
    assert len(solved) == 1
    assert "0001.npz is damaged" in caplog.text
