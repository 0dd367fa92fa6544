"""Effects of the floors' sensors and channels, which lie in the measurement."""

from torch import Tensor

from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect


class ChannelEffect(Effect):
    """A fault of one floor's channel, where `sits` does not say otherwise."""

    instrument = True
    sits = "every floor"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The sensors of the place."""
        return drawn.sensors(place)

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """What the FRFs of the place are multiplied by, (N, k) at omega (k,), rad/s."""
        raise NotImplementedError

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """The factor on the rows of the place."""
        own, changed = list(rows), frf.clone()
        changed[:, own] = frf[:, own] * self.factor(omega, sizes)[:, None, :]
        return changed
