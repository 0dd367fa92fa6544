"""What drives a building: motion of its base, or a force at a floor."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Excitation:
    """What drives a building; by default motion of its base."""

    force: str = ""  # floor at which a force acts; empty where the base moves
    # of the base's motion that are known: its translation, then its rotation, then its motion
    # across
    columns: int = 1

    @property
    def name(self) -> str:
        """For people; empty for motion of the base, of which nothing need be said."""
        return f"force at {self.force}" if self.force else ""


BASE_MOTION = Excitation()
