"""A strip of shells against the closed form of a beam; plates: tests/benchmarks/solver."""

import numpy as np
import pytest

from tests.fe import meshes

E = 30e9


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("thickness", [0.01, 0.5])
def test_a_strip_in_cylindrical_bending_is_exact_as_a_beam_is(count, thickness):
    """Timoshenko's cantilever under a force at its end, without Poisson's effect."""
    length, width, force = 2.0, 0.7, 3.0
    s, t, quads = meshes.grid(count, 1)
    points = meshes.stack(length * s, width * t, 0 * s)
    held = meshes.hold(len(s), (s == 0, range(6)), (s >= 0, (3, 5)))
    model = meshes.model(points, held, shells=meshes.shells(quads, thickness, E, 0.0))
    load = meshes.zeros(len(s))
    load[s == 1, 2] = 0.5 * force
    bending = E * width * thickness**3 / 12
    shear = 5 / 6 * width * thickness * E / 2
    expected = force * (length**3 / (3 * bending) + length / shear)
    np.testing.assert_allclose(meshes.displacement(model, load)[s == 1, 2], expected, rtol=1e-9)
