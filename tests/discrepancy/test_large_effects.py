"""Large effects that a little of would make worse: the factors have made up for most of them."""

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from femupdate.discrepancy import diagnose
from femupdate.discrepancy.fit import fit
from femupdate.discrepancy.score import score
from femupdate.inference.parameters import Parameter, Parameters

STORIES, TRUTH, NOISE = 2, -0.55, 0.01
SIZE = SimpleNamespace(scale=0.4, neutral=0.0, lower=-0.9, upper=0.0, trials=(0.5,))


FACTORS = Parameters.uniform(["theta_1", "theta_2"], [0.5] * 2, [2.0] * 2) + Parameters.uniform(
    ["zeta"], [0.02], [0.02], kind="damping"
)
OWN = Parameters(
    (Parameter(name="size", kind="effect", lower=-0.9, upper=0.0, neutral=0.0, scale=0.4),)
)


class Bent:
    """ln theta along straight lines; an effect that at first does the contrary of what it ends at.

    In the unit of the noise, so that the residuals of a right model are of unit variance.
    """

    placed = SimpleNamespace(effect=SimpleNamespace(parameters=(SIZE,), name="bent"), label="bent")

    def __init__(self, truth):
        rng = np.random.default_rng(4)
        self.design = torch.from_numpy(rng.normal(size=(60, STORIES + 1)) / NOISE)
        self.noise = torch.from_numpy(rng.normal(size=60))
        zero, size = torch.zeros(1, STORIES), torch.full((1, 1), truth)
        self.data = self.predicted(zero.double(), size.double())[0] + self.noise
        self.system, self.prior = SimpleNamespace(placed=()), FACTORS

    def predicted(self, log_theta, sizes):
        return torch.cat([log_theta, (sizes * (sizes + 0.3))], dim=1) @ self.design.T

    def with_effects(self, placed):
        other = copy(self)
        other.system = SimpleNamespace(placed=placed)
        other.prior = FACTORS + OWN if placed else FACTORS
        return other

    def raw(self, values):
        known = self.prior.split(values)
        both = known.sizes if known.sizes.shape[1] else values.new_zeros(len(values), 1)
        return self.data - self.predicted(known.theta.log(), both)

    def whitened(self, residuals):
        return residuals


@pytest.mark.parametrize("truth", [TRUTH, 0.0])
def test_a_test_that_points_to_an_impossible_size_does_not_hide_a_large_one(truth):
    problem = Bent(truth)
    base = fit(problem, (), torch.zeros(STORIES, dtype=torch.float64), 30)
    tested = score(problem, base, problem.placed)
    found = diagnose._glanced([base], 2, None, tested)
    size = SIZE.scale * float(found.z[-1])
    if truth:
        assert tested.statistic == 0.0  # as if there were nothing of it
        assert size == pytest.approx(truth, abs=0.02)
        # Sixty points and their noise, of which three unknowns take a little.
        assert found.misfit < 100.0 < 0.05 * base.misfit
    else:
        assert found.misfit == pytest.approx(base.misfit, rel=0.05)
