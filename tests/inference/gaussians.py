"""Boxes, and likelihoods that are Gaussian in standard normal coordinates."""

from dataclasses import dataclass

import numpy as np
import torch

from femupdate.inference import Parameters


def box(lower, upper):
    """A prior with bounds (p,) and (p,)."""
    names = tuple(f"theta_{i + 1}" for i in range(len(lower)))
    return Parameters.uniform(names, *torch.tensor([lower, upper], dtype=torch.float64))


@dataclass(frozen=True)
class LinearGaussian:
    """y = A xi + noise of standard deviation s, xi standard normal: all is known in closed form."""

    A: np.ndarray
    y: np.ndarray
    s: float

    @property
    def covariance(self):
        return np.linalg.inv(np.eye(self.A.shape[1]) + self.A.T @ self.A / self.s**2)

    @property
    def mean(self):
        return self.covariance @ self.A.T @ self.y / self.s**2

    @property
    def log_evidence(self):
        """Of exp(-|y - A xi|^2 / 2 s^2), which lacks the constant of the density."""
        total = self.A @ self.A.T + self.s**2 * np.eye(len(self.y))
        misfit = self.y @ np.linalg.solve(total, self.y)
        return float(
            -0.5 * misfit - 0.5 * np.linalg.slogdet(total)[1] + len(self.y) * np.log(self.s)
        )

    def on(self, prior):
        """The log likelihood of theta."""
        A, y = torch.from_numpy(self.A), torch.from_numpy(self.y)

        def log_likelihood(theta):
            residual = prior.to_normal(theta) @ A.T - y
            return -0.5 * (residual**2).sum(-1) / self.s**2

        return log_likelihood

    def draws(self, prior, count, seed):
        """Exact draws of theta from the posterior."""
        rng = np.random.default_rng(seed)
        xi = rng.multivariate_normal(self.mean, self.covariance, size=count)
        return prior.from_normal(torch.from_numpy(xi))
