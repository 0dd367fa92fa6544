"""Coordinates: stiffness factors by their root, sizes of effects by themselves."""

import pytest
import torch

from femupdate.surrogate.places import from_place, parameter_features, to_place

LOWER, UPPER = torch.tensor([0.25, 1.0, -0.5, 0.0]), torch.tensor([4.0, 9.0, 0.5, 2.0])


def test_places_by_hand():
    """Halfway between the roots .5 and 2 lies 1.25, between 1 and 3 lies 2."""
    theta = torch.tensor([[1.25**2, 4.0, 0.0, 0.5], [0.25, 9.0, -0.5, 2.0]])
    expected = torch.tensor([[0.0, 0.0, 0.0, -0.5], [-1.0, 1.0, -1.0, 1.0]])
    torch.testing.assert_close(to_place(theta, LOWER, UPPER, 2), expected)
    torch.testing.assert_close(from_place(expected, LOWER, UPPER, 2), theta)


def test_a_size_may_be_negative_and_lie_beyond_its_box():
    place = torch.tensor([[0.3, -0.2, 1.3, -1.3]])
    theta = from_place(place, LOWER, UPPER, 2)
    assert theta[0, 2:].tolist() == pytest.approx([0.65, -0.3])
    torch.testing.assert_close(to_place(theta, LOWER, UPPER, 2), place)


def test_features_of_sizes_are_places_three_times():
    theta = torch.tensor([[1.0, 2.0, 0.25, 0.1]])
    found = parameter_features(theta, LOWER, UPPER, 2)
    assert found.shape == (1, 12)
    alone = parameter_features(theta[:, :2], LOWER[:2], UPPER[:2]).view(3, 2)
    by_kind = found.view(3, 4)
    torch.testing.assert_close(by_kind[:, :2], alone)
    torch.testing.assert_close(by_kind[:, 2:], torch.tensor([[0.5, -0.9]]).expand(3, -1))
