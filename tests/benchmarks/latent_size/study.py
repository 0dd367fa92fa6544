"""How many latent coordinates the data need: what is lost where some directions are left out.

A latent space of d coordinates that is linear in those of the parameters keeps a subspace of them.
The one looked at is spanned by the leading eigenvectors of the mean outer product of the
response's derivatives (active subspaces: Constantine, Dow & Wang 2014, SIAM J. Sci. Comput. 36,
A1500). Whatever a decoder does with its coordinates, what ln|H| varies by while they stay the
same it cannot follow: that conditional variance is the least mean square error of any decoder, and
needs none to be trained.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.inference.parameters import Parameters

Respond = Callable[[Tensor], Tensor]
"""ln|H| (n, m) of parameters theta (n, p), float64."""

# Step of the differences, in coordinates that run from -1 to 1.
_STEP = 1e-4
# Moves within a slice of the prior's box. They start from a draw of the prior, so that none is
# needed for the distribution to be right, but only to forget where they started.
_MOVES = 400
# A loss below this, nats of the whole observation, is beyond what data can tell.
RESOLUTION = 1.0


@dataclass(frozen=True)
class SizeLoss:
    """What a latent space of some size loses at least.

    Attributes:
        coordinates: d, one for each direction kept.
        rms: of ln|H| that cannot be followed, over the prior.
        nats: rise of the misfit of a whole observation, mean over the prior.
    """

    coordinates: int
    rms: float
    nats: float


def box_coordinates(prior: Parameters, theta: Tensor) -> Tensor:
    """Coordinates (n, p) of theta in the prior's box: square roots, scaled from -1 to 1."""
    low, high = prior.lower.sqrt(), prior.upper.sqrt()
    return 2.0 * (theta.sqrt() - low) / (high - low) - 1.0


def from_box_coordinates(prior: Parameters, point: Tensor) -> Tensor:
    """The inverse of `box_coordinates`."""
    return _root(prior, point).square()


def sensitive_directions(
    respond: Respond, prior: Parameters, count: int, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Eigenvalues (p,) and eigenvectors (p, p), in columns, of the mean outer product of slopes.

    Args:
        respond: see `Respond`.
        prior: of the parameters.
        count: draws of the prior that the mean is taken over; p + 1 responses each.
        generator: of the draws.

    Returns:
        The largest first; the sum over the m responses, a unit of the coordinates squared.
    """
    point = box_coordinates(prior, prior.sample(count, generator))
    total = torch.zeros(prior.size, prior.size, dtype=point.dtype)
    # Towards the middle, so that nothing leaves the box.
    shift = torch.eye(prior.size, dtype=point.dtype)
    for row in point:
        step = torch.where(row > 0.0, -_STEP, _STEP)
        moved = torch.cat([row[None], row + step[:, None] * shift])
        values = respond(from_box_coordinates(prior, moved))
        slope = (values[1:] - values[0]) / step[:, None]
        total += slope @ slope.T / count
    value, vector = torch.linalg.eigh(total)
    return value.flip(0), vector.flip(1)


def size_losses(
    respond: Respond,
    prior: Parameters,
    directions: Tensor,
    sizes: Sequence[int],
    noise_sd: float,
    count: int,
    generator: torch.Generator,
) -> list[SizeLoss]:
    """What latent spaces of several sizes lose at least.

    Args:
        respond: see `Respond`.
        prior: of the parameters.
        directions: (p, p) in columns, those kept first.
        sizes: numbers of directions kept.
        noise_sd: of ln|H|.
        count: pairs of draws of the prior that agree in all that is kept.
        generator: of the draws.
    """
    point = box_coordinates(prior, prior.sample(count, generator))
    values = respond(from_box_coordinates(prior, point))
    losses = []
    for size in sizes:
        other = _resliced(prior, point, directions[:, size:], generator)
        # Half the mean square difference of two draws is their variance.
        variance = 0.5 * (respond(from_box_coordinates(prior, other)) - values).square().mean(0)
        rms, nats = variance.mean().sqrt(), 0.5 * variance.sum() / noise_sd**2
        losses.append(SizeLoss(size, float(rms), float(nats)))
    return losses


def enough_coordinates(losses: Sequence[SizeLoss], full: int) -> int:
    """The smallest size that loses less than data can tell, or the full one."""
    return min((one.coordinates for one in losses if one.nats < RESOLUTION), default=full)


def _resliced(prior: Parameters, point: Tensor, free: Tensor, generator: torch.Generator) -> Tensor:
    """Other draws (n, p) of the prior where only the directions `free` (p, q) may change.

    Hit-and-run within the slice of the box (Smith 1984, Oper. Res. 32, 1296): a point anywhere on
    the chord, accepted by the prior's density, which is uniform in theta and not in its root.
    """
    if not free.shape[1]:
        return point
    for _ in range(_MOVES):
        course = torch.randn(len(point), free.shape[1], generator=generator, dtype=point.dtype)
        course = course @ free.T
        ends = torch.stack([(-1.0 - point) / course, (1.0 - point) / course])
        start, end = ends.amin(0).amax(1), ends.amax(0).amin(1)
        share = torch.rand(len(point), generator=generator, dtype=point.dtype)
        moved = point + (start + (end - start) * share)[:, None] * course
        moved = moved.clamp(-1.0, 1.0)  # rounding
        ratio = (_root(prior, moved) / _root(prior, point)).prod(1)
        take = torch.rand(len(point), generator=generator, dtype=point.dtype) < ratio
        point = torch.where(take[:, None], moved, point)
    return point


def _root(prior: Parameters, point: Tensor) -> Tensor:
    low, high = prior.lower.sqrt(), prior.upper.sqrt()
    return low + 0.5 * (point + 1.0) * (high - low)
