"""How well the reduced six-story model follows the full one, at theta that its basis never saw.

The full model is the superposition of all modes up to three times the top of the frequency grid.
Takes some ten minutes on two cores for 50 samples:
    python examples/check_reduction.py [SAMPLES]
"""

import platform
import sys
from datetime import date

import numpy as np
import torch
from joblib import Parallel, delayed, parallel_config

from femupdate.building.files import load_building
from femupdate.dynamics.damping import ConstantDamping
from femupdate.dynamics.frf import log_frf
from femupdate.dynamics.modal import modal_data
from femupdate.dynamics.reduced import ReducedModel
from femupdate.dynamics.reduction import superposition_log_frf
from femupdate.fe.model import DOF_PER_NODE
from femupdate.fe.solve import modes_below
from femupdate.workflow.model import FrameParts, frame_parts, reduce_building, theta_prior


def full_log_frf(
    parts: FrameParts, theta: np.ndarray, grid: np.ndarray, zetas: tuple[float, ...]
) -> np.ndarray:
    """ln|H| (z, f, k) of the full model for several damping ratios."""
    modes = modes_below(parts.operators, theta, 3.0 * grid[-1])
    rows = np.zeros((len(parts.mesh.floor_nodes), parts.operators.dof))
    for row, nodes in zip(rows, parts.mesh.floor_nodes.values(), strict=True):
        row[DOF_PER_NODE * np.asarray(nodes) + parts.mesh.direction] = 1.0 / len(nodes)
    excitation = parts.operators.inertia(parts.mesh.direction)
    effect = (rows[:, parts.operators.free] @ modes.shapes) * (modes.shapes.T @ excitation)
    omega, nothing = 2.0 * np.pi * modes.frequency_hz, np.zeros((len(rows), 0))
    return np.stack([superposition_log_frf(omega, effect, nothing, grid, z) for z in zetas])


def reduced_log_frf(
    model: ReducedModel, theta: np.ndarray, grid: np.ndarray, zetas: tuple[float, ...]
) -> np.ndarray:
    """ln|H| (z, f, k) of the reduced model for the same."""
    modal = modal_data(model, torch.from_numpy(theta[None]))
    frequency = torch.from_numpy(grid)
    values = [
        log_frf(modal, frequency, ConstantDamping(), torch.tensor([z], dtype=torch.float64))[0]
        for z in zetas
    ]
    return torch.stack(values).numpy()


def main(samples: int) -> None:
    """Compare and print."""
    building = load_building("six_story_wall_frame")
    grid = building.frequency_grid.frequencies_hz()
    parts = frame_parts(building)
    reduction = reduce_building(building, parts)
    prior = theta_prior(building)
    generator = torch.Generator().manual_seed(2026)
    thetas = prior.sample(samples, generator).numpy()
    zetas = (0.0066, 0.02)

    with parallel_config("loky", inner_max_num_threads=1):
        tasks = (delayed(full_log_frf)(parts, theta, grid, zetas) for theta in thetas)
        full = np.stack(Parallel(n_jobs=2, max_nbytes=None)(tasks))
    errors = np.stack([reduced_log_frf(reduction.model, t, grid, zetas) for t in thetas]) - full
    print(f"{date.today()}, {platform.machine()}, {platform.python_version()}")
    print(f"{reduction.model.size} shapes, {samples} unseen theta, {grid.size} frequencies")
    for place, zeta in enumerate(zetas):
        error = np.abs(errors[:, place])
        worst = np.unravel_index(error.argmax(), error.shape)
        print(
            f"zeta {zeta}: rms {np.sqrt((error**2).mean()):.4f}, within .1 "
            f"{(error <= 0.1).mean():.4%}, largest {error.max():.3f} where |H| is "
            f"{np.exp(full[:, place][worst]):.2g} at {grid[worst[2]]:.2f} Hz (theta {worst[0]}, "
            f"floor {worst[1]})"
        )
        for least in (1e-3, 1e-2):
            plain = error[full[:, place] > np.log(least)]
            print(f"  where |H| > {least:g}: largest {plain.max():.3f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
