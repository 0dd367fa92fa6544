"""The closed form of the latent likelihood."""

import torch
from torch import Tensor


def latent_log_likelihood(
    mean_x: Tensor, variance_x: Tensor, mean_theta: Tensor, variance_theta: Tensor
) -> Tensor:
    """Return ln of the integral of q(z|x) q(z|theta) / p(z) over z, p(z) the standard normal.

    The product of the two Gaussians is N(mean_x; mean_theta, variance_x + variance_theta) times a
    Gaussian of variance s = variance_x variance_theta / (variance_x + variance_theta); dividing by
    p(z) leaves a finite integral where s < 1. Elsewhere the form is invalid and the result is
    minus infinity (never a reward). Written this way nothing cancels when variances are small.

    Args:
        mean_x, variance_x: (..., z) of q(z|x).
        mean_theta, variance_theta: (..., z) of q(z|theta).

    Returns:
        (...) broadcast over the leading axes, summed over z.
    """
    total = variance_x + variance_theta
    joint = variance_x * variance_theta / total
    centre = (mean_x * variance_theta + mean_theta * variance_x) / total
    room = 1.0 - joint
    valid = room > 0.0
    room = torch.where(valid, room, torch.ones_like(room))
    terms = (
        -0.5 * (mean_x - mean_theta) ** 2 / total
        - 0.5 * torch.log(total)
        - 0.5 * torch.log(room)
        + 0.5 * centre**2 / room
    )
    return torch.where(valid, terms, -torch.inf).sum(-1)
