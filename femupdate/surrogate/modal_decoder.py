"""The decoder p(x|z): from the latent space to modes, and by superposition to ln|H|."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from femupdate.dynamics.modes import ModalData
from femupdate.surrogate.layers import residual_blocks
from femupdate.surrogate.sizes import NetworkSizes

# Terms of the power series that replaces the modes above the grid, as in `ModalData`.
_SERIES = 3
# |H|^2 below this is rounding; its logarithm would dominate the loss.
LEAST_SQUARE = 1e-8


@dataclass(frozen=True)
class DecodedModes:
    """Modes of the decoder; frequencies in units of the top of the grid.

    Attributes:
        omega: (B, m).
        ratio: (B, m) damping ratios.
        effect: (B, f, m) shape times participation of each mode at each floor.
        series: (B, f, 3) coefficients of w^2, w^4, w^6.
    """

    omega: Tensor
    ratio: Tensor
    effect: Tensor
    series: Tensor


class ModalDecoder(nn.Module):
    """Mean of ln|H| at every floor, and the variance that it leaves unexplained.

    Frequencies, damping ratios and effects of a few modes are smooth functions of the stiffness,
    while ln|H| with its sharp peaks is not. The network gives the former; mode superposition
    (see `femupdate.dynamics.modal.ModalData`) gives the latter.
    """

    frequency: Tensor
    centre: Tensor
    spread: Tensor
    damping_bounds: Tensor

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        self.sizes = sizes
        width = sizes.decoder_width
        outputs = sizes.modes * (2 + sizes.floors) + _SERIES * sizes.floors
        self.join = nn.Linear(sizes.coordinates, width)
        self.blocks = residual_blocks(width, sizes.decoder_blocks)
        self.norm = nn.LayerNorm(width)
        self.modes = nn.Linear(width, outputs)
        nn.init.normal_(self.modes.weight, std=0.01)
        nn.init.zeros_(self.modes.bias)
        self.straight = nn.Linear(sizes.coordinates, outputs, bias=False)
        nn.init.zeros_(self.straight.weight)
        self.log_excess = nn.Parameter(torch.full((sizes.floors, sizes.points), -2.0))
        self.register_buffer("frequency", torch.linspace(0.0, 1.0, sizes.points))
        self.register_buffer("centre", torch.zeros(outputs))
        self.register_buffer("spread", torch.ones(outputs))
        self.register_buffer("damping_bounds", torch.ones(2))

    def forward(self, z: Tensor, points: Tensor | slice = slice(None)) -> Tensor:
        """Mean of ln|H| (B, f, k) at z (B, z); `points` chooses some of the k frequencies."""
        real, imaginary = self.frf_parts(z, points)
        return 0.5 * torch.log(real**2 + imaginary**2 + LEAST_SQUARE)

    def frf_parts(self, z: Tensor, points: Tensor | slice = slice(None)) -> tuple[Tensor, Tensor]:
        """Real and imaginary part of H (B, f, k)."""
        modes = self.decode_modes(z)
        data = ModalData(modes.omega, modes.effect, modes.series)
        return data.response(self.frequency[points], modes.ratio)

    def excess_variance(self, points: Tensor | slice = slice(None)) -> Tensor:
        """Variance of ln|H| (f, k) that the decoder leaves unexplained, without the noise."""
        return self.log_excess[:, points].exp()

    def decode_modes(self, z: Tensor) -> DecodedModes:
        """Modes at z (B, z)."""
        count, floors = self.sizes.modes, self.sizes.floors
        raw = self.straight(z) + self.modes(self.norm(self.blocks(self.join(z))))
        parts = (self.centre + self.spread * raw).split(
            [count, count, floors * count, floors * _SERIES], dim=1
        )
        return DecodedModes(
            parts[0].exp(),
            parts[1].exp() * self.damping(z)[:, None],
            parts[2].view(-1, floors, count),
            parts[3].view(-1, floors, _SERIES),
        )

    def damping(self, z: Tensor) -> Tensor:
        """Damping ratio (B,) from the last coordinate; uniform between its bounds under p(z)."""
        low, high = self.damping_bounds
        if not self.sizes.free_damping:
            return low.expand(len(z))
        return low + (high - low) * torch.special.ndtr(z[:, -1])

    def damping_coordinate(self, zeta: Tensor) -> Tensor:
        """The inverse of `damping`: (B, 1), or (B, 0) where the damping ratio is known."""
        if not self.sizes.free_damping:
            return zeta.new_zeros(len(zeta), 0)
        low, high = self.damping_bounds
        share = ((zeta - low) / (high - low)).clamp(1e-4, 1.0 - 1e-4)
        return torch.special.ndtri(share)[:, None]

    def standardise(
        self, omega: Tensor, ratio: Tensor, effect: Tensor, series: Tensor, top: float
    ) -> None:
        """Start from the mean modes of a sample of the training set, and vary by their spread.

        Args:
            omega: (n, M) circular frequencies, rad/s, of which the decoder has the first m.
            ratio: (n, M) damping ratios over the ratio of `damping`.
            effect: (n, f, M).
            series: (n, f, 3).
            top: top of the frequency grid, rad/s.
        """
        count = self.sizes.modes
        scale = torch.tensor([top**2, top**4, top**6]).to(series)
        rows = torch.cat(
            [
                (omega[:, :count] / top).log(),
                ratio[:, :count].log(),
                effect[:, :, :count].flatten(1),
                (series * scale).flatten(1),
            ],
            dim=1,
        )
        self.centre.copy_(rows.mean(0))
        # Where nothing varies in the sample, a small range is left.
        self.spread.copy_(rows.std(0).clamp_min(1e-3))
