"""Forces of members and spectra of floors against independent solutions."""

import numpy as np
import pytest
import torch
from scipy.sparse.linalg import splu

from femupdate.building import from_document
from femupdate.dynamics import ConstantDamping, Rows, SensorRows, driven_system, response_spectrum
from femupdate.dynamics.history import displacement_histories
from femupdate.dynamics.members import beam_end_rows, cut_rows
from femupdate.effects import structure_of
from femupdate.fe import Beams, static_displacement
from tests import documents

THETA = np.array([0.7, 1.5])


@pytest.fixture(scope="module")
def frame():
    return turned_frame("x")


def turned_frame(direction):
    """Two stories with a wall on one side, so that every direction turns the plan."""
    slab = {"x": ["X0", "X1"], "y": ["Y0", "Y1"], "thickness": 0.2, "diaphragm": "rigid"}
    document = documents.frame(
        {"X0": 0.0, "X1": 5.0},
        {"Y0": 0.0, "Y1": 4.0},
        {"S1": 3.2, "S2": 2.8},
        size=2.0,
        direction=direction,
        ratio=0.03,
        walls=[{"along": "Y0", "from": "X0", "to": "X1", "thickness": 0.15}],
        slabs=[slab],
        floor_mass=[{"total": 60e3}],
    )
    return structure_of(from_document(document))


def solved(structure, watched, top_hz):
    """The full model at THETA, whose response must be right along groups of rows, too."""
    seen = SensorRows(structure.floors, structure.floor_rows, structure.levels, watched)
    nothing = np.zeros(0)
    return driven_system(structure, (), THETA, nothing, top_hz, ConstantDamping(), seen)


def displacements(found, rows, zeta, record, time_step, oversampling=8):
    """Histories (o, n) along rows (o, n_free)."""
    shapes = torch.from_numpy(rows @ found.shapes)
    sample = torch.zeros(1, 0, dtype=torch.float64), torch.tensor([zeta], dtype=torch.float64)
    wanted = Rows(shapes, torch.zeros(len(rows), 3, dtype=torch.float64))
    motion = record, time_step, oversampling
    return displacement_histories(found.system, sample, wanted, *motion)[0]


def smooth_motion(time_step, count=600):
    """A few sine pulses that start from rest, well below the top frequency of the modes kept."""
    t = time_step * np.arange(count)
    window = np.sin(np.pi * np.minimum(t / 1.5, 1.0)) ** 2
    return window * (2.0 * np.sin(2 * np.pi * 3 * t) + 1.5 * np.sin(2 * np.pi * 7.3 * t + 0.4))


def newmark(stiffness, damping, mass, force, time_step):
    """Average acceleration, from rest: displacements (n_free, n)."""
    left = splu((stiffness + 2 / time_step * damping + 4 / time_step**2 * mass).tocsc())
    u = v = a = np.zeros(stiffness.shape[0])
    moved = [u]
    for push in force[1:]:
        inertia = mass @ (4 / time_step**2 * u + 4 / time_step * v + a)
        new = left.solve(push + inertia + damping @ (2 / time_step * u + v))
        speed = 2 / time_step * (new - u) - v
        a = 4 / time_step**2 * (new - u) - 4 / time_step * v - a
        u, v = new, speed
        moved.append(u)
    return np.array(moved).T


def rows_of(operators, nodes, axis):
    rows = np.zeros((len(nodes), operators.dof))
    rows[np.arange(len(nodes)), 6 * np.asarray(nodes) + axis] = 1.0
    return operators.gather(rows.T).T


@pytest.mark.parametrize("direction", ["x", "y"])
def test_against_direct_integration_of_the_full_model(direction):
    """Undamped, against Newmark at much finer steps."""
    structure = turned_frame(direction)
    operators, mesh = structure.operators, structure.mesh
    step, fine = 0.01, 10
    coarse = smooth_motion(step, 200)
    record = np.interp(step / fine * np.arange(199 * fine + 1), step * np.arange(200), coarse)
    stiffness = operators.stiffness(THETA)
    force = operators.inertia(structure.direction)
    u = newmark(stiffness, 0.0 * stiffness, operators.mass, -record[:, None] * force, step / fine)
    rows = rows_of(operators, mesh.floor_nodes["RF"], structure.direction)
    column = int(np.flatnonzero(mesh.model.elements_of(Beams).kind == "column")[1])
    ends = beam_end_rows(mesh.model, operators, THETA, column)
    found = solved(structure, (ends,), 150.0)
    for quantity in (rows, ends[:3], ends[4:6]):  # forces and moments, each beside its largest
        wanted = quantity @ u[:, ::fine]
        # Linear between the samples of the record, as in the integration.
        ours = displacements(found, quantity, 0.0, coarse, step, 1)
        size = np.abs(wanted).max()
        # 2 %: Newmark's own period error over 2 s, and modes above 150 Hz as if they were static.
        np.testing.assert_allclose(ours / size, wanted / size, atol=0.02)


def test_beam_end_forces_balance_and_follow_hand_formulas(frame):
    mesh, operators = frame.mesh, frame.operators
    motion = np.random.default_rng(2).standard_normal(len(operators.free)) * 1e-3
    beam = int(np.flatnonzero(mesh.model.elements_of(Beams).kind == "beam")[0])
    rows = beam_end_rows(mesh.model, operators, THETA, beam)
    first, second = (rows @ motion).reshape(2, 6)
    ends = mesh.model.nodes[mesh.model.elements_of(Beams).nodes[beam]]
    length = np.linalg.norm(ends[1] - ends[0])
    np.testing.assert_allclose(first[:4] + second[:4], 0.0, atol=1e-6 * np.abs(first).max())
    # Moments about the first end: My + My' - Vz' L = 0 and Mz + Mz' + Vy' L = 0.
    scale = np.abs(first).max()
    assert abs(first[4] + second[4] - second[2] * length) < 1e-6 * scale
    assert abs(first[5] + second[5] + second[1] * length) < 1e-6 * scale
    moved = operators.expand(motion).reshape(-1, 6)[mesh.model.elements_of(Beams).nodes[beam], :3]
    stretch = (moved[1] - moved[0]) @ (ends[1] - ends[0]) / length
    group = int(mesh.model.elements_of(Beams).group[beam])
    assert second[0] == pytest.approx(THETA[group] * 25e9 * 0.15 * stretch / length, rel=1e-9)


def test_a_cut_carries_all_that_is_above(frame):
    """Static horizontal and vertical loads on the roof pass the cut at the first floor."""
    mesh, operators = frame.mesh, frame.operators
    nodes = mesh.model.nodes
    load = np.zeros((len(nodes), 6))
    roof = np.flatnonzero(np.isclose(nodes[:, 2], 6.0))
    load[roof, 0], load[roof, 1], load[roof, 2] = 1e3, -4e2, -2e3
    moved = static_displacement(operators, THETA, load.ravel())
    cut = np.flatnonzero(np.isclose(nodes[:, 2], 3.2))
    point = np.array([1.0, 2.0, 3.2])
    rows = cut_rows(mesh.model, operators, THETA, cut, point, kinds=("wall", "column"), below=3.2)
    found = rows @ moved[operators.free]
    force = load[roof, :3]
    moment = np.cross(nodes[roof] - point, force).sum(axis=0)
    np.testing.assert_allclose(found, [*force.sum(axis=0), *moment], rtol=1e-6)
    # At the base the wall and the columns share it.
    base = np.flatnonzero(np.isclose(nodes[:, 2], 0.0))
    shares = [
        cut_rows(mesh.model, operators, THETA, base, point, kinds=[kind], below=0.0)
        @ moved[operators.free]
        for kind in ("wall", "column")
    ]
    np.testing.assert_allclose(sum(shares)[:3], force.sum(axis=0), rtol=1e-6)
    assert shares[0][0] > 0.7 * force[:, 0].sum()


@pytest.mark.parametrize("frequency", [0.2, 2.0, 8.0, 23.0])
def test_spectrum_of_a_long_sine_is_its_transmissibility(frequency):
    """Peak in the steady state: sqrt((1 + (2 z r)^2) / ((1 - r^2)^2 + (2 z r)^2)), r = f_g / f."""
    step, ground, zeta = 0.01, 3.0, 0.2
    t = step * np.arange(8000)
    record = np.sin(2 * np.pi * ground * t) * np.minimum(t / 20.0, 1.0)
    r = ground / frequency
    expected = np.sqrt((1 + (2 * zeta * r) ** 2) / ((1 - r**2) ** 2 + (2 * zeta * r) ** 2))
    found = response_spectrum(record, step, [frequency], zeta)
    assert found[0] == pytest.approx(expected, rel=0.01)


def test_spectrum_of_a_short_pulse_by_its_impulse():
    """After a pulse of area I the undamped oscillator swings with w I (absolute acceleration)."""
    record = np.zeros(2000)
    record[10] = 5.0
    area = 5.0 * 0.001  # a triangle of two steps of 1 ms
    frequency = np.array([1.0, 2.5, 6.0])
    found = response_spectrum(record, 0.001, frequency, 0.0)
    np.testing.assert_allclose(found, 2 * np.pi * frequency * area, rtol=2e-3)
