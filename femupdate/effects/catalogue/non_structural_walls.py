"""Stiffness of walls that count as weight alone in the model."""

from femupdate.building.kinds import FrameBuilding
from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, Stiffness, Terms, change
from femupdate.effects.infill import infill_lines
from femupdate.effects.structure import Structure

_ALL = "all"


class NonStructuralWalls(Effect):
    """A share of the elastic stiffness of walls without stiffness, by line and story."""

    name = "non_structural_walls"
    title = "Stiffness of non-structural walls"
    sentence = (
        "Walls that the model counts as weight alone (partitions, infill, cladding) are tight to "
        "the frame and stiffen the stories in which they stand."
    )
    clause = "The non-structural walls {where} have {size} of their elastic stiffness"
    settled_by = "the gaps around these walls, or sensors at both sides of the plan"
    parameters = change("share of the walls' elastic stiffness", 0.2, 0.0, 2.0)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """All such walls, those of a line, of a story, and each by itself, as in "X1/S2"."""
        lines = infill_lines(structure.building)
        names = structure.building.story_names
        stories = sorted({story for levels in lines.values() for story in levels})
        places = [_ALL, *lines, *(f"{_ALL}/{names[story]}" for story in stories)]
        places += [f"{line}/{names[story]}" for line, levels in lines.items() for story in levels]
        one_line, one_story = len(lines) == 1, len(stories) == 1
        if one_line:  # nothing is said twice
            places = [place for place in places if place not in lines and _ALL + "/" not in place]
        if one_story:
            places = [place for place in places if "/" not in place]
        return tuple(places) if lines else ()

    def where(self, place: str) -> str:
        line, _, story = place.partition("/")
        line = "" if line == _ALL else f"on line {line} "
        return f"{line}in {story or 'all stories'}"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The walls that the mesh does not have, from end to end of their line."""
        building = drawn.structure.building
        if not isinstance(building, FrameBuilding):
            return ()
        grid, faces = building.grid, []
        for line, stories in infill_lines(building).items():
            axis, at = (1, grid.y[line]) if line in grid.y else (0, grid.x[line])
            chosen = [k for k in stories if _names(place, line, building.story_names[k])]
            faces += [drawn.upright(axis, float(at), k) for k in chosen]
        return (Glyph.of("surfaces", faces),)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The walls' stiffness on the nodes that the model has, scaled by their story's factor."""
        names = structure.building.story_names
        chosen = [wall for wall in structure.infills if _names(place, wall.line, names[wall.story])]
        return Terms(stiffness=tuple(Stiffness(wall.story, wall.stiffness) for wall in chosen))


def _names(place: str, line: str, story: str) -> bool:
    """Whether a place such as "X1/S2" names the wall of a line and story."""
    side, _, name = place.partition("/")
    return side in (_ALL, line) and name in ("", story)
