"""Responses of a reduced structure with effects, for many parameter vectors at once.

Undamped modes of the structure with the effects' stiffness, mass and ground flexibility; modal
damping by the building's law; what acts along lines (dampers, appendages) by the receptance
between those lines, which makes modes complex without an eigenproblem of its own (Sherman and
Morrison's formula, frequency by frequency); what the instruments do last of all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.effect import UNSCALED, AddedMass, Placed, Terms
from femupdate.effects.structure import Structure

Floats = NDArray[np.float64]
_BATCH = 16
_SERIES = 3
_TOP = 2.0  # modes above this many times the grid's top enter by their power series


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
    """

    structure: Structure
    model: ReducedModel
    basis: Floats
    rigid_force: Floats
    rigid_rows: Floats | None = None

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


def reduce_terms(reduced: ReducedStructure, terms: Terms) -> ReducedTerms:
    """Project what an effect adds onto the basis."""
    basis = reduced.basis

    def onto(matrix: object) -> Tensor:
        projected = basis.T @ (matrix @ basis)  # type: ignore[operator]
        return torch.from_numpy(0.5 * (projected + projected.T))

    def onto_left(force: Floats) -> Tensor:
        return torch.from_numpy(basis.T @ force)

    def rigid(added: AddedMass) -> Tensor:
        return torch.from_numpy(added.rigid)

    mass = terms.mass
    return ReducedTerms(
        stiffness=tuple((story, onto(matrix)) for story, matrix in terms.stiffness),
        mass=None
        if mass is None
        else (
            onto(mass.matrix),
            torch.from_numpy(basis.T @ mass.force),
            torch.from_numpy(mass.rigid),
        ),
        flexibility=terms.flexibility,
        pitch=terms.pitch,
        port=None
        if terms.port is None
        else (torch.from_numpy(terms.port.row @ basis), torch.from_numpy(terms.port.rigid)),
        constants=terms.constants,
    )


@dataclass(frozen=True, eq=False)
class EffectSystem:
    """A reduced structure with effects at their places.

    Attributes:
        reduced: the structure.
        law: of the damping.
        placed: the effects.
        terms: of each.
    """

    reduced: ReducedStructure
    law: DampingLaw
    placed: tuple[Placed, ...]
    terms: tuple[ReducedTerms, ...]

    @property
    def sizes(self) -> int:
        """Number of parameters of all effects together."""
        return sum(len(one.effect.parameters) for one in self.placed)

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

    def modes(self, theta: Tensor, zeta: Tensor, sizes: Tensor) -> "Modes":
        """Undamped modes with the effects, lowest first."""
        return self._modes(theta, zeta, self._split(sizes))

    def _split(self, sizes: Tensor) -> list[Tensor]:
        counts = [len(one.effect.parameters) for one in self.placed]
        return list(sizes.split(counts, dim=1)) if counts else []

    def _batch(self, theta: Tensor, zeta: Tensor, sizes: Tensor, frequency_hz: Tensor) -> Tensor:
        own = self._split(sizes)
        modes = self._modes(theta, zeta, own)
        omega = 2.0 * torch.pi * frequency_hz.to(torch.float64)
        frf = _floor_response(modes, omega, self._port_stiffness(own, omega))
        floors = self.reduced.model.floors
        for one, size in zip(self.placed, own, strict=True):
            frf = one.effect.observe(frf, omega, size, one.effect.place_rows(one.place, floors))
        return frf

    def _port_stiffness(self, own: Sequence[Tensor], omega: Tensor) -> list[Tensor]:
        return [
            one.effect.port_stiffness(omega, size, terms.constants)
            for one, terms, size in zip(self.placed, self.terms, own, strict=True)
            if terms.port is not None
        ]

    def _modes(self, theta: Tensor, zeta: Tensor, own: Sequence[Tensor]) -> "Modes":
        stiffness, mass, force, rigid_mass = self._matrices(theta, own)
        flexibility = self._flexibility(own, theta)
        pitch = theta.new_zeros(len(theta))
        for terms, size in zip(self.terms, own, strict=True):
            if terms.pitch:
                pitch = pitch + terms.pitch * size[:, 0]
        base = torch.stack([torch.ones_like(pitch), pitch], dim=1)  # motion per unit translation
        outputs, rigid = self._outputs(len(theta))
        if flexibility is None:
            load = torch.einsum("nrb,nb->nr", force, base)
            shapes, inverse = _normal_modes(stiffness, mass)
            rows = outputs @ shapes
        else:
            root = flexibility.sqrt()  # (N, 2)
            stiffness, mass = _on_flexible_base(stiffness, mass, force, rigid_mass, root)
            load = torch.einsum("nrb,nb->nr", force, base)
            load_base = root * torch.einsum("nab,nb->na", rigid_mass, base)
            load = torch.cat([load, load_base], dim=1)
            shapes, inverse = _normal_modes(stiffness, mass)
            wide = torch.cat(
                [outputs.expand(len(theta), -1, -1), rigid[None] * root[:, None, :]], dim=2
            )
            rows = wide @ shapes
        ratio = self.law.ratio(inverse.clamp_min(1e-30).rsqrt(), zeta)
        for one, terms, size in zip(self.placed, self.terms, own, strict=True):
            natural = inverse.clamp_min(1e-30).rsqrt()
            ratio = one.effect.damping(ratio, natural, size, terms.constants)
        direct = torch.einsum("ob,nb->no", rigid, base)
        participation = torch.einsum("nrm,nr->nm", shapes, load)
        return Modes(inverse, ratio, rows, participation, direct, len(self.reduced.model.floors))

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

    def _outputs(self, count: int) -> tuple[Tensor, Tensor]:
        """Rows (o, r) and (o, 2) of floors and ports."""
        rows = [torch.from_numpy(self.reduced.model.floor_shapes)]
        rigid = [torch.from_numpy(self.reduced.rigid)]
        for terms in self.terms:
            if terms.port is not None:
                rows.append(terms.port[0][None])
                rigid.append(terms.port[1][None])
        return torch.cat(rows), torch.cat(rigid)


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of unit modal stiffness, m of them.

    Attributes:
        inverse: (N, m) 1 / omega^2, largest first.
        ratio: (N, m) damping ratios.
        rows: (N, o, m) displacement of floors and, after them, ports.
        participation: (N, m) modal force per unit base acceleration.
        direct: (N, o) rigid motion of floors and ports per unit base translation.
        floors: how many of the rows are floors.
    """

    inverse: Tensor
    ratio: Tensor
    rows: Tensor
    participation: Tensor
    direct: Tensor
    floors: int

    @property
    def frequency_hz(self) -> Tensor:
        """(N, m) natural frequencies."""
        return self.inverse.clamp_min(1e-30).rsqrt() / (2.0 * torch.pi)


def _normal_modes(stiffness: Tensor, mass: Tensor | None) -> tuple[Tensor, Tensor]:
    """Shapes (N, r, m) of unit modal stiffness and 1 / omega^2 (N, m), largest first."""
    if mass is None:
        squared, vectors = torch.linalg.eigh(stiffness)
        return vectors * squared.rsqrt()[:, None, :], 1.0 / squared
    factor = torch.linalg.cholesky(stiffness)
    half = torch.linalg.solve_triangular(factor, mass, upper=False)
    flexibility = torch.linalg.solve_triangular(factor, half.mT, upper=False)
    inverse, vectors = torch.linalg.eigh(0.5 * (flexibility + flexibility.mT))
    shapes = torch.linalg.solve_triangular(factor.mT, vectors, upper=True)
    return shapes.flip(-1), inverse.flip(-1).clamp_min(0.0)


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


def _floor_response(modes: Modes, omega: Tensor, port_stiffness: list[Tensor]) -> Tensor:
    """Complex FRFs (N, f, k): absolute acceleration over base acceleration."""
    floors = modes.floors
    ports = modes.rows[:, floors:]
    columns = torch.cat([modes.participation[:, :, None], ports.mT], dim=2)  # (N, m, 1 + j)
    dynamic = _modal_receptance(modes, omega)
    flexible = _receptance(modes, columns, omega, dynamic)
    squared = omega**2
    frf = modes.direct[:, :floors, None] + squared * flexible[:, :floors, 0]
    if not port_stiffness:
        return frf
    stiffness = torch.stack(port_stiffness, dim=-1).to(frf.dtype)  # (N, k, j)
    # Absolute displacement of the ports per unit base acceleration, without the ports' forces.
    free = -(flexible[:, floors:, 0] + modes.direct[:, floors:, None] / squared)
    between = flexible[:, floors:, 1:].permute(0, 3, 1, 2)  # (N, k, j, j)
    eye = torch.eye(ports.shape[1], dtype=frf.dtype)
    system = eye + between * stiffness[:, :, None, :]
    moved = torch.linalg.solve(system, free.permute(0, 2, 1)[..., None])[..., 0]
    forces = -(stiffness * moved)  # (N, k, j), what the ports do to the structure
    to_floors = flexible[:, :floors, 1:].permute(0, 3, 1, 2)
    added = (to_floors @ forces[..., None])[..., 0].permute(0, 2, 1)
    return frf - squared * added


def _modal_receptance(modes: Modes, omega: Tensor) -> tuple[Tensor, int]:
    """1 / (1 - mu w^2 + 2 i zeta sqrt(mu) w) (N, d, k) of the d modes that can resonate."""
    top = _TOP * float(omega[-1])
    dynamic = max(1, int((modes.inverse > top**-2).sum(dim=1).max()))
    inverse, ratio = modes.inverse[:, :dynamic, None], modes.ratio[:, :dynamic, None]
    share = torch.complex(1.0 - inverse * omega**2, 2.0 * ratio * inverse.sqrt() * omega)
    return 1.0 / share, dynamic


def _receptance(
    modes: Modes, columns: Tensor, omega: Tensor, dynamic: tuple[Tensor, int]
) -> Tensor:
    """Displacement (N, o, c, k) of the rows per unit force of the columns."""
    response, count = dynamic
    rows = modes.rows.to(response.dtype)
    parts = []
    for c in range(columns.shape[2]):
        column = columns[:, :, c]
        total = rows[:, :, :count] @ (column[:, :count, None] * response)
        series = torch.stack(
            [column[:, count:] * modes.inverse[:, count:] ** k for k in range(_SERIES)], dim=-1
        )
        powers = torch.stack([omega ** (2 * k) for k in range(_SERIES)])
        total = total + (modes.rows[:, :, count:] @ series) @ powers
        parts.append(total)
    return torch.stack(parts, dim=2)
