"""What the correction of a mesh leaves open: errors that all points of an FRF share.

The members of every kind and story are a little stiffer or softer than the mean correction has
them, every natural frequency is a little off by itself, and so is what each floor shows of a mode.
Without the last the ratios of floors are trusted where frequencies are not: stiffness factors of an
unsymmetrical frame were off by 2.4 of their standard deviations (rms).
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
_BEYOND = 1.25  # times the highest frequency: modes that far above it show in the responses, too
_STEP = 0.01  # of what the floors show of a mode, for differences
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
        members = _member_by_member(now, mesh, placed, theta, zeta, sizes)
        top_hz = _BEYOND * float(now.frequency_hz.max())
        modes = modes_shown(now.reduced, theta[0].numpy(), top_hz)

        def predicted(changed: ReducedStructure) -> Tensor:
            return now.predicted(replace(now, reduced=changed).system(placed), theta, zeta, sizes)

        more = 2.0 * _LEFT * mesh.left
        frequencies = [
            predicted(_with_stiffness(now.reduced, more * squared * np.outer(vector, vector)))
            for squared, vector in zip(modes.squared, modes.vectors.T, strict=True)
        ]
        parts = [now.moved(here, torch.cat([members, *frequencies]))]
        for vector in modes.vectors.T:
            shown = now.reduced.model.floor_shapes @ vector
            step = _STEP * np.linalg.norm(shown)
            moved = now.moved(here, predicted(_with_shape(now.reduced, step * vector)))
            parts.append(_as_shown(now, mesh, moved[0], shown))
        return torch.cat(parts)

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


def _as_shown(problem: Problem, mesh: MeshError, moved: Tensor, shown: Floats) -> Tensor:
    """Errors (1 + f, n) of what the floors show of a mode: of all alike, and of one by itself.

    Args:
        problem: structure and data.
        mesh: the error.
        moved: (n,) by what all floors show changed by the same amount, `_STEP` of its norm.
        shown: (floors,) what they show.
    """
    rows = list(problem.rows)
    each = moved.reshape(-1, len(rows), problem.sd.shape[1])
    alone = torch.eye(len(rows)).to(each)[:, None, :, None] * each
    alone = alone.flatten(1) * (_LEFT / _STEP)
    share = torch.from_numpy(shown / np.linalg.norm(shown))[rows]
    return torch.cat([mesh.effect * (share @ alone)[None], mesh.shape * alone])


def _with_stiffness(reduced: ReducedStructure, more: Floats) -> ReducedStructure:
    constant = reduced.model.stiffness_constant + more
    return replace(reduced, model=replace(reduced.model, stiffness_constant=constant))


def _with_shape(reduced: ReducedStructure, more: Floats) -> ReducedStructure:
    """The structure of which every floor shows more of a mode."""
    rows = reduced.model.floor_shapes
    return replace(reduced, model=replace(reduced.model, floor_shapes=rows + more))


__all__ = ["MeshScatter", "mesh_scatter", "with_mesh_error"]
