"""What too few latent coordinates lose, against closed forms and quadrature."""

import numpy as np
import pytest
import torch
from femupdate.benchmarks.latent_size.study import (
    box_coordinates,
    enough_coordinates,
    from_box_coordinates,
    sensitive_directions,
    size_losses,
)

from femupdate.inference.parameters import Parameters

LOWER, UPPER = 1.0 / 3.0, 3.0


def prior(size):
    ends = (torch.full((size,), end, dtype=torch.float64) for end in (LOWER, UPPER))
    return Parameters.uniform(tuple(f"theta_{k}" for k in range(size)), *ends)


def linear(matrix):
    """ln|H| that is linear in the places."""
    rows = torch.from_numpy(matrix)
    return lambda theta: box_coordinates(prior(matrix.shape[1]), theta) @ rows.T


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def place_density(grid):
    """Of the place of one theta that is uniform: its root's, which rises linearly."""
    low, high = LOWER**0.5, UPPER**0.5
    density = low + 0.5 * (grid + 1.0) * (high - low)
    return density / density.sum()


def test_places_and_back():
    theta = torch.tensor([[LOWER, 1.0, UPPER]], dtype=torch.float64)
    place = box_coordinates(prior(3), theta)
    np.testing.assert_allclose(place[0, ::2], [-1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(from_box_coordinates(prior(3), place), theta, rtol=1e-12)


def test_directions_of_a_linear_response_are_those_of_its_matrix():
    matrix = np.array([[1.0, 0.4, 0.0], [-0.3, 2.0, 0.7], [0.0, 0.5, 1.5], [0.2, -1.0, 0.6]])
    value, vector = sensitive_directions(linear(matrix), prior(3), 5, generator())
    _, roots, right = np.linalg.svd(matrix)
    np.testing.assert_allclose(value, roots**2, rtol=1e-6)
    np.testing.assert_allclose(np.abs(vector.numpy().T @ right.T), np.eye(3), atol=1e-5)


def test_what_is_lost_is_the_variance_that_is_left():
    """Two places, of which a combination is kept: the slices' variances by quadrature."""
    matrix = np.array([[3.0, 1.0], [0.5, -2.0]])
    kept = torch.tensor([[0.8, 0.6], [0.6, -0.8]], dtype=torch.float64)
    found = size_losses(linear(matrix), prior(2), kept, [0, 1, 2], 0.5, 4000, generator())
    assert found[2].nats == 0.0
    grid = np.linspace(-1.0, 1.0, 2001)
    weight = place_density(grid)
    variance = weight @ grid**2 - (weight @ grid) ** 2
    # Two thousand pairs' mean square differences are known to some 3 %.
    assert found[0].nats == pytest.approx(0.5 * (matrix**2).sum() * variance / 0.25, rel=0.1)
    square = np.array(np.meshgrid(grid[::4], grid[::4], indexing="ij")).reshape(2, -1)
    mass = np.outer(place_density(grid[::4]), place_density(grid[::4])).ravel()
    along = kept[:, 1].numpy() @ square
    slices = np.round((kept[:, 0].numpy() @ square) / 0.02).astype(int)
    slices -= slices.min()
    total, first, second = (np.bincount(slices, mass * along**k) for k in range(3))
    within = (second - first**2 / np.maximum(total, 1e-300)).sum()
    gain = ((matrix @ kept[:, 1].numpy()) ** 2).sum()
    assert found[1].nats == pytest.approx(0.5 * gain * within / 0.25, rel=0.1)
    assert found[1].rms == pytest.approx((gain * within / 2.0) ** 0.5, rel=0.05)


def test_a_coordinate_that_the_response_does_not_know_is_not_needed():
    matrix = np.array([[2.0, 1.0, 1.0], [1.0, -1.0, -1.0]])
    _, vector = sensitive_directions(linear(matrix), prior(3), 5, generator())
    found = size_losses(linear(matrix), prior(3), vector, range(3), 0.2, 100, generator())
    assert enough_coordinates(found, 3) == 2
    assert found[1].nats > 1.0
    assert enough_coordinates(found[:2], 3) == 3
