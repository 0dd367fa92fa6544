"""A shaking table that pitches as it translates."""

from femupdate.effects.effect import Effect, Parameter, Terms
from femupdate.effects.structure import Structure


class TablePitch(Effect):
    """A rotation of the base in proportion to its translation."""

    name = "table_pitch"
    title = "Table pitch"
    sentence = (
        "The table (or the ground) rotates along with its translation, which adds a motion in "
        "proportion to height; natural frequencies stay, anti-resonances move."
    )
    confused_with = ("foundation_rocking",)
    settled_by = "two vertical sensors at opposite ends of the table"
    parameters = (
        Parameter("size", "rad/m", 0.02, lower=-0.2, upper=0.2, text="rotation per translation"),
    )

    def places(self, structure: Structure) -> tuple[str, ...]:
        """The base."""
        return ("base",)

    def terms(self, structure: Structure, place: str) -> Terms:
        """One radian a metre."""
        return Terms(pitch=1.0)
