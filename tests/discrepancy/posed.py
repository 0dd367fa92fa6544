"""Chains solved by hand, observed with noise whose size is known, posed to the effect finder."""

import numpy as np

from femupdate.building import from_document
from femupdate.discrepancy.search import problem_of
from femupdate.dynamics import lumped
from femupdate.effects import CATALOGUE, Placed, structure_of
from femupdate.inference import COARSE_ERROR
from femupdate.inference.frf_data import frf_data
from femupdate.measurement import Observation
from tests.documents import stick


def building_of(masses, springs, zeta=(0.005, 0.2), ratio=0.05, **changes):
    """A shear building with the prior 0.5 to 2 of every factor."""
    prior = {"theta": {"lower": 0.5, "upper": 2.0}}
    if zeta is not None:
        prior["zeta"] = {"lower": zeta[0], "upper": zeta[1]}
    # Names need go beyond none.
    known = {"name": "chain", "prior": prior, "tolerances": {"mass": 0.0}}
    return from_document(stick(masses, springs, grid=(0.2, 60), ratio=ratio) | known | changes)


def observe(floors, frequency_hz, frf, sd, seed, phase=True):
    """FRFs (f, k) with independent errors of ln|H| and phase of a known size."""
    error = sd * np.random.default_rng(seed).standard_normal((2, *frf.shape))
    return Observation(
        np.asarray(frequency_hz),
        tuple(floors),
        np.log(np.abs(frf)) + error[0],
        np.full(frf.shape, sd),
        np.ones(frf.shape, dtype=bool),
        np.angle(frf * np.exp(1j * error[1])) if phase else None,
        None,
        float(frequency_hz[1] - frequency_hz[0]),
    )


def reduced_of(building):
    """A shear building on its own degrees of freedom."""
    return lumped(structure_of(building))


def pose(building, observation):
    """A building and an observation as a problem."""
    data = frf_data(observation, building.floors, table=COARSE_ERROR)
    return problem_of(reduced_of(building), building, (data,))


def place(*labels):
    """Effects at places from labels such as "added_mass@3F"."""
    return tuple(Placed(CATALOGUE[n], p) for n, p in (one.split("@") for one in labels))
