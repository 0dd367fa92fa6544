"""Effects in closed form, and against building files in which the same thing is written."""

import numpy as np

from femupdate.building import from_document
from femupdate.effects import DrawnBuilding, building_effects, structure_of


def test_all_kinds_of_members_together_are_their_stories(frame_document):
    building = from_document(frame_document | {"tolerances": {"members": 0.1}})
    structure, theta, size = structure_of(building), np.array([0.8, 1.3]), 0.07
    varying = building_effects(building).placed
    assert [placed.place for placed in varying] == ["wall", "column", "beam", "slab"]
    terms = [placed.effect.terms(structure, placed.place).stiffness for placed in varying]
    drawn = DrawnBuilding(structure)
    assert all(any(placed.effect.glyphs(drawn, placed.place)) for placed in varying)
    added = sum(size * theta[k] * matrix for kind in terms for k, matrix, _ in kind)
    ours, exact = structure.stiffness(theta) + added, structure.stiffness((1.0 + size) * theta)
    np.testing.assert_allclose(ours.toarray(), exact.toarray(), atol=1e-12 * abs(exact).max())


def test_rigid_motions_of_a_free_frame_cost_no_energy(frame):
    """The base's translations and rotation strain nothing, in an unsupported mesh."""
    from dataclasses import replace

    from femupdate.fe import assemble

    model = replace(frame.mesh.model, fixed=np.zeros_like(frame.mesh.model.fixed))
    free = assemble(model)
    K = free.stiffness(np.ones(2))
    held = assemble(frame.mesh.model).free
    shapes = np.zeros((free.dof, 3))
    shapes[held] = frame.structure.rigid_shapes
    base = frame.mesh.base_nodes
    nodes = frame.mesh.model.nodes
    middle = 0.5 * (nodes[:, 0].min() + nodes[:, 0].max())
    # The base itself: it turns about y, and its nodes go up and down.
    shapes[6 * base, 0] = shapes[6 * base + 1, 2] = 1.0
    shapes[6 * base + 2, 1] = middle - nodes[base, 0]
    shapes[6 * base + 4, 1] = 1.0
    np.testing.assert_allclose(K @ shapes, 0.0, atol=1e-8 * abs(K).max())
