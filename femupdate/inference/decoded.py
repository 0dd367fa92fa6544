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

import copy
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Likelihood, likelihood_of
from femupdate.inference.thresholds import DECODER
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


class Decoded:
    """The decoder as it answers for the building, at the observed points.

    Args:
        mvae: of the building; its precision and device are those of the answers.
        data: ln|H| under base motion, with the noise that the likelihood believes.
        correction: of the decoder on the valid points; without it the decoder's own variance is
            what it misses.
    """

    def __init__(self, mvae: Mvae, data: FrfData, correction: Correction | None = None) -> None:
        self._mvae, self._data = mvae, data
        like = mvae.lower
        self._valid = data.valid.to(like.device)
        self._points = self._valid.any(0).nonzero()[:, 0]
        self._correction = None if correction is None else correction.to(like)
        if self._correction is None:
            self._left = mvae.decoder.excess_variance()[list(data.rows)][self._valid]
        else:
            self._left = self._correction.left

    def precise(self) -> "Decoded":
        """The same in double precision: maxima are sought by differences."""
        return Decoded(copy.deepcopy(self._mvae).double(), self._data, self._correction)

    def likelihood(self, exact: Likelihood) -> Likelihood:
        """That of the data by the decoder, by all rows of the table of errors.

        Args:
            exact: the building's own, of the same data, with the errors that are known beforehand.
        """
        left = torch.zeros_like(self._data.sd)
        left[self._data.valid] = self._left.to(left)
        data = self._data.decoded(self.log_frf, left)
        found = likelihood_of((data,), exact.system, exact.prior, exact.constant)
        return replace(found, error=found.error.with_known_of(exact.error))

    def log_frf(self, theta: Tensor, zeta: Tensor) -> Tensor:
        """ln|H| (n, g, k) of the observed floors at theta (n, p); zero where not valid."""
        known = self.respond(self.place(theta, zeta))
        at = self._valid.flatten().nonzero()[:, 0]
        whole = known.new_zeros(len(known), self._valid.numel()).index_copy(1, at, known)
        return whole.unflatten(1, self._valid.shape)

    def place(self, theta: Tensor, zeta: Tensor) -> Tensor:
        """z (n, z) of theta (n, p) and damping ratios (n,)."""
        like = self._mvae.lower
        free = self._mvae.decoder.damping_coordinate(zeta.to(like))
        return torch.cat([self._mvae.encode_parameters(theta.to(like)), free], dim=1)

    def respond(self, z: Tensor) -> Tensor:
        """ln|H| (n, m) of the valid points at z (n, z)."""
        decoded = self._mvae.decode(z, self._points)[:, list(self._data.rows)]
        decoded = decoded[:, self._valid[:, self._points]]
        return decoded if self._correction is None else decoded + self._correction(z)

    def corrected(self, theta: Tensor, zeta: Tensor, log_frf: Tensor) -> "Decoded":
        """With a correction, in place of its own, from the building's responses.

        Args:
            theta: (n, p); zeta: (n,).
            log_frf: (n, g, k) the building's, of the observed floors.
        """
        plain = Decoded(self._mvae, self._data)
        error = plain.missed(theta, zeta, log_frf).double()
        correction = fit_correction(plain.place(theta, zeta).double(), error)
        return Decoded(self._mvae, self._data, correction)

    @torch.no_grad()
    def missed(self, theta: Tensor, zeta: Tensor, log_frf: Tensor) -> Tensor:
        """Responses of the building less those of the decoder, corrected or not, (n, m)."""
        z = self.place(theta, zeta)
        return log_frf.to(z)[:, self._valid] - self.respond(z)
