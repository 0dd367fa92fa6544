"""Which members share a stiffness factor: one factor a story, or one a story and kind of member."""

from dataclasses import dataclass, replace

import numpy as np

from femupdate.arrays import Integers, Strings
from femupdate.building.document import Building
from femupdate.building.kinds import FrameBuilding, MeshBuilding
from femupdate.building.model_files import building_model
from femupdate.building.references import resolve
from femupdate.fe.model import FiniteElementModel

# Kind of an element in the model, and what its factor is called.
_CALLED = {
    "wall": "walls",
    "non_structural_wall": "walls",
    "column": "columns",
    "beam": "beams",
    "brace": "braces",
    "infill": "infills",
    "slab": "slabs",
}
_ORDER = ("walls", "columns", "beams", "braces", "infills", "slabs")


@dataclass(frozen=True)
class StiffnessFactor:
    """One parameter."""

    name: str  # "theta_3", or "S3 walls"
    story: int  # index of the story
    # "walls", "columns", "beams", "braces", "infills" or "slabs"; None for all of the story
    kind: str | None = None


def stiffness_factors(building: Building) -> tuple[StiffnessFactor, ...]:
    """Return the parameters of a building, story by story from the bottom."""
    if not building.by_kind:
        count = len(building.story_names)
        return tuple(StiffnessFactor(f"theta_{i + 1}", i) for i in range(count))
    stories = building.story_names
    if isinstance(building, FrameBuilding):
        owned = _owned_by_members(building)
    elif "owned" not in building.__dict__:  # read once
        assert isinstance(building, MeshBuilding)
        blocks = building_model(building).model.elements
        owned = {
            (int(group), _CALLED[str(kind)])
            for block in blocks
            for group, kind in zip(block.group, block.kind, strict=True)
            if group >= 0
        }
        building.__dict__["owned"] = owned
    else:
        owned = building.__dict__["owned"]
    return tuple(
        StiffnessFactor(f"{name} {kind}", story, kind)
        for story, name in enumerate(stories)
        for kind in _ORDER
        if (story, kind) in owned
    )


def _owned_by_members(building: FrameBuilding) -> set[tuple[int, str]]:
    """Stories and kinds of which a frame has members."""
    stories, floors = building.story_names, building.floors
    lists = (  # of all members with stiffness; story i owns floor i + 1
        *(("walls", wall.stories, stories) for wall in building.walls if wall.is_stiff),
        *(("columns", columns.stories, stories) for columns in building.columns),
        *(("beams", beams.floors, floors) for beams in building.beams),
        *(("braces", braces.stories, stories) for braces in building.braces),
        *(("infills", infill.stories, stories) for infill in building.infills),
        *(("slabs", slab.floors, floors) for slab in building.slabs),
    )
    return {
        (known.index(name), kind)
        for kind, names, known in lists
        for name in resolve(names, known, kind, kind)
    }


def factor_titles(building: Building) -> dict[str, str]:
    """Return what every stiffness factor is of, by its name: "story S3" or "walls of story S3"."""
    names = building.story_names
    factors = stiffness_factors(building)
    parts = {factor.name: f"{factor.kind} of " if factor.kind else "" for factor in factors}
    return {factor.name: f"{parts[factor.name]}story {names[factor.story]}" for factor in factors}


def factor_ranges(building: Building) -> dict[str, tuple[float, float]]:
    """Return lowest and highest value of every stiffness factor, by its name."""
    ranges = {
        factor.name: building.prior.theta_of(building.story_names[factor.story])
        for factor in stiffness_factors(building)
    }
    return {name: (prior.lower, prior.upper) for name, prior in ranges.items()}


def with_factors(
    model: FiniteElementModel, factors: tuple[StiffnessFactor, ...]
) -> FiniteElementModel:
    """Return a model by stories with the elements' groups numbered as the factors.

    Args:
        model: whose groups are stories.
        factors: of all kinds that the model has.
    """
    number = {(factor.story, factor.kind): k for k, factor in enumerate(factors)}

    def of(group: Integers, kind: Strings) -> Integers:
        pairs = zip(group.tolist(), kind.tolist(), strict=True)
        numbers = [number[story, _CALLED[name]] if story >= 0 else story for story, name in pairs]
        return np.array(numbers, dtype=np.int64)

    renumbered = model.mapped(lambda part: replace(part, group=of(part.group, part.kind)))
    return replace(renumbered, groups=len(factors))
