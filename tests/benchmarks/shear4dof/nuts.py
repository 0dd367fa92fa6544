"""The published comparison: one long chain of the No-U-Turn sampler, through Pyro."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.parameters import Parameters
from femupdate.inference.smc import LogLikelihood

from .case import Shear4dof
from .samplers import SamplerRow, SamplerTarget, row_of_runs

_WARM_UP = 0.1


@dataclass(frozen=True)
class Chain:
    """Draws of one chain.

    Attributes:
        theta: (n, p), in the order drawn, without the warm-up.
        evaluations: of the likelihood with its gradient.
        seconds: all in all.
    """

    theta: Tensor
    evaluations: int
    seconds: float


def require_pyro() -> Any:
    """Pyro's inference module.

    Raises:
        InferenceError: it is not installed.
    """
    try:
        from pyro import infer
    except ImportError as error:
        raise InferenceError(
            'the No-U-Turn sampler needs Pyro; pip install "femupdate[nuts]"'
        ) from error
    return infer


def nuts_chain(
    prior: Parameters,
    log_likelihood: LogLikelihood,
    iterations: int,
    seed: int,
    advance: Callable[[], None] | None = None,
) -> Chain:
    """Run one chain (Hoffman & Gelman 2014) in the prior's standard normal coordinates.

    Args:
        prior: of theta.
        log_likelihood: with gradients; of one row at a time.
        iterations: all in all; a tenth of them is warm-up, in which step and mass adapt.
        seed: of the chain and of where it starts, a draw from the prior.
        advance: called after every iteration.

    Raises:
        InferenceError: Pyro is not installed.
    """
    infer, evaluations = require_pyro(), 0

    def potential(at: Mapping[str, Tensor]) -> Tensor:
        nonlocal evaluations
        evaluations += 1
        xi = at["xi"][None]
        density = log_likelihood(prior.from_normal(xi)) + prior.log_density_normal(xi)
        return -density[0].to(torch.float64)

    def tell(*_: Any) -> None:
        if advance is not None:
            advance()

    warm_up = max(1, int(_WARM_UP * iterations))
    started = time.monotonic()
    # Pyro draws from torch's own generator.
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        start = torch.randn(prior.size, dtype=torch.float64)
        sampler = infer.MCMC(
            infer.NUTS(potential_fn=potential),
            num_samples=iterations - warm_up,
            warmup_steps=warm_up,
            initial_params={"xi": start},
            hook_fn=tell,
            disable_progbar=True,
        )
        sampler.run()
    xi = sampler.get_samples()["xi"]
    return Chain(prior.from_normal(xi), evaluations, time.monotonic() - started)


def nuts_row(
    problem: Shear4dof,
    target: SamplerTarget,
    iterations: int,
    seed: int,
    advance: Callable[[], None],
) -> SamplerRow:
    """One chain in the table of samplers."""
    chain = nuts_chain(problem.model.prior, target.log_likelihood, iterations, seed, advance)
    figures = {
        "evaluations": float(chain.evaluations),
        "log_evidence": float("nan"),
        "unique": len(torch.unique(chain.theta[:, 0])) / len(chain.theta),
        "seconds": chain.seconds,
        **target.figures(problem.case, chain.theta.numpy()),
    }
    return row_of_runs(target.label, "NUTS, one chain", len(chain.theta), [figures])
