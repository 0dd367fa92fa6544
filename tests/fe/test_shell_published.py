"""The shell against published static tests: value / target on coarse and fine meshes."""

import pytest
from femupdate.benchmarks.solver import membranes, surfaces, walls
from femupdate.benchmarks.solver.static_scores import (
    CANTILEVER_TARGETS,
    COOK,
    CURVED_TARGETS,
    HEMISPHERE,
    PINCHED,
    PLATE_TARGETS,
    SCORDELIS_LO,
    TWISTED_TARGETS,
)

from femupdate.fe import Shells

TWO_PER_CENT = 0.02  # coarse-mesh scores differ by that much between drilling formulations


# Under constant shear with all rotations held, those inside the elements give way.
@pytest.mark.parametrize("name", sorted(set(membranes.PATCH_FIELDS) - {"shear"}))
def test_patch(name):
    assert membranes.patch_error(name) < 1e-10


@pytest.mark.parametrize(("count", "score"), [(2, 0.877), (4, 0.960), (8, 0.988), (16, 0.997)])
def test_cook(count, score):
    assert membranes.cook(count) / COOK == pytest.approx(score, rel=0.01)


@pytest.mark.parametrize(
    ("shape", "case", "score"),
    [
        ("rect", "extension", 0.996),
        ("rect", "in-plane", 0.987),
        ("rect", "out-of-plane", 0.980),
        ("rect", "twist", 0.941),
        ("trap", "extension", 0.999),
        ("trap", "out-of-plane", 0.963),
        ("trap", "twist", 0.884),
        ("para", "extension", 0.999),
        ("para", "in-plane", 0.629),
        ("para", "out-of-plane", 0.978),
        ("para", "twist", 0.849),
    ],
)
def test_straight_cantilever(shape, case, score):
    value = membranes.straight_cantilever(shape, case) / CANTILEVER_TARGETS[case]
    assert value == pytest.approx(score, rel=TWO_PER_CENT)


@pytest.mark.parametrize(("case", "score"), [("in-plane", 0.372), ("out-of-plane", 0.942)])
def test_curved_cantilever(case, score):
    value = membranes.curved_cantilever(case) / CURVED_TARGETS[case]
    assert value == pytest.approx(score, rel=TWO_PER_CENT)


@pytest.mark.parametrize(("thickness", "along"), list(TWISTED_TARGETS))
def test_twisted_beam_of_warped_elements(thickness, along):
    target = TWISTED_TARGETS[thickness, along]
    assert membranes.twisted_beam(thickness, along) == pytest.approx(target, rel=0.01)


@pytest.mark.parametrize(("ratio", "edges", "loading"), list(PLATE_TARGETS))
def test_rectangular_plate_without_shear_locking(ratio, edges, loading):
    value = surfaces.rectangular_plate(2.0 * ratio, edges, loading, 8)
    target = PLATE_TARGETS[ratio, edges, loading]
    assert value == pytest.approx(target, rel=TWO_PER_CENT)  # MITC4: 5 % off in the last


@pytest.mark.parametrize(("count", "score"), [(4, 1.05), (8, 1.01), (16, 1.0)])
def test_scordelis_lo(count, score):
    assert surfaces.scordelis_lo(count) / SCORDELIS_LO == pytest.approx(score, rel=0.005)


@pytest.mark.parametrize(("count", "score"), [(4, 0.957), (8, 0.99), (16, 0.995)])
def test_hemisphere_with_a_hole(count, score):
    assert surfaces.hemisphere(count) / HEMISPHERE == pytest.approx(score, rel=TWO_PER_CENT)


@pytest.mark.parametrize(("count", "score"), [(4, 0.572), (8, 0.889), (16, 1.0)])
def test_pinched_cylinder(count, score):
    assert surfaces.pinched_cylinder(count) / PINCHED == pytest.approx(score, rel=TWO_PER_CENT)


@pytest.mark.parametrize(
    ("columns", "rows", "score"), [(1, 6, 0.984), (2, 6, 0.980), (2, 12, 0.987), (4, 24, 0.994)]
)
def test_wall_against_the_timoshenko_beam(columns, rows, score):
    """A wall 6 m x 21 m x 0.3 m under 1 MN at its top: one element across is enough."""
    value = walls.plain_wall(columns, rows) / walls.timoshenko_wall()
    assert value == pytest.approx(score, abs=0.005)


@pytest.mark.parametrize(
    ("fine", "elements", "top", "frequencies"),
    [(1, 132, 7.321e-3, (6.406, 24.07)), (2, 528, 7.989e-3, (6.135, 23.30))],
)
def test_coupled_wall(fine, elements, top, frequencies):
    """100 kN a floor on its line; expected: the enhanced-strain ASDShellQ4 on the same mesh."""
    wall = walls.coupled_wall(fine)
    assert len(wall.elements_of(Shells)) == elements
    assert walls.coupled_wall_top(wall) == pytest.approx(top, rel=TWO_PER_CENT)
    assert walls.coupled_wall_frequencies(wall) == pytest.approx(frequencies, rel=0.01)
