"""The four-story benchmark: the latent posterior of the shipped surrogate against the exact one.

Roof alone, the authors' observation (noise .2, seed 101); equivalent solutions of Katafygiotis and
Lam, exact weights and standard deviations from data-space sampling:
    python examples/check_four_story.py [PARTICLES]
"""

import sys
import time

import numpy as np
import torch
from scipy.stats import norm

from femupdate.building.files import load_building
from femupdate.dynamics.damping import damping_law
from femupdate.dynamics.frf import log_frf
from femupdate.dynamics.modal import modal_data
from femupdate.inference.likelihood import LatentLikelihood
from femupdate.inference.smc import TemperedSmc
from femupdate.measurement.observation import Observation
from femupdate.study import Study
from femupdate.workflow.model import StudyModel, reduce_building, theta_prior
from femupdate.workflow.surrogates import require_surrogate

SOLUTIONS = np.array(
    [
        [1.0, 1.0, 1.0, 1.0],
        [1.72206, 0.63637, 1.30144, 0.70116],
        [2.0, 1.0, 0.5, 1.0],
        [2.63969, 0.64718, 0.81280, 0.72018],
    ]
)
EXACT_WEIGHTS = np.array([0.337, 0.132, 0.346, 0.185])
EXACT_SD = np.array(
    [
        [0.0071, 0.0058, 0.0045, 0.0067],
        [0.0073, 0.0052, 0.0048, 0.0022],
        [0.0269, 0.0114, 0.0036, 0.0028],
        [0.0117, 0.0046, 0.0043, 0.0037],
    ]
)


def authors_observation(model: StudyModel) -> Observation:
    """ln|H| of the roof at theta = 1 with the authors' noise."""
    modal = modal_data(model.reduced, torch.ones(1, 4, dtype=torch.float64))
    clean = log_frf(modal, model.frequency_hz, model.law, torch.ones(1))[0, 3].numpy()
    noisy = clean + norm.rvs(size=clean.size, random_state=101) * 0.2
    grid = model.frequency_hz.numpy()
    shape = (1, grid.size)
    return Observation(grid, ("RF",), noisy[None], np.full(shape, 0.2), np.ones(shape, dtype=bool))


def nearest_solution(theta: np.ndarray) -> np.ndarray:
    """Index of the solution that each draw belongs to, in units of the gaps between them."""
    scaled = (theta[:, None] - SOLUTIONS) / np.array([0.3, 0.15, 0.1, 0.1])
    return (scaled**2).sum(axis=-1).argmin(axis=1)


def main(particles: int) -> None:
    """Sample and print."""
    building = load_building("shear_4dof")
    reduced = reduce_building(building).model
    model = StudyModel(building, reduced, damping_law(building), theta_prior(building), None, 0.0)
    surrogate = require_surrogate(Study("no-such-study"), model.building)
    started = time.monotonic()
    likelihood = LatentLikelihood(surrogate, reduced, model.law, authors_observation(model))
    result = TemperedSmc(model.prior, likelihood).run(particles, seed=0)
    seconds = time.monotonic() - started
    theta = result.theta.numpy()
    mode = nearest_solution(theta)
    print(f"{particles} particles, {len(result.levels)} levels, {seconds:.1f} s")
    for k, solution in enumerate(SOLUTIONS):
        draws = theta[mode == k]
        ratio = draws.std(axis=0) / EXACT_SD[k]
        print(
            f"{solution}: weight {len(draws) / particles:.3f} (exact {EXACT_WEIGHTS[k]}), "
            f"mean {draws.mean(axis=0).round(4)}, sd / exact {ratio.round(2)}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)
