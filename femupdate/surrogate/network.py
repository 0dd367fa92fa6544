"""The multimodal variational autoencoder: parameters and FRFs in one latent space, and back."""

import math
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor, nn

from femupdate.dynamics.modes import ModalData


@dataclass(frozen=True)
class NetworkSizes:
    """Sizes of the MVAE.

    Attributes:
        free_damping: whether the damping ratio is unknown; it is then one more coordinate of z.
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


# Bands of the training start in the lowest tenth of the grid and end above its lower 3/10.
LATEST_START, EARLIEST_END = 0.1, 0.3


@dataclass(frozen=True)
class Visibility:
    """The observed part of each FRF: some floors, over one band.

    Attributes:
        floors: (B, f) one where the floor is observed, else zero.
        band: (B, 2) first and last observed frequency, as shares of the grid from 0 to 1.
    """

    floors: Tensor
    band: Tensor

    def __len__(self) -> int:
        return len(self.floors)

    def __getitem__(self, rows: Tensor | slice) -> "Visibility":
        return Visibility(self.floors[rows], self.band[rows])

    def to(self, device: torch.device) -> "Visibility":
        """The same on a device."""
        return Visibility(self.floors.to(device), self.band.to(device))

    def features(self) -> Tensor:
        """Features (B, f + 2) for the observation encoder."""
        return torch.cat([self.floors, 2.0 * self.band - 1.0], dim=1)

    def weights(self, points: int) -> Tensor:
        """Weights (B, f, k): one where a point is observed, else zero."""
        share = torch.linspace(0.0, 1.0, points, device=self.band.device)
        inside = (share >= self.band[:, :1] - 1e-6) & (share <= self.band[:, 1:] + 1e-6)
        return self.floors[:, :, None] * inside[:, None, :]


class Box(Protocol):
    """Bounds of parameters, such as those of their prior."""

    @property
    def lower(self) -> Tensor:
        """(p,) float64."""

    @property
    def upper(self) -> Tensor:
        """(p,) float64."""


def to_place(theta: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Positions (..., p) from -1 to 1 of theta (..., p) in a box (p,)."""
    return 2.0 * (theta.sqrt() - lower.sqrt()) / (upper.sqrt() - lower.sqrt()) - 1.0


def parameter_features(theta: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Features (B, 3 p) of theta: position by root, value and logarithm, from -1 to 1."""
    linear = 2.0 * (theta - lower) / (upper - lower) - 1.0
    logarithmic = 2.0 * torch.log(theta / lower) / torch.log(upper / lower) - 1.0
    return torch.cat([to_place(theta, lower, upper), linear, logarithmic], dim=-1)


class ResidualBlock(nn.Module):
    """x + W2 silu(W1 norm(x)), with W2 starting at zero."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.inner = nn.Linear(width, width)
        self.outer = nn.Linear(width, width)
        nn.init.zeros_(self.outer.weight)
        nn.init.zeros_(self.outer.bias)

    def forward(self, x: Tensor) -> Tensor:
        """(B, width) to (B, width)."""
        return x + self.outer(nn.functional.silu(self.inner(self.norm(x))))


def residual_blocks(width: int, count: int) -> nn.Sequential:
    """`count` blocks one after another."""
    return nn.Sequential(*(ResidualBlock(width) for _ in range(count)))


class FloorLinear(nn.Module):
    """One linear map for each floor, all floors in one batched product."""

    def __init__(self, floors: int, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(floors, inputs, outputs) * inputs**-0.5)
        self.bias = nn.Parameter(torch.zeros(floors, 1, outputs))

    def forward(self, x: Tensor) -> Tensor:
        """(B, f, inputs) to (B, f, outputs)."""
        return torch.baddbmm(self.bias, x.transpose(0, 1), self.weight).transpose(0, 1)


# Terms of the power series that replaces the modes above the grid, as in `ModalData`.
_SERIES = 3


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
        count, floors = self.sizes.modes, self.sizes.floors
        raw = self.straight(z) + self.modes(self.norm(self.blocks(self.join(z))))
        widths = [count, count, floors * count, floors * _SERIES]
        # Of the modes: frequencies over the top of the grid, damping ratios over that of all, shape
        # times participation at each floor, and coefficients of w^2, w^4, w^6.
        omega, ratio, effect, series = (self.centre + self.spread * raw).split(widths, dim=1)
        modes = ModalData(
            omega.exp(), effect.view(-1, floors, count), series.view(-1, floors, _SERIES)
        )
        damping = ratio.exp() * self.damping(z)[:, None]
        real, imaginary = modes.response(self.frequency[points], damping)
        # |H|^2 below this is rounding; its logarithm would dominate the loss.
        return 0.5 * torch.log(real**2 + imaginary**2 + 1e-8)

    def excess_variance(self, points: Tensor | slice = slice(None)) -> Tensor:
        """Variance of ln|H| (f, k) that the decoder leaves unexplained, without the noise."""
        return self.log_excess[:, points].exp()

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


# z over the position from -1 to 1: a uniform position has a variance of 1/3, z of about one.
_ROOT_SPREAD = 3.0**0.5
# How far beyond the box theta may lie, as a share of its half width.
_BEYOND = 0.3


@dataclass(frozen=True)
class LatentMixture:
    """A mixture of c diagonal Gaussians over z.

    Attributes:
        log_weight: (B, c), normalised.
        mean: (B, c, z).
        log_variance: (B, c, z).
    """

    log_weight: Tensor
    mean: Tensor
    log_variance: Tensor

    def log_density(self, z: Tensor) -> Tensor:
        """Log density (B,) at z (B, z)."""
        squares = (z[:, None] - self.mean) ** 2 * torch.exp(-self.log_variance)
        nats = -0.5 * (squares + self.log_variance + math.log(2.0 * math.pi)).sum(-1)
        return torch.logsumexp(self.log_weight + nats, dim=1)


class Bend(nn.Module):
    """Coordinates of the parameters in which the modes are easier to learn.

    They start as the square root of theta, as frequencies do; training changes them from there.
    """

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        width, count = sizes.parameter_width, sizes.parameters
        self.straight = nn.Linear(count, count)
        self.join = nn.Linear(2 * count, width)
        self.blocks = residual_blocks(width, sizes.parameter_blocks)
        self.norm = nn.LayerNorm(width)
        self.mean = nn.Linear(width, count)
        with torch.no_grad():
            self.straight.weight.copy_(_ROOT_SPREAD * torch.eye(count))
        for weights in (self.straight.bias, self.mean.weight, self.mean.bias):
            nn.init.zeros_(weights)

    def forward(self, features: Tensor) -> Tensor:
        """features (B, 3 p), see `parameter_features`, to (B, p)."""
        root, bent = features.tensor_split([self.straight.in_features], dim=-1)
        mean: Tensor = self.mean(self.norm(self.blocks(self.join(bent))))
        return self.straight(root) + mean


class ObservationEncoder(nn.Module):
    """q(z|x): the z that may belong to an observation, as a mixture.

    A mixture, since several theta can explain what is observed. The decoder refines it.
    """

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        self.sizes = sizes
        width, joined = sizes.width, sizes.floors * sizes.floor_features
        self.floors = FloorLinear(sizes.floors, sizes.points, sizes.floor_features)
        self.join = nn.Linear(joined + sizes.floors + 2, width)
        self.blocks = residual_blocks(width, sizes.blocks)
        self.norm = nn.LayerNorm(width)
        self.head = nn.Linear(width, sizes.components * (1 + 2 * sizes.coordinates))

    def forward(self, x: Tensor, visibility: Visibility) -> LatentMixture:
        """x (B, f, k), standardised, zero where nothing is observed."""
        features = nn.functional.silu(self.floors(x)) * visibility.floors[:, :, None]
        joined = torch.cat([features.flatten(1), visibility.features()], dim=1)
        hidden = self.norm(self.blocks(self.join(joined)))
        widths = [1, self.sizes.coordinates, self.sizes.coordinates]
        parts = self.head(hidden).float().view(len(x), self.sizes.components, sum(widths))
        log_weight, mean, log_variance = parts.split(widths, dim=-1)
        # Least variance: finite in float32, and far below that of any posterior.
        return LatentMixture(
            log_weight[..., 0].log_softmax(dim=1),
            mean,
            (log_variance - 3.0).clamp(-18.0, 4.0),
        )


class Mvae(nn.Module):
    """Multimodal variational autoencoder of FRFs x and stiffness factors theta.

    Buffers hold the prior box and the mean and scale (f, k) that standardise ln|H| for the
    observation encoder, so that a weights file is complete.
    """

    lower: Tensor
    upper: Tensor
    x_mean: Tensor
    x_scale: Tensor

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        self.sizes = sizes
        self.observation_encoder = ObservationEncoder(sizes)
        self.bend = Bend(sizes)
        self.decoder = ModalDecoder(sizes)
        self.register_buffer("lower", torch.zeros(sizes.parameters))
        self.register_buffer("upper", torch.ones(sizes.parameters))
        self.register_buffer("x_mean", torch.zeros(sizes.floors, sizes.points))
        self.register_buffer("x_scale", torch.ones(sizes.floors, sizes.points))

    def encode_observation(self, log_frf: Tensor, visibility: Visibility) -> LatentMixture:
        """q(z|x) for ln|H| (B, f, k); only the visible part counts, but all must be finite."""
        standard = (log_frf - self.x_mean) / self.x_scale
        return self.observation_encoder(
            standard * visibility.weights(self.sizes.points), visibility
        )

    def encode_parameters(self, theta: Tensor) -> Tensor:
        """Coordinates z (..., p) of theta (..., p): its position in the prior's box (`to_place`).

        q(z|theta) is concentrated there. The coordinate of an unknown damping ratio, about which
        theta says nothing, keeps its prior.
        """
        return _ROOT_SPREAD * to_place(theta, self.lower, self.upper)

    def parameters_at(self, z: Tensor) -> Tensor:
        """theta (B, p) at z (B, z), at most slightly outside the prior's box."""
        reach = 1.0 + _BEYOND
        place = (z[:, : self.sizes.parameters] / _ROOT_SPREAD).clamp(-reach, reach)
        lower, upper = self.lower.sqrt(), self.upper.sqrt()
        return (lower + 0.5 * (place + 1.0) * (upper - lower)).square()  # the inverse of `to_place`

    def reach(self) -> Tensor:
        """Largest coordinates (z,), of either sign, for which there is a theta."""
        reach = torch.full((self.sizes.coordinates,), math.inf).to(self.lower)
        reach[: self.sizes.parameters] = _ROOT_SPREAD * (1.0 + _BEYOND)
        return reach

    def decode(self, z: Tensor, points: Tensor | slice = slice(None)) -> Tensor:
        """Mean of ln|H| (B, f, k) at z (B, z); `points` chooses some of the k frequencies."""
        theta = self.parameters_at(z)
        features = parameter_features(theta, self.lower, self.upper)
        inner = torch.cat([self.bend(features), z[:, self.sizes.parameters :]], dim=1)
        values: Tensor = self.decoder(inner, points)
        return values
