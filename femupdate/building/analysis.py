"""What a building file says beside the building: frequencies, priors, damping, effects."""

from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from femupdate.arrays import Floats
from femupdate.building.entry import Complaint, Entry
from femupdate.building.quantities import (
    Frequency,
    FrequencyOrZero,
    Label,
    Number,
    PositiveNumber,
    Whole,
)

_MOST_FREQUENCIES = 1_000_000


class FrequencyGrid(Entry):
    """The frequencies at which responses are computed: start, start + step, ... (Hz)."""

    start: FrequencyOrZero
    step: Frequency
    count: Whole

    @model_validator(mode="after")
    def _countable(self) -> "FrequencyGrid":
        if not 2 <= self.count <= _MOST_FREQUENCIES:
            text = f"{self.count} must lie between 2 and {_MOST_FREQUENCIES}; write another count"
            raise Complaint("count", text)
        return self

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

    @model_validator(mode="after")
    def _upright(self) -> "Range":
        if self.lower >= self.upper:
            raise Complaint(
                "lower", f"{self.lower:g} must lie below upper = {self.upper:g}; exchange the two"
            )
        return self


class Prior(Entry):
    """Uniform priors: theta of all stories, of single ones, and zeta where it is a nuisance."""

    theta: Range
    stories: Mapping[str, Range] = Field(default_factory=dict)
    zeta: Range | None = None

    @model_validator(mode="after")
    def _below_critical(self) -> "Prior":
        if self.zeta is not None and self.zeta.upper >= 1.0:
            raise Complaint(
                "zeta.upper", f"{self.zeta.upper:g} must lie below 1 (critical); correct it"
            )
        return self

    def theta_of(self, story: str) -> Range:
        """Return the limits of one story's stiffness factor."""
        return self.stories.get(story, self.theta)


class Damping(Entry):
    """The damping ratio of every mode.

    With the law "constant" all modes have `ratio`, which predictions use. With "rayleigh" the ratio
    is reached at two frequencies, the anchors, and fixed whatever theta is: that of a mode of
    circular frequency w is a0 / (2 w) + a1 w / 2 (Clough and Penzien, 1993, section 12-5).
    """

    law: Literal["constant", "rayleigh"]
    ratio: PositiveNumber
    anchors: tuple[Frequency, Frequency] | None = None

    @model_validator(mode="after")
    def _complete(self) -> "Damping":
        if self.ratio >= 1.0:
            text = f"{self.ratio:g} must lie below 1 (critical); 2 % is written 0.02"
            raise Complaint("ratio", text)
        if self.is_rayleigh and self.anchors is None:
            raise Complaint("anchors", "the key is missing; add the two frequencies")
        if not self.is_rayleigh and self.anchors is not None:
            raise Complaint("anchors", 'they need law = "rayleigh"; remove them or change the law')
        if self.anchors is not None and self.anchors[0] == self.anchors[1]:
            raise Complaint("anchors", "the two frequencies must differ; change one of them")
        return self

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


class ParameterGrouping(Entry):
    """Which members share a stiffness factor: `["story"]`, or `["story", "kind"]`.

    The kinds are walls, columns, beams and slabs; a story has a factor for each that it owns.
    """

    by: tuple[Literal["story", "kind"], ...]

    @model_validator(mode="after")
    def _known_division(self) -> "ParameterGrouping":
        if self.by not in (("story",), ("story", "kind")):
            text = f'{list(self.by)} is no division; write ["story"] or ["story", "kind"]'
            raise Complaint("by", text)
        return self


class EffectEntry(Entry):
    """One `[[effects]]` table: which effect, where, and how large it was found to be.

    The figures are in the units of the effect's parameters (SI); calibrations start from them and
    sample them with the prior of the effect.
    """

    name: Label
    place: Label
    parameters: Mapping[str, Number] = Field(default_factory=dict)
