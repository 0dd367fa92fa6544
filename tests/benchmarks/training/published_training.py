"""Training of the published network, in the published way but for noise where it belongs."""

from collections.abc import Iterator

import torch
from torch import Tensor

from femupdate.surrogate.places import Box

from .published_network import PublishedNetwork

BATCH = 256
LEARNING_RATE = 1e-3
# Weight of both reconstructions against the divergences, as in the authors' code.
RECONSTRUCTION = 10.0


def start_published(box: Box, log_frf: Tensor, noise_sd: float, seed: int) -> PublishedNetwork:
    """A network with fresh weights that knows the prior's box and the scale of some FRFs (n, k)."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = PublishedNetwork(len(box.lower), log_frf.shape[1])
    network.lower.copy_(box.lower)
    network.upper.copy_(box.upper)
    network.x_mean.copy_(log_frf.float().mean(0))
    network.x_scale.copy_(log_frf.float().std(0).clamp_min(noise_sd))
    return network


def published_training(
    network: PublishedNetwork, theta: Tensor, log_frf: Tensor, noise_sd: float, seed: int
) -> Iterator[PublishedNetwork]:
    """Train by Adam without end, and stop after each step to be looked at.

    Args:
        network: changed in place.
        theta: (n, p).
        log_frf: ln|H| (n, k) of the roof without noise.
        noise_sd: of the noise, drawn afresh at every step for the input and for the target.
        seed: of order, noise and latent draws; dropout follows torch's global generator.

    Yields:
        The network: once before the first step, and then after each.
    """
    generator = torch.Generator().manual_seed(seed)
    optimizer = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
    yield network
    while True:
        for rows in torch.randperm(len(theta), generator=generator).split(BATCH):
            if len(rows) < BATCH:
                continue
            loss = published_loss(network, theta[rows], log_frf[rows].float(), noise_sd, generator)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            yield network


def published_loss(
    network: PublishedNetwork,
    theta: Tensor,
    log_frf: Tensor,
    noise_sd: float,
    generator: torch.Generator,
) -> Tensor:
    """The bound of two modalities, mean over the batch, over the weight of its reconstructions.

    w (-ln p(x'|z_x) - ln p(x'|z_theta)) + KL(q(z|x)) + KL(q(z|theta)), with independent noise on
    the encoder's x and on the decoder's x'.
    """

    def noisy() -> Tensor:
        noise = torch.empty_like(log_frf).normal_(generator=generator)
        return log_frf + noise_sd * noise

    posterior = network.encode_observation(noisy()).joined(network.encode_parameters(theta))
    # One batch of both: batch norm then has one mean and one spread for both.
    decoded = network.decode(posterior.sample(generator))
    nats = decoded.negative_log_density(noisy().repeat(2, 1))
    # A sum over the two encoders, the mean over the rows of each.
    return 2.0 * (nats + posterior.prior_divergence() / RECONSTRUCTION).mean()
