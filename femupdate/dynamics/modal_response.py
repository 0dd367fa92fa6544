"""Which modes matter to the outputs, and the outputs from the motion of the modes."""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.dynamics.modes import Modes
from femupdate.dynamics.recurrence import Window

IN_BAND = 1.5  # modes below this many Nyquist frequencies can resonate
_NOTHING = 1e-18
RESONANCE = 100.0  # amplification at a damping ratio of 0.005


@dataclass(frozen=True)
class ModalOutputs:
    """The modes of S samples as the outputs see them: displacement eta + acceleration eta'' + base.

    Every mode is scaled to a participation of one, eta'' + 2 zeta omega eta' + omega^2 eta = -a_g.

    Attributes:
        omega: (S, m) rad/s.
        displacement, acceleration: (S, o, m) shares of eta and eta'' in each output.
        base: (S, o) share of the base acceleration.
    """

    omega: Tensor
    displacement: Tensor
    acceleration: Tensor
    base: Tensor


def see_modes(modes: Modes, floors: int, stories: int) -> ModalOutputs:
    """Express floor accelerations, story shears and story drifts by the modes.

    Args:
        modes: with the rows of `femupdate.dynamics.story.story_rows`.
        floors, stories: number of rows of each.
    """
    effect, zero = modes.effect, torch.zeros_like(modes.effect)
    ends = [floors, stories, stories]
    of_floor, of_inertia, of_drift = effect.split(ends, dim=1)
    nothing = zero.split(ends, dim=1)
    direct = modes.direct.split(ends, dim=1)
    return ModalOutputs(
        modes.omega,
        torch.cat([nothing[0], nothing[1], of_drift], dim=1),
        torch.cat([of_floor, -of_inertia, nothing[2]], dim=1),
        torch.cat([direct[0], -direct[1], torch.zeros_like(direct[2])], dim=1),
    )


def keep_dynamic(modes: ModalOutputs, nyquist_hz: float, tolerance: float) -> ModalOutputs:
    """Leave the modes that are as good as static to the base term.

    Which modes stay is decided for each sample by itself, so that its response does not depend on
    the batch; the modes kept are as many as the sample with the most needs.
    """
    # A base without mass is static whatever the tolerance.
    matters = importance(modes, 2.0 * torch.pi * nyquist_hz) > max(tolerance, _NOTHING)
    count = max(1, int(matters.sum(dim=1).max()))
    order = matters.to(torch.int8).argsort(dim=1, descending=True, stable=True)[:, :count]
    pick = order[:, None, :].expand(-1, modes.base.shape[1], -1)
    alive = matters[:, None, :]
    return ModalOutputs(
        modes.omega.gather(1, order),
        (modes.displacement * alive).gather(2, pick),
        (modes.acceleration * alive).gather(2, pick),
        modes.base + _static_response(modes, ~matters),
    )


def importance(modes: ModalOutputs, nyquist: float) -> Tensor:
    """Largest change (S, m) of any output if the mode were static, over the output's own size.

    The size of an acceleration is the base acceleration's, of a shear the mass above times it, of
    a drift the sum of the static drifts of all modes.
    """
    static = modes.displacement / modes.omega[:, None, :] ** 2
    of_base = modes.acceleration / modes.base.abs()[..., None].clamp_min(1e-30)
    of_static = static / static.abs().sum(-1, keepdim=True).clamp_min(1e-30)
    share = torch.where(modes.base[..., None] != 0.0, of_base, of_static)
    squared = (nyquist / modes.omega) ** 2
    error = torch.where(squared > IN_BAND**-2, RESONANCE, squared / (1.0 - squared))
    return share.abs().amax(dim=1) * error


def _static_response(modes: ModalOutputs, static: Tensor) -> Tensor:
    """Static modes follow as eta = -a_g / omega^2, without acceleration against the base."""
    weight = torch.where(static, -1.0 / modes.omega**2, 0.0)
    return (modes.displacement * weight[:, None, :]).sum(-1)


def state_weights(modes: ModalOutputs, omega: Tensor, ratio: Tensor) -> Tensor:
    """What states (omega eta, eta') show in the outputs, (S, o, 2 m), at omega and ratio (S, m)."""
    wide = omega[:, None, :]
    of_first = modes.displacement / wide - modes.acceleration * wide
    return torch.cat([of_first, -2.0 * ratio[:, None, :] * wide * modes.acceleration], dim=-1)


def project(modes: ModalOutputs, windows: Iterable[Window], record: Tensor) -> Tensor:
    """Return the outputs (S, o, n) from the states of the modes.

    Args:
        modes: S samples, o outputs, m modes.
        windows: from rest, from whose states eta'' = -a_g - 2 zeta omega eta' - omega^2 eta.
        record: (n,) base acceleration, m/s2.
    """
    result = (modes.base - modes.acceleration.sum(-1))[..., None] * record
    start = 1
    for omega, ratio, states in windows:
        stop = start + len(states)
        columns = states.flatten(2).permute(1, 2, 0)
        result[..., start:stop] += torch.bmm(state_weights(modes, omega, ratio), columns)
        start = stop
    return result
