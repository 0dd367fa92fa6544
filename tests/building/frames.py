"""A small frame building as a file, and a maker of frame buildings of any size."""

from typing import Any

from tests.documents import frame

# A valid two-story frame building.
SMALL = """\
name = "small"
kind = "frame"

[grid.x]
A = "0 m"
B = "4 m"
C = "7 m"

[grid.y]
P = "0 m"
Q = "5 m"

[[stories]]
name = "low"
height = "3.2 m"

[[stories]]
name = "high"
height = "2.8 m"

[materials.concrete]
youngs_modulus = "25 GPa"
poisson_ratio = 0.2
density = "2400 kg/m3"

[sections.column]
shape = "rectangle"
width = "300 mm"
depth = "500 mm"

[sections.beam]
shape = "rectangle"
width = "250 mm"
depth = "400 mm"

[[columns]]
section = "column"

[[beams]]
section = "beam"

[[walls]]
along = "P"
from = "A"
to = "B"
thickness = "150 mm"

[[walls]]
along = "C"
from = "P"
to = "Q"
thickness = "100 mm"
role = "non_structural"

[[slabs]]
x = ["A", "C"]
y = ["P", "Q"]
thickness = "150 mm"

[[floor_mass]]
total = "60 t"

[mesh]
size = "1 m"

[sensors]
direction = "x"
points = ["P-B", "Q-B"]

[frequency_grid]
start = "0.1 Hz"
step = "0.1 Hz"
count = 300

[prior.theta]
lower = "1/3"
upper = 3

[prior.zeta]
lower = 0.01
upper = 0.05

[damping]
law = "constant"
ratio = 0.02
"""


def make_document(
    heights: list[float],
    bays: tuple[list[float], list[float]],
    mesh_size: float,
    floor_mass: float | None = None,
    walls: list[dict[str, Any]] | None = None,
) -> dict[str, Any]:
    """A document of a rectangular frame building (SI numbers, as from Python)."""
    lines = [
        {f"{name}{n}": sum(widths[:n]) for n in range(len(widths) + 1)}
        for name, widths in zip("XY", bays, strict=True)
    ]
    x, y = lines
    document: dict[str, Any] = frame(
        x,
        y,
        {f"S{n}": height for n, height in enumerate(heights, 1)},
        size=mesh_size,
        direction="y",
        grid=(0.1, 100),
        ratio=0.03,
        walls=walls or [],
        slabs=[{"x": [*x][:: len(bays[0])], "y": [*y][:: len(bays[1])], "thickness": 0.15}],
        prior={"theta": {"lower": 0.5, "upper": 2.0}},
    )
    if floor_mass is not None:
        document["floor_mass"] = [{"total": floor_mass}]
    return document
