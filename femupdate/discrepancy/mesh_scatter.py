"""What the correction of a mesh leaves open: errors of the model that all points of the data share.

The members of every kind and story are a little stiffer or softer than the mean correction has
them, every natural frequency is a little off by itself, and so is what each floor shows of a mode.
Without the last the ratios of floors are trusted where frequencies are not: stiffness factors of an
unsymmetrical frame were off by 2.4 of their standard deviations (rms).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.mesh_error import MeshError, MeshModes, modes_shown
from femupdate.discrepancy.thresholds import FIT, MESH_ERROR
from femupdate.dynamics.reduced import ReducedStructure, first_coordinates
from femupdate.dynamics.system import System
from femupdate.effects.effect import Terms
from femupdate.inference.data import Data
from femupdate.inference.frf_data import FrfData
from femupdate.inference.parameters import Values

_BENDS = 0.7  # ln|H| by known errors, from which a point is no straight line: half of |H|
_BENT = 10.0  # standard deviation of such a point by itself, of that


@dataclass(frozen=True, eq=False)
class OpenMesh:
    """The errors that a corrected mesh leaves open, as `inference.likelihood.KnownErrors`.

    Attributes:
        mesh: the error.
        terms: of the effects that stand for it, on the basis of the corrected model.
        by_modes: whether single modes err beside the members. Else a point that these change by
            too much for a straight line errs by itself: at the bottom of an anti-resonance a
            thousandth of the frequency multiplies |H|, and one point would tell what no other does.
    """

    mesh: MeshError
    terms: tuple[Terms, ...]
    by_modes: bool = False

    def __call__(self, data: Sequence[Data], system: System, values: Values) -> Tensor:
        """One standard deviation of every error (c, n), in the unit of the residuals.

        Args:
            data: all that was measured.
            system: the corrected model with its effects.
            values: one set of parameters, about which errors are taken.
        """
        if not self.by_modes:
            members = self._members(data, system, self.terms, values)
            return torch.cat([torch.cat(members, dim=1), of_points_that_bend(data, members)])
        # Of changes this small fewer shapes tell enough.
        count = min(FIT.fewer_shapes, system.model.size)
        own, terms = (
            tuple(first_coordinates(one, count) for one in some)
            for some in (system.terms, self.terms)
        )
        few = replace(system, model=system.model.first(count), terms=own)
        top_hz = MESH_ERROR.beyond_top * max(one.top_hz for one in data)
        modes = modes_shown(few.model, values.theta[0].numpy(), top_hz)
        here = _predicted(data, few, values)
        return torch.cat(
            [
                torch.cat(self._members(data, few, terms, values), dim=1),
                *self._frequencies(data, few, values, here, modes),
                *self._shown(data, few, values, here, modes),
            ]
        )

    def _members(
        self, data: Sequence[Data], system: System, terms: tuple[Terms, ...], values: Values
    ) -> list[Tensor]:
        """Changes (c, n) of every kind of data by one error of the members after the other.

        Along tangents: a whole step bends at peaks, and data would tell it from stiffness factors.
        """
        steps = torch.from_numpy(MESH_ERROR.part * self.mesh.steps)
        steps, count = torch.cat([torch.zeros_like(steps[:1]), steps]), len(steps) + 1
        placed = (*system.placed, *self.mesh.placed)
        wide = replace(system, placed=placed, terms=(*system.terms, *terms))
        both = Values(
            values.theta.expand(count, -1),
            values.zeta.expand(count),
            torch.cat([values.sizes.expand(count, -1), steps], dim=1),
        )
        found = _predicted(data, wide, both)
        parts = zip(data, found, strict=True)
        return [one.moved(all_[:1], all_[1:]) / MESH_ERROR.part for one, all_ in parts]

    def _frequencies(
        self,
        data: Sequence[Data],
        system: System,
        values: Values,
        here: list[Tensor],
        modes: MeshModes,
    ) -> Iterator[Tensor]:
        """Changes (1, n) by one mode's frequency after the other, off by what is left."""
        model, more = system.model, 2.0 * MESH_ERROR.left_factor * self.mesh.left
        for squared, vector in zip(modes.squared, modes.vectors.T, strict=True):
            stiffer = model.stiffness_constant + more * squared * np.outer(vector, vector)
            other = replace(system, model=replace(model, stiffness_constant=stiffer))
            yield torch.cat(_moved(data, here, _predicted(data, other, values)), dim=1)

    def _shown(
        self,
        data: Sequence[Data],
        system: System,
        values: Values,
        here: list[Tensor],
        modes: MeshModes,
    ) -> Iterator[Tensor]:
        """Errors (1 + f, n) of what the floors show of every mode: of all alike, and of each."""
        model = system.model
        for vector in modes.vectors.T:
            shown = model.floor_shapes @ vector
            step = MESH_ERROR.step * np.linalg.norm(shown)
            shapes = model.floor_shapes + step * vector
            other = replace(system, model=replace(model, floor_shapes=shapes))
            moved = _moved(data, here, _predicted(data, other, values))
            yield from self._of_floors(data, [one[0] for one in moved], shown)

    def _of_floors(
        self, data: Sequence[Data], moved: list[Tensor], shown: Floats
    ) -> tuple[Tensor, Tensor]:
        """Errors (1, n) and (f, n), from changes (n,) when all floors show a step more of a mode.

        Of several kinds of data one after the other: each floor's error is its own in each.
        """
        share = torch.from_numpy(shown / np.linalg.norm(shown))
        scale = MESH_ERROR.left_factor / MESH_ERROR.step
        alone = [scale * one.by_floor(own) for one, own in zip(data, moved, strict=True)]
        alike = [share[list(one.rows)] @ own for one, own in zip(data, alone, strict=True)]
        return (
            self.mesh.effect * torch.cat(alike)[None],
            self.mesh.shape * torch.block_diag(*alone),
        )


def left_open(mesh: MeshError, reduced: ReducedStructure, *, by_modes: bool = False) -> OpenMesh:
    """What is left open of a structure that is `corrected`."""
    return OpenMesh(mesh, tuple(reduced.terms(one) for one in mesh.placed), by_modes)


def _predicted(data: Sequence[Data], system: System, values: Values) -> list[Tensor]:
    return [one.predicted(system, values.theta, values.zeta, values.sizes) for one in data]


def _moved(data: Sequence[Data], from_: list[Tensor], to: list[Tensor]) -> list[Tensor]:
    """Changes (c, n) of every kind of data."""
    return [one.moved(*both) for one, *both in zip(data, from_, to, strict=True)]


def of_points_that_bend(data: Sequence[Data], known: list[Tensor]) -> Tensor:
    """An error (c, n) for every point of FRFs that the known ones change by too much for a line."""
    found = []
    for one, changes in zip(data, known, strict=True):
        size = changes.square().sum(0).sqrt()
        if not isinstance(one, FrfData):
            found.append(changes.new_zeros(0, len(size)))
            continue
        root = one.weight.sqrt().flatten().to(size)
        root = root.repeat(len(size) // len(root))
        (bent,) = ((size > _BENDS * root) & (root > 0.0)).nonzero(as_tuple=True)
        own = changes.new_zeros(len(bent), len(size))
        own[torch.arange(len(bent)), bent] = _BENT * size[bent]
        found.append(own)
    return torch.block_diag(*found)


__all__ = ["OpenMesh", "left_open"]
