"""A two-story building small enough to train networks for in seconds."""

import numpy as np
import pytest
import torch

from femupdate.dynamics import System
from femupdate.inference import Parameters
from femupdate.surrogate import (
    NetworkSizes,
    TrainingSettings,
    TrainingTask,
    compute_dataset,
    train_mvae,
)
from tests.documents import reduced_stick
from tests.helpers import Recorded

FREQUENCY = 0.2 * np.arange(1, 65)
SIZES = NetworkSizes(
    floors=2,
    points=64,
    parameters=2,
    free_damping=True,
    modes=2,
    floor_features=24,
    width=48,
    parameter_width=24,
    decoder_width=48,
    blocks=2,
    components=3,
)


@pytest.fixture(scope="session")
def model():
    """Two unequal floors on unequal springs, first modes near 4 and 10 Hz."""
    return System(reduced_stick([2.0, 1.3], [3000.0, 2000.0]))


@pytest.fixture(scope="session")
def prior():
    return Parameters.uniform(
        ("theta_1", "theta_2"),
        torch.tensor([0.5, 0.4], dtype=torch.float64),
        torch.tensor([2.0, 2.5], dtype=torch.float64),
    )


@pytest.fixture(scope="session")
def task(model, prior):
    dataset = compute_dataset(model, prior, samples=2000, modes=2, top_hz=12.8, seed=1)
    frequency = torch.from_numpy(FREQUENCY).float()
    return TrainingTask(dataset, frequency, model, (0.02, 0.05), prior, SIZES)


@pytest.fixture(scope="session")
def settings():
    return TrainingSettings(
        epochs=6,
        batch=100,
        learning_rate=3e-3,
        redraw_zeta_every=2,
        average=0.98,
        points=32,
        proposal_rows=100,
    )


@pytest.fixture(scope="session")
def trained(task, settings):
    """The networks after a short training, and the progress that was told."""
    told = Recorded()
    return train_mvae(task, settings, progress=told), told
