"""Flexible joints and diaphragms against equations written by hand."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import from_document
from femupdate.dynamics import ConstantDamping, System, equations_at, lumped
from femupdate.effects import CATALOGUE, Placed, structure_of
from femupdate.fe import Beams, RigidLinks, Springs, assemble
from tests import documents

JOINTS, FEET = CATALOGUE["joint_flexibility"], CATALOGUE["foot_flexibility"]
TURN = {0: [4], 1: [3], 2: [3, 4]}  # axis of a bar and rotations that bend it in upright planes


def stick(heights, springs, masses):
    return structure_of(from_document(documents.stick(masses, springs, heights)))


def frequencies(structure, theta, size):
    """Natural circular frequencies (n,) of a stick with flexible joints."""
    placed, reduced = (Placed(JOINTS, "all"),), lumped(structure)
    system = System(reduced.model, ConstantDamping(), placed, (reduced.terms(placed[0]),))
    parameters = [torch.from_numpy(np.array([one], dtype=float)) for one in (theta, [size])]
    return system.modes(*parameters).omega[0].numpy()


@pytest.mark.parametrize("size", [0.0, 0.02, 0.3, 2.0])
def test_one_story_lies_between_a_clamped_column_and_a_cantilever(size):
    """k = 12 E I / h^3 (1 + kappa) / (4 + kappa): with no spring a fourth is left."""
    spring, mass = 1.8e6, 2000.0
    share = (1.0 + size) / (1.0 + 4.0 * size)
    found = frequencies(stick([3.2], [spring], [mass]), [1.0], size)
    np.testing.assert_allclose(found, (share * spring / mass) ** 0.5, rtol=1e-10)


def test_a_stick_is_its_columns_with_rotations_condensed():
    """Columns as beams of two nodes, sway and rotation of every floor free, theta on each."""
    heights, springs = np.array([4.0, 3.0, 3.5]), np.array([2.0e6, 1.6e6, 0.9e6])
    masses, theta, size = np.array([900.0, 1000.0, 700.0]), np.array([0.7, 1.4, 1.1]), 0.08
    flexural = springs * heights**3 / 12.0
    whole = np.zeros((8, 8))  # sway and rotation of the base and of three floors
    for k, (h, bending) in enumerate(zip(heights, theta * flexural, strict=True)):
        sway, turn = [12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]
        back = [6 * h, 2 * h**2, -6 * h, 4 * h**2]
        column = np.array([sway, turn, [-value for value in sway], back])
        own = slice(2 * k, 2 * k + 4)
        whole[own, own] += bending / h**3 * column
    whole = whole[2:, 2:]
    whole[1::2, 1::2] += np.eye(3) * np.mean(flexural / heights) / size
    sway, turn = np.arange(0, 6, 2), np.arange(1, 6, 2)
    inner = np.linalg.solve(whole[np.ix_(turn, turn)], whole[np.ix_(turn, sway)])
    exact = whole[np.ix_(sway, sway)] - whole[np.ix_(sway, turn)] @ inner
    structure = stick(heights, springs, masses)
    found = frequencies(structure, theta, size)
    np.testing.assert_allclose(found**2, eigh(exact, np.diag(masses))[0], rtol=1e-10)
    full = equations_at(structure, theta, [(JOINTS.terms(structure, "all"), size)])
    np.testing.assert_allclose(full.stiffness.toarray(), exact, rtol=1e-9, atol=1e-3)


def opened(mesh, size, kind):
    """The mesh with springs E I / (s L) between its beams' ends and columns, or under columns."""
    model = mesh.model
    beams = model.elements_of(Beams)
    turns = np.isin(np.arange(len(model.nodes)), beams.nodes[beams.kind == "column"])
    if kind == "column":
        turns = model.fixed.all(axis=1)
    nodes, points = beams.nodes.copy(), list(model.nodes)
    master, slave, tied, springs = [], [], [], []
    for element in np.flatnonzero(beams.kind == kind):
        ends = model.nodes[beams.nodes[element]]
        along = int(np.abs(ends[1] - ends[0]).argmax())
        length = SPANS[along](ends.mean(axis=0)[along])
        stiffness = beams.youngs_modulus[element] * beams.inertia_y[element] / length / size
        for end in np.flatnonzero(turns[beams.nodes[element]]):
            points.append(ends[end])
            nodes[element, end] = len(points) - 1
            master.append(beams.nodes[element, end])
            slave.append(len(points) - 1)
            tied.append(~np.isin(np.arange(6), TURN[along]))
            pair = master[-1], slave[-1]
            springs += [(*pair, axis, stiffness, beams.group[element]) for axis in TURN[along]]
    pairs = np.array([spring[:2] for spring in springs])
    rest = [np.array([spring[k] for spring in springs]) for k in (2, 3, 4)]
    others = [part for part in model.elements if not isinstance(part, Beams)]
    more = len(points) - len(model.nodes)
    return replace(
        model,
        nodes=np.array(points),
        fixed=np.concatenate([model.fixed, np.zeros((more, 6), dtype=bool)]),
        elements=(*others, replace(beams, nodes=nodes)),
        links=RigidLinks(np.array(master), np.array(slave), np.array(tied)),
        springs=Springs(pairs, *rest),
    )


# Beams of the frame from column to column: 5 and 4 m along x, 6 m along y.
SPANS = {0: lambda x: 5.0 if x < 5.0 else 4.0, 1: lambda y: 6.0, 2: lambda z: 3.4}


@pytest.mark.parametrize("mesh", [5.0, 2.0])
@pytest.mark.parametrize(("effect", "kind"), [(JOINTS, "beam"), (FEET, "column")])
def test_flexible_joints_and_feet_are_springs(frame_document, mesh, effect, kind):
    known = {"beam": documents.rectangle(0.3, 0.5), "column": documents.rectangle(0.5, 0.5)}
    made = frame_document | {"mesh": {"size": mesh}, "sections": known}
    structure, theta, size = structure_of(from_document(made)), np.array([0.8, 1.3]), 0.3
    ours = equations_at(structure, theta, [(effect.terms(structure, "all"), size)]).stiffness
    exact = assemble(opened(structure.mesh, size, kind))
    load = structure.rigid_force[:, 0]
    moved = np.linalg.solve(ours.toarray(), load)
    full = np.zeros(exact.dof)
    full[structure.operators.free] = load
    by_springs = np.linalg.solve(exact.stiffness(theta).toarray(), exact.gather(full[:, None]))
    expected = exact.expand(by_springs)[:, 0][structure.operators.free]
    np.testing.assert_allclose(moved, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())
    rigid = np.linalg.solve(structure.stiffness(theta).toarray(), load)
    roof = structure.floor_rows[-1]
    assert roof @ moved > 1.01 * (roof @ rigid)


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
