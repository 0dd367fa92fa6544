"""The vibration tests with their targets, scored."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from femupdate.fe import FiniteElementModel

from .peers import frequency_peer
from .score import ElementTest, Score
from .vibrations import (
    deep_beam,
    distorted_cantilever,
    double_cross,
    frequencies,
    off_centre_masses,
    rhombic_plate,
    square_plate,
    tapered_membrane,
)

FREE = "NAFEMS R0015"

# Distinct frequencies (Hz) with how many modes share each.
TARGETS: dict[str, tuple[tuple[float, int], ...]] = {
    "FV2": ((11.336, 1), (17.709, 7), (45.345, 1), (57.390, 7)),
    "FV4": ((1.723, 1), (1.727, 1), (7.413, 1), (9.972, 1), (18.155, 1), (26.957, 1)),
    "FV5": ((42.649, 2), (77.542, 1), (125.00, 1), (148.31, 2), (233.10, 1), (284.55, 2)),
    "FV12": ((1.622, 1), (2.360, 1), (2.922, 1), (4.233, 2), (7.416, 1)),
    "FV13": ((2.377, 1), (5.942, 2), (9.507, 1), (11.884, 2), (15.449, 2)),
    "FV15": ((7.938, 1), (12.835, 1), (17.941, 1), (19.133, 1), (24.009, 1), (27.922, 1)),
    "FV16": ((0.421, 1), (1.029, 1), (2.582, 1), (3.306, 1), (3.753, 1), (6.555, 1)),
    "FV21": ((45.897, 1), (109.44, 2), (167.89, 1), (204.51, 2), (256.50, 2)),
    "FV22": ((133.95, 1), (201.41, 1), (265.81, 1), (283.68, 1), (334.45, 1), (386.62, 1)),
    "FV32": ((44.623, 1), (130.03, 1), (162.70, 1), (246.05, 1), (379.90, 1), (391.44, 1)),
    "FV52": ((45.897, 1), (109.44, 2), (167.89, 1), (193.59, 1), (206.19, 2)),
}
TARGETS["FV16 T2"] = TARGETS["FV16"]
NAMES = {
    "FV2": "FV2 pin-ended double cross",
    "FV4": "FV4 cantilever with off-centre masses",
    "FV5": "FV5 deep beam",
    "FV12": "FV12 free thin plate",
    "FV13": "FV13 simply supported thin plate",
    "FV15": "FV15 clamped thin rhombic plate",
    "FV16": "FV16 cantilever thin plate",
    "FV16 T2": "FV16 Test 2, distorted mesh",
    "FV21": "FV21 simply supported thick plate",
    "FV22": "FV22 clamped thick rhombic plate",
    "FV32": "FV32 tapered membrane",
    "FV52": "FV52 simply supported solid plate",
}

_SKEWED = (
    "MITC4 is stiff in bending on skewed elements whose half wave spans four of them; the error "
    "falls with h squared"
)
_DISTORTED = (
    "MITC4 is stiff in bending where a wave spans four distorted elements; DKGQ, which has no "
    "shear, is softer there"
)
_SHORT_WAVE = "a half wave over little more than one element"
_SOFT = (
    "the target is the plate whose edges cannot twist; with only the deflection held, as the test "
    "says, solids find 44.1 Hz too (MathWorks' example of FV52)"
)


def vibration_scores() -> Iterator[Score]:
    """Free vibration tests on the published mesh, plates on one or two finer meshes too."""
    yield from _scores("FV2", double_cross(), "4 an arm")
    yield from _scores("FV4", off_centre_masses(), "5 + 2 arms", _SHORT_WAVE)
    yield from _scores("FV5", deep_beam(), "5", _SHORT_WAVE)
    for count in (8, 16, 32):
        square = partial(_plate_scores, count, published=8)
        yield from square("FV12", square_plate(count, 0.05, "free"), floating=3)
        yield from square("FV13", square_plate(count, 0.05, "hard"))
        yield from square("FV16", square_plate(count, 0.05, "clamped"))
        yield from square("FV21", square_plate(count, 1.0, "hard"))
    yield from _scores("FV16 T2", distorted_cantilever(), "4x4 distorted", _DISTORTED)
    for count in (12, 24, 48):
        yield from _plate_scores(count, "FV15", rhombic_plate(count, 0.05), published=12)
    for count in (10, 20, 40):
        yield from _plate_scores(count, "FV22", rhombic_plate(count, 1.0), published=10)
    yield from _scores("FV32", tapered_membrane(16, 8), "16x8")
    yield from _scores("FV32", tapered_membrane(32, 16), "32x16", peers=False)
    solid = square_plate(16, 1.0, "soft")
    yield from _scores("FV52", solid, "16x16 shells", _SOFT, peers=False, floating=3)


def _plate_scores(
    count: int, test: str, plate: FiniteElementModel, *, published: int, floating: int = 0
) -> Iterator[Score]:
    """Of a plate of count x count elements; peers are known on the published mesh."""
    mesh, peers = f"{count}x{count}", count == published
    return _scores(test, plate, mesh, _SKEWED, peers=peers, floating=floating)


def _scores(
    name: str,
    structure: FiniteElementModel,
    mesh: str,
    reason: str = "",
    *,
    peers: bool = True,
    floating: int = 0,
) -> Iterator[Score]:
    """One score a distinct frequency; of modes that share one, the farthest counts."""
    test = ElementTest(NAMES[name], "Hz", FREE, reason)
    found = frequencies(structure, sum(count for _, count in TARGETS[name]), floating)
    start = 0
    for number, (target, count) in enumerate(TARGETS[name]):
        group = found[start : start + count]
        value = float(group[np.abs(group / target - 1.0).argmax()])
        modes = f"mode {start + 1}" if count == 1 else f"modes {start + 1} to {start + count}"
        peer = frequency_peer(name, number) if peers else None
        yield test.score(modes, mesh, target, value, peer)
        start += count
