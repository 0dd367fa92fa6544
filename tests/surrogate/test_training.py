"""The training: its data, its optimizer, and what comes of it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import ortho_group

from femupdate.surrogate import Soap, TrainingSettings, Visibility, compute_dataset, train_mvae
from femupdate.surrogate import training as room
from tests.helpers import Recorded, tensor


def losses_told(notes):
    """Validation loss after each epoch but the last, as the progress bar shows it."""
    found = dict(note.split(", validation loss ") for note in notes)
    return [float(value) for value in found.values()][1:]


def assert_equal(one, other):
    assert one.keys() == other.keys()
    for name, value in one.items():
        assert torch.equal(value, other[name]), name


def test_training_lowers_the_validation_loss(trained):
    result, told = trained
    losses = [*losses_told(told.notes), result.metrics["validation_loss"]]
    assert len(losses) == 6
    assert losses[-1] < losses[0] - 5.0  # nats of some 130 points
    assert np.isfinite(losses).all()


def test_proposals_tell_theta_apart(trained, task):
    """q(z|x) of noise-free responses is higher where their theta is put than elsewhere."""
    mvae = trained[0].average
    rows = torch.arange(200)
    theta = task.dataset.theta[rows].float()
    pool = room._draw_samples(task, TrainingSettings(), 0, rows).log_frf.float()
    seen = Visibility(torch.ones(200, 2), torch.tensor([[0.0, 1.0]]).expand(200, 2))
    with torch.no_grad():
        x = mvae.encode_observation(pool, seen)
        z = torch.nn.functional.pad(mvae.encode_parameters(theta), (0, 1))
        own, other = x.log_density(z), x.log_density(z.roll(1, 0))
    assert float((own > other).float().mean()) > 0.9


def test_a_seed_gives_one_training_and_leaves_the_global_generator_alone(task, settings):
    short = replace(settings, epochs=1, batch=500)
    before = torch.random.get_rng_state()
    one = train_mvae(task, short)
    assert torch.equal(torch.random.get_rng_state(), before)
    torch.manual_seed(123)
    assert_equal(train_mvae(task, short).average.state_dict(), one.average.state_dict())
    other = train_mvae(task, replace(short, seed=1)).average.state_dict()
    name = "decoder.join.weight"
    assert not torch.equal(other[name], one.average.state_dict()[name])


PLAN = {"samples": 2600, "modes": 2, "top_hz": 12.8}


def same(one, other):
    return torch.equal(one.theta, other.theta) and all(
        torch.equal(getattr(one.modal, name), getattr(other.modal, name))
        for name in ("omega", "effect", "residual")
    )


def test_a_seed_gives_one_data_set(model, prior):
    told = Recorded()
    one = compute_dataset(model, prior, **PLAN, seed=3, progress=told)
    assert told.counts == [1, 1]  # pieces of 2500 and of 100
    assert len(one.modal) == len(one) == 2600
    assert same(compute_dataset(model, prior, **PLAN, seed=3), one)
    assert not same(compute_dataset(model, prior, **PLAN, seed=4), one)
    last = model.modal_data(one.theta[-5:], modes=2, top_frequency_hz=12.8)
    torch.testing.assert_close(one.modal.omega[-5:].double(), last.omega, rtol=1e-6, atol=0.0)


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
