"""Sampler runs that were killed go on where they stopped."""

import pytest
import torch

from femupdate.inference.parameters import Parameters
from femupdate.inference.smc import THOROUGH, TemperedSmc
from femupdate.progress import Silent
from femupdate.workflow.sampling import ChainRunner


class KilledError(Exception):
    """Stands for a kill in the middle of a run."""


def sampler(fails_after=None):
    prior = Parameters.uniform(
        ("a", "b"), torch.zeros(2).double(), torch.tensor([1.0, 3.0]).double()
    )
    calls = 0

    def log_likelihood(theta):
        nonlocal calls
        calls += 1
        if fails_after is not None and calls > fails_after:
            raise KilledError
        return -0.5 * (((theta - torch.tensor([0.3, 2.0])) / 0.01) ** 2).sum(-1)

    return TemperedSmc(prior, log_likelihood, settings=THOROUGH)


def runner(folder, fingerprint="one"):
    return ChainRunner(400, 2, 7, Silent(), folder, fingerprint)


@pytest.fixture(autouse=True)
def _save_every_level(monkeypatch):
    monkeypatch.setattr("femupdate.workflow.sampling._SAVE_EVERY_S", -1.0)


@pytest.mark.parametrize("fails_after", [30, 150])  # in the first chain, in the second
def test_a_killed_run_goes_on_to_the_same_draws(tmp_path, fails_after):
    whole = runner(tmp_path / "whole")(sampler(), "sampling")
    with pytest.raises(KilledError):
        runner(tmp_path / "cut")(sampler(fails_after), "sampling")
    resumed = runner(tmp_path / "cut")(sampler(), "sampling")
    for one, other in zip(whole, resumed, strict=True):
        assert torch.equal(one.theta, other.theta)
        assert one.log_evidence == other.log_evidence
        assert one.levels == other.levels


def test_a_state_of_something_else_is_not_gone_on_from(tmp_path):
    whole = runner(tmp_path / "whole")(sampler(), "sampling")
    with pytest.raises(KilledError):
        runner(tmp_path / "cut", "another")(sampler(30), "sampling")
    fresh = runner(tmp_path / "cut")(sampler(), "sampling")
    assert torch.equal(whole[0].theta, fresh[0].theta)


def test_a_damaged_state_is_drawn_again(tmp_path):
    whole = runner(tmp_path / "whole")(sampler(), "sampling")
    with pytest.raises(KilledError):
        runner(tmp_path / "cut")(sampler(30), "sampling")
    for path in (tmp_path / "cut").iterdir():
        path.write_bytes(path.read_bytes()[:200])
    again = runner(tmp_path / "cut")(sampler(), "sampling")
    assert torch.equal(whole[0].theta, again[0].theta)


def test_clear_leaves_nothing(tmp_path):
    run = runner(tmp_path / "states")
    run(sampler(), "sampling")
    assert (tmp_path / "states").exists()
    run.clear()
    assert not (tmp_path / "states").exists()
