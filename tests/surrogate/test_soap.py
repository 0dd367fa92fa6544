"""The optimiser: against torch's Adam, and what rotations must not change."""

import numpy as np
import pytest
import torch
from scipy.stats import ortho_group

from femupdate.surrogate.soap import Soap


def tensor(values):
    return torch.tensor(values, dtype=torch.float64)


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


def quadratic(seed=0):
    """Curvatures of five decades along the axes of rows and columns."""
    scale = tensor(np.logspace(0.0, -5.0, 12).reshape(4, 3))
    goal = tensor(np.random.default_rng(seed).normal(size=(4, 3)))
    return lambda w: (scale * (w - goal) ** 2).sum()


def test_without_rotation_it_is_adam_with_decoupled_decay():
    loss, start = quadratic(), torch.zeros(4, 3, dtype=torch.float64)
    found = run(start, loss, 40, weight_decay=0.1)
    weight = torch.nn.Parameter(start.clone())
    adam = torch.optim.AdamW([weight], lr=0.02, weight_decay=0.1)
    for expected in found:
        adam.zero_grad()
        loss(weight).backward()
        adam.step()
        torch.testing.assert_close(weight.detach(), expected, rtol=1e-9, atol=1e-12)


def test_rotated_weights_take_the_rotated_path():
    """Adam's path depends on the axes in which weights are written; this one's does not."""
    left, right = (tensor(ortho_group.rvs(size, random_state=size)) for size in (4, 3))
    loss, start = quadratic(), tensor(np.random.default_rng(1).normal(size=(4, 3)))

    def rotated_loss(weight):
        return loss(left.T @ weight @ right.T)

    options = {"rotate": True, "every": 5}
    path = run(start, loss, 30, **options)
    rotated = run(left @ start @ right, rotated_loss, 30, **options)
    torch.testing.assert_close(rotated, left @ path @ right, rtol=1e-5, atol=1e-6)
    plain, turned = run(start, loss, 30), run(left @ start @ right, rotated_loss, 30)
    assert float((turned - left @ plain @ right).abs().max()) > 0.01


@pytest.mark.parametrize("rotate", [False, True])
def test_it_arrives(rotate):
    loss = quadratic()
    path = run(torch.zeros(4, 3, dtype=torch.float64), loss, 400, rotate=rotate)
    assert float(loss(path[-1])) < 1e-3 * float(loss(path[0]))


def test_it_goes_on_from_its_state():
    loss, start = quadratic(), torch.zeros(4, 3, dtype=torch.float64)
    whole = run(start, loss, 25, rotate=True)
    weight = torch.nn.Parameter(start.clone())
    groups = [{"params": [weight], "rotate": True}]
    optimizer = Soap(groups, lr=0.02)
    for step in range(25):
        if step == 13:
            kept = optimizer.state_dict()
            optimizer = Soap([{"params": [weight], "rotate": True}], lr=0.02)
            optimizer.load_state_dict(kept)
        optimizer.zero_grad()
        loss(weight).backward()
        optimizer.step()
    assert torch.equal(weight.detach(), whole[-1])
