"""A viscous damper in one story."""

from torch import Tensor

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, Parameter, Terms, as_complex, story_port
from femupdate.effects.structure import Structure


class StoryDamper(Effect):
    """A dashpot between two floors."""

    name = "story_damper"
    title = "Damper in a story"
    sentence = (
        "One story dissipates more than the rest: a damper, rubbing partitions, damage; modes "
        "are damped unequally and become complex."
    )
    confused_with = ("damping_law",)
    settled_by = "what may rub or slip in the story, or the decay of free vibration in each mode"
    parameters = (
        Parameter("size", "1", 0.02, lower=0.0, upper=0.5, text="damping ratio in the first mode"),
    )

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every story, named after the floor above it."""
        return structure.floors

    def where(self, place: str) -> str:
        """As `Effect.where`."""
        return f"below {place}"

    def said(self, place: str, size: float) -> str:
        """As `Effect.said`."""
        return f"The story below {place} adds {100.0 * size:.3g} % to the first damping ratio"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A dashpot from corner to corner of the story."""
        level = drawn.level(place)
        return (Glyph.of("dashpot", *drawn.diagonal(level - 1, level)),)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The dashpot (N s/m) that damps the first mode critically at theta = 1."""
        story = structure.floors.index(place)
        omega, shape = structure.fundamental
        drift = shape[story] - (shape[story - 1] if story else 0.0)
        return Terms(port=story_port(structure, story), constants=(float(2.0 * omega / drift**2),))

    def port_stiffness(self, omega: Tensor, sizes: Tensor, constants: tuple[float, ...]) -> Tensor:
        """i omega c."""
        rate = constants[0] * sizes[:, :1] * omega
        return as_complex(rate.new_zeros(()), rate)
