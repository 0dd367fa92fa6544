"""The multimodal variational autoencoder: parameters and FRFs in one latent space, and back."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from femupdate.surrogate.layers import FloorLinear, residual_blocks
from femupdate.surrogate.modal_decoder import ModalDecoder
from femupdate.surrogate.places import from_place, parameter_features, to_place
from femupdate.surrogate.sizes import NetworkSizes
from femupdate.surrogate.visibility import Visibility

# Least variance: finite in float32, and far below that of any posterior.
_LEAST_LOG_VARIANCE = -18.0
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
        return LatentMixture(
            log_weight[..., 0].log_softmax(dim=1),
            mean,
            (log_variance - 3.0).clamp(_LEAST_LOG_VARIANCE, 4.0),
        )


class Mvae(nn.Module):
    """Multimodal variational autoencoder of FRFs x and stiffness factors theta.

    Args:
        sizes: of the networks.

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
        return from_place(place, self.lower, self.upper)

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
