"""Joints between columns and floors that rotate."""

from femupdate.effects.bars import turning_beams, turning_feet, turning_floors
from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, Terms, change
from femupdate.effects.structure import Structure

_ALL = "all"


class JointFlexibility(Effect):
    """Rotational springs between columns and floors, alike in the whole building.

    A stick of stories that shear alone has floors that do not rotate. With finite springs the
    stories act on the next ones through the floors between them, and f2 / f1 rises.
    """

    joints = "Joints"
    name = "joint_flexibility"
    title = "Flexible joints"
    sentence = (
        "The joints between columns and floors rotate (soft beams or plates, slip, cracked "
        "connections): stories are softer than clamped ones and bend their neighbours."
    )
    settled_by = "gyroscopes or pairs of vertical sensors beside a joint"
    parameters = change(
        "E I / L of the column (in frames: of the beam) over the joint's stiffness", 0.05, 0.0, 2.0
    )

    def places(self, structure: Structure) -> tuple[str, ...]:
        """All joints together; a frame needs beams that meet columns."""
        return (_ALL,) if self.terms(structure, _ALL).changes_shapes else ()

    def said(self, place: str, size: float) -> str:
        times = 1.0 / max(size, 1e-12)
        return f"{self.joints} are {times:.3g} times as stiff as E I / L of the member"

    def scatter(self, size: float, sd: float) -> str:
        """As `Effect.scatter`: of the stiffness, which is one over the size."""
        return f"± {sd / max(size, 1e-12) ** 2:.2g}"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A ball at the ends of every floor's near edge."""
        levels = range(1, len(drawn.levels))
        corners = [corner for level in levels for corner in drawn.edges(level)]
        return tuple(Glyph.of("ball", corner, drawn.radius) for corner in corners)

    def terms(self, structure: Structure, place: str) -> Terms:
        """At unit size the joint is as stiff as E I / L of what it holds."""
        if structure.is_stick:
            return Terms(hinges=turning_floors(structure))
        mesh, operators = structure.meshed
        turning = structure.once(("joints",), lambda: turning_beams(mesh.model, operators))
        return Terms(stiffness=turning)


class FootFlexibility(JointFlexibility):
    """Rotational springs under the columns of a frame, alike at all feet that are held."""

    joints = "Column feet"
    name = "foot_flexibility"
    title = "Flexible column feet"
    sentence = (
        "The feet of the columns rotate (thin base plates, shallow pockets, soft ground under each "
        "footing), so the lowest story is softer, and its columns bend more at their heads."
    )
    settled_by = "gyroscopes or pairs of vertical sensors at a column's foot"
    parameters = change("E I / L of the column over the foot's stiffness", 0.1, 0.0, 2.0)

    def places(self, structure: Structure) -> tuple[str, ...]:
        """All feet together, where columns of a frame are held against turning."""
        there = not structure.is_stick and self.terms(structure, "base").changes_shapes
        return ("base",) if there else ()

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A ball at the ends of the base's near edge."""
        return tuple(Glyph.of("ball", corner, drawn.radius) for corner in drawn.edges(0))

    def terms(self, structure: Structure, place: str) -> Terms:
        """At unit size a foot is as stiff as E I / L of its column."""
        mesh, operators = structure.meshed
        return Terms(
            stiffness=structure.once(("feet",), lambda: turning_feet(mesh.model, operators))
        )
