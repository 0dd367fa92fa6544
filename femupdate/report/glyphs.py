"""Signs for things that are not in a mesh: masses, springs, dashpots, sensors, arrows, walls."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.effects.drawn_building import Glyph
from femupdate.errors import ReportError

_TURNS, _WIDTH = 5, 0.18  # of a spring; width over length


@dataclass(frozen=True)
class Glyphs:
    """What is drawn on top of a building, in its coordinates, m.

    Attributes:
        balls: centres (3,) and radii.
        lines: (n, 3) each, drawn as tubes.
        faces: (4, 3) each, drawn as surfaces.
    """

    balls: tuple[tuple[Floats, float], ...] = ()
    lines: tuple[Floats, ...] = field(default=())
    faces: tuple[Floats, ...] = ()

    def __add__(self, other: "Glyphs") -> "Glyphs":
        """Both."""
        return Glyphs(self.balls + other.balls, self.lines + other.lines, self.faces + other.faces)


def ball(centre: Floats, radius: float) -> Glyphs:
    """A mass."""
    return Glyphs(balls=((np.asarray(centre, dtype=np.float64), radius),))


def arrow(start: Floats, end: Floats) -> Glyphs:
    """From start to end, the head in the vertical plane or flat where the arrow is upright."""
    along = end - start
    length = float(np.linalg.norm(along))
    side = _across(along) * 0.14 * length
    neck = start + 0.72 * along
    return Glyphs(lines=(np.stack([start, end]), np.stack([neck + side, end, neck - side])))


def spring(start: Floats, end: Floats) -> Glyphs:
    """A zigzag between two points, straight at its ends."""
    along, side = end - start, _across(end - start)
    share = np.linspace(0.2, 0.8, 2 * _TURNS + 1)
    swing = _WIDTH * float(np.linalg.norm(along)) * np.where(np.arange(len(share)) % 2, 1.0, -1.0)
    swing[[0, -1]] = 0.0
    middle = start + share[:, None] * along + swing[:, None] * side
    return Glyphs(lines=(np.vstack([start, middle, end]),))


def dashpot(start: Floats, end: Floats) -> Glyphs:
    """A piston in a cup between two points."""
    along = end - start
    side = _across(along) * 0.09 * float(np.linalg.norm(along))
    cup = [start + 0.62 * along + side, start + 0.38 * along + side]
    cup += [start + 0.38 * along - side, start + 0.62 * along - side]
    plate = [start + 0.52 * along + 0.8 * side, start + 0.52 * along - 0.8 * side]
    rods = [[start, start + 0.38 * along], [start + 0.52 * along, end]]
    return Glyphs(lines=tuple(np.stack(points) for points in ([*cup], plate, *rods)))


def lines(paths: Sequence[Floats]) -> Glyphs:
    """Beams, columns or plain lines, points (n, 3) each."""
    return Glyphs(lines=tuple(paths))


def surfaces(corners: Sequence[Floats]) -> Glyphs:
    """Walls or slabs, four corners (4, 3) each."""
    return Glyphs(faces=tuple(corners))


def sensor(place: Floats, tip: Floats, radius: float) -> Glyphs:
    """A ball, and an arrow from it along the direction that is measured."""
    return ball(place, radius) + arrow(place, tip)


def _across(along: Floats) -> Floats:
    """A unit vector across a direction, upright unless that is upright itself."""
    unit = along / np.linalg.norm(along)
    up = np.array([0.0, 0.0, 1.0]) if abs(unit[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    side = up - (up @ unit) * unit
    return np.asarray(side / np.linalg.norm(side))


SIGNS: Mapping[str, Callable[..., Glyphs]] = {
    "ball": ball,
    "arrow": arrow,
    "spring": spring,
    "dashpot": dashpot,
    "lines": lines,
    "surfaces": surfaces,
    "sensor": sensor,
}


def sign(kind: str, *arguments: Any) -> Glyphs:
    """Return the sign of a kind, made from what its function takes.

    Raises:
        ReportError: no sign has this name.
    """
    if kind not in SIGNS:
        known = ", ".join(SIGNS)
        raise ReportError(f"no sign is named {kind!r} (known: {known}); write one of these")
    return SIGNS[kind](*arguments)


def drawn(glyphs: Iterable[Glyph]) -> Glyphs:
    """Return the signs that an effect asks for.

    Raises:
        ReportError: one is of a kind that is not known.
    """
    return sum((sign(glyph.kind, *glyph.arguments) for glyph in glyphs), Glyphs())
