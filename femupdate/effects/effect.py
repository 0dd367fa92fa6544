"""What every effect says of itself, the terms that it adds to a structure, and how it is drawn.

Terms are of the full model, whose n degrees of freedom have sparse matrices and arrays, or of a
reduced one, whose n coordinates have tensors.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
import torch
from scipy.sparse import csc_matrix, diags
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.effects.structure import RANGE, Structure, numbers_of


@dataclass(frozen=True, eq=False)
class Glyph:
    """Something to be drawn on a building."""

    kind: str  # "ball", "arrow", "spring", "dashpot", "lines", "surfaces" or "sensor"
    # what the function of that name in `femupdate.report.geometry` takes; points m
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, kind: str, *arguments: Any) -> "Glyph":
        """A glyph of a kind, from what that kind takes."""
        return cls(kind, arguments)


@dataclass(frozen=True, eq=False)
class DrawnBuilding:
    """Corners and centres of a building as it is drawn."""

    structure: Structure  # the full model of the building

    @cached_property
    def nodes(self) -> Floats:
        """(N, 3) of the mesh, m; of a shear building the corners of a square plan at each level."""
        if self.structure.mesh is not None:
            return self.structure.mesh.model.nodes
        heights = np.concatenate([[0.0], self.structure.levels])
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5
        # The plan of a shear building is drawn this wide, of its height.
        plan = 0.45 * heights[-1] * corners
        return np.vstack([np.column_stack([plan, np.full(4, height)]) for height in heights])

    @cached_property
    def low(self) -> Floats:
        """(3,) least coordinates, m."""
        return np.asarray(self.nodes.min(axis=0))

    @cached_property
    def high(self) -> Floats:
        """(3,) greatest coordinates, m."""
        return np.asarray(self.nodes.max(axis=0))

    @cached_property
    def size(self) -> float:
        """Largest side of what is drawn, m; nodes without an element do not count."""
        used = self.nodes
        if self.structure.mesh is not None:
            model = self.structure.mesh.model
            used = used[np.unique(np.concatenate([model.faces.ravel(), model.lines.ravel()]))]
        return float(np.ptp(used, axis=0).max())

    @property
    def radius(self) -> float:
        """Of the ball of a sensor, m."""
        return 0.027 * self.size

    @cached_property
    def levels(self) -> Floats:
        """(f + 1,) heights of the base and the floors, m."""
        return np.asarray(self.low[2] + np.concatenate([[0.0], self.structure.levels]))

    def level(self, floor: str) -> int:
        """Index of a floor in `levels`."""
        return 1 + self.structure.floors.index(floor)

    def plan(self, level: int) -> tuple[Floats, Floats]:
        """Least and greatest coordinates of a floor, (3,) each, m; those of all at the base."""
        here = self.structure.level_of == level - 1
        if self.structure.mesh is None or level == 0 or not here.any():
            return self.low, self.high
        place = self.structure.points.position[here]
        return place.min(axis=0), place.max(axis=0)

    def centre(self, level: int) -> Floats:
        """(3,) middle of a level, m; 0 is the base."""
        middle = 0.5 * np.add(*self.plan(level))
        middle[2] = self.levels[level]
        return np.asarray(middle)

    def along(self, length: float) -> Floats:
        """(3,) a vector along the motion, m."""
        vector = np.zeros(3)
        vector[self.structure.direction] = length
        return vector

    def edges(self, level: int, under: int | None = None) -> tuple[Floats, Floats]:
        """The near corner of a level and the next one along the motion, (3,) each, m.

        Args:
            under: the level whose plan it is, by default its own.
        """
        low, high = self.plan(level if under is None else under)
        start = low.copy()
        start[2] = self.levels[level]
        return start, start + self.along(float((high - low)[self.structure.direction]))

    def diagonal(self, lower: int, upper: int) -> tuple[Floats, Floats]:
        """From corner to corner between two levels, on the near face, (3,) each, m."""
        return self.edges(lower, under=upper)[0], self.edges(upper)[1]

    def upright(self, axis: int, at: float, story: int) -> Floats:
        """(4, 3) corners of a story's face across an axis, m."""
        face = np.zeros((4, 3))
        face[:, axis] = at
        ends = [end[1 - axis] for end in self.plan(story + 1)]
        face[:, 1 - axis] = [ends[0], ends[1], ends[1], ends[0]]
        bottom, top = self.low[2] + self.structure.feet[story], self.levels[story + 1]
        face[:, 2] = [bottom, bottom, top, top]
        return face

    def stories(self, place: str) -> list[int]:
        """Index of the stories that a place names, or those of all."""
        return numbers_of(place, self.structure.building.story_names)

    def sensors(self, place: str) -> tuple[Glyph, ...]:
        """The sensors of the floors that a place names, or those of all, along the motion."""
        floors, mesh = self.structure.floors, self.structure.mesh
        glyphs = []
        for floor in [part for part in place.split(",") if part in floors] or floors:
            points = self.centre(self.level(floor))[None]
            if mesh is not None:
                points = mesh.model.nodes[np.asarray(mesh.floor_nodes[floor])]
            arm = self.along(0.16 * self.size)
            glyphs += [Glyph.of("sensor", point, point + arm, self.radius) for point in points]
        return tuple(glyphs)

    def members(self, kinds: tuple[str, ...], place: str) -> tuple[Glyph, ...]:
        """The members of some kinds, in the story that a place names or in all."""
        if self.structure.mesh is None:
            return ()
        model, wanted = self.structure.mesh.model, self.stories(place)
        chosen = model.mapped(
            lambda part: part.taken(
                np.flatnonzero(np.isin(part.kind, kinds) & np.isin(part.group, wanted))
            )
        )
        lines, faces = model.nodes[chosen.lines], model.nodes[chosen.faces]
        return Glyph.of("lines", list(lines)), Glyph.of("surfaces", list(faces))


ALL_STORIES = -1
UNSCALED = -2
Matrix: TypeAlias = csc_matrix | Tensor
Array: TypeAlias = Floats | Tensor


@dataclass(frozen=True)
class EffectParameter:
    """One number that says how large an effect is or how it is tuned."""

    name: str  # such as "size"
    unit: str  # of the number; "1" for a share
    scale: float  # standard deviation of its normal prior about `neutral`
    # value without the effect (or in the middle of what is likely, for a tuning)
    neutral: float = 0.0
    # physical limits; a limit at the neutral value makes the effect one-sided
    lower: float = -float("inf")
    upper: float = float("inf")
    text: str = ""  # what it is
    # a frequency as a multiple of the first natural one, which may lie anywhere in the band
    tuning: bool = False
    # distance from the neutral value below which nobody would look for it: what it does is then no
    # more than a detail of the model
    least: float = 0.0
    # standard deviations from the neutral value at which a search looks for it; more than one where
    # what it does is far from linear
    trials: tuple[float, ...] = (0.5,)

    def shown(self, value: float) -> str:
        """A value with its unit as it is read: shares in per cent, times in milliseconds."""
        return f"{self._scale * value:.3g} {self._unit}"

    def scatter(self, sd: float) -> str:
        """A standard deviation with its unit, such as "± 1.2 %"."""
        return f"± {self._scale * sd:.2g} {self._unit}"

    def as_read(self, value: float, sd: float) -> tuple[float, float, str]:
        """Value, standard deviation and unit as they are read."""
        return self._scale * value, self._scale * sd, self._unit

    @property
    def _unit(self) -> str:
        return {"1": "%", "s": "ms", "rad/m": "mrad/m"}.get(self.unit, self.unit)

    @property
    def _scale(self) -> float:
        return {"1": 100.0, "s": 1000.0, "rad/m": 1000.0}.get(self.unit, 1.0)

    @property
    def likely(self) -> tuple[float, float]:
        """Lowest and highest value that the prior takes seriously, within the limits."""
        # Nothing is looked for beyond five standard deviations of the prior.
        reach = 5.0 * self.scale
        return max(self.lower, self.neutral - reach), min(self.upper, self.neutral + reach)


def change(
    text: str,
    scale: float,
    lower: float,
    upper: float,
    unit: str = "1",
    trials: tuple[float, ...] = (0.5,),
) -> tuple[EffectParameter]:
    """The size of an effect, alone: what it is, its prior standard deviation and its limits."""
    size = EffectParameter("size", unit, scale, lower=lower, upper=upper, text=text, trials=trials)
    return (size,)


@dataclass(frozen=True, eq=False)
class Port:
    """A line in the structure along which a dynamic stiffness acts."""

    row: Array  # (n,) displacement along it per unit of each degree of freedom
    rigid: Array  # (2,) displacement along it per unit base translation and rotation


@dataclass(frozen=True, eq=False)
class MassTerms:
    """Mass of an effect."""

    matrix: Matrix  # (n, n)
    force: Array  # (n, 3) it times the rigid motions of the base
    rigid: Array  # (3, 3) it by the rigid motions on both sides
    # (s, n) force of inertia of what lies above the middle of each story, per unit acceleration of
    # each degree of freedom
    above: Array
    above_rigid: Array  # (s, 3) the same per unit acceleration of the base


class Stiffness(NamedTuple):
    """Stiffness that an effect adds: size / (1 + series size) of a matrix.

    A share of a part that lies in series with another, such as bending beside shear, changes the
    stiffness of both together in this way: k = 1 / (a / (1 + s) + b) is k(0) + s / (1 + r s) k'(0)
    with r = b / (a + b).
    """

    story: int  # whose factor scales the matrix; `UNSCALED` where none does
    matrix: Matrix  # (n, n) N/m, the derivative by the size where there is no effect
    series: float = 0.0  # r; zero where the stiffness is proportional to the size


@dataclass(frozen=True, eq=False)
class SpringTerms:
    """Springs that an effect puts between sums over many degrees of freedom, c of them.

    As a matrix a spring between the means of two floors would join every point of both, millions
    of numbers on a fine mesh. No factor scales them.
    """

    rows: Floats  # (c, n) stretch per unit of each degree of freedom
    stiffness: Floats  # (c,) N/m at unit size; negative where they push


@dataclass(frozen=True, eq=False)
class Hinges:
    """Rotations that springs hold, condensed: j of them without mass.

    At size s the spring of each is its unit stiffness over s, so that at zero nothing rotates, and
        K = K(theta) - s C (D + s A)^-1 C^T,   C = sum theta_i C_i,   A = sum theta_i A_i.
    """

    coupling: Array  # C_i (p, n, j), by story: forces on the structure per unit rotation
    inner: Array  # A_i (p, j, j), by story: moments that the stories put against the rotations
    spring: Array  # (j,) the diagonal of D, the springs at unit size

    def softening(self, theta: Tensor, size: Tensor) -> Tensor:
        """Stiffness (N, n, n) that hinges of sizes (N,) take away at theta (N, p)."""
        parts = self.coupling, self.inner, self.spring
        coupling, inner, spring = (torch.as_tensor(part).to(theta) for part in parts)
        coupling = torch.einsum("np,prj->nrj", theta, coupling)
        inner = torch.einsum("np,pij->nij", theta, inner)
        held = torch.diag(spring) + size[:, None, None] * inner
        return size[:, None, None] * (coupling @ torch.linalg.solve(held, coupling.mT))


@dataclass(frozen=True, eq=False)
class Terms:
    """What an effect of unit size adds to a model."""

    stiffness: tuple[Stiffness, ...] = ()  # what it adds to that of stories
    # what it puts between sums over many degrees of freedom, or None. In a reduced model they are
    # stiffness like any other.
    springs: SpringTerms | None = None
    hinges: Hinges | None = None  # rotations that it sets free, or None
    mass: MassTerms | None = None  # mass, or None
    # (2,) of the ground under the base, m/N and rad/(N m)
    flexibility: tuple[float, float] = (0.0, 0.0)
    pitch: float = 0.0  # rotation of the base that goes with its translation, rad/m
    port: Port | None = None  # where a dynamic stiffness acts, or None
    # numbers that the effect needs to evaluate itself, in its own order
    constants: tuple[float, ...] = ()

    @property
    def changes_shapes(self) -> bool:
        """Whether the shapes that a basis must hold change."""
        added = self.springs, self.mass, self.hinges
        return bool(self.stiffness) or any(matrix is not None for matrix in added)

    @property
    def shapeless(self) -> bool:
        """Whether nothing is added to the structure, so that any basis serves the effect."""
        still = self.port is None and self.flexibility == (0.0, 0.0) and self.pitch == 0.0
        return still and not self.changes_shapes


class LevelChange(NamedTuple):
    """What a structure is multiplied by where its motion is stronger or weaker."""

    stiffness: Tensor  # (N,) factor on stiffness
    damping: Tensor  # (N,) factor on the damping ratios


class Sway(NamedTuple):
    """How a structure sways at some stiffness factors, by which shares are counted.

    Attributes:
        roof: static displacement of the roof under unit base acceleration, s2.
        omega: first circular frequency.
        drift: (s,) of the stories in the first mode, of unit modal mass.
    """

    roof: float
    omega: float
    drift: Floats


PLACES: dict[str, Callable[[Structure], tuple[str, ...]]] = {
    "the base": lambda structure: ("base",),
    "all stories together": lambda structure: ("all",),
    "all stories together, and every story": lambda structure: (
        ("all", *names) if len(names := structure.building.story_names) > 1 else ("all",)
    ),
    "all floors together": lambda structure: ("floors",),
    "every floor": lambda structure: structure.floors,
    "every story, named after the floor above it": lambda structure: structure.floors,
}


class Effect(ABC):
    """A thing that a model may lack. Its first parameter is its size.

    >>> import femupdate
    >>> from femupdate.effects.registry import CATALOGUE
    >>> effect = CATALOGUE["added_mass"]
    >>> isinstance(effect, femupdate.Effect), effect.title
    (True, 'Added mass')
    >>> effect.places(femupdate.Building.load("shear_3dof"))
    ('2F', '3F', 'RF')
    """

    name: ClassVar[str]  # as in files and options
    title: ClassVar[str]  # a few words for figures
    sentence: ClassVar[str]  # what it is and does, for an engineer
    # what is there, with its first parameter, no full stop. Filled in are `{place}`, `{where}` (the
    # place with its preposition), `{size}` (with its unit), `{number}` (the size without it),
    # `{lost}` (the size with its sign turned), `{change}` (such as "25 % more"), `{title}`, and
    # `{text}`, what the first parameter is.
    clause: ClassVar[str] = "{title} {where}: {text} {size}"
    # the two of a change, for more and for less
    words: ClassVar[tuple[str, str]] = ("more", "less")
    at: ClassVar[str] = "at"  # the preposition of a place that is a floor or story
    sits: ClassVar[str]  # where it can be in a building, in words of `PLACES`
    # names of effects that are this one at some value of its parameters. Where one of them does as
    # well, that one is meant.
    contains: ClassVar[tuple[str, ...]] = ()
    # a look or a measurement that tells whether it is there, without any model
    settled_by: ClassVar[str]
    # the size first; without any the effect is there (size 1) or not
    parameters: ClassVar[tuple[EffectParameter, ...]]
    instrument: ClassVar[bool] = False  # it lies in the measurement, not in the structure
    # it is known to be there and how large it is; building files list it, and it is not looked for
    correction: ClassVar[bool] = False
    needs_phase: ClassVar[bool] = False  # |H| does not show it
    # it shows in observations at two levels of motion, not in one
    needs_levels: ClassVar[bool] = False
    # it arises in the making of tables of |H|, not in FRFs estimated by H1
    tables_only: ClassVar[bool] = False
    # it is how the base turns, which is known where that was measured
    turns_base: ClassVar[bool] = False
    # share of its parameters by which it may differ from what it stands for, beside what a reduced
    # model of it errs by
    own_error: ClassVar[float] = 0.0

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Where it can sit in a building; none where the building has no such thing."""
        return PLACES[self.sits](structure)

    def points(self, structure: Structure) -> tuple[str, ...]:
        """Further places, which building files and simulations may name; they are not searched."""
        return ()

    @abstractmethod
    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """What is drawn on or beside the building; "sensor" where it lies in a measurement."""

    def where(self, place: str) -> str:
        """A place in words, such as "in all stories" or "in S2"."""
        known = {"all": "in all stories", "floors": "on all floors", "base": "at the base"}
        return known.get(place, f"{self.at} {_in_words(place)}")

    def said(self, place: str, size: float) -> str:
        """What is there, with its first parameter; a clause for an engineer, no full stop."""
        named = f"Each of {place}" if RANGE in place else _in_words(place)
        known = {"title": self.title, "place": named, "where": self.where(place)}
        for first in self.parameters[:1]:
            size_as_read = first.shown(size)
            known |= {
                "text": first.text,
                "size": size_as_read,
                "number": size_as_read.partition(" ")[0],
                "lost": first.shown(-size),
                "change": f"{100.0 * abs(size):.3g} % {self.words[0 if size > 0.0 else 1]}",
            }
        return self.clause.format(**known)

    def scatter(self, size: float, sd: float) -> str:
        """The standard deviation of what `said` says."""
        return self.parameters[0].scatter(sd)

    def terms(self, structure: Structure, place: str) -> Terms:
        """What unit size adds to the structure."""
        return Terms()

    def basis_questions(self, structure: Structure) -> tuple[tuple[str, float], ...]:
        """Places, each with a size, whose responses a basis of a frame must hold.

        The widest places, with sizes to both sides: they hold what one floor or story does. Where
        all places are single stories or floors, each of them.
        """
        if self.instrument or not self.parameters:
            return ()
        places = self.places(structure)
        narrow = {*structure.floors, *structure.building.story_names}
        wide = [place for place in places if place not in narrow and "/" not in place]
        size_of = self.parameters[0]
        both = [size_of.neutral + sign * size_of.scale for sign in (-1.0, 1.0)]
        sizes = [size for size in both if size_of.lower <= size <= size_of.upper]
        if wide or len(places) == 1:
            return tuple((place, size) for place in wide or places for size in sizes)
        return tuple((place, sizes[-1]) for place in places)

    def unit(self, sway: Sway, place: int) -> float:
        """What a size of one is, in a unit that does not depend on stiffness factors.

        Sizes are kept as they are at theta = 1; a reader is told the share in the building that was
        measured. The place is a floor's number, or zero.
        """
        return 1.0

    def port_stiffness(self, omega: Tensor, sizes: Tensor, constants: tuple[float, ...]) -> Tensor:
        """Complex dynamic stiffness (N, k), N/m, of the port at omega (k,), rad/s."""
        raise NotImplementedError

    def damping(
        self, ratio: Tensor, omega: Tensor, sizes: Tensor, constants: tuple[float, ...]
    ) -> Tensor:
        """Damping ratios (N, m) of the modes omega (N, m), from those without the effect."""
        return ratio

    def at_level(self, sizes: Tensor, level: float | Tensor) -> LevelChange | None:
        """How the structure differs at another level of motion; None where it is always the same.

        Args:
            level: doublings of the amplitude, one or (N,).
        """
        return None

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """The FRFs (N, f, k) as they are measured; `rows` are the floors of the place."""
        return frf


@dataclass(frozen=True)
class Placed:
    """An effect at a place."""

    effect: Effect
    place: str

    @property
    def label(self) -> str:
        """Such as `added_mass@3F`."""
        return f"{self.effect.name}@{self.place}"

    @property
    def in_words(self) -> str:
        """Such as "Added mass at 3F"."""
        return f"{self.effect.title} {self.effect.where(self.place)}"

    @property
    def is_range(self) -> bool:
        """Whether it sits in several neighbouring stories or floors, not in all."""
        return RANGE in self.place

    @property
    def exchange(self) -> bool:
        """Whether it is there or not: channels exchanged or reversed."""
        return not self.effect.parameters and not self.effect.correction


def _in_words(place: str) -> str:
    """A place such as "2F,3F" as it is read."""
    return place.replace(",", " and ")


def mass_terms(structure: Structure, values: Floats) -> Terms:
    """Terms of point masses (m,) kg on the structure's points."""
    points = structure.points
    matrix = csc_matrix(points.motion.T @ diags(values) @ points.motion)
    force = values[:, None] * points.rigid
    mass = MassTerms(
        matrix, points.motion.T @ force, points.rigid.T @ force, *structure.inertia_above(values)
    )
    return Terms(mass=mass)


def as_complex(real: Tensor, imaginary: Tensor) -> Tensor:
    """A complex tensor of two real ones that broadcast."""
    return torch.complex(*torch.broadcast_tensors(real, imaginary))


def split_sizes(placed: Sequence[Placed], sizes: Tensor) -> list[Tensor]:
    """The parameters (N, q) of all effects, one after the other, each effect's by themselves."""
    if len(placed) < 2:
        return [sizes] * len(placed)
    return list(sizes.split([len(effect.effect.parameters) for effect in placed], dim=1))


def observed(
    placed: Sequence[Placed],
    floors: tuple[str, ...],
    frf: Tensor,
    omega: Tensor,
    sizes: Tensor,
    over_base: bool = True,
) -> Tensor:
    """FRFs (N, f, k) of the floors at omega (k,), rad/s, as instruments with effects give them.

    `over_base` says whether they are taken over the reading of the base's horizontal sensor.
    """
    for listed, values in zip(placed, split_sizes(placed, sizes), strict=True):
        if over_base or listed.place != "base":
            # A floor may have several rows, one a sensor.
            named = floors if listed.place == "floors" else listed.place.split(",")
            rows = tuple(k for part in named for k, floor in enumerate(floors) if floor == part)
            frf = listed.effect.observe(frf, omega, values, rows)
    return frf
