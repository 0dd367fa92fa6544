"""Story shear, drift and stiffness, and their summary over samples."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from femupdate.dynamics import BaseRotation, ReducedModel, System, statistics, story_stiffness
from femupdate.dynamics.history import story_rows


@given(
    st.lists(st.floats(1e5, 1e9), min_size=1, max_size=5),
    st.floats(-0.01, 0.01),
    st.floats(-1e4, 1e4),
)
def test_stiffness_of_a_spring_is_its_own_whatever_the_offsets(springs, drift_offset, shear_offset):
    k = np.array(springs)[:, None]
    drift = 1e-3 * np.sin(np.linspace(0.0, 9.0, 120)) * np.arange(1, len(springs) + 1)[:, None]
    found = story_stiffness(k * drift + shear_offset, drift + drift_offset)
    np.testing.assert_allclose(found, k[:, 0], rtol=1e-6)  # offsets cost up to 1e4 / 1e2 in digits


def test_rows_of_floors_inertia_and_drift():
    """What moves with a base that translates by one and turns by one besides."""
    model = ReducedModel(
        stiffness_terms=np.ones((1, 2, 2)),
        stiffness_constant=np.eye(2),
        excitation=np.array([3.0, 4.0]),
        floor_shapes=np.array([[1.0, 2.0], [5.0, 7.0]]),
        floors=("2F", "RF"),
        story_inertia=np.array([[11.0, 13.0], [17.0, 19.0]]),
        story_mass=np.array([30.0, 20.0]),
        story_drift=np.array([[1.0, 2.0], [4.0, 5.0]]),
        rotation=BaseRotation(
            force=np.array([5.0, 6.0]),
            mass=np.eye(2),
            story_moment=np.array([90.0, 70.0]),
            levels=np.array([3.0, 7.5]),
            story_height=np.array([3.0, 4.5]),
        ),
    )
    rows = story_rows(System(model), torch.zeros(1, 0))
    shapes = [model.floor_shapes, model.story_inertia, model.story_drift]
    np.testing.assert_array_equal(rows.shapes[0], np.concatenate(shapes))
    rigid = [[1.0, 3.0], [1.0, 7.5], [30.0, 90.0], [20.0, 70.0], [0.0, 3.0], [0.0, 4.5]]
    np.testing.assert_array_equal(rows.rigid[0], [[*row, 0.0] for row in rigid])


def test_statistics_of_known_numbers():
    found = statistics(np.arange(101.0)[:, None] * [1.0, -2.0])
    np.testing.assert_allclose(found.mean, [50.0, -100.0])
    np.testing.assert_allclose(found.q05, [5.0, -190.0])
    np.testing.assert_allclose(found.q95, [95.0, -10.0])
    np.testing.assert_allclose(found.sd, np.arange(101.0).std(ddof=1) * np.array([1.0, 2.0]))
