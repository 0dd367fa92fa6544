"""The benchmark `shear4dof`: the published tables, beside the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..log import ResumableLog
from ..result import Job, Report
from ..shipped import benchmark_model, shipped_surrogate, surrogate_mark
from .case import Shear4dof, authors_case, exact_posterior, random_case
from .observations import ObservationResult, observation_result
from .tables import exact_table, observation_table, solutions_table

NAME = "shear4dof"


@dataclass(frozen=True)
class Shear4dofPlan:
    """How much of the benchmark is run."""

    reference_draws: int = 50_000  # of the posteriors that others are compared with
    observations: int = 20  # that latent posterior and bridge are judged on
    particles: int = 2000  # of the posteriors that judge an observation


QUICK = Shear4dofPlan(3000, 2)


def run_shear4dof(job: Job, plan: Shear4dofPlan) -> Report:
    """Run the benchmark and write its results; one that was cut off goes on from its parts."""
    model = benchmark_model()
    surrogate, case = shipped_surrogate(model.building), authors_case(model)
    header = [model.hash, surrogate_mark(surrogate), job.seed, plan]
    log = ResumableLog(job.folder / f"{NAME}_parts.jsonl", header)
    job.progress.start("Exact posterior", 1)
    exact = exact_posterior(model, case, plan.reference_draws, job.seed)
    job.progress.advance()
    problem = Shear4dof(model, surrogate, case, exact)
    observations = _observations(problem, plan, job, log)
    found = {
        "solutions": case.solutions,
        "exact_weight": exact.modes.weight,
        "log_evidence": exact.weighted.log_evidence,
    }
    more = {
        "exact_sd": exact.modes.sd,
        "log_evidence_error": exact.weighted.log_evidence_error,
        "observations": observations,
    }
    return job.write(
        NAME,
        {**found, **more},
        _text(problem, observations),
        packages=("scikit-learn",),
        answer=found,
    )


def _observations(
    problem: Shear4dof, plan: Shear4dofPlan, job: Job, log: ResumableLog
) -> list[ObservationResult]:
    """The authors' observation, whose exact posterior is known, and random ones."""
    job.progress.start("Latent posterior and bridge", plan.observations)
    rng, draws = np.random.default_rng(job.seed), min(20_000, plan.reference_draws)
    results = []
    for number in range(plan.observations):
        case = random_case(problem.model, rng) if number else problem.case
        sizes = draws, plan.particles
        make = partial(observation_result, problem, case, job.seed + number, *sizes)
        results.append(log.get_or_make(f"observation {number}", ObservationResult, make))
        job.progress.advance()
    return results


def _text(problem: Shear4dof, observations: Sequence[ObservationResult]) -> str:
    weighted = problem.exact.weighted
    return "\n\n".join(
        (
            "## Equivalent solutions (Table 1)",
            solutions_table(problem.case),
            "## Exact posterior",
            exact_table(problem.exact),
            f"Log evidence {weighted.log_evidence:.3f} ± {weighted.log_evidence_error:.3f}.",
            f"## Latent posterior and bridge over {len(observations)} observations",
            observation_table(observations),
        )
    )
