"""The networks of the multimodal variational autoencoder: two encoders and one decoder."""

from dataclasses import asdict, dataclass

import torch
from torch import Tensor, nn


@dataclass(frozen=True)
class NetworkSizes:
    """Sizes of the MVAE.

    Attributes:
        floors: observed floors f.
        points: frequencies k.
        parameters: stiffness parameters p.
        latent: dimensions of z.
        floor_features: features that each floor's FRF is first reduced to.
        width: width of the residual blocks of the observation encoder and the decoder.
        parameter_width: the same for the parameter encoder.
        blocks: residual blocks in each encoder; the decoder has one less.
    """

    floors: int
    points: int
    parameters: int
    latent: int = 8
    floor_features: int = 128
    width: int = 256
    parameter_width: int = 256
    blocks: int = 3

    def as_dict(self) -> dict[str, int]:
        """Plain numbers, for the header of a weights file."""
        return asdict(self)


# Bands that are trained for start in the lowest tenth of the grid and end above its lower 3/10.
LATEST_START, EARLIEST_END = 0.1, 0.3


@dataclass(frozen=True)
class Visibility:
    """What of each FRF is observed: some floors, over one band.

    What z can say depends on it, so both encoders are told.

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

    def repeat(self, count: int) -> "Visibility":
        """Every row `count` times, kept together."""
        return Visibility(
            self.floors.repeat_interleave(count, 0), self.band.repeat_interleave(count, 0)
        )

    def expand(self, count: int) -> "Visibility":
        """A single row as `count` rows."""
        return Visibility(self.floors.expand(count, -1), self.band.expand(count, -1))

    def features(self) -> Tensor:
        """(B, f + 2) for the encoders."""
        return torch.cat([self.floors, 2.0 * self.band - 1.0], dim=1)

    def weights(self, points: int, chosen: Tensor | slice = slice(None)) -> Tensor:
        """(B, f, k) one where a point is observed; `chosen` picks some of the frequencies."""
        share = torch.linspace(0.0, 1.0, points, device=self.band.device)[chosen]
        inside = (share >= self.band[:, :1] - 1e-6) & (share <= self.band[:, 1:] + 1e-6)
        return self.floors[:, :, None] * inside[:, None, :]


@dataclass(frozen=True)
class LatentGaussian:
    """A diagonal Gaussian over z.

    Attributes:
        mean: (B, z).
        variance: (B, z), between 0 and 1, the prior's: data never make z less certain.
    """

    mean: Tensor
    variance: Tensor

    def sample(self, noise: Tensor) -> Tensor:
        """Reparameterised draw from standard normal noise (B, z)."""
        return self.mean + self.variance.sqrt() * noise


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


class GaussianHead(nn.Module):
    """Mean and variance of z from features; the variance is a sigmoid, hence below the prior's."""

    def __init__(self, width: int, latent: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.mean = nn.Linear(width, latent)
        self.log_odds = nn.Linear(width, latent)
        nn.init.zeros_(self.log_odds.weight)
        nn.init.constant_(self.log_odds.bias, -3.0)

    def forward(self, features: Tensor) -> LatentGaussian:
        """(B, width) to a Gaussian over (B, z)."""
        hidden = self.norm(features)
        # Above -18 the variance is at least 1.5e-8: finite in float32, far below any posterior.
        log_odds = self.log_odds(hidden).clamp_min(-18.0)
        return LatentGaussian(self.mean(hidden), torch.sigmoid(log_odds))


class FloorLinear(nn.Module):
    """One linear map a floor, all floors in one batched product."""

    def __init__(self, floors: int, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(floors, inputs, outputs) * inputs**-0.5)
        self.bias = nn.Parameter(torch.zeros(floors, 1, outputs))

    def forward(self, x: Tensor, outputs: Tensor | slice = slice(None)) -> Tensor:
        """(B, f, inputs) to (B, f, outputs), or to some of the outputs."""
        weight, bias = self.weight[:, :, outputs], self.bias[:, :, outputs]
        return torch.baddbmm(bias, x.transpose(0, 1), weight).transpose(0, 1)


class ObservationEncoder(nn.Module):
    """q(z|x): standardised ln|H| of the floors that are observed."""

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        joined = sizes.floors * sizes.floor_features
        self.floors = FloorLinear(sizes.floors, sizes.points, sizes.floor_features)
        self.join = nn.Linear(joined + sizes.floors + 2, sizes.width)
        self.blocks = nn.Sequential(*(ResidualBlock(sizes.width) for _ in range(sizes.blocks)))
        self.head = GaussianHead(sizes.width, sizes.latent)

    def forward(self, x: Tensor, visibility: Visibility) -> LatentGaussian:
        """x (B, f, k), zero where nothing is observed."""
        features = nn.functional.silu(self.floors(x)) * visibility.floors[:, :, None]
        joined = torch.cat([features.flatten(1), visibility.features()], dim=1)
        return self.head(self.blocks(self.join(joined)))


class ParameterEncoder(nn.Module):
    """q(z|theta), for what is observed."""

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        self.join = nn.Linear(2 * sizes.parameters + sizes.floors + 2, sizes.parameter_width)
        self.blocks = nn.Sequential(
            *(ResidualBlock(sizes.parameter_width) for _ in range(sizes.blocks))
        )
        self.head = GaussianHead(sizes.parameter_width, sizes.latent)

    def forward(self, features: Tensor, visibility: Visibility) -> LatentGaussian:
        """features (B, 2 p), see `parameter_features`."""
        joined = torch.cat([features, visibility.features()], dim=1)
        return self.head(self.blocks(self.join(joined)))


class Decoder(nn.Module):
    """p(x|z): mean of the standardised ln|H| at every floor, and the variance it leaves."""

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        self.sizes = sizes
        self.join = nn.Linear(sizes.latent, sizes.width)
        self.blocks = nn.Sequential(*(ResidualBlock(sizes.width) for _ in range(sizes.blocks - 1)))
        self.norm = nn.LayerNorm(sizes.width)
        self.split = nn.Linear(sizes.width, sizes.floors * sizes.floor_features)
        self.floors = FloorLinear(sizes.floors, sizes.floor_features, sizes.points)
        self.log_excess = nn.Parameter(torch.full((sizes.floors, sizes.points), -2.3))

    def forward(self, z: Tensor, points: Tensor | slice = slice(None)) -> tuple[Tensor, Tensor]:
        """(B, z) to the mean (B, f, k) and the log of the variance above the noise's (f, k).

        `points` chooses some of the k frequencies.
        """
        hidden = self.split(self.norm(self.blocks(self.join(z))))
        features = hidden.view(len(z), self.sizes.floors, self.sizes.floor_features)
        return self.floors(nn.functional.silu(features), points), self.log_excess[:, points]


def parameter_features(theta: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Features (B, 2 p) of theta: linear and logarithmic position in the prior box, -1 to 1.

    Frequencies go with the square root of theta, between the two.
    """
    linear = 2.0 * (theta - lower) / (upper - lower) - 1.0
    logarithmic = 2.0 * torch.log(theta / lower) / torch.log(upper / lower) - 1.0
    return torch.cat([linear, logarithmic], dim=-1)


class Mvae(nn.Module):
    """Multimodal variational autoencoder of FRFs x and stiffness factors theta.

    Buffers hold the prior box and the mean and scale (f, k) that standardise ln|H|, so that a
    weights file is complete.
    """

    lower: Tensor
    upper: Tensor
    x_mean: Tensor
    x_scale: Tensor

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        self.sizes = sizes
        self.observation_encoder = ObservationEncoder(sizes)
        self.parameter_encoder = ParameterEncoder(sizes)
        self.decoder = Decoder(sizes)
        self.register_buffer("lower", torch.zeros(sizes.parameters))
        self.register_buffer("upper", torch.ones(sizes.parameters))
        self.register_buffer("x_mean", torch.zeros(sizes.floors, sizes.points))
        self.register_buffer("x_scale", torch.ones(sizes.floors, sizes.points))

    def encode_observation(self, log_frf: Tensor, visibility: Visibility) -> LatentGaussian:
        """q(z|x) for ln|H| (B, f, k), of which only the visible part counts; all must be finite."""
        standard = (log_frf - self.x_mean) / self.x_scale
        return self.observation_encoder(
            standard * visibility.weights(self.sizes.points), visibility
        )

    def encode_parameters(self, theta: Tensor, visibility: Visibility) -> LatentGaussian:
        """q(z|theta) for theta (B, p), given what is visible."""
        features = parameter_features(theta, self.lower, self.upper)
        return self.parameter_encoder(features, visibility)
