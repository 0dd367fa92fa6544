"""Responses of a reduced structure with effects, for many parameter vectors at once.

Undamped modes of the structure with the effects' stiffness, mass and ground flexibility; modal
damping by the building's law; what acts along lines (dampers, appendages) by the receptance
between those lines, which makes modes complex without an eigenproblem of its own (Sherman and
Morrison's formula, frequency by frequency); what the instruments do last of all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from scipy.sparse import csc_matrix
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.effect_modes import Modes, natural, normal_modes, response
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.effect import UNSCALED, Placed, Terms
from femupdate.effects.structure import Structure

_BATCH = 16


@dataclass(frozen=True, eq=False)
class ReducedStructure:
    """A structure seen through a mass-orthonormal basis of r shapes.

    Attributes:
        structure: the full model.
        model: its reduced model.
        basis: (n, r) the shapes.
        rigid_force: (r, 2) force per unit acceleration of base translation and rotation.
        rigid_rows: (f, 2) motion of what the model's rows observe per unit base translation and
            rotation; that of the floors where None.
        known: what effects add, by label, once it was asked for.
        whole: the structure on more shapes whose first these are, or None.
    """

    structure: Structure
    model: ReducedModel
    basis: Floats
    rigid_force: Floats
    rigid_rows: Floats | None = None
    known: dict[str, "ReducedTerms"] = field(default_factory=dict, repr=False)
    whole: "ReducedStructure | None" = None

    def terms(self, placed: Placed) -> "ReducedTerms":
        """What an effect adds."""
        if placed.label not in self.known:
            if self.whole is not None:
                added = self.whole.terms(placed).first(self.model.size)
            else:
                added = reduce_terms(self, placed.effect.terms(self.structure, placed.place))
            self.known[placed.label] = added
        return self.known[placed.label]

    def first(self, count: int) -> "ReducedStructure":
        """The structure on the first shapes of its basis, which count most."""
        if count >= self.model.size:
            return self
        model, own = self.model, slice(count)
        fewer = replace(
            model,
            stiffness_terms=model.stiffness_terms[:, own, own],
            stiffness_constant=model.stiffness_constant[own, own],
            excitation=model.excitation[own],
            floor_shapes=model.floor_shapes[:, own],
            story_inertia=model.story_inertia[:, own],
            story_drift=model.story_drift[:, own],
            node_shapes=None,
        )
        return replace(
            self,
            model=fewer,
            basis=self.basis[:, own],
            rigid_force=self.rigid_force[own],
            known={},
            whole=self,
        )

    @property
    def rigid(self) -> Floats:
        """(f, 2) motion of the rows as on a rigid body."""
        return self.structure.rigid_floors if self.rigid_rows is None else self.rigid_rows


@dataclass(frozen=True, eq=False)
class ReducedTerms:
    """`Terms` of an effect as the reduced structure has them (r coordinates).

    The mass is its matrix (r, r), its force (r, 2) and its rigid part (2, 2).
    """

    stiffness: tuple[tuple[int, Tensor], ...]
    mass: tuple[Tensor, Tensor, Tensor] | None
    flexibility: tuple[float, float]
    pitch: float
    port: tuple[Tensor, Tensor] | None
    constants: tuple[float, ...]

    def first(self, count: int) -> "ReducedTerms":
        """The same in the first coordinates."""
        mass, port, own = self.mass, self.port, slice(count)
        return replace(
            self,
            stiffness=tuple((story, matrix[own, own]) for story, matrix in self.stiffness),
            mass=None if mass is None else (mass[0][own, own], mass[1][own], mass[2]),
            port=None if port is None else (port[0][own], port[1]),
        )


def projected(basis: Floats, matrix: csc_matrix) -> Floats:
    """basis^T matrix basis (r, r), through the rows that the matrix has."""
    by_row = matrix.tocsr()
    rows = np.flatnonzero(np.diff(by_row.indptr))
    own = basis[rows]
    result = own.T @ (by_row[rows][:, rows] @ own)
    return 0.5 * (result + result.T)


def reduce_terms(reduced: ReducedStructure, terms: Terms) -> ReducedTerms:
    """Project what an effect adds onto the basis."""
    basis, mass, port = reduced.basis, None, None
    if terms.mass is not None:
        own = (
            projected(basis, terms.mass.matrix),
            basis.T @ terms.mass.force,
            terms.mass.rigid,
        )
        mass = (torch.from_numpy(own[0]), torch.from_numpy(own[1]), torch.from_numpy(own[2]))
    if terms.port is not None:
        port = (torch.from_numpy(terms.port.row @ basis), torch.from_numpy(terms.port.rigid))
    return ReducedTerms(
        stiffness=tuple(
            (story, torch.from_numpy(projected(basis, own))) for story, own in terms.stiffness
        ),
        mass=mass,
        flexibility=terms.flexibility,
        pitch=terms.pitch,
        port=port,
        constants=terms.constants,
    )


def split_sizes(placed: Sequence[Placed], sizes: Tensor) -> list[Tensor]:
    """The parameters (N, q) of all effects, one after the other, each effect's by themselves."""
    counts = [len(one.effect.parameters) for one in placed]
    return list(sizes.split(counts, dim=1)) if counts else []


def observed(
    placed: Sequence[Placed], floors: tuple[str, ...], frf: Tensor, omega: Tensor, sizes: Tensor
) -> Tensor:
    """FRFs (N, f, k) of the floors at omega (k,), rad/s, as instruments with effects give them."""
    for one, own in zip(placed, split_sizes(placed, sizes), strict=True):
        frf = one.effect.observe(frf, omega, own, one.effect.place_rows(one.place, floors))
    return frf


@dataclass(frozen=True, eq=False)
class EffectSystem:
    """A reduced structure with effects at their places.

    Attributes:
        reduced: the structure.
        law: of the damping.
        placed: the effects.
        terms: of each.
        kept: which columns of the sizes of a larger system are this one's; None for all.
    """

    reduced: ReducedStructure
    law: DampingLaw
    placed: tuple[Placed, ...]
    terms: tuple[ReducedTerms, ...]
    kept: tuple[int, ...] | None = None

    @property
    def sizes(self) -> int:
        """Number of parameters of all effects together."""
        return sum(len(one.effect.parameters) for one in self.placed)

    @property
    def parameters(self) -> int:
        """Number of stiffness factors and of parameters of effects together."""
        return self.reduced.model.parameters + self.sizes

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors, bottom to top."""
        return self.reduced.model.floors

    def frf(self, theta: Tensor, zeta: Tensor, sizes: Tensor, frequency_hz: Tensor) -> Tensor:
        """Complex FRFs (N, f, k) of all floors as their sensors give them.

        Args:
            theta: (N, p) stiffness factors.
            zeta: (N,) damping ratio.
            sizes: (N, q) the parameters of the effects, one after the other.
            frequency_hz: (k,).
        """
        parts = []
        for start in range(0, len(theta), _BATCH):
            rows = slice(start, start + _BATCH)
            parts.append(self._batch(theta[rows], zeta[rows], sizes[rows], frequency_hz))
        return torch.cat(parts)

    def modes(self, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Modes:
        """Undamped modes with the effects, lowest first."""
        return self._modes(theta, zeta, self._split(sizes))

    def ratio(self, omega: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """Damping ratios (N, m) of modes omega (N, m), rad/s, with the effects."""
        return self._ratio(omega, zeta, self._split(sizes))

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor) -> Tensor:
        """FRFs (N, f, k) at omega (k,), rad/s, as their sensors give them."""
        return observed(self.placed, self.floors, frf, omega, sizes)

    def at_level(
        self, theta: Tensor, zeta: Tensor, sizes: Tensor, level: float
    ) -> tuple[Tensor, Tensor]:
        """Stiffness factors and damping ratios at a level of motion (see `Effect`)."""
        if level == 0.0:
            return theta, zeta
        stories = self.reduced.structure.building.story_names
        for one, own in zip(self.placed, self._split(sizes), strict=True):
            story = stories.index(one.place) if one.place in stories else None
            theta, zeta = one.effect.at_level(theta, zeta, own, level, story)
        return theta, zeta

    def _split(self, sizes: Tensor) -> list[Tensor]:
        return split_sizes(self.placed, sizes)

    def _batch(self, theta: Tensor, zeta: Tensor, sizes: Tensor, frequency_hz: Tensor) -> Tensor:
        own = self._split(sizes)
        modes = self._modes(theta, zeta, own)
        omega = 2.0 * torch.pi * frequency_hz.to(torch.float64)
        frf = response(modes, omega, self._port_stiffness(own, omega))
        return self.observe(frf, omega, sizes)

    def _port_stiffness(self, own: Sequence[Tensor], omega: Tensor) -> list[Tensor]:
        return [
            one.effect.port_stiffness(omega, size, terms.constants)
            for one, terms, size in zip(self.placed, self.terms, own, strict=True)
            if terms.port is not None
        ]

    def _modes(self, theta: Tensor, zeta: Tensor, own: Sequence[Tensor]) -> Modes:
        stiffness, mass, force, rigid_mass = self._matrices(theta, own)
        flexibility = self._flexibility(own, theta)
        pitch = theta.new_zeros(len(theta))
        for terms, size in zip(self.terms, own, strict=True):
            if terms.pitch:
                pitch = pitch + terms.pitch * size[:, 0]
        base = torch.stack([torch.ones_like(pitch), pitch], dim=1)  # motion per unit translation
        outputs, rigid = self._outputs()
        outputs = outputs.expand(len(theta), -1, -1)
        load = torch.einsum("nrb,nb->nr", force, base)
        if flexibility is not None:
            root = flexibility.sqrt()  # (N, 2)
            stiffness, mass = _on_flexible_base(stiffness, mass, force, rigid_mass, root)
            on_base = root * torch.einsum("nab,nb->na", rigid_mass, base)
            load = torch.cat([load, on_base], dim=1)
            outputs = torch.cat([outputs, rigid * root[:, None, :]], dim=2)
        seen, inverse = normal_modes(stiffness, mass, torch.cat([outputs, load[:, None]], dim=1))
        ratio = self._ratio(natural(inverse), zeta, own)
        direct = torch.einsum("ob,nb->no", rigid, base)
        floors = len(self.reduced.model.floors)
        return Modes(inverse, ratio, seen[:, :-1], seen[:, -1], direct, floors)

    def _ratio(self, omega: Tensor, zeta: Tensor, own: Sequence[Tensor]) -> Tensor:
        ratio = self.law.ratio(omega, zeta)
        for one, terms, size in zip(self.placed, self.terms, own, strict=True):
            ratio = one.effect.damping(ratio, omega, size, terms.constants)
        return ratio

    def _matrices(
        self, theta: Tensor, own: Sequence[Tensor]
    ) -> tuple[Tensor, Tensor | None, Tensor, Tensor]:
        """K (N, r, r), M (N, r, r) or None for the identity, forces (N, r, 2), mass (N, 2, 2)."""
        model = self.reduced.model
        count, size = len(theta), model.size
        terms = torch.from_numpy(model.stiffness_terms).reshape(model.parameters, -1)
        stiffness = torch.from_numpy(model.stiffness_constant) + (theta @ terms).reshape(
            count, size, size
        )
        force = torch.from_numpy(self.reduced.rigid_force).expand(count, -1, -1)
        rigid = torch.from_numpy(self.reduced.structure.rigid_mass).expand(count, -1, -1)
        mass = None
        for added, values in zip(self.terms, own, strict=True):
            for story, matrix in added.stiffness:
                factor = values[:, 0] if story == UNSCALED else values[:, 0] * theta[:, story]
                stiffness = stiffness + factor[:, None, None] * matrix
            if added.mass is not None:
                mass = torch.eye(size, dtype=theta.dtype) if mass is None else mass
                weight = values[:, 0, None, None]
                matrix, more_force, more_rigid = added.mass
                mass = mass + weight * matrix
                force = force + weight * more_force
                rigid = rigid + weight * more_rigid
        return stiffness, mass, force, rigid

    def _flexibility(self, own: Sequence[Tensor], theta: Tensor) -> Tensor | None:
        """(N, 2) of the ground, or None where it is rigid."""
        total = None
        for terms, size in zip(self.terms, own, strict=True):
            if any(terms.flexibility):
                unit = theta.new_tensor(terms.flexibility)
                total = (0.0 if total is None else total) + size[:, :1].clamp_min(0.0) * unit
        return total

    def _outputs(self) -> tuple[Tensor, Tensor]:
        """Rows (o, r) and (o, 2) of floors and ports."""
        rows = [torch.from_numpy(self.reduced.model.floor_shapes)]
        rigid = [torch.from_numpy(self.reduced.rigid)]
        for terms in self.terms:
            if terms.port is not None:
                rows.append(terms.port[0][None])
                rigid.append(terms.port[1][None])
        return torch.cat(rows), torch.cat(rigid)


def _on_flexible_base(
    stiffness: Tensor, mass: Tensor | None, force: Tensor, rigid: Tensor, root: Tensor
) -> tuple[Tensor, Tensor]:
    """Add the base's own motion, scaled so that its springs are of unit stiffness."""
    count, size = stiffness.shape[0], stiffness.shape[1]
    eye = torch.eye(size + 2, dtype=stiffness.dtype).expand(count, -1, -1)
    wide_stiffness, wide_mass = eye.clone(), eye.clone()
    wide_stiffness[:, :size, :size] = stiffness
    if mass is not None:
        wide_mass[:, :size, :size] = mass
    coupling = force * root[:, None, :]
    wide_mass[:, :size, size:] = coupling
    wide_mass[:, size:, :size] = coupling.mT
    wide_mass[:, size:, size:] = rigid * root[:, :, None] * root[:, None, :]
    return wide_stiffness, wide_mass
