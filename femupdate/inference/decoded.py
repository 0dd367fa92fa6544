"""The latent likelihood by the decoder itself, for posteriors that no few Gaussians describe.

Where q(z|theta) is all at one place the latent likelihood is q(z|x) / p(z) there, which by Bayes'
theorem is p(x|z) but for a constant. A mixture of Gaussians stands for q(z|x) where the data leave
little open; with dozens of parameters what they know well bends along what they leave open, and
p(x|z) is asked itself. It is differentiable, and a gradient of it costs a fourteenth of one of the
building's own likelihood.

What the decoder has learned wrongly would move a narrow posterior by several of its widths. It is
put right for each observation: the difference between the building's own responses and the
decoder's, at draws of the posterior, is fitted to the second order in z and added.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.inference.thresholds import DECODER
from femupdate.surrogate.gauss_newton import LatentData
from femupdate.surrogate.network import Mvae


@dataclass(frozen=True)
class Features:
    """z about a centre, and the products of its components along a few directions.

    Attributes:
        centre: (z,).
        axes: (z, q).
    """

    centre: Tensor
    axes: Tensor

    def __call__(self, z: Tensor) -> Tensor:
        """(n, z + q (q + 1) / 2) of z (n, z)."""
        offset = z - self.centre
        along = offset @ self.axes
        first, second = torch.triu_indices(along.shape[1], along.shape[1], device=z.device)
        return torch.cat([offset, along[:, first] * along[:, second]], dim=1)


@dataclass(frozen=True)
class Correction:
    """What is added to the decoder's ln|H|.

    Attributes:
        features: h of z.
        base: (h,) their means, where the correction is `value`.
        value: (m,).
        slope: (h, m).
        left: (m,) variance that it leaves, on points that it was not fitted to.
    """

    features: Features
    base: Tensor
    value: Tensor
    slope: Tensor
    left: Tensor

    def __call__(self, z: Tensor) -> Tensor:
        """(n, m) at z (n, z)."""
        return torch.addmm(self.value, self.features(z) - self.base, self.slope)

    def to(self, like: Tensor) -> "Correction":
        """The same on the device and in the precision of `like`."""
        features = Features(self.features.centre.to(like), self.features.axes.to(like))
        parts = (self.base, self.value, self.slope, self.left)
        return Correction(features, *(part.to(like) for part in parts))


def fit_correction(z: Tensor, error: Tensor) -> Correction:
    """Fit error (n, m) at z (n, z), linearly and along the widest directions to the second order.

    Ridge and number of directions are those that predict best what is left out of the fit.
    """
    axes = torch.linalg.svd(z - z.mean(0), full_matrices=False)[2].T
    fits = [_ridge(Features(z.mean(0), axes[:, :count]), z, error) for count in DECODER.curved]
    return min(fits, key=lambda fit: float(fit.left.sum()))


def _ridge(features: Features, z: Tensor, error: Tensor) -> Correction:
    """Ridge regression on the features; the ridge by leaving one point out.

    The errors of the fits to all points but one are known without fitting again (Allen 1974,
    Technometrics 16, 125).
    """
    values, value = features(z), error.mean(0)
    base = values.mean(0)
    left, roots, right = torch.linalg.svd(values - base, full_matrices=False)
    turned = left.T @ (error - value)
    unit = roots.square().sum() / len(roots)
    found = []
    for ridge in DECODER.ridges:
        share = roots.square() / (roots.square() + ridge * unit)
        leverage = (left.square() @ share + 1.0 / len(z)).clamp_max(0.999)
        missed = error - value - left @ (share[:, None] * turned)
        variance = (missed / (1.0 - leverage)[:, None]).square().mean(0)
        slope = right.T @ ((share / roots.clamp_min(1e-12))[:, None] * turned)
        found.append(Correction(features, base, value, slope, variance))
    return min(found, key=lambda fit: float(fit.left.sum()))


class DecodedLikelihood:
    """ln p(x|z) at the z of parameters, differentiable.

    Args:
        mvae: of the building; its precision and device are those of the result.
        data: the observation with the variance of its noise alone.
        correction: of the decoder on the observed points; without it the decoder's own variance is
            added to the noise's.
        power: that the likelihood is raised to.
    """

    def __init__(
        self,
        mvae: Mvae,
        data: LatentData,
        correction: Correction | None = None,
        power: float = 1.0,
    ) -> None:
        self._mvae = mvae
        self._data = data
        self._power = power
        like = mvae.lower
        self._seen = (data.weight > 0).to(like.device)
        self._points = self._seen.any(0).nonzero()[:, 0]
        self._rows = self._seen[:, self._points].flatten().nonzero()[:, 0]
        self._correction = None if correction is None else correction.to(like)
        weight = data.weight.to(like)[self._seen]
        if self._correction is None:
            left = mvae.decoder.excess_variance()[self._seen]
        else:
            left = self._correction.left
        self._root = (weight / (1.0 + weight * left)).sqrt()
        self._target = data.log_frf.to(like)[self._seen]

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of theta (n, p), with the damping ratio last where it is unknown."""
        return -0.5 * self.residuals(parameters).square().sum(1)

    def residuals(self, parameters: Tensor) -> Tensor:
        """Whitened residuals (n, m): minus half their square is the log likelihood."""
        misfit = self.respond(self.place(parameters)) - self._target
        return self._power**0.5 * misfit * self._root

    def place(self, parameters: Tensor) -> Tensor:
        """z (n, z) of parameters."""
        size = self._mvae.sizes.parameters
        known = parameters.to(self._mvae.lower)
        free = self._mvae.decoder.damping_coordinate(known[:, -1])
        return torch.cat([self._mvae.encode_parameters(known[:, :size]), free], dim=1)

    def respond(self, z: Tensor) -> Tensor:
        """ln|H| (n, m) of the observed points at z (n, z)."""
        decoded = self._mvae.decode(z, self._points).flatten(1)[:, self._rows]
        return decoded if self._correction is None else decoded + self._correction(z)

    def corrected(self, parameters: Tensor, log_frf: Tensor) -> "DecodedLikelihood":
        """With a correction, in place of its own, from the building's responses.

        Args:
            parameters: (n, p) as above.
            log_frf: (n, f, k) the building's, all floors of the decoder.
        """
        plain = DecodedLikelihood(self._mvae, self._data)
        error = plain.missed(parameters, log_frf).double()
        correction = fit_correction(plain.place(parameters).double(), error)
        return DecodedLikelihood(self._mvae, self._data, correction, self._power)

    @torch.no_grad()
    def missed(self, parameters: Tensor, log_frf: Tensor) -> Tensor:
        """Responses of the building less those of the decoder, corrected or not, (n, m)."""
        z = self.place(parameters)
        return log_frf.to(z)[:, self._seen] - self.respond(z)

    def misfit(self, log_frf: Tensor) -> Tensor:
        """Mean squared misfit (n,) of the building's responses, whitened by the noise alone."""
        weight, target = self._data.weight[self._seen], self._data.log_frf[self._seen]
        return (weight * (log_frf.to(target)[:, self._seen] - target).square()).mean(1)

    def by_responses(self, log_frf: Tensor) -> Tensor:
        """Log likelihood (n,) of the building's responses, which the decoder has no part in."""
        return -0.5 * self._power * self.misfit(log_frf) * len(self._target)
