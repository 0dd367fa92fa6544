"""Member forces in a ground motion against what a building must carry."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.building import from_document, to_document
from femupdate.dynamics import ConstantDamping, choose_members, member_forces
from femupdate.errors import BuildingError

MASS, HEIGHT = 40e3, 3.0
WALL = {"height": 12.0, "length": 4.0, "thickness": 0.25, "density": 2500.0}
COMMON = {
    "kind": "frame",
    "sensors": {"direction": "x", "points": ["X0-Y0"]},
    "frequency_grid": {"start": 0.1, "step": 0.1, "count": 100},
    "prior": {"theta": {"lower": 0.5, "upper": 2.0}},
    "damping": {"law": "rayleigh", "ratio": 0.03, "anchors": [1.0, 20.0]},
}


# Four equal columns under a rigid slab of 40 t, all that weighs.
TABLE = from_document(
    {
        **COMMON,
        "name": "table",
        "grid": {"x": {"X0": 0.0, "X1": 5.0}, "y": {"Y0": 0.0, "Y1": 4.0}},
        "stories": [{"name": "S1", "height": HEIGHT}],
        "materials": {"c": {"youngs_modulus": 25e9, "poisson_ratio": 0.2, "density": 0.0}},
        "sections": {"column": {"shape": "circle", "diameter": 0.4}},
        "columns": [{"section": "column"}],
        "slabs": [{"x": ["X0", "X1"], "y": ["Y0", "Y1"], "thickness": 0.6}],
        "floor_mass": [{"total": MASS}],
        "mesh": {"size": 3.0},
    }
)


def test_a_point_on_a_diagonal_of_a_cross_takes_that_one():
    document = to_document(TABLE)
    document["sections"]["rod"] = {"shape": "circle", "diameter": 0.03}
    cross = {"section": "rod", "along": ["Y0", "Y1"], "from": "X0", "to": "X1", "shape": "cross"}
    braced = from_document({**document, "braces": [cross]})
    found = choose_members(braced, [(x, 0.0, 0.2 * HEIGHT) for x in (1.0, 4.0)]).members
    rising, falling = (np.prod((member.ends[1] - member.ends[0])[[0, 2]]) for member in found)
    assert rising > 0.0 > falling


def cantilever(axis):
    """A wall of four stories along x or y, and nothing else."""
    along, across = {"X0": 0.0, "X1": WALL["length"]}, {"Y0": 0.0, "Y1": 3.0}
    if axis == "y":
        along, across = {"X0": 0.0, "X1": 3.0}, {"Y0": 0.0, "Y1": WALL["length"]}
    bounds = ("Y0", "X0", "X1") if axis == "x" else ("X0", "Y0", "Y1")
    return from_document(
        {
            **COMMON,
            "name": "cantilever",
            "grid": {"x": along, "y": across},
            "sensors": {"direction": axis, "points": ["X0-Y0"]},
            "stories": [{"name": f"S{n}", "height": WALL["height"] / 4} for n in range(1, 5)],
            "materials": {
                "c": {"youngs_modulus": 25e9, "poisson_ratio": 0.2, "density": WALL["density"]}
            },
            "walls": [
                dict(zip(("along", "from", "to"), bounds, strict=True))
                | {"thickness": WALL["thickness"]}
            ],
            "mesh": {"size": 0.5},
        }
    )


# Walls and columns under slabs, lopsided, with one wall that only weighs.
WALL_FRAME = from_document(
    {
        **COMMON,
        "name": "wall frame",
        "grid": {"x": {"X0": 0.0, "X1": 4.0, "X2": 9.0}, "y": {"Y0": 0.0, "Y1": 5.0}},
        "stories": [{"name": "S1", "height": 3.2}, {"name": "S2", "height": 2.8}],
        "materials": {"c": {"youngs_modulus": 25e9, "poisson_ratio": 0.2, "density": 2400.0}},
        "sections": {
            "column": {"shape": "rectangle", "width": 0.4, "depth": 0.6},
            "beam": {"shape": "rectangle", "width": 0.3, "depth": 0.5},
        },
        "columns": [{"section": "column"}],
        "beams": [{"section": "beam"}],
        "walls": [
            {"along": "Y0", "from": "X0", "to": "X1", "thickness": 0.2},
            {"along": "Y0", "from": "X1", "to": "X2", "thickness": 0.15, "stories": ["S1"]},
            {"along": "X0", "from": "Y0", "to": "Y1", "thickness": 0.2},
            {"along": "Y1", "from": "X0", "to": "X1", "thickness": 0.1, "stiffness": False},
        ],
        "slabs": [{"x": ["X0", "X2"], "y": ["Y0", "Y1"], "thickness": 0.2}],
        "floor_mass": [{"total": 90e3}],
        "mesh": {"size": 1.0},
    }
)


def slow():
    """A ground acceleration that rises to 1 m/s2 and falls again within 20 s."""
    t = np.linspace(0.0, 20.0, 1001)
    return np.sin(np.pi * t / 20.0) ** 2, 0.02


def forces(building, theta, zeta, wanted, motion=None):
    """Forces at one draw or more; with one damping ratio, or by the building's own law."""
    theta, chosen = np.atleast_2d(theta), choose_members(building, wanted)
    if zeta is not None:
        chosen = replace(chosen, law=ConstantDamping())
    ratio = np.full(len(theta), np.nan if zeta is None else zeta)
    return member_forces(chosen, theta, ratio, motion or slow(), 30.0)


@pytest.mark.parametrize("zeta", [0.05, None])  # one ratio, or the building's own law
def test_columns_share_the_inertia_of_the_floor(zeta):
    for found in forces(TABLE, [0.8], zeta, [(0, 0, 0.5), (5, 4, 0.5)]):
        assert found.member.kind == "column"
        peaks = found.named(found.peak.mean)
        # Local y of a column is the global x here. 1 %: the motion is slow, not still.
        assert peaks["Vy_start"] == pytest.approx(MASS / 4, rel=0.01)
        assert peaks["Vz_start"] < 0.01 * MASS
        # Clamped below, all but clamped above: the moments at both ends hold the shear.
        whole = peaks["Mz_start"] + peaks["Mz_end"]
        assert whole == pytest.approx(MASS / 4 * HEIGHT, rel=0.01)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("story", [1, 3])
def test_a_cantilever_wall_carries_the_inertia_above(axis, story):
    """V = m (H - z) a and M = m (H - z)^2 a / 2, against the motion of the ground."""
    line = "Y0" if axis == "x" else "X0"
    (found,) = forces(cantilever(axis), np.ones(4), 0.05, [f"{line}:S{story}"])
    assert found.member.forces == ("N", "V", "M")
    above = WALL["height"] * (1.0 - (story - 1) / 4)
    weight = WALL["length"] * WALL["thickness"] * WALL["density"]  # kg/m
    middle = found.mean[:, found.mean.shape[1] // 2]  # the ground's acceleration is 1 m/s2
    # The inertia of half the lowest element goes straight into the nodes of the cut.
    half = 0.5 * WALL["height"] / 4 / 6
    assert middle[1] == pytest.approx(-weight * (above - half), rel=0.01)
    assert middle[2] == pytest.approx(-weight * above**2 / 2, rel=0.015)
    assert abs(middle[0]) < 1e-6 * abs(middle[1])


@pytest.mark.parametrize("story", [1, 2])
def test_walls_and_columns_share_the_story_shear(story):
    """All that passes a story cut is the inertia of what lies above, whoever carries it."""
    walls = [f"Y0:X0-X1:S{story}", f"X0:S{story}"] + ["Y0:X1-X2:S1"] * (story == 1)
    z = 0.2 if story == 1 else 3.4
    places = [(x, y, z) for x in (0.0, 4.0, 9.0) for y in (0.0, 5.0)]
    chosen = choose_members(WALL_FRAME, [*walls, *places])
    # The wall across carries along x with its thickness: cut it as if it stood along x.
    turned = replace(chosen.members[1].what, ends=chosen.members[0].ends, has_columns=False)
    across = replace(chosen.members[1], forces=("N", "V", "M"), what=turned)
    members = (chosen.members[0], across, *chosen.members[2:])
    theta = np.array([[0.7, 1.3]])
    found = member_forces(replace(chosen, members=members), theta, np.full(1, 0.05), slow(), 30.0)
    at = found[0].mean.shape[1] // 2
    shares = [one.mean[1, at] for one in found]
    for k in range(len(walls), len(found)):
        assert found[k].member.ends[0, 2] == pytest.approx(0.0 if story == 1 else 3.2)
        shares[k] *= -1.0  # the joint puts it on the column's foot; local y is the global x
    operators, level = chosen.structure.operators, 0.0 if story == 1 else 3.2
    inertia = (operators.mass_full @ operators.rigid_translation(0)).reshape(-1, 6)[:, 0]
    above = inertia[chosen.structure.mesh.model.nodes[:, 2] > level + 1e-6].sum()
    # 6 %: the lower half of the lowest elements. The motion is slow, not still.
    assert above == pytest.approx(180e3 if story == 1 else 90e3, rel=0.06)
    assert -sum(shares) == pytest.approx(above, rel=0.005)
    assert -shares[0] > 0.25 * above


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Y0:S1", r"2 walls stand along Y0 in S1: Y0:X0-X1:S1, Y0:X1-X2:S1; write one of them"),
        ("Y1:S1", r"the wall Y1:S1 only weighs \(its stiffness is false\)"),
        ("Y0:X0-X2:S2", r"no wall is named 'Y0:X0-X2:S2' \(known: .*did you mean 'Y0:X0-X1:S2'\?"),
        ("Q:S1", r"no wall is named 'Q:S1'"),
    ],
)
def test_walls_that_are_not_there(name, words):
    with pytest.raises(BuildingError, match=words):
        choose_members(WALL_FRAME, [name])


def with_effect(building, name, place, **parameters):
    entry = {"name": name, "place": place, "parameters": parameters}
    return from_document(to_document(building) | {"effects": [entry]})


def test_columns_carry_the_inertia_of_an_added_mass():
    heavier = with_effect(TABLE, "added_mass", TABLE.floors[0], size=0.1)
    (found,) = forces(heavier, [0.8, 0.25], 0.05, [(0, 0, 0.5)])
    assert found.named(found.peak.mean)["Vy_start"] == pytest.approx(1.25 * MASS / 4, rel=0.01)


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("cracked_columns", "S1"),
        ("joint_flexibility", "all"),
        ("story_damper", "2F"),
        ("amplitude_softening", "all"),
    ],
)
def test_effects_that_change_members_or_do_not_follow_modes_are_refused(name, place):
    words = rf"not found beside the effect {name}@{place}, which changes members.*leave members out"
    with pytest.raises(BuildingError, match=words):
        choose_members(with_effect(WALL_FRAME, name, place), [(0, 0, 0)])
