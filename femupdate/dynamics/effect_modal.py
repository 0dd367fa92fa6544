"""Modes of a reduced structure with effects as the few numbers that an FRF needs.

Effects that change stiffness, mass, ground or damping ratios leave a structure real modes, whose
superposition `ModalData` is. What base motion and instruments do besides is known in closed form.
Dynamic stiffnesses along lines (dampers, appendages) make modes complex: there is no such data.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.dynamics.effect_modes import natural
from femupdate.dynamics.effect_response import EffectSystem, observed
from femupdate.dynamics.frf import fast_batch, frf_parts
from femupdate.dynamics.modal import ModalData, keep_modes
from femupdate.effects.effect import Effect, Parameter, Placed
from femupdate.progress import SILENT, Progress

# |H|^2 below this is rounding; its logarithm would be all that is seen.
_LEAST_SQUARE = 1e-24


@dataclass(frozen=True)
class ClosedForm:
    """What effects do to FRFs beside what they do to modes.

    Attributes:
        placed: the effects.
        pitch: of each effect, rotation of the base per unit translation and size, rad/m.
        floors: names, bottom to top.
        levels: (f,) heights of the floors above the base, m.
        stories: number of stiffness factors, which come before the sizes.
        top_hz: top of the frequency grid.
    """

    placed: tuple[Placed, ...]
    pitch: tuple[float, ...]
    floors: tuple[str, ...]
    levels: tuple[float, ...]
    stories: int
    top_hz: float

    def frf(self, parts: tuple[Tensor, Tensor], omega: Tensor, parameters: Tensor) -> Tensor:
        """Complex FRFs (N, f, k) as they are measured.

        Args:
            parts: real and imaginary part (N, f, k) as if the base only translated.
            omega: (k,) rad/s.
            parameters: (N, p + q) stiffness factors, then sizes.
        """
        sizes = parameters[:, self.stories :]
        frf = torch.complex(*parts) + self._leaning(sizes)[:, :, None]
        return observed(self.placed, self.floors, frf, omega, sizes)

    def _leaning(self, sizes: Tensor) -> Tensor:
        """(N, f) rigid motion of the floors by the base's rotation, per unit translation."""
        rotation, first = sizes.new_zeros(len(sizes)), 0
        for one, pitch in zip(self.placed, self.pitch, strict=True):
            if pitch:
                rotation = rotation + pitch * sizes[:, first]
            first += len(one.effect.parameters)
        return rotation[:, None] * sizes.new_tensor(self.levels)


def closed_form(system: EffectSystem, top_hz: float) -> ClosedForm:
    """What the effects of a system do in closed form, on a grid up to a frequency."""
    return ClosedForm(
        system.placed,
        tuple(terms.pitch for terms in system.terms),
        system.floors,
        tuple(float(level) for level in system.reduced.rigid[:, 1]),
        system.reduced.model.parameters,
        top_hz,
    )


def makes_modes_complex(effect: Effect) -> bool:
    """Whether an effect acts along a line: then there are no real modes."""
    return type(effect).port_stiffness is not Effect.port_stiffness


def effect_modal_data(
    system: EffectSystem,
    parameters: Tensor,
    *,
    modes: int | None = None,
    top_frequency_hz: float | None = None,
    batch: int = 64,
    progress: Progress = SILENT,
) -> ModalData:
    """Solve the modes of every parameter vector and keep those that the floors feel.

    The leading one of `ModalData`'s formula stands for a base that only translates.

    Args:
        system: the structure with effects that leave its modes real.
        parameters: (N, p + q) stiffness factors, then sizes of the effects.
        modes: how many to keep a sample; default all.
        top_frequency_hz: top of the frequency grid; needed when `modes` leaves some out.
        batch: samples solved at a time.
        progress: advances by one a sample.

    Returns:
        float64 data.
    """
    stories = system.reduced.model.parameters
    parts = []
    for rows in parameters.to(torch.float64).split(batch):
        theta, sizes = rows[:, :stories], rows[:, stories:]
        found = system.modes(theta, torch.ones_like(theta[:, 0]), sizes)
        omega = natural(found.inverse)
        # Shapes are of unit modal stiffness there, of unit modal mass here.
        effect = found.rows * (found.participation * omega.square())[:, None, :]
        parts.append(keep_modes(omega, effect, modes, top_frequency_hz))
        progress.advance(len(rows))
    return ModalData(
        torch.cat([p.omega for p in parts]),
        torch.cat([p.effect for p in parts]),
        torch.cat([p.residual for p in parts]),
    )


def log_size(frf: Tensor, least: float = _LEAST_SQUARE) -> Tensor:
    """ln|H| of complex FRFs, `least` being added to |H|^2."""
    return 0.5 * torch.log(frf.real.square() + frf.imag.square() + least)


def effect_log_frf_batches(
    system: EffectSystem,
    modal: ModalData,
    parameters: Tensor,
    frequency_hz: Tensor,
    zeta: Tensor,
    *,
    batch: int | None = None,
    seen: Callable[[Tensor], Tensor] | None = None,
) -> Iterator[Tensor]:
    """Yield ln|H| of consecutive samples (n, f, k), in the precision of their modal data.

    What an estimate makes of FRFs, `seen`, is applied to them before the logarithm is taken.
    """
    form = closed_form(system, float(frequency_hz[-1]))
    own = parameters.to(modal.omega)
    omega = 2.0 * math.pi * frequency_hz.to(modal.omega)
    batch = batch or fast_batch(modal, len(frequency_hz))
    for start in range(0, len(modal), batch):
        rows = slice(start, start + batch)
        law = _WithEffects(system, own[rows, form.stories :])
        parts = frf_parts(modal[rows], frequency_hz, law, zeta[rows])
        frf = form.frf(parts, omega, own[rows])
        yield log_size(frf if seen is None else seen(frf))


def effect_log_frf(
    system: EffectSystem,
    parameters: Tensor,
    frequency_hz: Tensor,
    zeta: Tensor,
    seen: Callable[[Tensor], Tensor] | None = None,
) -> Tensor:
    """ln|H| (N, f, k), float64, of parameters (N, p + q); smooth, also beyond the sizes' limits.

    What an effect cannot be (a spring of negative flexibility) is carried on from its limit: a
    point as far inside, reflected.
    """
    limits = parameter_limits(system)
    inside = torch.minimum(torch.maximum(parameters, limits[0]), limits[1])
    values = _log_frf(system, inside, frequency_hz, zeta, seen)
    out = (inside != parameters).any(dim=1)
    if out.any():
        mirrored = 2.0 * inside[out] - parameters[out]
        values[out] = 2.0 * values[out] - _log_frf(system, mirrored, frequency_hz, zeta[out], seen)
    return values


def parameter_limits(system: EffectSystem) -> tuple[Tensor, Tensor]:
    """(p + q,) physical limits of the parameters; a stiffness factor has none here."""
    sizes = parameters_of(system.placed)
    free = torch.full((system.reduced.model.parameters,), torch.inf, dtype=torch.float64)
    low = torch.tensor([one.lower for one in sizes], dtype=torch.float64)
    high = torch.tensor([one.upper for one in sizes], dtype=torch.float64)
    return torch.cat([-free, low]), torch.cat([free, high])


def parameters_of(placed: Sequence[Placed]) -> list[Parameter]:
    """The parameters of effects, one effect after the other."""
    return [parameter for one in placed for parameter in one.effect.parameters]


def _log_frf(
    system: EffectSystem,
    parameters: Tensor,
    frequency_hz: Tensor,
    zeta: Tensor,
    seen: Callable[[Tensor], Tensor] | None,
) -> Tensor:
    # Damping leaves the modes alone: neighbours that differ in it only share theirs.
    distinct, which = torch.unique_consecutive(parameters, dim=0, return_inverse=True)
    modal = effect_modal_data(system, distinct)[which]
    frequency = frequency_hz.to(torch.float64)
    parts = effect_log_frf_batches(system, modal, parameters, frequency, zeta, seen=seen)
    return torch.cat(list(parts))


@dataclass(frozen=True)
class _WithEffects:
    """The damping law of some samples with effects of their sizes (n, q)."""

    system: EffectSystem
    sizes: Tensor

    def ratio(self, omega: Tensor, zeta: Tensor) -> Tensor:
        """Damping ratios (n, m) of modes (n, m), rad/s, and zeta (n,)."""
        return self.system.ratio(omega, zeta, self.sizes)
