"""How well the local basis of the six-story building follows the full model with effects.

Every structural effect, at random places, with the size of its prior's standard deviation, at
story factors up to 15 % beside those that the basis is made for. The full model is seen through
all modes of the changed structure up to 1.5 times the top of the grid and what forces on the base,
the floors and the effect do statically beside them. Some five minutes a theta on one core:
    python examples/check_effects.py [THETAS] [EFFECT ...]
"""

import sys
import time
from dataclasses import replace

import numpy as np
import torch
from scipy.sparse import csc_matrix

from femupdate.arrays import Floats
from femupdate.building.files import load_building
from femupdate.dynamics.damping import ConstantDamping
from femupdate.dynamics.effect_local import local_structure
from femupdate.dynamics.effect_reduction import structure_on
from femupdate.dynamics.effect_response import EffectSystem, ReducedStructure, reduce_terms
from femupdate.effects.effect import UNSCALED, Placed, Terms
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.structure import Structure, structure_of
from femupdate.fe.assembly import with_terms
from femupdate.fe.factorization import factorize
from femupdate.fe.solve import modes_below
from femupdate.workflow.effects import reduction_target
from femupdate.workflow.model import theta_prior

ZETAS = (0.0066, 0.02)  # at the lowest of the prior resonances are sharpest
_BESIDE = 0.14  # in ln theta


def full_structure(
    structure: Structure, theta: Floats, terms: Terms, size: float, top_hz: float
) -> ReducedStructure:
    """The structure on the modes of what it is with an effect."""
    if structure.operators is None:
        raise AssertionError("a frame has operators")
    stiffness, mass = structure.stiffness(theta), structure.mass
    for story, matrix in terms.stiffness:
        stiffness = stiffness + size * (1.0 if story == UNSCALED else theta[story]) * matrix
    if terms.mass is not None:
        mass = mass + size * terms.mass.matrix
    changed = with_terms(
        replace(structure.operators, stiffness_constant=csc_matrix(stiffness), mass=mass.tocsc()),
        (),
    )
    shapes = modes_below(changed, np.zeros(0), top_hz).shapes
    port = [] if terms.port is None else [terms.port.row]
    solve = factorize(csc_matrix(stiffness)).solve
    static = solve(np.column_stack([structure.rigid_force, structure.floor_rows.T, *port]))
    return structure_on(
        structure, orthonormal(structure.mass, [shapes, static, solve(mass @ static)])
    )


def orthonormal(mass: csc_matrix, parts: list[Floats]) -> Floats:
    """A basis of all columns; twice, as they are nearly dependent."""
    basis = np.column_stack(parts)
    for _ in range(2):
        basis = basis / np.sqrt(np.einsum("ij,ij->j", basis, mass @ basis))
        energy, directions = np.linalg.eigh(basis.T @ (mass @ basis))
        kept = energy > 1e-12 * energy[-1]
        basis = basis @ (directions[:, kept] / np.sqrt(energy[kept]))
    return basis


def log_frf(
    reduced: ReducedStructure,
    placed: Placed,
    terms: Terms,
    theta: Floats,
    values: Floats,
    zeta: float,
) -> Floats:
    """ln|H| (f, k) over the building's grid."""
    system = EffectSystem(reduced, ConstantDamping(), (placed,), (reduce_terms(reduced, terms),))
    grid = torch.from_numpy(reduced.structure.building.frequency_grid.frequencies_hz())
    ratio = torch.tensor([zeta], dtype=torch.float64)
    frf = system.frf(torch.from_numpy(theta[None]), ratio, torch.from_numpy(values[None]), grid)
    return np.asarray(frf[0].abs().log())


def main(samples: int, names: list[str]) -> None:
    """Compare and print."""
    building = load_building("six_story_wall_frame")
    structure, target = structure_of(building), reduction_target(building)
    thetas = theta_prior(building).sample(samples, torch.Generator().manual_seed(7)).numpy()
    rng = np.random.default_rng(1)
    errors: dict[tuple[str, float], list[Floats]] = {}
    for theta in thetas:
        centre = theta * np.exp(_BESIDE * rng.uniform(-1.0, 1.0, theta.shape))
        started = time.perf_counter()
        reduced = local_structure(structure, centre, target)
        print(f"{reduced.model.size} shapes in {time.perf_counter() - started:.0f} s", flush=True)
        for effect in CATALOGUE.values():
            places = effect.places(structure)
            if effect.instrument or not places or (names and effect.name not in names):
                continue
            placed = Placed(effect, str(rng.choice(places)))
            for zeta, error in compare(reduced, placed, theta).items():
                errors.setdefault((effect.name, zeta), []).append(error)
                print(f"  zeta {zeta}: {placed.label}: {spread(error)}", flush=True)
    for (name, zeta), own in errors.items():
        print(f"zeta {zeta}: {name}: {spread(np.array(own))}")


def compare(reduced: ReducedStructure, placed: Placed, theta: Floats) -> dict[float, Floats]:
    """Reduced less full ln|H| (f, k) by damping ratio."""
    structure, effect = reduced.structure, placed.effect
    top = 1.5 * float(structure.building.frequency_grid.frequencies_hz()[-1])
    values = np.array([p.neutral for p in effect.parameters])
    first = effect.parameters[0]
    values[0] += first.scale if first.upper > first.neutral else -first.scale
    terms = effect.terms(structure, placed.place)
    full = full_structure(structure, theta, terms, values[0], top)
    return {
        zeta: log_frf(reduced, placed, terms, theta, values, zeta)
        - log_frf(full, placed, terms, theta, values, zeta)
        for zeta in ZETAS
    }


def spread(error: Floats) -> str:
    """Root mean square and largest absolute value, in words."""
    return f"rms {np.sqrt((error**2).mean()):.4f}, largest {np.abs(error).max():.3f}"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3, sys.argv[2:])
