"""Chains solved by hand, observed with noise whose size is known, posed to the effect finder."""

import numpy as np
import pytest

from femupdate.building import from_document
from femupdate.discrepancy.search import problem_of
from femupdate.dynamics import lumped
from femupdate.effects import CATALOGUE, Placed, structure_of
from femupdate.inference import COARSE_ERROR
from femupdate.inference.frf_data import frf_data
from femupdate.measurement import Observation
from tests import chains as by_hand
from tests.documents import stick


@pytest.fixture(scope="session")
def chains():
    """The module `tests.chains`."""
    return by_hand


@pytest.fixture(scope="session")
def building_of():
    """A function: a shear building with the prior 0.5 to 2 of every factor."""

    def make(masses, springs, zeta=(0.005, 0.2), ratio=0.05, **changes):
        prior = {"theta": {"lower": 0.5, "upper": 2.0}}
        if zeta is not None:
            prior["zeta"] = {"lower": zeta[0], "upper": zeta[1]}
        known = {
            "name": "chain",
            "prior": prior,
            "tolerances": {"mass": 0.0},
        }  # names need go beyond none
        return from_document(stick(masses, springs, grid=(0.2, 60), ratio=ratio) | known | changes)

    return make


@pytest.fixture(scope="session")
def observe():
    """A function: FRFs (f, k) with independent errors of ln|H| and phase of a known size."""

    def make(floors, frequency_hz, frf, sd, seed, phase=True):
        error = sd * np.random.default_rng(seed).standard_normal((2, *frf.shape))
        angle = np.angle(frf * np.exp(1j * error[1])) if phase else None
        return Observation(
            np.asarray(frequency_hz),
            tuple(floors),
            np.log(np.abs(frf)) + error[0],
            np.full(frf.shape, sd),
            np.ones(frf.shape, dtype=bool),
            angle,
            None,
            float(frequency_hz[1] - frequency_hz[0]),
        )

    return make


@pytest.fixture(scope="session")
def reduced_of():
    """A function: a shear building on its own degrees of freedom."""

    def make(building):
        return lumped(structure_of(building))

    return make


@pytest.fixture(scope="session")
def pose(reduced_of):
    """A function: a building and an observation as a problem."""

    def make(building, observation):
        data = frf_data(observation, building.floors, table=COARSE_ERROR)
        return problem_of(reduced_of(building), building, (data,))

    return make


@pytest.fixture(scope="session")
def place():
    """A function: effects at places from labels such as "added_mass@3F"."""

    def make(*labels):
        return tuple(Placed(CATALOGUE[n], p) for n, p in (one.split("@") for one in labels))

    return make
