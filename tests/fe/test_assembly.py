"""Assembly: affine in theta, complete in mass, indifferent to numbering, plain about mistakes."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.errors import StructureError
from femupdate.fe import Beams, PointMasses, Shells, Springs, assemble
from tests.fe import meshes


@pytest.fixture
def parts():
    springs = Springs(
        nodes=np.array([[3, -1], [5, 9], [9, 2]]),
        direction=np.array([0, 4, 2]),
        stiffness=np.array([1e6, 2e7, 3e8]),
        group=np.array([-1, 2, 2]),
    )
    masses = PointMasses(
        np.array([4, 9]), np.array([500.0, 90.0]), np.array([[1.0, 2, 3], [4, 5, 6]])
    )
    return {"springs": springs, "masses": masses}


@pytest.fixture
def structure(parts):
    points, elements = meshes.frame_with_wall()
    fixed = meshes.hold(len(points), (points[:, 2] == 0, range(6)))
    return meshes.model(points, fixed, groups=3, **elements, **parts)


def looped(model):
    """The same matrices, element by element and entry by entry, before supports."""
    stiffness, mass = np.zeros((2, model.groups + 1, model.dof, model.dof))
    shells, beams, springs = model.elements_of(Shells), model.elements_of(Beams), model.springs
    for elements in (shells, beams):
        matrices = elements.matrices(model.nodes)
        for k, nodes in enumerate(elements.nodes):
            dof = np.concatenate([6 * n + np.arange(6) for n in nodes])
            stiffness[elements.group[k]][np.ix_(dof, dof)] += matrices.stiffness[k]
            mass[-1][np.ix_(dof, dof)] += matrices.mass[k]
    for (a, b), d, k, group in zip(
        springs.nodes, springs.direction, springs.stiffness, springs.group, strict=True
    ):
        stretch = np.zeros(model.dof)
        stretch[6 * a + d] = 1.0
        if b >= 0:
            stretch[6 * b + d] = -1.0
        stiffness[group] += k * np.outer(stretch, stretch)
    for node, m, inertia in zip(
        model.masses.node, model.masses.mass, model.masses.inertia, strict=True
    ):
        dof = 6 * node + np.arange(6)
        mass[-1][dof, dof] += np.concatenate([m, inertia])
    return stiffness, mass[-1]


def close(sparse, dense):
    np.testing.assert_allclose(
        sparse.toarray(), dense, rtol=1e-12, atol=1e-14 * np.abs(dense).max()
    )


def test_every_entry_is_where_a_plain_loop_puts_it(structure):
    operators = assemble(structure)
    stiffness, mass = looped(structure)
    free = np.flatnonzero(~structure.fixed.ravel())
    np.testing.assert_array_equal(operators.free, free)
    for group in range(3):
        close(operators.stiffness_terms[group], stiffness[group][np.ix_(free, free)])
    close(operators.stiffness_constant, stiffness[-1][np.ix_(free, free)])
    close(operators.mass_full, mass)
    close(operators.mass, mass[np.ix_(free, free)])


def test_stiffness_is_affine_in_theta(structure):
    theta = np.array([0.37, 2.9, 1.4])
    scale = np.append(theta, 1.0)  # the last one for elements of no parameter
    springs = structure.springs
    scaled = replace(
        structure.mapped(lambda part: part.scaled(scale[part.group])),
        springs=replace(springs, stiffness=springs.stiffness * scale[springs.group]),
    )
    operators = assemble(structure)
    close(operators.stiffness(theta), assemble(scaled).stiffness(np.ones(3)).toarray())
    by_terms = operators.stiffness_constant + sum(
        value * term for value, term in zip(theta, operators.stiffness_terms, strict=True)
    )
    close(operators.stiffness(theta), by_terms.toarray())


def test_stiffness_shares_its_pattern_and_leaves_the_operators_alone(structure):
    operators = assemble(structure)
    before = operators.stiffness_constant.data.copy()
    first, second = (operators.stiffness(np.full(3, value)) for value in (1.0, 5.0))
    assert np.shares_memory(first.indices, second.indices)
    first.data[:] = 0.0
    np.testing.assert_array_equal(operators.stiffness_constant.data, before)
    assert second.data.any()


@pytest.mark.parametrize("theta", [[1.0], [1.0, 2.0, np.nan], [[1.0, 1.0, 1.0]]])
def test_theta_of_another_shape_is_refused(structure, theta):
    with pytest.raises(StructureError, match="theta must hold 3 finite values"):
        assemble(structure).stiffness(np.array(theta))


@pytest.mark.parametrize("direction", [0, 1, 2])
def test_inertia_sees_the_moving_supports(structure, direction):
    """The force of inertia on free and held degrees of freedom together is the whole mass."""
    operators = assemble(structure)
    motion = operators.rigid_translation(direction)
    shells, beams = structure.elements_of(Shells), structure.elements_of(Beams)
    areas = np.where(shells.group == 0, 4.5 * 3 / 12, 4.5 * 2.5 / 6)
    total = 2500 * (areas * shells.thickness).sum() + 2400 * beams.area[0] * 3.0 + 590
    assert motion @ operators.mass_full @ motion == pytest.approx(total, rel=1e-12)
    _, mass = looped(structure)
    np.testing.assert_allclose(
        operators.inertia(direction), (mass @ motion)[operators.free], atol=1e-9
    )
    only_free = operators.mass @ motion[operators.free]
    assert operators.inertia(direction).sum() > only_free.sum() + 1.0
    np.testing.assert_array_equal(
        motion.reshape(-1, 6).sum(axis=0)[direction], len(structure.nodes)
    )


def broken(model, part, **changes):
    if isinstance(part, str):
        return replace(model, **{part: replace(getattr(model, part), **changes)})
    return model.mapped(lambda block: replace(block, **changes) if type(block) is part else block)


def with_first(values, value):
    values = values.copy()
    values.reshape(-1)[0] = value
    return values


@pytest.mark.parametrize(
    ("part", "name", "value", "message"),
    [
        (Shells, "nodes", 999, "shell 0 names node 999"),
        (Shells, "nodes", -1, "shell 0 names node -1"),
        (Beams, "nodes", 999, "beam 0 names node 999"),
        ("springs", "nodes", 999, "spring 0 names node 999"),
        ("springs", "nodes", -1, "spring 0 names node -1"),
        ("masses", "node", 999, "point mass 0 names node 999"),
        (Shells, "group", 3, "shell 0 belongs to parameter 3"),
        (Beams, "group", 7, "beam 0 belongs to parameter 7"),
        ("springs", "direction", 6, "spring 0 acts along 6"),
        ("springs", "stiffness", np.inf, "spring 0 must have a finite stiffness"),
        ("masses", "mass", -1.0, "point mass 0 must have a finite mass"),
        ("masses", "inertia", np.nan, "point mass 0 must have a finite mass"),
        (Shells, "thickness", 0.0, r"shell 0 \(nodes .*\) has thickness 0"),
    ],
)
def test_a_part_that_does_not_fit_is_named(structure, part, name, value, message):
    whole = getattr(structure, part) if isinstance(part, str) else structure.elements_of(part)
    values = with_first(getattr(whole, name), value)
    with pytest.raises(StructureError, match=message):
        assemble(broken(structure, part, **{name: values}))


def test_lonely_nodes_are_named(structure):
    count = len(structure.nodes)
    model = replace(
        structure,
        nodes=np.concatenate([structure.nodes, np.ones((2, 3))]),
        fixed=np.concatenate([structure.fixed, np.zeros((2, 6), dtype=bool)]),
    )
    with pytest.raises(StructureError, match=f"nodes {count}, {count + 1} belong to no"):
        assemble(model)
