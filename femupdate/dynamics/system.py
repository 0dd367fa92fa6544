"""A reduced structure with a sum of effects on it, for many parameter vectors at once.

A building without effects is the empty sum. Undamped modes of the structure with the effects'
stiffness, mass and ground flexibility; modal damping by the building's law; what acts along lines
(dampers, appendages) by the receptance between those lines, which makes modes complex without an
eigenproblem of its own (Sherman and Morrison's formula, frequency by frequency); what the
instruments do last of all.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import pad

from femupdate.dynamics.damping import ConstantDamping, DampingLaw
from femupdate.dynamics.excitation import BASE_MOTION, Excitation
from femupdate.dynamics.force_response import RestFlexibility
from femupdate.dynamics.modes import ModalData, Modes, joined, keep_modes, normal_modes, response
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.effect import (
    ALL_STORIES,
    UNSCALED,
    EffectParameter,
    Placed,
    Terms,
    observed,
    split_sizes,
)
from femupdate.errors import brief

Sample = tuple[Tensor, Tensor, Tensor]
"""theta (N, p), zeta (N,) and sizes (N, q)."""
_BATCH = 16  # responses of a hundred shapes at a few hundred frequencies stay in the cache


class Estimate(Protocol):
    """What an estimate makes of complex FRFs (N, f, e)."""

    @property
    def inputs(self) -> int:
        """Columns of the base's motion that were measured (see `Excitation`)."""

    def __call__(self, *frf: Tensor) -> Tensor:
        """(N, f, k) as measured, from the FRFs to each of these."""


@dataclass(frozen=True, eq=False)
class Rows:
    """What is observed of a motion."""

    shapes: Tensor  # (o, r) or (N, o, r) per unit coordinate
    rigid: Tensor  # (o, 3) or (N, o, 3) per unit of each column of the base's motion


@dataclass(frozen=True, kw_only=True)
class Responses:
    """How ln|H| is made."""

    # kept for a response; all where None, which makes responses smooth in theta: which modes are
    # kept changes from place to place
    modes: int | None = None
    # of the sum over the modes; they are always solved in float64. float32 takes half the time and
    # moves a log likelihood by a few thousandths.
    precision: torch.dtype = torch.float64
    floors: tuple[int, ...] | None = None  # whose responses are wanted; all where None
    # what an estimate makes of complex FRFs, before the logarithm is taken
    seen: Estimate | None = None


@dataclass(frozen=True, eq=False)
class System:
    """A reduced model with effects at their places.

    >>> import femupdate, torch
    >>> system = femupdate.reduce("house", "shear_3dof").system
    >>> theta = torch.ones(2, 3, dtype=torch.float64)
    >>> zeta = torch.tensor([0.01, 0.02], dtype=torch.float64)
    >>> frequency_hz = torch.linspace(0.5, 10.0, 20, dtype=torch.float64)
    >>> system.log_frf(theta, zeta, frequency_hz).shape  # draws, floors, points
    torch.Size([2, 3, 20])
    """

    __repr__ = brief

    model: ReducedModel  # the reduced model
    law: DampingLaw = field(default_factory=ConstantDamping)  # of the damping
    placed: tuple[Placed, ...] = ()  # the effects; none by default
    terms: tuple[Terms, ...] = ()  # of each, on the model's basis

    @property
    def factors(self) -> int:
        """Number of stiffness factors."""
        return self.model.parameters

    @property
    def sizes(self) -> int:
        """Number of parameters of all effects together."""
        return sum(len(listed.effect.parameters) for listed in self.placed)

    @property
    def parameters(self) -> int:
        """Number of stiffness factors and of parameters of effects together."""
        return self.factors + self.sizes

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors, bottom to top."""
        return self.model.floors

    @property
    def crosses(self) -> bool:
        """Whether floors follow the base's motion across."""
        return self.model.across is not None

    @property
    def complex_modes(self) -> bool:
        """Whether something acts along lines, so that modes are complex."""
        ports = any(terms.port is not None for terms in self.terms)
        return ports or self.model.dashpots is not None

    def split(self, parameters: Tensor) -> tuple[Tensor, Tensor]:
        """Stiffness factors (N, p) and sizes (N, q) of parameters (N, p + q)."""
        return parameters[:, : self.factors], parameters[:, self.factors :]

    def respond(
        self,
        excitation: Excitation,
        theta: Tensor,
        zeta: Tensor,
        sizes: Tensor,
        frequency_hz: Tensor,
        rest: RestFlexibility | None = None,
    ) -> Tensor:
        """Complex accelerations (N, f, e, k) of all floors as their sensors give them.

        Args:
            excitation: a force, N; or the acceleration of the base along the motion, m/s2, in a
                second column its rotation, rad/s2, that leans the building forward, and in a third
                its acceleration across. Each column has unit size.
            theta: (N, p) stiffness factors.
            zeta: (N,) damping ratio.
            sizes: (N, q) the parameters of the effects, one after the other.
            frequency_hz: (k,).
            rest: static displacement under a force that a reduced model lacks; a stick lacks none.
        """
        omega = 2.0 * torch.pi * frequency_hz.to(torch.float64)
        if len(theta) <= _BATCH:
            return self._respond(excitation, (theta, zeta, sizes), omega, rest)
        parts = zip(theta.split(_BATCH), zeta.split(_BATCH), sizes.split(_BATCH), strict=True)
        return torch.cat([self._respond(excitation, rows, omega, rest) for rows in parts])

    def frf(self, theta: Tensor, zeta: Tensor, sizes: Tensor, frequency_hz: Tensor) -> Tensor:
        """The same (N, f, k) under a base that translates."""
        return self.respond(BASE_MOTION, theta, zeta, sizes, frequency_hz)[:, :, 0]

    def seen_frf(
        self,
        theta: Tensor,
        zeta: Tensor,
        sizes: Tensor,
        frequency_hz: Tensor,
        seen: Estimate | None,
    ) -> Tensor:
        """The same as an estimate shows them, (N, f, k); without one as they are."""
        inputs = Excitation(columns=1 if seen is None else seen.inputs)
        frf = self.respond(inputs, theta, zeta, sizes, frequency_hz).unbind(dim=2)
        return frf[0] if seen is None else seen(*frf)

    def frf_beside(self, sample: Sample, frequency_hz: Tensor, beside: Tensor | None) -> Tensor:
        """FRFs (N, f, k) over the base's translation, with what goes with it.

        Args:
            beside: (c - 1, k) of the further columns of the base's motion; None for none.
        """
        if beside is None:
            return self.frf(*sample, frequency_hz)
        frf = self.respond(Excitation(columns=1 + len(beside)), *sample, frequency_hz)
        return frf[:, :, 0] + (frf[:, :, 1:] * beside).sum(dim=2)

    def log_frf(
        self,
        parameters: Tensor,
        zeta: Tensor,
        frequency_hz: Tensor,
        how: "Responses | None" = None,
    ) -> Tensor:
        """ln|H| (N, f, k) of parameters (N, p + q); smooth, also beyond sizes' limits.

        What an effect cannot be (a spring of negative flexibility) is carried on from its limit: a
        point as far inside, reflected.

        Args:
            parameters: on any device.
            zeta: (N,) damping ratios.
            frequency_hz: (k,).
        """
        chosen = how or Responses()
        low, high = (limit.to(parameters.device) for limit in self.limits())
        inside = torch.minimum(torch.maximum(parameters, low), high)
        values = self._log_frf(inside, zeta, frequency_hz, chosen)
        out = (inside != parameters).any(dim=1)
        if out.any():
            mirrored = 2.0 * inside[out] - parameters[out]
            reflected = self._log_frf(mirrored, zeta[out], frequency_hz, chosen)
            values[out] = 2.0 * values[out] - reflected
        return values

    def modal_data(
        self,
        parameters: Tensor,
        *,
        modes: int | None = None,
        top_frequency_hz: float | None = None,
        batch: int | None = None,
    ) -> ModalData:
        """Solve the modes of every parameter vector and keep those that the floors feel.

        The leading one of `ModalData`'s formula stands for a base that only translates.

        Args:
            parameters: (N, p + q) stiffness factors, then sizes of effects; on any device.
            modes: how many to keep a sample; default all.
            top_frequency_hz: top of the frequency grid; needed when `modes` leaves some out.
            batch: samples solved at a time; default what is fastest.
        """
        floors, parts = len(self.floors), []
        step = batch or max(16, min(1024, 2**20 // self.model.size**2))
        for rows in parameters.to(torch.float64).split(step):
            found = self.modes(*self.split(rows))
            parts.append(keep_modes(found.omega, found.effect[:, :floors], modes, top_frequency_hz))
        return joined(parts)

    def log_frf_batches(
        self,
        modal: ModalData,
        parameters: Tensor,
        zeta: Tensor,
        frequency_hz: Tensor,
        *,
        batch: int | None = None,
        seen: Estimate | None = None,
    ) -> Iterator[Tensor]:
        """Yield ln|H| of consecutive samples (n, f, k), in the precision of their modal data.

        Args:
            modal: of the samples, N of them.
            parameters: (N, p + q).
            zeta: (N,) damping ratios.
            frequency_hz: (k,).
            batch: samples at a time; default what is fastest.
            seen: what an estimate makes of FRFs, before the logarithm is taken.
        """
        sizes = self.split(parameters)[1].to(modal.omega)
        omega = 2.0 * torch.pi * frequency_hz.to(modal.omega)
        # Intermediate arrays of a MB stay in a processor's cache: larger ones are up to seven times
        # slower there. Of many modes a fourth are summed at all frequencies of a band.
        room = 2**20 if omega.device.type == "cpu" else 2**29
        points = min(len(omega), 128) if omega.dtype == torch.float64 else len(omega)
        step = batch or max(1, room // (modal.omega.shape[1] * points * omega.element_size()))
        for start in range(0, len(modal), step):
            rows = slice(start, start + step)
            ratio = self.ratio(modal[rows].omega, zeta[rows].to(modal.omega), sizes[rows])
            parts = modal[rows].response(omega, ratio)
            if self._read_otherwise or seen is not None:
                frf = torch.complex(*parts)
                if any(terms.pitch for terms in self.terms) and self.model.rotation is not None:
                    base = self._base_motion(sizes[rows], split_sizes(self.placed, sizes[rows]))
                    leaning = base[:, 1, :1] * sizes.new_tensor(self.model.rotation.levels)
                    frf = frf + leaning[:, :, None]
                frf = observed(self.placed, self.floors, frf, omega, sizes[rows])
                frf = frf if seen is None else seen(frf)
                parts = frf.real, frf.imag
            # A square below 1e-24 is rounding; its logarithm would be all that is seen.
            yield 0.5 * torch.log(parts[0].square() + parts[1].square() + 1e-24)

    def modes(
        self, theta: Tensor, sizes: Tensor, rows: Rows | None = None, *, released: bool = False
    ) -> Modes:
        """Undamped modes with the effects, lowest first; rows are those of the floors by default.

        The ports of the effects follow the rows. Forces move a base that is not held: `released`.
        """
        by_effect = split_sizes(self.placed, sizes)
        stiffness, mass, force, rigid_mass = self._matrices(theta, by_effect)
        base = self._base_motion(theta, by_effect)
        rows = rows or Rows(*(part.to(theta) for part in self.model.tensors[4:]))
        shapes, rigid = self._with_ports(rows, len(theta))
        load = torch.einsum("nrb,nbe->ner", force, base)
        flexibility, free = self._flexibility(theta, by_effect), self.model.released
        if released and free is not None:
            soft = torch.from_numpy(free.flexibility).to(theta).expand(len(theta), -1)
            flexibility = soft if flexibility is None else soft + flexibility
            rigid_mass = rigid_mass + pad(torch.from_numpy(free.mass).to(theta), (0, 1, 0, 1))
        if flexibility is not None:
            root, flexes = flexibility.sqrt(), slice(2)  # (N, 2); across it is held
            at_base = rigid_mass[:, flexes, flexes]
            stiffness, mass = _on_flexible_base(stiffness, mass, force[..., flexes], at_base, root)
            on_base = root[:, None] * torch.einsum("nab,nbe->nea", rigid_mass[:, flexes], base)
            load = torch.cat([load, on_base], dim=2)
            shapes = torch.cat([shapes, rigid[..., flexes] * root[:, None, :]], dim=2)
        seen, inverse = normal_modes(stiffness, mass, torch.cat([shapes, load], dim=1))
        return Modes(inverse, seen[:, :-3], seen[:, -3:], rigid @ base)

    def first_hz(self, theta: Tensor, sizes: Tensor) -> float:
        """The lowest frequency of all these parameters."""
        return float(self.modes(theta, sizes).omega.min()) / (2.0 * np.pi)

    def ratio(self, omega: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """Damping ratios (N, m) of modes omega (N, m), rad/s, with the effects."""
        ratio = self.law.ratio(omega, zeta)
        by_effect = split_sizes(self.placed, sizes)
        for listed, terms, size in zip(self.placed, self.terms, by_effect, strict=True):
            ratio = listed.effect.damping(ratio, omega, size, terms.constants)
        return ratio

    def at_level(
        self, theta: Tensor, zeta: Tensor, sizes: Tensor, level: float | Tensor
    ) -> tuple[Tensor, Tensor]:
        """Stiffness factors and damping ratios at a level of motion (see `Effect`)."""
        if isinstance(level, float) and level == 0.0:
            return theta, zeta
        by_effect = split_sizes(self.placed, sizes)
        for listed, terms, size in zip(self.placed, self.terms, by_effect, strict=True):
            change = listed.effect.at_level(size, level)
            if change is not None:
                story, softer = int(terms.constants[0]), torch.ones_like(theta)
                own_story = slice(None) if story == ALL_STORIES else [story]
                softer[:, own_story] = change.stiffness[:, None]
                theta, zeta = theta * softer, zeta * change.damping
        return theta, zeta

    def port_stiffness(self, omega: Tensor, sizes: Tensor) -> list[Tensor]:
        """Complex dynamic stiffness (N, k), N/m, in every port, those of the dashpots last."""
        by_effect, dashpots = split_sizes(self.placed, sizes), self.model.dashpots
        rate = torch.complex(torch.zeros_like(omega), omega).expand(len(sizes), -1)
        ports = [
            listed.effect.port_stiffness(omega, size, terms.constants)
            for listed, terms, size in zip(self.placed, self.terms, by_effect, strict=True)
            if terms.port is not None
        ]
        return ports if dashpots is None else [*ports, *(rate for _ in dashpots)]

    @property
    def _read_otherwise(self) -> bool:
        """Whether effects change FRFs beside the modes."""
        pitched = any(terms.pitch for terms in self.terms)
        return pitched or any(listed.effect.instrument for listed in self.placed)

    def limits(self) -> tuple[Tensor, Tensor]:
        """(p + q,) physical limits of the parameters; a stiffness factor has none here."""
        sizes = parameters_of(self.placed)
        free = torch.full((self.factors,), torch.inf, dtype=torch.float64)
        low = torch.tensor([parameter.lower for parameter in sizes], dtype=torch.float64)
        high = torch.tensor([parameter.upper for parameter in sizes], dtype=torch.float64)
        return torch.cat([-free, low]), torch.cat([free, high])

    def _respond(
        self, excitation: Excitation, sample: Sample, omega: Tensor, rest: RestFlexibility | None
    ) -> Tensor:
        theta, zeta, sizes = sample
        # Instruments leave the motion alone, and what is no stiffness or mass the modes: rows that
        # differ in these only share the others.
        inside = self._sizes_of(sizes, [not listed.effect.instrument for listed in self.placed])
        rows, same = _different(torch.cat([theta, zeta[:, None], inside], dim=1))
        moved = self._motion(excitation, (theta[rows], zeta[rows], sizes[rows]), omega, rest)[same]
        if not any(listed.effect.instrument for listed in self.placed):
            return moved
        # What the base's own instrument does shows over its translation alone.
        read = [
            observed(self.placed, self.floors, column, omega, sizes, not (k or excitation.force))
            for k, column in enumerate(moved.unbind(dim=2))
        ]
        return torch.stack(read, dim=2)

    def _sizes_of(self, sizes: Tensor, chosen: Sequence[bool]) -> Tensor:
        """The parameters (N, c) of some effects, from those of all (N, q)."""
        parts = zip(split_sizes(self.placed, sizes), chosen, strict=True)
        return torch.cat([sizes[:, :0], *(values for values, wanted in parts if wanted)], dim=1)

    def _motion(
        self, excitation: Excitation, sample: Sample, omega: Tensor, rest: RestFlexibility | None
    ) -> Tensor:
        """Complex accelerations (N, f, e, k) of the floors themselves."""
        theta, zeta, sizes = sample
        shaping = self._sizes_of(sizes, [not terms.shapeless for terms in self.terms])
        rows, same = _different(torch.cat([theta, shaping], dim=1))
        ports = self.port_stiffness(omega, sizes)
        if excitation.force:
            modes = self.modes(theta[rows], sizes[rows], released=True)[same]
            ratio, floor = self.ratio(modes.omega, zeta, sizes), self.floors.index(excitation.force)
            moved = response(modes, ratio, omega, ports, forced=floor)
            if rest is None:
                return moved
            terms = torch.from_numpy(rest.terms[:, :, floor]).to(theta)
            return moved - omega**2 * (1.0 / theta @ terms)[:, :, None, None]
        modes = self.modes(theta[rows], sizes[rows])[same]
        ratio = self.ratio(modes.omega, zeta, sizes)
        return response(modes, ratio, omega, ports, columns=excitation.columns)

    def _log_frf(
        self,
        parameters: Tensor,
        zeta: Tensor,
        frequency_hz: Tensor,
        how: "Responses",
    ) -> Tensor:
        if self.complex_modes or (how.seen is not None and how.seen.inputs > 1):
            theta, sizes = self.split(parameters)
            whole = self.seen_frf(theta, zeta, sizes, frequency_hz, how.seen)
            frf = whole if how.floors is None else whole[:, list(how.floors)]
            # What is smaller is rounding.
            return frf.abs().clamp_min(1e-12).log()
        # Damping leaves the modes alone: rows that differ in it only share theirs.
        rows, same = _different(parameters.detach())
        top, chosen = float(frequency_hz[-1]), None if how.floors is None else list(how.floors)
        modal = self.modal_data(parameters[rows], modes=how.modes, top_frequency_hz=top)
        modal = modal.to(parameters.device, how.precision)[same]
        # What effects do in closed form is known by the rows of all floors.
        early = chosen is not None and not self._read_otherwise
        parts = self.log_frf_batches(
            modal.of_floors(chosen) if early and chosen is not None else modal,
            parameters,
            zeta,
            frequency_hz,
            seen=how.seen,
        )
        values = torch.cat(list(parts))
        return values if early or chosen is None else values[:, chosen]

    def _matrices(
        self, theta: Tensor, by_effect: Sequence[Tensor]
    ) -> tuple[Tensor, Tensor | None, Tensor, Tensor]:
        """K (N, r, r), M (N, r, r) or None for the identity, forces (N, r, 3), mass (N, 3, 3)."""
        count, size, mass = len(theta), self.model.size, None
        terms, constant, *forces = (part.to(theta) for part in self.model.tensors[:4])
        stiffness, factors = constant + (theta @ terms).reshape(count, size, size), []
        force, rigid = (part.expand(count, -1, -1) for part in forces)
        for added, values in zip(self.terms, by_effect, strict=True):
            own_size = values[:, 0] if values.shape[1] else theta.new_ones(count)
            for story, _, series in added.stiffness:
                factor = own_size / (1.0 + series * own_size)
                factors.append(factor if story == UNSCALED else factor * theta[:, story])
            if added.hinges is not None:
                stiffness = stiffness - added.hinges.softening(theta, own_size)
            if added.mass is not None:
                mass = torch.eye(size).to(theta) if mass is None else mass
                weight = own_size[:, None, None]
                mass = mass + weight * added.mass.matrix.to(theta)
                force = force + weight * torch.as_tensor(added.mass.force).to(theta)
                rigid = rigid + weight * torch.as_tensor(added.mass.rigid).to(theta)
        if factors:
            whole = torch.stack(factors, dim=1) @ self._added.to(theta)
            stiffness = stiffness + whole.reshape(count, size, size)
        return stiffness, mass, force, rigid

    @cached_property
    def _added(self) -> Tensor:
        """(a, r r) stiffness that the effects add, at sizes and factors of one."""
        return torch.stack([m.flatten() for terms in self.terms for _, m, _ in terms.stiffness])

    def _base_motion(self, theta: Tensor, by_effect: Sequence[Tensor]) -> Tensor:
        """(N, 3, 3) motion of the base, by the columns of its acceleration."""
        base = torch.eye(3).to(theta).repeat(len(theta), 1, 1)
        for terms, size in zip(self.terms, by_effect, strict=True):
            if terms.pitch:
                base[:, 1, 0] += terms.pitch * size[:, 0]
        return base

    def _flexibility(self, theta: Tensor, by_effect: Sequence[Tensor]) -> Tensor | None:
        """(N, 2) of the ground, or None where it is rigid."""
        total = None
        for terms, size in zip(self.terms, by_effect, strict=True):
            if any(terms.flexibility):
                unit = theta.new_tensor(terms.flexibility)
                total = (0.0 if total is None else total) + size[:, :1].clamp_min(0.0) * unit
        return total

    def _with_ports(self, rows: Rows, count: int) -> tuple[Tensor, Tensor]:
        """Rows (N, o, r) and their rigid motion (N, o, 3), those of the ports last."""
        shapes, rigid = (part.expand(count, -1, -1) for part in (rows.shapes, rows.rigid))
        ports = [terms.port for terms in self.terms if terms.port is not None]
        # What acts along the motion does not feel a base that moves across as a rigid body.
        parts = [(port.row[None], pad(torch.as_tensor(port.rigid), (0, 1))[None]) for port in ports]
        if self.model.dashpots is not None:  # which stand on the base, and move with it
            parts.append((self.model.dashpots, torch.zeros(len(self.model.dashpots), 3)))
        for pair in parts:
            lines, with_base = (
                torch.as_tensor(part).to(shapes).expand(count, -1, -1) for part in pair
            )
            shapes = torch.cat([shapes, lines], dim=1)
            rigid = torch.cat([rigid, with_base], dim=1)
        return shapes, rigid


def _different(values: Tensor) -> tuple[Tensor | slice, Tensor | slice]:
    """One row (u,) of every kind among values (N, v), and which of these each row is (N,)."""
    if not values.numel() or len(values) == 1:
        return slice(None), slice(None)
    kinds = torch.unique(values, dim=0, return_inverse=True)[1]
    first = torch.zeros(int(kinds.max()) + 1, dtype=torch.long, device=kinds.device)
    return first.scatter_(0, kinds, torch.arange(len(kinds), device=kinds.device)), kinds


def parameters_of(placed: Sequence[Placed]) -> list[EffectParameter]:
    """The parameters of effects, one effect after the other."""
    return [parameter for listed in placed for parameter in listed.effect.parameters]


def _on_flexible_base(
    stiffness: Tensor, mass: Tensor | None, force: Tensor, rigid: Tensor, root: Tensor
) -> tuple[Tensor, Tensor]:
    """Add the base's own motion, scaled so that its springs are of unit stiffness."""
    count, size = stiffness.shape[0], stiffness.shape[1]
    eye = torch.eye(size + 2).to(stiffness).expand(count, -1, -1)
    wide_stiffness, wide_mass = eye.clone(), eye.clone()
    wide_stiffness[:, :size, :size] = stiffness
    if mass is not None:
        wide_mass[:, :size, :size] = mass
    coupling = force * root[:, None, :]
    wide_mass[:, :size, size:] = coupling
    wide_mass[:, size:, :size] = coupling.mT
    wide_mass[:, size:, size:] = rigid * root[:, :, None] * root[:, None, :]
    return wide_stiffness, wide_mass
