"""What a prediction gives an engineer: peaks, drift ratios, base shear and stiffness."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.schema import Building
from femupdate.dynamics.summary import HistorySummary, Statistics, statistics
from femupdate.tables import table
from femupdate.units import STANDARD_GRAVITY

TIDY = ("quantity", "unit", "place", "mean", "sd", "q05", "q95")


@dataclass(frozen=True, eq=False)
class Quantity:
    """One quantity at several places of a building.

    Attributes:
        name: such as "peak drift ratio".
        unit: of the values.
        places: names of floors or stories.
        values: (S, n) one row a draw.
    """

    name: str
    unit: str
    places: tuple[str, ...]
    values: Floats

    @cached_property
    def statistics(self) -> Statistics:
        """(n,) over the draws."""
        return statistics(self.values)

    def tidy(self) -> tuple[tuple[object, ...], ...]:
        """Rows of a tidy table, see `TIDY`."""
        own = self.statistics
        columns = (own.mean, own.sd, own.q05, own.q95)
        rows = zip(self.places, *(column.tolist() for column in columns), strict=True)
        return tuple((self.name, self.unit, *row) for row in rows)

    def table(self) -> str:
        """Mean and quantiles in words, three significant figures or so."""
        own = self.statistics
        rows = [
            (place, *(figures(value) for value in values))
            for place, *values in zip(self.places, own.mean, own.q05, own.q95, strict=True)
        ]
        return table((f"{self.name}, {self.unit}", "mean", "5 %", "95 %"), rows)


def figures(value: float) -> str:
    """Four significant figures, without an exponent where there is no need."""
    return f"{value:.4g}" if abs(value) < 1e5 else f"{value:.0f}"


def heights_of(building: Building) -> Floats | None:
    """(s,) heights of the stories, m; None where the file does not give them all."""
    heights = [getattr(story, "height", None) for story in building.stories]
    return None if None in heights else np.array(heights, dtype=float)


@dataclass(frozen=True, eq=False)
class PeakDraws:
    """Peaks of S draws, as a prediction keeps them.

    Attributes:
        acceleration: (S, f) m/s2.
        shear: (S, s) N.
        drift: (S, s) m.
        stiffness: (S, s) N/m.
    """

    acceleration: Floats
    shear: Floats
    drift: Floats
    stiffness: Floats

    @classmethod
    def of(cls, summary: HistorySummary) -> "PeakDraws":
        """Those of a summary."""
        return cls(
            summary.peak_acceleration,
            summary.peak_shear,
            summary.peak_drift,
            summary.story_stiffness,
        )


def quantities(
    building: Building, floors: Sequence[str], peaks: PeakDraws, mass: float
) -> Mapping[str, Quantity]:
    """Return everything worth a table, by key.

    Args:
        building: for names and heights of its stories.
        floors: names of the floors.
        peaks: of the draws.
        mass: above the middle of the first story, kg, for the base shear over the weight.
    """
    stories = tuple(building.story_names)
    base = peaks.shear[:, :1]
    found = {
        "acceleration": Quantity(
            "peak floor acceleration", "m/s²", tuple(floors), peaks.acceleration
        ),
        "drift": Quantity("peak story drift", "mm", stories, 1e3 * peaks.drift),
    }
    heights = heights_of(building)
    if heights is not None:
        ratio = 100.0 * peaks.drift / heights
        found["ratio"] = Quantity("peak story drift ratio", "%", stories, ratio)
    found["shear"] = Quantity("peak story shear", "kN", stories, 1e-3 * peaks.shear)
    found["base"] = Quantity("peak base shear", "kN", ("base",), 1e-3 * base)
    weight = mass * STANDARD_GRAVITY
    found["coefficient"] = Quantity(
        "peak base shear over weight", "%", ("base",), 100.0 * base / weight
    )
    found["stiffness"] = Quantity(
        "story stiffness in this motion", "kN/mm", stories, 1e-6 * peaks.stiffness
    )
    return found
