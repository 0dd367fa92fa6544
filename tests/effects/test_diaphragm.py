"""In-plane stiffness of slabs, in closed form and against a direct solution."""

import numpy as np
import pytest

from femupdate.effects import CATALOGUE

EFFECT = CATALOGUE["flexible_diaphragm"]
YOUNG, POISSON, THICKNESS, AREA = 25e9, 0.2, 0.15, 9.0 * 6.0


def matrix(frame, story):
    ((_, found, _),) = EFFECT.terms(frame.structure, story).stiffness
    return found


def motion(frame, story, **components):
    """(n,) motion of one floor from functions of x and y, by direction."""
    structure = frame.structure
    level = structure.levels[structure.building.story_names.index(story)]
    there = np.isclose(structure.position[:, 2], level)
    x, y = structure.position[:, 0], structure.position[:, 1]
    moved = np.zeros(len(structure.axis))
    for name, function in components.items():
        where = there & (structure.axis == ("ux", "uy", "uz", "rx", "ry", "rz").index(name))
        moved[where] = function(x, y)[where]
    return moved


def energy(frame, story, moved):
    return moved @ (matrix(frame, story) @ moved)


@pytest.mark.parametrize("story", ["low", "high"])
def test_uniform_strain(frame, story):
    """Twice the energy of plane stress: E t A / (1 - nu^2) (strain 1 along x alone)."""
    stretched = motion(frame, story, ux=lambda x, y: x)
    expected = YOUNG * THICKNESS * AREA / (1.0 - POISSON**2)
    assert energy(frame, story, stretched) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("place", ["all", "high"])
def test_response(frame, place):
    chosen = ["low", "high"] if place == "all" else [place]
    theta = dict(zip(("low", "high"), frame.theta, strict=True))
    softer = frame.equations.K - 0.7 * sum(
        theta[story] * matrix(frame, story).toarray() for story in chosen
    )
    exact = frame.equations.but(K=softer).frf(frame.frequency_hz, 0.03)
    ours = frame.frf(f"flexible_diaphragm@{place}", sizes=[-0.7], zeta=0.03)
    np.testing.assert_allclose(ours, exact, rtol=2e-8)
