"""Training: it learns, stops, resumes bit for bit, and refuses what does not belong to it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from femupdate.errors import SurrogateError
from femupdate.surrogate import TrainingSettings, Visibility, train_mvae
from femupdate.surrogate import training as room
from tests.helpers import Recorded


class KilledError(Exception):
    """Stands for a kill in the middle of an epoch."""


def kill_in(epoch):
    """Progress that stops the training at the second step of an epoch."""
    notes = []

    def advance(count=1, note=""):
        notes.append(note.split(",")[0])
        if notes.count(f"epoch {epoch + 1}") == 2:
            raise KilledError

    return SimpleNamespace(start=lambda label, total: None, advance=advance)


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


@pytest.mark.parametrize("epoch", [1, 3])  # in a drawing of the damping, and between two
def test_a_killed_training_goes_on_to_the_same_weights(task, quick, tmp_path, epoch):
    whole = train_mvae(task, quick)
    path = tmp_path / "training.safetensors"
    with pytest.raises(KilledError):
        train_mvae(task, quick, path, kill_in(epoch))
    assert path.exists()
    torch.manual_seed(epoch)  # whatever else happens meanwhile
    told = Recorded()
    resumed = train_mvae(task, quick, path, told)
    epochs = {note.split(",")[0] for note in told.notes}
    assert epochs == {f"epoch {k}" for k in range(epoch + 1, 5)}
    assert "nan" not in told.notes[0]
    assert_equal(resumed.average.state_dict(), whole.average.state_dict())
    for name in ("validation_loss", "best_epoch", "epochs"):
        assert resumed.metrics[name] == whole.metrics[name]
    # Once it is done, another call returns the same at once.
    done = train_mvae(task, quick, path, kill_in(0))
    assert_equal(done.average.state_dict(), whole.average.state_dict())


def test_a_seed_gives_one_training_and_leaves_the_global_generator_alone(task, quick):
    short = replace(quick, epochs=1)
    before = torch.random.get_rng_state()
    one = train_mvae(task, short)
    assert torch.equal(torch.random.get_rng_state(), before)
    torch.manual_seed(123)
    assert_equal(train_mvae(task, short).average.state_dict(), one.average.state_dict())
    other = train_mvae(task, replace(short, seed=1)).average.state_dict()
    name = "decoder.join.weight"
    assert not torch.equal(other[name], one.average.state_dict()[name])


@pytest.fixture
def stopped(task, quick, tmp_path):
    path = tmp_path / "training.safetensors"
    with pytest.raises(KilledError):
        train_mvae(task, quick, path, kill_in(1))
    return path


@pytest.mark.parametrize(
    "change", [{"learning_rate": 1e-4}, {"batch": 400}, {"seed": 5}, {"epochs": 9}]
)
def test_a_checkpoint_of_other_settings_is_refused(task, quick, stopped, change):
    with pytest.raises(SurrogateError, match="with other settings; delete it"):
        train_mvae(task, replace(quick, **change), stopped)


def test_a_checkpoint_of_other_data_is_refused(make_task, quick, stopped):
    """As many samples of the same box, of another drawing."""
    with pytest.raises(SurrogateError, match="on other data; delete it"):
        train_mvae(make_task(seed=8), quick, stopped)
    fewer = make_task(samples=1500)
    with pytest.raises(SurrogateError, match="delete it"):
        train_mvae(fewer, quick, stopped)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.999])
def test_a_checkpoint_cut_short(task, quick, stopped, share):
    content = stopped.read_bytes()
    stopped.write_bytes(content[: int(share * len(content))])
    with pytest.raises(SurrogateError, match=r"training\.safetensors cannot be read .*delete it"):
        train_mvae(task, quick, stopped)
