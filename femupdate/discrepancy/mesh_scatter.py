"""What the correction of a mesh leaves open: errors that all points of an FRF share.

The members of every kind and story are a little stiffer or softer than the mean correction has
them, and every natural frequency is a little off by itself.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from femupdate.discrepancy.mesh_error import MeshError, modes_shown
from femupdate.discrepancy.problem import Problem
from femupdate.dynamics.effect_modal import effect_log_frf
from femupdate.dynamics.effect_response import EffectSystem, ReducedStructure
from femupdate.effects.effect import Placed

Floats = NDArray[np.float64]
_LEFT = 2.0  # times what the mean correction leaves at the theta that it was learned from


@dataclass(frozen=True, eq=False)
class MeshScatter:
    """What the correction of a mesh leaves open, as changes of ln|H| that all points share.

    Attributes:
        system: the corrected model with its effects and, behind them, those of the mesh error.
        steps: (c, q) one standard deviation of every error, as sizes of the latter.
    """

    system: EffectSystem
    steps: Tensor

    def __call__(
        self,
        parameters: Tensor,
        frequency_hz: Tensor,
        zeta: Tensor,
        seen: Callable[[Tensor], Tensor] | None = None,
    ) -> Tensor:
        """Changes of ln|H| (N, c, f, k) at parameters (N, p + q) of the building with its effects.

        Args:
            parameters: stiffness factors, then sizes.
            frequency_hz: (k,).
            zeta: (N,) damping ratios.
            seen: what an estimate makes of FRFs.
        """
        count = len(self.steps)
        steps = torch.cat([torch.zeros_like(self.steps[:1]), self.steps])
        both = torch.cat(
            [
                parameters.repeat_interleave(count + 1, 0),
                steps.repeat(len(parameters), 1).to(parameters),
            ],
            dim=1,
        )
        ratio = zeta.repeat_interleave(count + 1)
        values = effect_log_frf(self.system, both, frequency_hz, ratio, seen)
        values = values.reshape(len(parameters), count + 1, *values.shape[1:])
        return values[:, 1:] - values[:, :1]


def mesh_scatter(system: EffectSystem, mesh: MeshError) -> MeshScatter:
    """What the correction leaves open of a system whose structure is `corrected`."""
    placed = (*system.placed, *mesh.placed)
    terms = tuple(system.reduced.terms(one) for one in placed)
    return MeshScatter(
        EffectSystem(system.reduced, system.law, placed, terms), torch.from_numpy(mesh.steps)
    )


def with_mesh_error(problem: Problem, mesh: MeshError) -> Problem:
    """The problem of the corrected model, with what the correction leaves open.

    Args:
        problem: of the corrected model.
        mesh: the error.
    """

    def left_open(
        now: Problem, placed: tuple[Placed, ...], theta: Tensor, zeta: Tensor, sizes: Tensor
    ) -> Tensor:
        # Of changes this small fewer shapes tell enough.
        now = now.on_fewer()
        here = now.predicted(now.system(placed), theta, zeta, sizes)
        both = _member_by_member(now, mesh, placed, theta, zeta, sizes)
        alone = _mode_by_mode(now, mesh, placed, theta, zeta, sizes)
        return now.moved(here, torch.cat([both, *alone]))

    return replace(problem, left_open=left_open)


def _member_by_member(
    problem: Problem,
    mesh: MeshError,
    placed: tuple[Placed, ...],
    theta: Tensor,
    zeta: Tensor,
    sizes: Tensor,
) -> Tensor:
    """FRFs (c, f, k) with one error of the members' stiffness after the other."""
    system, count = problem.system((*placed, *mesh.placed)), len(mesh.steps)
    both = torch.cat([sizes.expand(count, -1), torch.from_numpy(mesh.steps)], dim=1)
    return problem.predicted(system, theta.expand(count, -1), zeta.expand(count), both)


def _mode_by_mode(
    problem: Problem,
    mesh: MeshError,
    placed: tuple[Placed, ...],
    theta: Tensor,
    zeta: Tensor,
    sizes: Tensor,
) -> list[Tensor]:
    """FRFs (1, f, k) with one mode's frequency or effect after the other off by what is left."""
    reduced, parts = problem.reduced, []
    modes = modes_shown(reduced, theta[0].numpy(), float(problem.frequency_hz.max()))
    for squared, vector in zip(modes.squared, modes.vectors.T, strict=True):
        unit = np.outer(vector, vector)
        for changed in (
            _with_stiffness(reduced, 2.0 * _LEFT * mesh.left * squared * unit),
            _with_effect(reduced, _LEFT * mesh.effect * unit),
        ):
            system = replace(problem, reduced=changed).system(placed)
            parts.append(problem.predicted(system, theta, zeta, sizes))
    return parts


def _with_stiffness(reduced: ReducedStructure, more: Floats) -> ReducedStructure:
    constant = reduced.model.stiffness_constant + more
    return replace(reduced, model=replace(reduced.model, stiffness_constant=constant))


def _with_effect(reduced: ReducedStructure, more: Floats) -> ReducedStructure:
    """The structure whose floors show more of a mode."""
    rows = reduced.model.floor_shapes
    return replace(reduced, model=replace(reduced.model, floor_shapes=rows + rows @ more))


__all__ = ["MeshScatter", "mesh_scatter", "with_mesh_error"]
