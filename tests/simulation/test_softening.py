"""A structure that softens while it shakes, simulated on the full model."""

import numpy as np
import pytest

from femupdate.building import load_building
from femupdate.errors import StructureError
from femupdate.simulation import SimulationSettings, simulate_observation


def simulated(file, *effects):
    settings = SimulationSettings(
        theta=(0.8, 1.3), zeta=0.05, duration_s=20.0, seed=3, effects=effects
    )
    return simulate_observation(load_building(file), settings).histories.acceleration


@pytest.mark.parametrize("building", ["tower_file", "cabin_file"])
def test_without_a_fall_it_is_the_linear_simulation(building, request):
    """Within a hundredth: one goes by recurrence, the other by Fourier transform."""
    file = request.getfixturevalue(building)
    linear = simulated(file, ("added_mass@RF", (0.0,)))
    still = simulated(file, ("softening_in_run@all", (0.0, 0.0)))
    fallen = simulated(file, ("softening_in_run@all", (-0.1, 0.0)))
    size = linear.std(axis=1)
    assert (np.abs(still - linear).std(axis=1) < 0.01 * size).all()
    # The base moves alike; the floors do not.
    assert (np.abs(fallen - linear).std(axis=1)[1:] > 0.03 * size[1:]).all()


def test_what_cannot_be_followed_beside_it_is_refused(tower_file):
    with pytest.raises(StructureError, match="simulate them apart"):
        simulated(tower_file, ("softening_in_run@all", (-0.1,)), ("channel_gain@RF", (0.1,)))
