"""Coordinates of stiffness factors, linear in their root."""

import torch

from femupdate.surrogate.network import from_place, parameter_features, to_place

LOWER, UPPER = torch.tensor([0.25, 1.0]), torch.tensor([4.0, 9.0])


def test_places_by_hand():
    """Halfway between the roots .5 and 2 lies 1.25, between 1 and 3 lies 2."""
    theta = torch.tensor([[1.25**2, 4.0], [0.25, 9.0]])
    expected = torch.tensor([[0.0, 0.0], [-1.0, 1.0]])
    torch.testing.assert_close(to_place(theta, LOWER, UPPER), expected)
    torch.testing.assert_close(from_place(expected, LOWER, UPPER), theta)


def test_features_are_places_by_root_value_and_logarithm():
    """Of 1 in (.25, 4) by hand: the root lies a third of the way, the value a fifth, ln half."""
    found = parameter_features(torch.tensor([[1.0, 9.0]]), LOWER, UPPER).view(3, 2)
    torch.testing.assert_close(found[:, 0], torch.tensor([-1.0 / 3.0, -0.6, 0.0]))
    torch.testing.assert_close(found[:, 1], torch.ones(3))
