"""Simply supported rectangular plates against closed forms of Kirchhoff, Mindlin and Navier."""

import numpy as np
import pytest

from femupdate.fe import Shells, assemble, lowest_modes

A, B = 6.0, 4.0
E, NU, DENSITY = 30e9, 0.2, 2500.0


def plate(meshes, columns, rows, thickness, rotation=None):
    """Simply supported plate ("hard": no rotation along the edges), in-plane motion held."""
    s, t, quads = meshes.grid(columns, rows)
    x_edge, y_edge = (s == 0) | (s == 1), (t == 0) | (t == 1)
    fixed = meshes.hold(
        len(s), (s >= 0, (0, 1, 5)), (x_edge | y_edge, (2,)), (x_edge, (3,)), (y_edge, (4,))
    )
    points = meshes.stack(A * s, B * t, 0 * s)
    return meshes.model(points, fixed, shells=meshes.shells(quads, thickness, E, NU, DENSITY))


def mindlin_frequencies(thickness, count):
    """Exact frequencies (Hz) of the Mindlin plate with shear correction 5/6 and rotary inertia.

    w = sin sin and rotations cos sin, sin cos solve Mindlin's equations (1951); each pair of wave
    numbers leaves three frequencies.
    """
    shear = 5 / 6 * E / (2 * (1 + NU)) * thickness
    rigidity = E * thickness**3 / (12 * (1 - NU**2))
    mass, rotary = DENSITY * thickness, DENSITY * thickness**3 / 12
    found = []
    for m in range(1, 8):
        for n in range(1, 8):
            p, q = m * np.pi / A, n * np.pi / B
            own = [rigidity * (k**2 + (1 - NU) / 2 * j**2) + shear for k, j in ((p, q), (q, p))]
            cross = rigidity * (1 + NU) / 2 * p * q
            stiffness = np.array(
                [
                    [shear * (p**2 + q**2), shear * p, shear * q],
                    [shear * p, own[0], cross],
                    [shear * q, cross, own[1]],
                ]
            )
            scale = 1 / np.sqrt([mass, rotary, rotary])
            found.append(np.linalg.eigvalsh(scale[:, None] * stiffness * scale)[0])
    return np.sqrt(np.sort(found)[:count]) / (2 * np.pi)


def navier_deflection(thickness, pressure):
    """Deflection in the middle of a thin plate under uniform pressure (Navier's double series)."""
    rigidity = E * thickness**3 / (12 * (1 - NU**2))
    odd = np.arange(1, 200, 2)
    m, n = np.meshgrid(odd, odd)
    term = (
        np.sin(m * np.pi / 2) * np.sin(n * np.pi / 2) / (m * n * ((m / A) ** 2 + (n / B) ** 2) ** 2)
    )
    return 16 * pressure / (np.pi**6 * rigidity) * term.sum()


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("thickness", [0.01, 0.5])
def test_a_strip_in_cylindrical_bending_is_exact_as_a_beam_is(meshes, count, thickness):
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


def test_static_deflection_converges_to_navier(meshes):
    thickness, pressure = 0.006, 10.0  # B / t = 667: shear adds 1e-5 only
    # A third of the error of second order from 4 % on the first mesh.
    for count, allowed in ((4, 0.03), (8, 0.0035), (16, 0.0009)):
        model = plate(meshes, 2 * count, count, thickness)
        load = meshes.zeros(len(model.nodes))
        load[:, 2] = pressure * meshes.area_shares(model.nodes, model.elements_of(Shells).nodes)
        u = meshes.displacement(model, load)
        middle = np.linalg.norm(model.nodes - [A / 2, B / 2, 0], axis=1).argmin()
        assert u[middle, 2] == pytest.approx(navier_deflection(thickness, pressure), rel=allowed)


@pytest.mark.parametrize("thickness", [0.02, 0.2, 0.8])
def test_frequencies_converge_to_mindlin_at_second_order(meshes, thickness):
    errors = []
    for count in (24, 48):
        operators = assemble(plate(meshes, count + 2, count, thickness))
        found = lowest_modes(operators, np.ones(1), 4).frequency_hz
        errors.append(np.abs(found / mindlin_frequencies(thickness, 4) - 1))
    # The largest counts: errors of a thin plate change their sign on coarser meshes.
    assert np.log2(errors[0].max() / errors[1].max()) == pytest.approx(2.0, abs=0.25)
    assert errors[0].max() < 0.0025


def test_mindlin_oracle_gives_the_published_thick_plate(monkeypatch):
    """NAFEMS FV21: 10 m x 10 m x 1 m, first frequency 45.897 Hz."""
    for name, value in (("A", 10.0), ("B", 10.0), ("E", 200e9), ("NU", 0.3), ("DENSITY", 8000.0)):
        monkeypatch.setitem(globals(), name, value)
    # The published value uses Mindlin's own shear correction, pi^2 / 12 = 0.822, not 5/6.
    assert mindlin_frequencies(1.0, 1)[0] == pytest.approx(45.897, rel=1e-3)
