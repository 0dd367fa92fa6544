"""The likelihood of a fitted model's parameters, with the errors that count at the fit."""

from dataclasses import replace

import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, likeliest_row
from femupdate.discrepancy.problem import Problem
from femupdate.effects.effect import Placed
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.parameters import Parameters
from femupdate.inference.priors import effect_parameters


def likelihood_about(problem: Problem, fitted: Fit) -> Likelihood:
    """The likelihood of a fitted model's parameters, by the rows that count at the fit."""
    # The tables by which a hundred fits are compared are too coarse for intervals.
    error = problem.error.finer(likeliest_row(problem, fitted))
    densities = error.log_densities(fitted.raw[None])
    likeliest = tuple(int(own.argmax()) for own in densities)
    rows = error.counting_beside(likeliest, densities)
    parameters = parameters_of(problem, fitted.placed)
    whole = Likelihood(problem.data, fitted.system, parameters, error, error.first)
    # By the noise alone a right frame would miss: the fit counts on what its mesh may err by.
    return replace(whole.kept(rows), known_is_met=True)


def parameters_of(problem: Problem, placed: tuple[Placed, ...]) -> Parameters:
    """The parameters of a problem with effects and their priors, the damping ratio last."""
    prior = problem.prior
    return prior.of("stiffness") + effect_parameters(placed) + prior.of("damping")


def parameters_at(fitted: Fit) -> Tensor:
    """Parameters (1, p) of a fit."""
    theta, zeta, sizes = fitted.split
    return torch.cat([theta, sizes, zeta[:, None]], dim=1)


__all__ = ["likelihood_about", "parameters_at", "parameters_of"]
