"""The optimiser: against Adam by hand, and what rotations must not change."""

import numpy as np
import pytest
import torch
from scipy.stats import ortho_group

from femupdate.surrogate import Soap
from tests.helpers import tensor


def run(start, loss, steps, **options):
    """Weights after some steps, one column a step."""
    weight = torch.nn.Parameter(start.clone())
    optimizer = Soap([{"params": [weight], **options}], lr=0.02)
    path = []
    for _ in range(steps):
        optimizer.zero_grad()
        loss(weight).backward()
        optimizer.step()
        path.append(weight.detach().clone())
    return torch.stack(path)


# Curvatures of five decades along the axes of rows and columns, and where the least is.
SCALE = np.logspace(0.0, -5.0, 12).reshape(4, 3)
GOAL = np.random.default_rng(0).normal(size=(4, 3))


def quadratic():
    return lambda w: (tensor(SCALE) * (w - tensor(GOAL)) ** 2).sum()


def adam(start, gradient, steps, decay):
    """Weights after some steps of Adam (Kingma & Ba 2015, alg. 1) with decoupled decay.

    Written by hand: torch's own loads its compiler, which ends processes that have drawn where
    torch is built for CUDA.
    """
    weight, mean, square = np.array(start), 0.0, 0.0
    for count in range(1, steps + 1):
        slope = gradient(weight)
        mean, square = 0.9 * mean + 0.1 * slope, 0.999 * square + 0.001 * slope**2
        size = np.sqrt(square / (1.0 - 0.999**count)) + 1e-8
        weight = (1.0 - 0.02 * decay) * weight - 0.02 * mean / (1.0 - 0.9**count) / size
        yield weight


def test_without_rotation_it_is_adam_with_decoupled_decay():
    start = torch.zeros(4, 3, dtype=torch.float64)
    found = run(start, quadratic(), 40, weight_decay=0.1)
    expected = adam(np.zeros((4, 3)), lambda w: 2.0 * SCALE * (w - GOAL), 40, 0.1)
    np.testing.assert_allclose(found.numpy(), list(expected), rtol=1e-9, atol=1e-12)


def test_rotated_weights_take_the_rotated_path():
    """Adam's path depends on the axes in which weights are written; this one's does not."""
    left, right = (tensor(ortho_group.rvs(size, random_state=size)) for size in (4, 3))
    loss, start = quadratic(), tensor(np.random.default_rng(1).normal(size=(4, 3)))

    def rotated_loss(weight):
        return loss(left.T @ weight @ right.T)

    options = {"rotate": True, "every": 5}
    path = run(start, loss, 30, **options)
    rotated = run(left @ start @ right, rotated_loss, 30, **options)
    torch.testing.assert_close(rotated, left @ path @ right, rtol=1e-5, atol=1e-5)
    plain, turned = run(start, loss, 30), run(left @ start @ right, rotated_loss, 30)
    assert float((turned - left @ plain @ right).abs().max()) > 0.01


@pytest.mark.parametrize("rotate", [False, True])
def test_it_arrives(rotate):
    loss = quadratic()
    path = run(torch.zeros(4, 3, dtype=torch.float64), loss, 400, rotate=rotate)
    assert float(loss(path[-1])) < 1e-3 * float(loss(path[0]))
