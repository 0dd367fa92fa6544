"""Training: it learns, stops, and gives the same weights by the same seed."""

from dataclasses import replace

import numpy as np
import torch

from femupdate.surrogate import TrainingSettings, Visibility, train_mvae
from femupdate.surrogate import training as room


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
