"""The static element tests with their targets, scored."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from .membranes import (
    CANTILEVER_CASES,
    PATCH_FIELDS,
    Shape,
    cook,
    curved_cantilever,
    patch_error,
    straight_cantilever,
    twisted_beam,
)
from .peers import COUPLED_LIMITS, coupled_wall_peers, static_peer
from .score import ElementTest, Score, best_peer
from .surfaces import (
    Edges,
    Loading,
    hemisphere,
    pinched_cylinder,
    raasch_hook,
    rectangular_plate,
    scordelis_lo,
)
from .walls import (
    coupled_wall,
    coupled_wall_frequencies,
    coupled_wall_top,
    plain_wall,
    timoshenko_wall,
)

MACNEAL = "MacNeal and Harder 1985"
CANTILEVER_TARGETS = {
    "extension": 3e-5,
    "in-plane": 0.1081,
    "out-of-plane": 0.4321,
    "twist": 0.03208,
}
CURVED_TARGETS = {"in-plane": 0.08734, "out-of-plane": 0.5022}
TWISTED_TARGETS = {
    (0.32, "width"): 5.424e-3,
    (0.32, "thickness"): 1.754e-3,
    (0.0032, "width"): 5.256e-3,
    (0.0032, "thickness"): 1.294e-3,
}
PLATE_TARGETS: dict[tuple[int, Edges, Loading], float] = {
    (1, "ss", "q"): 4.062,
    (1, "ss", "p"): 11.60,
    (1, "cl", "q"): 1.26,
    (1, "cl", "p"): 5.60,
    (5, "ss", "q"): 12.97,
    (5, "ss", "p"): 16.96,
    (5, "cl", "q"): 2.56,
    (5, "cl", "p"): 7.23,
}
COOK, SCORDELIS_LO, HEMISPHERE, HEMISPHERE_LIMIT, PINCHED = 23.96, 0.3024, 0.0940, 0.0935, 1.8248e-5
HOOK = 5.05

_TRAPEZOIDS = (
    "no four-node element that passes the patch test bends in its plane as a trapezoid or a "
    "parallelogram with 6 elements (MacNeal 1987); pyfe3d's, which does, fails the patch test"
)
_STRETCHED = (
    "in a clamped thin plate the tied shear still stiffens elements five times as long as wide; "
    "Pynite's DKMQ adds a quadratic rotation on each side, which is too soft on square ones"
)
_PINCHED = "the load acts on a wrinkle narrower than one element; DKMQ is softer there"
_TWIST = "the two-node end couple twists a strip of one element; MYSTRAN's MIN4T is softer in it"
_HELD = (
    "the rotations inside the elements are free while those of the nodes are held; a constant "
    "shear force has linear moments, so that the state is none of a plate without moments on it"
)
_ROOF = "on 2x2 elements both bending and membrane are too soft (they share that with ASDShellQ4)"
_HEMISPHERE = "elements of 18 x 22 degrees; every element errs by 2.5 % or more here"

_PATCH_CASES = {
    "membrane": "constant strain in its plane",
    "spin": "constant strain and spin in its plane",
    "bending": "constant curvature",
    "twist": "constant twist",
    "shear": "constant transverse shear, rotations held",
}
_SHAPES: dict[Shape, str] = {"rect": "rectangles", "trap": "trapezoids", "para": "parallelograms"}


def static_scores() -> Iterator[Score]:
    """All static element tests, one after the other."""
    yield from _patch()
    yield from _straight_cantilevers()
    yield from _curved_and_twisted()
    yield from _cook()
    yield from _plates()
    yield from _curved_shells()
    yield from _plain_wall()
    yield from _coupled_wall()


def _patch() -> Iterator[Score]:
    for name in PATCH_FIELDS:
        test = ElementTest("Patch test", "-", MACNEAL, _HELD if name == "shear" else "")
        yield test.score(_PATCH_CASES[name], "5 distorted", 0.0, patch_error(name))


def _straight_cantilevers() -> Iterator[Score]:
    reasons = {"in-plane": _TRAPEZOIDS, "twist": _TWIST}
    for shape, name in _SHAPES.items():
        for case in CANTILEVER_CASES:
            unit = "in" if case != "twist" else "rad"
            test = ElementTest("Straight cantilever", unit, MACNEAL, reasons.get(case, ""))
            value, peer = straight_cantilever(shape, case), static_peer(f"cant {shape} {case}")
            yield test.score(f"{name}, {case}", "6x1", CANTILEVER_TARGETS[case], value, peer)


def _curved_and_twisted() -> Iterator[Score]:
    test = ElementTest("Curved cantilever", "in", MACNEAL, _TRAPEZOIDS)
    for case, target in CURVED_TARGETS.items():
        yield test.score(
            case, "6x1", target, curved_cantilever(case), static_peer(f"curved {case}")
        )
    test = ElementTest("Twisted beam", "in", MACNEAL)
    for (thickness, along), target in TWISTED_TARGETS.items():
        case, value = f"t = {thickness:g}, load along the {along}", twisted_beam(thickness, along)
        peer = static_peer(f"twisted t={thickness:g} {along}")
        yield test.score(case, "12x2 warped", target, value, peer)


def _cook() -> Iterator[Score]:
    test = ElementTest("Cook's membrane", "-", "converged (23.964 at N = 128)")
    yield from _refined(test, "middle of the loaded edge", COOK, cook, "Cook", (2, 4, 8, 16, 32))


def _plates() -> Iterator[Score]:
    for (ratio, edges, loading), target in PLATE_TARGETS.items():
        test = ElementTest(f"Rectangular plate b/a = {ratio}", "in", MACNEAL, _STRETCHED)
        support = "simply supported" if edges == "ss" else "clamped"
        case = f"{support}, {'pressure' if loading == 'q' else 'force in the middle'}"
        plate = partial(rectangular_plate, 2.0 * ratio, edges, loading)
        key = f"plate b/a={ratio} {edges} {loading}"
        yield from _refined(test, case, target, plate, key, (2, 4, 8))


def _curved_shells() -> Iterator[Score]:
    roof = ElementTest("Scordelis-Lo roof", "ft", MACNEAL, _ROOF)
    case, counts = "middle of the free edge", [2, 4, 6, 8, 16]
    yield from _refined(roof, case, SCORDELIS_LO, scordelis_lo, "Scordelis-Lo", counts)
    case, counts = "under the load", [4, 8, 12, 16]
    test = ElementTest("Hemisphere with a hole", "in", MACNEAL, _HEMISPHERE)
    yield from _refined(test, case, HEMISPHERE, hemisphere, "hemisphere", counts)
    limit = "converged (0.0935 by two other elements at N = 64)"
    test = ElementTest("Hemisphere with a hole", "in", limit)
    yield test.score(case, "32x32", HEMISPHERE_LIMIT, hemisphere(32))
    test, counts = ElementTest("Pinched cylinder", "in", MACNEAL, _PINCHED), [4, 8, 16, 32]
    yield from _refined(test, case, PINCHED, pinched_cylinder, "pinched cylinder", counts)
    limit = "extrapolated from 20-node bricks of OpenSees (5.022 and 5.039)"
    test = ElementTest("Raasch's hook", "in", limit)
    for across, along in ((1, 9), (3, 18), (5, 36), (10, 72), (20, 144)):
        value, peer = raasch_hook(across, along), static_peer(f"hook {across}x{along}")
        yield test.score("shear along the width", f"{across}x{along}", HOOK, value, peer)


def _refined(
    test: ElementTest,
    case: str,
    target: float,
    value: Callable[[int], float],
    key: str,
    counts: Sequence[int],
) -> Iterator[Score]:
    """One row a mesh; `value` takes the elements along a side, `key` leads to the peers."""
    for count in counts:
        peer = static_peer(f"{key} N={count}")
        yield test.score(case, f"{count}x{count}", target, value(count), peer)


def _plain_wall() -> Iterator[Score]:
    source = "Timoshenko beam (the plane stress limit is 0.997 of it)"
    test, target = ElementTest("Wall 6 m x 21 m", "m", source), timoshenko_wall()
    for columns, rows in ((1, 6), (2, 6), (2, 12), (4, 24), (16, 48)):
        mesh, value = f"{columns}x{rows}", plain_wall(columns, rows)
        yield test.score("top displacement", mesh, target, value, static_peer(f"plain wall {mesh}"))


def _coupled_wall() -> Iterator[Score]:
    source = "extrapolated (Richardson) from OpenSees runs"
    names = (("top displacement", "mm"), ("first frequency in its plane", "Hz"))
    for fine in (1, 2, 4, 8):
        wall = coupled_wall(fine)
        values = (1e3 * coupled_wall_top(wall), float(coupled_wall_frequencies(wall)[0]))
        mesh = f"{len(wall.faces)} shells"
        reason = "one element over the depth of a lintel" if fine == 1 else ""
        for k, (name, unit) in enumerate(names):
            test = ElementTest("Coupled wall, six stories", unit, source, reason)
            peer = best_peer(coupled_wall_peers(fine, k))
            yield test.score(name, mesh, COUPLED_LIMITS[k], values[k], peer)
