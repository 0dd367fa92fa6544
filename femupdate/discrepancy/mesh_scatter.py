"""What the correction of a mesh leaves open: errors that all points of an FRF share.

The members of every kind and story are a little stiffer or softer than the mean correction has
them, every natural frequency is a little off by itself, and so is what each floor shows of a mode.
Without the last the ratios of floors are trusted where frequencies are not: stiffness factors of an
unsymmetrical frame were off by 2.4 of their standard deviations (rms).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.mesh_error import MeshError, ShownModes, modes_shown
from femupdate.discrepancy.problem import Problem
from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.dynamics.closed_form import Estimate
from femupdate.dynamics.reduced import ReducedStructure
from femupdate.dynamics.system import Responses, System
from femupdate.effects.effect import Placed


@dataclass(frozen=True, eq=False)
class MeshScatter:
    """What the correction of a mesh leaves open, as changes of ln|H| that all points share.

    Attributes:
        system: the corrected model with its effects and, behind them, those of the mesh error.
        steps: (c, q) one standard deviation of every error, as sizes of the latter.
    """

    system: System
    steps: Tensor

    def __call__(
        self,
        parameters: Tensor,
        frequency_hz: Tensor,
        zeta: Tensor,
        seen: Estimate | None = None,
    ) -> Tensor:
        """Changes of ln|H| (N, c, f, k) at parameters (N, p + q) of the building with its effects.

        Along tangents: a whole step bends at peaks, and data would tell it from stiffness factors.

        Args:
            parameters: stiffness factors, then sizes.
            frequency_hz: (k,).
            zeta: (N,) damping ratios.
            seen: what an estimate makes of FRFs.
        """
        count = len(self.steps)
        part = MESH_ERROR.part
        steps = torch.cat([torch.zeros_like(self.steps[:1]), part * self.steps])
        both = torch.cat(
            [
                parameters.repeat_interleave(count + 1, 0),
                steps.repeat(len(parameters), 1).to(parameters),
            ],
            dim=1,
        )
        ratio = zeta.repeat_interleave(count + 1)
        values = self.system.log_frf(both, ratio, frequency_hz, Responses(seen=seen))
        values = values.reshape(len(parameters), count + 1, *values.shape[1:])
        return (values[:, 1:] - values[:, :1]) / part


def mesh_scatter(reduced: ReducedStructure, system: System, mesh: MeshError) -> MeshScatter:
    """What the correction leaves open of a system on a structure that is `corrected`."""
    terms = (*system.terms, *(reduced.terms(one) for one in mesh.placed))
    wide = System(system.model, system.law, (*system.placed, *mesh.placed), terms)
    return MeshScatter(wide, torch.from_numpy(mesh.steps))


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
        return _About(now.on_fewer(), mesh, placed, theta, zeta, sizes).errors()

    return replace(problem, left_open=left_open)


@dataclass(frozen=True, eq=False)
class _About:
    """A model at given unknowns, about which errors are taken.

    Attributes:
        problem: structure and data.
        mesh: the error.
        placed: the model's effects.
        theta: (1, p); zeta: (1,); sizes: (1, q).
    """

    problem: Problem
    mesh: MeshError
    placed: tuple[Placed, ...]
    theta: Tensor
    zeta: Tensor
    sizes: Tensor

    def errors(self) -> Tensor:
        """One standard deviation of each (c, n), in the unit of the residuals."""
        top_hz = MESH_ERROR.beyond_top * self.problem.top_hz
        modes = modes_shown(self.problem.reduced.model, self.theta[0].numpy(), top_hz)
        parts = [self._members(), *self._frequencies(modes)]
        return torch.cat([*parts, *self._shown(modes)])

    @cached_property
    def _here(self) -> list[Tensor]:
        """Predictions (1, ...) of every kind of data, without any error."""
        return self._predicted(self.problem.reduced)

    def _predicted(self, reduced: ReducedStructure) -> list[Tensor]:
        """The same of a structure in place of the problem's."""
        system = replace(self.problem, reduced=reduced).system(self.placed)
        known = self.theta, self.zeta, self.sizes
        return [data.predicted(system, *known) for data in self.problem.data]

    def _moved(self, predicted: list[Tensor]) -> list[Tensor]:
        """Changes (c, n) of every kind of data."""
        parts = zip(self.problem.data, self._here, predicted, strict=True)
        return [data.moved(here, there) for data, here, there in parts]

    def _members(self) -> Tensor:
        """Changes (c, n) by one error of the members' stiffness after the other."""
        system, count = self.problem.system((*self.placed, *self.mesh.placed)), len(self.mesh.steps)
        both = torch.cat([self.sizes.expand(count, -1), torch.from_numpy(self.mesh.steps)], dim=1)
        known = self.theta.expand(count, -1), self.zeta.expand(count), both
        predicted = [data.predicted(system, *known) for data in self.problem.data]
        return torch.cat(self._moved(predicted), dim=1)

    def _frequencies(self, modes: ShownModes) -> list[Tensor]:
        """Changes (1, n) by one mode's frequency after the other, off by what is left."""
        reduced, more = self.problem.reduced, 2.0 * MESH_ERROR.left_factor * self.mesh.left
        stiffer = (
            _with_stiffness(reduced, more * squared * np.outer(vector, vector))
            for squared, vector in zip(modes.squared, modes.vectors.T, strict=True)
        )
        return [torch.cat(self._moved(self._predicted(one)), dim=1) for one in stiffer]

    def _shown(self, modes: ShownModes) -> list[Tensor]:
        """Errors (1 + f, n) of what the floors show of every mode: of all alike, and of each."""
        reduced, parts = self.problem.reduced, []
        for vector in modes.vectors.T:
            shown = reduced.model.floor_shapes @ vector
            step = MESH_ERROR.step * np.linalg.norm(shown)
            moved = self._moved(self._predicted(_with_shape(reduced, step * vector)))
            parts += self._of_floors([one[0] for one in moved], shown)
        return parts

    def _of_floors(self, moved: list[Tensor], shown: Floats) -> list[Tensor]:
        """Errors (1 + f, n), from changes (n,) when all floors show a step more of a mode.

        Of several kinds of data one after the other: each floor's error is its own in each.
        """
        share = torch.from_numpy(shown / np.linalg.norm(shown))
        scale = MESH_ERROR.left_factor / MESH_ERROR.step
        alone = [
            scale * data.by_floor(one) for data, one in zip(self.problem.data, moved, strict=True)
        ]
        alike = [
            share[list(data.rows)] @ own for data, own in zip(self.problem.data, alone, strict=True)
        ]
        return [
            self.mesh.effect * torch.cat(alike)[None],
            self.mesh.shape * torch.block_diag(*alone),
        ]


def _with_stiffness(reduced: ReducedStructure, more: Floats) -> ReducedStructure:
    constant = reduced.model.stiffness_constant + more
    return replace(reduced, model=replace(reduced.model, stiffness_constant=constant))


def _with_shape(reduced: ReducedStructure, more: Floats) -> ReducedStructure:
    """The structure of which every floor shows more of a mode."""
    rows = reduced.model.floor_shapes
    return replace(reduced, model=replace(reduced.model, floor_shapes=rows + more))


__all__ = ["MeshScatter", "mesh_scatter", "with_mesh_error"]
