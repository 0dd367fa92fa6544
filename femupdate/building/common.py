"""What building files of every kind hold, validated (SI inside)."""

from collections.abc import Callable, Mapping
from functools import cached_property
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from femupdate.arrays import Floats
from femupdate.building.entry import (
    Complaint,
    Complaints,
    Entry,
    Flag,
    Frequency,
    FrequencyOrZero,
    Label,
    Number,
    PositiveNumber,
    Share,
    Time,
    Whole,
    unknown,
)
from femupdate.building.members import (
    Base,
    FloorMass,
    FrameStory,
    Material,
    SpringGroup,
    Story,
    Supports,
)
from femupdate.building.references import require, resolve
from femupdate.building.sections import Section
from femupdate.errors import brief

_MOST_FREQUENCIES = 1_000_000


class FrequencyGrid(Entry):
    """The frequencies at which responses are computed: start, start + step, ... (Hz)."""

    start: FrequencyOrZero
    step: Frequency
    count: Whole

    def _complaints(self) -> Complaints:
        if not 2 <= self.count <= _MOST_FREQUENCIES:
            text = f"{self.count} must lie between 2 and {_MOST_FREQUENCIES}; write another count"
            yield ("count", text)

    @property
    def stop(self) -> float:
        """The last frequency, Hz."""
        return self.start + self.step * (self.count - 1)

    def frequencies_hz(self) -> Floats:
        """Return the (count,) frequencies, Hz."""
        return self.start + self.step * np.arange(self.count, dtype=np.float64)


class Range(Entry):
    """The limits of a uniform prior."""

    lower: PositiveNumber
    upper: PositiveNumber

    def _complaints(self) -> Complaints:
        if self.lower >= self.upper:
            yield (
                "lower",
                f"{self.lower:g} must lie below upper = {self.upper:g}; exchange the two",
            )


class Prior(Entry):
    """Uniform priors: theta of all stories, of single ones, and zeta where it is a nuisance."""

    theta: Range = Range(lower=1.0 / 3.0, upper=3.0)
    stories: Mapping[str, Range] = Field(default_factory=dict)
    zeta: Range | None = None

    def _complaints(self) -> Complaints:
        if self.zeta is not None and self.zeta.upper >= 1.0:
            yield ("zeta.upper", f"{self.zeta.upper:g} must lie below 1 (critical); correct it")

    def theta_of(self, story: str) -> Range:
        """Return the limits of one story's stiffness factor."""
        return self.stories.get(story, self.theta)


class Damping(Entry):
    """The damping ratio of every mode.

    With the law "constant" all modes have `ratio`, which predictions use. With "rayleigh" the ratio
    is reached at two frequencies, the anchors, and fixed whatever theta is: that of a mode of
    circular frequency w is a0 / (2 w) + a1 w / 2 (Clough and Penzien, 1993, section 12-5). With
    "modes" each mode has its own of `ratios`, told by its frequency among the anchors: between two
    of them linear in the logarithm of frequency, beyond them as at the last. All go with the first,
    which is `ratio`, where that is unknown.
    """

    law: Literal["constant", "rayleigh", "modes"]
    ratio: PositiveNumber
    anchors: tuple[Frequency, ...] | None = None
    ratios: tuple[PositiveNumber, ...] | None = None

    def _complaints(self) -> Complaints:
        if self.ratio >= 1.0:
            yield ("ratio", f"{self.ratio:g} must lie below 1 (critical); 2 % is written 0.02")
        if self.law == "constant":
            for key in ("anchors", "ratios"):
                if getattr(self, key) is not None:
                    text = 'they need law = "rayleigh" or "modes"; remove them or change the law'
                    yield (key, text)
            return
        anchors, ratios = self.anchors or (), self.ratios or ()
        if self.anchors is None:
            text = "the two frequencies" if self.is_rayleigh else "the frequency of each mode"
            yield "anchors", f"the key is missing; add {text}"
        if self.is_rayleigh:
            if len(anchors) != 2:
                yield "anchors", f"the list has {len(anchors)} entries; write 2"
            if anchors[0] == anchors[1]:
                yield "anchors", "the two frequencies must differ; change one of them"
            return
        if self.ratios is None or len(ratios) != len(anchors):
            yield "ratios", f"write a ratio for each of the {len(anchors)} anchors"
        if any(low >= high for low, high in pairwise(anchors)):
            yield "anchors", "frequencies of modes must rise; put them in order"
        if max(ratios) >= 1.0:
            yield "ratios", f"{max(ratios):g} must lie below 1 (critical)"
        if ratios[0] != self.ratio:
            text = f"the first, {ratios[0]:g}, must be `ratio`, {self.ratio:g}; correct one"
            yield "ratios", text

    @property
    def lowest(self) -> float:
        """Lowest ratio of any mode, over `ratio`."""
        return min(self.ratios or (self.ratio,)) / self.ratio

    @property
    def is_rayleigh(self) -> bool:
        """Whether the law fixes the ratio of every mode."""
        return self.law == "rayleigh"


class ObservationSettings(Entry):
    """What is assumed about an observation that does not say it itself.

    `noise_sd` is the standard deviation of the noise on ln|H|.
    """

    noise_sd: PositiveNumber = 0.2


class ReductionSettings(Entry):
    """How close the reduced model must follow the full one: difference in ln|H| allowed."""

    tolerance: PositiveNumber = 0.02


class Tolerances(Entry):
    """How well is known what is taken as known: standard deviations, 0 where it was measured.

    `mass` is that of each floor by itself, `gain` that of each sensor, the base's among them,
    `delay` that of each floor's clock against the base's, `damping_of_modes` that of a mode's
    damping ratio about the law of the building, and `members` that of each kind of member in what
    it adds to the stiffness of its stories.
    """

    mass: Share = 0.0
    gain: Share = 0.0
    delay: Time = 0.0
    damping_of_modes: Share = 0.0
    members: Share = 0.0

    def _complaints(self) -> Complaints:
        for key, most, text in (
            ("mass", 0.5, "50 %"),
            ("gain", 0.5, "50 %"),
            ("delay", 0.05, "50 ms"),
            ("damping_of_modes", 0.5, "50 %"),
            ("members", 0.5, "50 %"),
        ):
            if getattr(self, key) > most:
                yield (key, f"it is above {text}, which is no tolerance; correct it")


class EffectEntry(Entry):
    """One `[[effects]]` table: which effect, where, and how large it was found to be.

    The figures are in the units of the effect's parameters (SI); calibrations start from them and
    sample them with the prior of the effect.
    """

    name: Label
    place: Label
    parameters: Mapping[str, Number] = Field(default_factory=dict)


BASE = "base"


class Building(Entry):
    """A building as its file says: stories, frequencies, priors, damping and listed effects.

    Its kinds are `FrameBuilding`, `MeshBuilding` and `ShearBuilding`.

        >>> import femupdate
        >>> building = femupdate.Building.load("shear_3dof")
        >>> building.floors, building.story_names
        (('2F', '3F', 'RF'), ('S1', 'S2', 'S3'))
    """

    __repr__ = brief

    removed: ClassVar = {
        "parameters": "every story has one stiffness factor; remove the table. `diagnose` names "
        "walls, slabs, columns or beams that are stiffer or softer, and [[effects]] lists them"
    }

    # A building of any kind by its file or its shipped name: put here by what knows all kinds.
    load: ClassVar[Callable[..., "Building"]]

    name: Label
    title: str = ""
    description: str = ""
    stories: tuple[Story, ...]
    frequency_grid: FrequencyGrid
    prior: Prior = Prior()
    damping: Damping
    observation: ObservationSettings = ObservationSettings()
    reduction: ReductionSettings = ReductionSettings()
    effects: tuple[EffectEntry, ...] = ()
    tolerances: Tolerances | None = None
    # Where the figures come from, in the words of the file's author; nothing here reads it.
    provenance: Mapping[str, str | tuple[str, ...]] = Field(default_factory=dict)
    # What is left out of the document, and so of its hash, where it is not said.
    masses_known: Flag | None = None
    supports: Base | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "Building":
        self.check()
        return self

    @cached_property
    def source(self) -> str:
        """The text of the file that it was read from, with its comments; empty without one."""
        return ""

    @property
    def story_names(self) -> tuple[str, ...]:
        """Names of the stories, bottom to top."""
        return tuple(story.name for story in self.stories)

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors above each story, "2F" to "RF"."""
        return (*(f"{number}F" for number in range(2, len(self.stories) + 1)), "RF")

    @property
    def below(self) -> tuple[int, ...]:
        """Index of the floor on which every story stands, -1 for the base."""
        return tuple(range(-1, len(self.stories) - 1))

    def over_foot(self, values: Floats) -> Floats:
        """Values of the floors (f, ...) less those of the floors on which their stories stand."""
        return (
            values - np.concatenate([np.zeros_like(values[:1]), values])[np.array(self.below) + 1]
        )

    @property
    def is_chain(self) -> bool:
        """Whether every story stands on the one listed before."""
        return self.below == tuple(range(-1, len(self.stories) - 1))

    @property
    def has_dashpots(self) -> bool:
        """Whether dashpots stand between building and ground, so that modes are complex."""
        return False

    @property
    def forces_are_relative(self) -> bool:
        """Whether masses are nominal, so that only stiffness over mass can be known."""
        return self.masses_known is False

    @property
    def moving_base(self) -> str:
        """What the base does under forces: "slides" or "is free"; empty where it is held."""
        base = "fixed" if self.supports is None else self.supports.base
        return {"slides": "slides", "free": "is free"}.get(base, "")

    def check(self) -> None:
        """Raise Complaint for the first entry that does not fit the others."""
        if self.tolerances and self.tolerances.members and not isinstance(self, MeshedBuilding):
            raise Complaint("tolerances.members", "it is for frames and meshes; remove it")
        seen: list[str] = []
        for number, name in enumerate(self.story_names):
            if name in seen:
                text = f"{name!r} is the name of stories[{seen.index(name)}] already; rename one"
                raise Complaint(f"stories[{number}].name", text)
            seen.append(name)
            on = getattr(self.stories[number], "on", None)
            if on not in (None, BASE, *seen[:-1]):
                text = f'{on!r} is no story listed before it; write "{BASE}" or one of those'
                raise Complaint(f"stories[{number}].on", text)
        if not seen:
            raise Complaint("stories", "the building has no story; add a [[stories]] table")
        for name in self.prior.stories:
            if name not in self.story_names:
                raise Complaint(f"prior.stories.{name}", unknown("story", name, self.story_names))
        for key in ("floors", "at"):
            for floor in getattr(getattr(self, "sensors", None), key, ()):
                require(floor, self.floors, "floor", f"sensors.{key}.{floor}")
        if self.prior.zeta is not None and self.damping.is_rayleigh:
            text = "Rayleigh damping is fixed by its anchors; remove the prior, or use constant"
            raise Complaint("prior.zeta", f"{text} damping")


class MeshedBuilding(Building):
    """A building with a finite-element mesh: materials, sections, floor masses and supports."""

    stories: tuple[FrameStory, ...]
    materials: dict[str, Material]
    sections: dict[str, Section] = Field(default_factory=dict)
    floor_mass: tuple[FloorMass, ...] = ()
    supports: Supports = Supports()
    springs: tuple[SpringGroup, ...] = ()

    @property
    def has_dashpots(self) -> bool:
        return any(any(group.dashpots) for group in (self.supports, *self.springs))

    @property
    def floor_levels(self) -> Floats:
        """Heights of the floors above the base, (stories,) m."""
        levels = [0.0]
        for story, foot in zip(self.stories, self.below, strict=True):
            level = levels[foot + 1] + story.height
            # Floors of neighbours that differ by rounding are at one level.
            levels.append(next((near for near in levels if abs(near - level) < 1e-6), level))
        return np.array(levels[1:])

    @property
    def below(self) -> tuple[int, ...]:
        places = (BASE, *self.story_names)
        return tuple(
            k - 1 if story.on is None else places.index(story.on) - 1
            for k, story in enumerate(self.stories)
        )

    def material(self, name: str | None) -> Material:
        """Return the named material; None means the only one of the building."""
        return self.materials[name] if name is not None else next(iter(self.materials.values()))

    def check(self) -> None:
        """Raise Complaint for the first entry that does not fit the others."""
        super().check()
        if not self.materials:
            text = "the building has no material; add a [materials.NAME] table"
            raise Complaint("materials", text)
        for name, section in self.sections.items():
            self.check_material(section.material, f"sections.{name}")
        if self.springs and self.supports.base not in ("fixed", "pinned"):
            text = f'they stand on a base that is "fixed" or "pinned", not {self.supports.base!r}'
            raise Complaint("springs", f"{text}; change supports.base")
        given: dict[str, int] = {}
        for n, mass in enumerate(self.floor_mass):
            key = f"floor_mass[{n}].floors"
            for floor in resolve(mass.floors, self.floors, "floor", key):
                if floor in given:
                    text = f"floor_mass[{given[floor]}] gives the mass of {floor} already"
                    raise Complaint(key, f"{text}; remove one")
                given[floor] = n

    def check_material(self, name: str | None, key: str) -> None:
        """Raise Complaint where a member names no material, or one that is not there."""
        if name is not None:
            require(name, self.materials, "material", f"{key}.material")
        elif len(self.materials) != 1:
            names = ", ".join(self.materials)
            text = f"the key is missing; name one of the materials {names}"
            raise Complaint(f"{key}.material", text)
