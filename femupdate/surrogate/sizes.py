"""Sizes of the networks."""

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class NetworkSizes:
    """Sizes of the MVAE.

    Attributes:
        floors: observed floors f.
        points: frequencies k.
        parameters: stiffness factors p.
        free_damping: whether the damping ratio is unknown; it is then one more coordinate of z.
        modes: of the decoder.
        floor_features: features that the observation encoder first reduces each floor's FRF to.
        width: of the observation encoder's residual blocks.
        parameter_width: the same for the bend of the parameters' coordinates.
        decoder_width: the same for the decoder.
        blocks: residual blocks in the observation encoder.
        parameter_blocks: the same for the bend.
        decoder_blocks: the same for the decoder.
        components: of the observation encoder's mixture.
    """

    floors: int
    points: int
    parameters: int
    free_damping: bool
    modes: int
    floor_features: int = 96
    width: int = 256
    parameter_width: int = 64
    decoder_width: int = 256
    blocks: int = 3
    parameter_blocks: int = 2
    decoder_blocks: int = 3
    components: int = 8

    @property
    def coordinates(self) -> int:
        """Dimensions of z."""
        return self.parameters + self.free_damping

    @property
    def least_weights(self) -> int:
        """Weights of the largest parts: no file with fewer can be of these sizes."""
        blocks = 2 * (
            self.blocks * self.width**2
            + self.parameter_blocks * self.parameter_width**2
            + self.decoder_blocks * self.decoder_width**2
        )
        floors = self.floors * self.floor_features * (self.points + self.width)
        modes = self.decoder_width * self.modes * (2 + self.floors)
        mixture = 2 * self.width * self.components * self.parameters
        return blocks + floors + modes + mixture + 2 * self.parameters**2

    def as_dict(self) -> dict[str, int]:
        """Plain numbers, for the header of a weights file."""
        return asdict(self)
