"""The likelihood of all that was measured by a model with effects, in its parameters."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, likeliest_row
from femupdate.discrepancy.joint_error import JointError
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.thresholds import FIT
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.inference.parameters import Parameter, Parameters
from femupdate.inference.priors import effect_parameters
from femupdate.seeds import Seed, torch_generator

_AT_ONCE = 128  # points at a time: a thousand, with all their residuals, take a GB


@dataclass(frozen=True, eq=False)
class EffectLikelihood:
    """ln of the density of all that was measured, what the model errs by summed over.

    Attributes:
        problem: structure and data, with the row of errors that residuals are whitened by.
        system: the structure with its effects.
        prior: of the parameters: stiffness factors, parameters of the effects, damping ratio.
        error: what the model may err by: the rows that count.
    """

    problem: Problem
    system: System
    prior: Parameters
    error: JointError

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""
        parts = parameters.split(_AT_ONCE)
        return torch.cat([self.error.log_density(self.raw(some)) for some in parts])

    def residuals(self, parameters: Tensor) -> Tensor:
        """Residuals (n, m) of parameters (n, p), of unit covariance by the problem's row."""
        return self.problem.whitened(self.raw(parameters))

    def log_density(self, parameters: Tensor) -> Tensor:
        """Log density (n,) of parameters (n, p), were the problem's row true."""
        parts = parameters.split(_AT_ONCE)
        return torch.cat([-0.5 * self.residuals(some).square().sum(1) for some in parts])

    def raw(self, parameters: Tensor) -> Tensor:
        """Residuals (n, m) of parameters (n, p) in the unit of the noise."""
        values = self.prior.split(parameters)
        return self.problem.missed(self.system, (values.theta, values.zeta, values.sizes))

    def coarse(self) -> "EffectLikelihood":
        """The same as if noise were coarse, so that peaks that do not meet show a distance."""
        problem = self.problem.coarse(FIT.coarse_noise)
        return replace(self, problem=problem, error=problem.error)

    def parameters_of(self, fitted: Fit) -> Tensor:
        """Parameters (1, p) of a fit."""
        theta, zeta, sizes = fitted.split
        return torch.cat([theta, sizes, zeta[:, None]], dim=1)

    def misfit(self, parameters: Tensor) -> Tensor:
        """Mean squared residual (n,) of parameters (n, p), by the noise alone."""
        error = self.problem.error
        left = error.whiten(error.tame(self.raw(parameters), error.first), error.first)
        return left.square().sum(1) / max(self.problem.effective, 1.0)

    def checked(self, parameters: Tensor, seed: Seed) -> list[tuple[str, Tensor, Tensor]]:
        """Name, squares (n,) and independent numbers (n,) of each part that is checked.

        Squares hold what the model may err by; of every draw by one row of its own. What is wilder
        than counts in the likelihood is in neither.
        """
        raw, generator = self.raw(parameters), torch_generator(seed)
        shares = [own.softmax(1) for own in self.error.log_densities(raw)]
        parts = zip(self.problem.data, self.error.parts, self.error.apart(raw), shares, strict=True)
        found: list[tuple[str, Tensor, Tensor]] = []
        for data, error, own, share in parts:
            rows = torch.multinomial(share, 1, generator=generator)[:, 0]
            found += data.checked(*error.floor_squares(own, rows))
        return found


def likelihood_about(problem: Problem, fitted: Fit) -> EffectLikelihood:
    """The likelihood of a fitted model's parameters, with the errors that count at the fit."""
    row = likeliest_row(problem, fitted)
    # The tables by which a hundred fits are compared are too coarse for intervals.
    error = problem.error.finer(row)
    rows = error.counting(error.log_densities(fitted.raw[None]))
    parameters = parameters_of(problem, fitted.placed)
    return EffectLikelihood(problem.at_row(row), fitted.system, parameters, error.kept(rows))


def parameters_of(problem: Problem, placed: tuple[Placed, ...]) -> Parameters:
    """The parameters of a problem with effects and their priors, the damping ratio last."""
    names = [f"theta_{number}" for number in range(1, len(problem.lower) + 1)]
    low, high = problem.zeta or (problem.fixed_zeta, problem.fixed_zeta)
    zeta = Parameter(name="zeta", kind="damping", lower=low, upper=high)
    factors = Parameters.uniform(names, problem.lower, problem.upper)
    return factors + effect_parameters(placed) + Parameters((zeta,))


__all__ = ["EffectLikelihood", "likelihood_about", "parameters_of"]
