"""The likelihood of a fitted model's parameters, with the errors that count at the fit."""

from dataclasses import replace

import torch
from torch import Tensor

from femupdate.discrepancy.fit import Fit, likeliest_row
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.parameters import effect_parameters


def likelihood_about(fitted: Fit) -> Likelihood:
    """The likelihood of a fitted model's parameters, by the rows that count at the fit."""
    own = fitted.likelihood
    # The tables by which a hundred fits are compared are too coarse for intervals.
    error = own.error.finer(likeliest_row(own, fitted))
    densities = error.log_densities(fitted.raw[None])
    likeliest = tuple(int(one.argmax()) for one in densities)
    rows = error.counting_beside(likeliest, densities)
    effects = effect_parameters(fitted.placed)
    prior = own.prior.of("stiffness") + effects + own.prior.of("damping")
    return replace(own, error=error, prior=prior).at_row(likeliest).kept(rows)


def parameters_at(fitted: Fit) -> Tensor:
    """Parameters (1, p) of a fit, the damping ratio last."""
    theta, zeta, sizes = fitted.split
    return torch.cat([theta, sizes, zeta[:, None]], dim=1)


__all__ = ["likelihood_about", "parameters_at"]
