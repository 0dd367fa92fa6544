"""The static element tests with their targets, scored."""

from collections.abc import Iterator

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
from .score import Peer, Score, best
from .surfaces import (
    Edges,
    Loading,
    hemisphere,
    pinched_cylinder,
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
from .z_section import axial_stress

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
LE5 = -108e6

_TRAPEZOIDS = (
    "no four-node element that passes the patch test bends in its plane as a trapezoid or a "
    "parallelogram with 6 elements (MacNeal 1987); pyfe3d's, which does, fails the patch test"
)
_STRETCHED = (
    "MITC4's constant shear along a side stiffens elements five times as long as wide; Pynite's "
    "DKMQ adds a quadratic rotation there, which errs the other way on square ones"
)
_PINCHED = "the load acts on a wrinkle narrower than one element; DKMQ is softer there"
_PLATE_STRIP = "ours is MITC4 in bending; DKMQ is ahead by 2.4 % on trapezoids, at 0.74 in twist"
_ROOF = "on 2x2 elements both bending and membrane are too soft (they share that with ASDShellQ4)"


def static_scores() -> Iterator[Score]:
    """All static element tests, one after the other."""
    yield from _patch()
    yield from _cantilevers()
    yield from _plates()
    yield from _curved_shells()
    yield from _walls()
    yield from _z_section()


_PATCH_CASES = {
    "membrane": "constant strain in its plane",
    "spin": "constant strain and spin in its plane",
    "bending": "constant curvature",
    "twist": "constant twist",
    "shear": "constant transverse shear, rotations held",
}


def _patch() -> Iterator[Score]:
    for name in PATCH_FIELDS:
        yield Score(
            "Patch test",
            _PATCH_CASES[name],
            "5 distorted",
            0.0,
            patch_error(name),
            "-",
            MACNEAL,
        )


def _cantilevers() -> Iterator[Score]:
    shapes: dict[Shape, str] = {
        "rect": "rectangles",
        "trap": "trapezoids",
        "para": "parallelograms",
    }
    for shape, name in shapes.items():
        for case in CANTILEVER_CASES:
            reason = {"in-plane": _TRAPEZOIDS, "out-of-plane": _PLATE_STRIP}.get(case, "")
            yield _score(
                "Straight cantilever",
                f"{name}, {case}",
                "6x1",
                CANTILEVER_TARGETS[case],
                straight_cantilever(shape, case),
                "in" if case != "twist" else "rad",
                f"cant {shape} {case}",
                reason=reason,
            )
    for case, target in CURVED_TARGETS.items():
        yield _score(
            "Curved cantilever",
            case,
            "6x1",
            target,
            curved_cantilever(case),
            "in",
            f"curved {case}",
            reason=_TRAPEZOIDS,
        )
    for (thickness, along), target in TWISTED_TARGETS.items():
        yield _score(
            "Twisted beam",
            f"t = {thickness:g}, load along the {along}",
            "12x2 warped",
            target,
            twisted_beam(thickness, along),
            "in",
            f"twisted t={thickness:g} {along}",
        )
    for count in (2, 4, 8, 16, 32):
        yield _score(
            "Cook's membrane",
            "middle of the loaded edge",
            f"{count}x{count}",
            COOK,
            cook(count),
            "-",
            f"Cook N={count}",
            source="converged (23.964 at N = 128)",
        )


def _plates() -> Iterator[Score]:
    for (ratio, edges, loading), target in PLATE_TARGETS.items():
        for count in (2, 4, 8):
            yield _score(
                f"Rectangular plate b/a = {ratio}",
                f"{'simply supported' if edges == 'ss' else 'clamped'}, "
                f"{'pressure' if loading == 'q' else 'force in the middle'}",
                f"{count}x{count}",
                target,
                rectangular_plate(2.0 * ratio, edges, loading, count),
                "in",
                f"plate b/a={ratio} {edges} {loading} N={count}",
                reason=_STRETCHED,
            )


def _curved_shells() -> Iterator[Score]:
    for count in (2, 4, 6, 8, 16):
        yield _score(
            "Scordelis-Lo roof",
            "middle of the free edge",
            f"{count}x{count}",
            SCORDELIS_LO,
            scordelis_lo(count),
            "ft",
            f"Scordelis-Lo N={count}",
            reason=_ROOF,
        )
    for count in (4, 8, 12, 16):
        yield _score(
            "Hemisphere with a hole",
            "under the load",
            f"{count}x{count}",
            HEMISPHERE,
            hemisphere(count),
            "in",
            f"hemisphere N={count}",
            reason="elements of 18 x 22 degrees; every element errs by 2.5 % or more here",
        )
    yield _score(
        "Hemisphere with a hole",
        "under the load",
        "32x32",
        HEMISPHERE_LIMIT,
        hemisphere(32),
        "in",
        "",
        source="converged (0.0935 by two other elements at N = 64)",
    )
    for count in (4, 8, 16, 32):
        yield _score(
            "Pinched cylinder",
            "under the load",
            f"{count}x{count}",
            PINCHED,
            pinched_cylinder(count),
            "in",
            f"pinched cylinder N={count}",
            reason=_PINCHED,
        )


def _walls() -> Iterator[Score]:
    target = timoshenko_wall()
    for columns, rows in ((1, 6), (2, 6), (2, 12), (4, 24), (16, 48)):
        yield _score(
            "Wall 6 m x 21 m",
            "top displacement",
            f"{columns}x{rows}",
            target,
            plain_wall(columns, rows),
            "m",
            f"plain wall {columns}x{rows}",
            source="Timoshenko beam (the plane stress limit is 0.997 of it)",
        )
    source = "extrapolated (Richardson) from OpenSees runs"
    for fine in (1, 2, 4, 8):
        wall = coupled_wall(fine)
        values = (1e3 * coupled_wall_top(wall), float(coupled_wall_frequencies(wall)[0]))
        names = (("top displacement", "mm"), ("first frequency in its plane", "Hz"))
        for k, (name, unit) in enumerate(names):
            yield Score(
                "Coupled wall, six stories",
                name,
                f"{len(wall.faces)} shells",
                COUPLED_LIMITS[k],
                values[k],
                unit,
                source,
                best(coupled_wall_peers(fine, k)),
                "one element over the depth of a lintel" if fine == 1 else "",
            )


def _z_section() -> Iterator[Score]:
    peers = {"Abaqus S4": -110.36e6 / LE5, "OptiStruct CQUAD4": -112.2e6 / LE5}
    yield Score(
        "LE5 Z-section",
        "axial stress at A",
        "8x4",
        LE5,
        axial_stress(8, 1)["tip"],
        "Pa",
        "NAFEMS TNSB rev. 3 (1990)",
        best(peers),
    )
    yield Score(
        "LE5 Z-section",
        "axial stress at A",
        "32x16",
        LE5,
        axial_stress(32, 4)["tip"],
        "Pa",
        "NAFEMS TNSB rev. 3 (1990)",
        Peer("Abaqus S4", -110.38e6 / LE5),
    )


def _score(
    test: str,
    case: str,
    mesh: str,
    target: float,
    value: float,
    unit: str,
    key: str,
    *,
    source: str = MACNEAL,
    reason: str = "",
) -> Score:
    return Score(test, case, mesh, target, value, unit, source, static_peer(key), reason)
