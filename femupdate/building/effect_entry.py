"""An effect of the catalogue as a building file lists it."""

from collections.abc import Mapping

from pydantic import Field

from femupdate.building.entry import Entry
from femupdate.building.quantities import Label, Number


class EffectEntry(Entry):
    """One `[[effects]]` table: which effect, where, and how large it was found to be.

    The figures are in the units of the effect's parameters (SI); calibrations start from them and
    sample them with the prior of the effect.
    """

    name: Label
    place: Label
    parameters: Mapping[str, Number] = Field(default_factory=dict)
