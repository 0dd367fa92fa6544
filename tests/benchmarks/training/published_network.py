"""The network of the published method, to train beside ours: two encoders, one decoder.

Built from what is published of its layout. Kinds and sizes of layers are theirs, and all three
parts have as many parameters as theirs. What is not published is chosen here: ReLU between layers,
nearest-neighbour upsampling, batch norm after the fully connected layers, FRFs standardised point
by point on the way in and out, and a start from one variance.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, relu, softplus
from torch.nn.utils.parametrizations import spectral_norm

# Parameters of the published parts, for four stiffness factors and 1,024 points.
PUBLISHED_PARAMETERS = {
    "parameter encoder": 1_888,
    "observation encoder": 708_070,
    "decoder": 701_014,
}
# With eight latent dimensions the counts come out exactly.
LATENT = 8

_THETA_WIDTHS = (8, 16, 16, 8, 8)
_THETA_DROPOUT = 0.2
_CHANNELS = (1, 2, 4, 8, 16, 32)
_WIDTHS = (512, 256, 128)
_DROPOUT = 0.5
_LEAST_VARIANCE = 1e-6
# Each of the five blocks halves the number of points, or doubles it.
_SHRINKAGE = 2 ** (len(_CHANNELS) - 1)


@dataclass(frozen=True)
class Gaussian:
    """Independent Gaussians: mean and variance of the same shape."""

    mean: Tensor
    variance: Tensor

    def joined(self, other: "Gaussian") -> "Gaussian":
        """The rows of both."""
        return Gaussian(
            torch.cat([self.mean, other.mean]), torch.cat([self.variance, other.variance])
        )

    def sample(self, generator: torch.Generator) -> Tensor:
        """Reparameterised draw."""
        noise = torch.empty_like(self.mean).normal_(generator=generator)
        return self.mean + self.variance.sqrt() * noise

    def negative_log_density(self, x: Tensor) -> Tensor:
        """-ln p(x) (B,), summed over the last axis."""
        nats = (x - self.mean) ** 2 / self.variance + torch.log(2.0 * math.pi * self.variance)
        return 0.5 * nats.sum(-1)

    def prior_divergence(self) -> Tensor:
        """KL from the standard normal (B,)."""
        nats = self.mean**2 + self.variance - self.variance.log() - 1.0
        return 0.5 * nats.sum(-1)


class PublishedNetwork(nn.Module):
    """Encoders of theta (B, p) and of roof FRFs x (B, k), and the decoder from z to x.

    Args:
        parameters: p.
        points: k, a multiple of 32.

    Raises:
        ValueError: the points cannot be halved five times.
    """

    lower: Tensor
    upper: Tensor
    x_mean: Tensor
    x_scale: Tensor

    def __init__(self, parameters: int = 4, points: int = 1024) -> None:
        super().__init__()
        if points % _SHRINKAGE:
            raise ValueError(f"{points} points are no multiple of {_SHRINKAGE}")
        self.parameter_encoder = _ParameterEncoder(parameters)
        self.observation_encoder = _ObservationEncoder(points)
        self.decoder = _Decoder(points)
        self.register_buffer("lower", torch.zeros(parameters))
        self.register_buffer("upper", torch.ones(parameters))
        self.register_buffer("x_mean", torch.zeros(points))
        self.register_buffer("x_scale", torch.ones(points))

    def encode_parameters(self, theta: Tensor) -> Gaussian:
        """q(z|theta)."""
        unit = (theta - self.lower) / (self.upper - self.lower)
        found: Gaussian = self.parameter_encoder(2.0 * unit - 1.0)
        return found

    def encode_observation(self, x: Tensor) -> Gaussian:
        """q(z|x)."""
        found: Gaussian = self.observation_encoder((x - self.x_mean) / self.x_scale)
        return found

    def decode(self, z: Tensor) -> Gaussian:
        """p(x|z)."""
        standard: Gaussian = self.decoder(z)
        return Gaussian(
            self.x_mean + self.x_scale * standard.mean, self.x_scale**2 * standard.variance
        )


def parameter_counts(network: nn.Module, parts: tuple[str, ...]) -> dict[str, int]:
    """Trainable numbers in each of the named parts of a network."""
    return {
        part.replace("_", " "): sum(p.numel() for p in network.get_submodule(part).parameters())
        for part in parts
    }


class _GaussianHead(nn.Module):
    """Mean and softplus variance, a linear layer each."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mean = nn.Linear(width, LATENT)
        self.variance = nn.Linear(width, LATENT)

    def forward(self, x: Tensor) -> Gaussian:
        return Gaussian(self.mean(x), softplus(self.variance(x)) + _LEAST_VARIANCE)


class _FullyConnectedBlock(nn.Module):
    """Two linear layers beside the identity, or a third where the width changes."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.inner = nn.Linear(inputs, outputs)
        self.outer = nn.Linear(outputs, outputs)
        self.dropout = nn.Dropout(_THETA_DROPOUT)
        same = inputs == outputs
        self.shortcut = nn.Identity() if same else nn.Linear(inputs, outputs)

    def forward(self, x: Tensor) -> Tensor:
        inner = self.dropout(relu(self.inner(x)))
        return relu(self.outer(inner) + self.shortcut(x))


class _ParameterEncoder(nn.Sequential):
    def __init__(self, parameters: int) -> None:
        widths = (parameters, *_THETA_WIDTHS)
        blocks = (_FullyConnectedBlock(*pair) for pair in pairwise(widths))
        super().__init__(*blocks, _GaussianHead(widths[-1]))


class _ConvolutionBlock(nn.Module):
    """1x3 and 3x3 convolutions beside a 1x1 convolution, on rows of one roof: (B, c, 1, k).

    With `normalise` batch norm follows each of the three, else their weights are kept to a spectral
    norm of one.
    """

    def __init__(self, inputs: int, outputs: int, *, normalise: bool, last: bool = False) -> None:
        super().__init__()

        def layer(channels: int, kernel: tuple[int, int]) -> nn.Module:
            padding = (kernel[0] // 2, kernel[1] // 2)
            convolution = nn.Conv2d(channels, outputs, kernel, padding=padding)
            if normalise:
                return nn.Sequential(convolution, nn.BatchNorm2d(outputs))
            return spectral_norm(convolution)

        self.inner = layer(inputs, (1, 3))
        self.outer = layer(outputs, (3, 3))
        self.shortcut = layer(inputs, (1, 1))
        self.last = last

    def forward(self, x: Tensor) -> Tensor:
        found: Tensor = self.outer(relu(self.inner(x))) + self.shortcut(x)
        return found if self.last else relu(found)


class _ObservationEncoder(nn.Module):
    def __init__(self, points: int) -> None:
        super().__init__()
        pairs = pairwise(_CHANNELS)
        self.blocks = nn.ModuleList(_ConvolutionBlock(*pair, normalise=False) for pair in pairs)
        self.dropout = nn.Dropout(_DROPOUT)
        self.pool = nn.AvgPool2d((1, 2))
        self.dense = _dense(_CHANNELS[-1] * points // _SHRINKAGE, *_WIDTHS)
        self.head = _GaussianHead(_WIDTHS[-1])

    def forward(self, x: Tensor) -> Gaussian:
        hidden = x[:, None, None]
        for block in self.blocks:
            hidden = self.pool(self.dropout(block(hidden)))
        found: Gaussian = self.head(self.dense(hidden.flatten(1)))
        return found


class _Decoder(nn.Module):
    def __init__(self, points: int) -> None:
        super().__init__()
        down = _CHANNELS[::-1]
        self.dense = _dense(LATENT, *_WIDTHS[::-1], down[0] * points // _SHRINKAGE)
        pairs = pairwise(down[:-1])
        self.blocks = nn.ModuleList(_ConvolutionBlock(*pair, normalise=True) for pair in pairs)
        self.mean = _ConvolutionBlock(*down[-2:], normalise=True, last=True)
        self.variance = _ConvolutionBlock(*down[-2:], normalise=True, last=True)
        # Batch norms that start at one make a few variances of 1e-4, whose misfits are all that the
        # first hundreds of steps see: start from one variance.
        for branch in (self.variance.outer, self.variance.shortcut):
            nn.init.zeros_(branch.get_parameter("1.weight"))

    def forward(self, z: Tensor) -> Gaussian:
        hidden = self.dense(z).view(len(z), _CHANNELS[-1], 1, -1)
        for block in self.blocks:
            hidden = block(_upsample(hidden))
        hidden = _upsample(hidden)
        variance = softplus(self.variance(hidden)) + _LEAST_VARIANCE
        return Gaussian(self.mean(hidden)[:, 0, 0], variance[:, 0, 0])


def _upsample(x: Tensor) -> Tensor:
    """Every point twice."""
    return interpolate(x, scale_factor=(1.0, 2.0), mode="nearest")


def _dense(*widths: int) -> nn.Sequential:
    """Linear layers, each with batch norm and ReLU."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(widths):
        layers += [nn.Linear(inputs, outputs), nn.BatchNorm1d(outputs), nn.ReLU()]
    return nn.Sequential(*layers)
