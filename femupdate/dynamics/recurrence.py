"""Exact step-by-step response of many modes to one record (Nigam and Jennings 1969)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats, Integers


def interpolate_record(acceleration: Floats, factor: int) -> Floats:
    """Return the band-limited record at `factor` times its sampling rate.

    Straight lines between samples take a share 1 - sinc^2(f dt) of the motion at frequency f away
    (3 % at a tenth of the sampling rate, 19 % at a quarter) and put it above the Nyquist frequency.
    A windowed sinc passes through the samples and keeps the motion; ground before the first and
    after the last sample is at rest.

    Args:
        factor: points a step, 1 or more.

    Returns:
        ((n - 1) factor + 1,) samples from the first to the last of the record.
    """
    if factor == 1:
        return np.asarray(acceleration, dtype=np.float64)
    from scipy.signal import firwin, resample_poly

    # 32 samples of the record to either side; 80 dB: flat to 1e-4 up to .92 of its Nyquist rate.
    taps = firwin(2 * 32 * factor + 1, 1.0 / factor, window=("kaiser", 8.0), scale=False)
    fine = resample_poly(acceleration, factor, 1, window=taps)
    return fine[: (len(acceleration) - 1) * factor + 1]


def step_matrices(omega: Tensor, ratio: Tensor, time_step: float) -> tuple[Tensor, Tensor]:
    """Return what one step does to the state and what the excitation at its two ends adds.

    The state of a mode is v = (omega eta, eta') with eta'' + 2 zeta omega eta' + omega^2 eta = -a,
    a linear over the step. All comes from one matrix exponential (Van Loan 1978), so that any
    damping ratio, critical and beyond, and any step are treated alike.

    Args:
        omega, ratio: (...) rad/s and damping ratios.

    Returns:
        transition (..., 2, 2) and load (..., 2, 2), whose last axis is start and end of the step.
    """
    generator = omega.new_zeros(*omega.shape, 4, 4)
    generator[..., 0, 1] = omega * time_step
    generator[..., 1, 0] = -omega * time_step
    generator[..., 1, 1] = -2.0 * ratio * omega * time_step
    generator[..., 1, 2] = -time_step
    generator[..., 2, 3] = 1.0
    exponential = torch.linalg.matrix_exp(generator)
    from_start, from_slope = exponential[..., :2, 2], exponential[..., :2, 3]
    return exponential[..., :2, :2], torch.stack([from_start - from_slope, from_slope], dim=-1)


def join_steps(transition: Tensor, load: Tensor, factor: int) -> tuple[Tensor, Tensor]:
    """Join `factor` steps into one that takes the excitation at its factor + 1 points.

    Args:
        transition, load: as from `step_matrices`.

    Returns:
        transition (..., 2, 2) and load (..., 2, factor + 1).
    """
    joined = load.new_zeros(*load.shape[:-1], factor + 1)
    power = torch.eye(2, dtype=load.dtype, device=load.device).expand_as(transition)
    for step in range(factor):
        joined = transition @ joined
        joined[..., step : step + 2] += load
        power = transition @ power
    return power, joined


def record_points(acceleration: Floats, factor: int) -> Tensor:
    """A motion (e, n) between its samples, band-limited: (n - 1, e (factor + 1)) step by step."""
    fine = [torch.from_numpy(interpolate_record(row, factor)) for row in acceleration]
    return torch.cat([row.unfold(0, factor + 1, factor) for row in fine], dim=1)


@dataclass(frozen=True, eq=False)
class ModalOutputs:
    """The modes of S samples as outputs see them: displacement q + acceleration q'' + base a.

    Modes are of unit mass: q'' + 2 zeta omega q' + omega^2 q = -participation a, with a (e,) the
    columns of the base's acceleration.
    """

    omega: Tensor  # (S, m) rad/s
    participation: Tensor  # (S, e, m)
    displacement: Tensor  # (S, o, m) shares of q and q'' in each output
    acceleration: Tensor
    base: Tensor  # (S, o, e) shares of the base's acceleration

    def dynamic(self, nyquist_hz: float, tolerance: float) -> "ModalOutputs":
        """Leave the modes that are as good as static to the base term.

        Which modes stay is decided for each sample by itself, so that its response does not depend
        on the batch; the modes kept are as many as the sample with the most needs.
        """
        # A base without mass is static whatever the tolerance.
        matters = self.importance(2.0 * torch.pi * nyquist_hz) > max(tolerance, 1e-18)
        count = max(1, int(matters.sum(dim=1).max()))
        order = matters.to(torch.int8).argsort(dim=1, descending=True, stable=True)[:, :count]

        def kept(part: Tensor) -> Tensor:
            return part.gather(2, order[:, None, :].expand(-1, part.shape[1], -1))

        alive, weight = matters[:, None, :], torch.where(matters, 0.0, self.omega**-2)
        static = (self.displacement * weight[:, None, :]) @ self.participation.mT
        return ModalOutputs(
            self.omega.gather(1, order),
            kept(self.participation),
            kept(self.displacement * alive),
            kept(self.acceleration * alive),
            self.base - static,  # static modes follow as q = -participation a / omega^2
        )

    def importance(self, nyquist: float) -> Tensor:
        """Largest change (S, m) of any output if the mode were static, over the output's own size.

        The size of an acceleration is the base acceleration's, of a shear the mass above times it,
        of a drift the sum of the static drifts of all modes.
        """
        driven = self.participation[:, None]  # (S, 1, e, m)
        static = self.displacement[:, :, None] * driven / self.omega[:, None, None, :] ** 2
        of_base = self.acceleration[:, :, None] * driven
        of_base = of_base / self.base.abs()[..., None].clamp_min(1e-30)
        of_static = static / static.abs().sum(-1, keepdim=True).clamp_min(1e-30)
        share = torch.where(self.base[..., None] != 0.0, of_base, of_static)
        squared = (nyquist / self.omega) ** 2
        # Modes below 1.5 Nyquist frequencies can resonate: a hundred times at a damping of .005.
        error = torch.where(squared > 1.5**-2, 100.0, squared / (1.0 - squared))
        return share.abs().amax(dim=(1, 2)) * error

    def project(self, windows: Iterator["Window"], record: Tensor) -> Tensor:
        """Return the outputs (S, o, n) from the states of the modes, from rest.

        Args:
            windows: from whose states q'' = -participation a - 2 zeta omega q' - omega^2 q.
            record: (e, n) base acceleration.
        """
        result = (self.base - self.acceleration @ self.participation.mT) @ record
        start = 1
        for omega, ratio, states in windows:
            stop, wide = start + len(states), omega[:, None, :]
            of_first = self.displacement / wide - self.acceleration * wide
            of_second = -2.0 * ratio[:, None, :] * wide * self.acceleration
            columns = states.flatten(2).permute(1, 2, 0)
            result[..., start:stop] += torch.bmm(torch.cat([of_first, of_second], -1), columns)
            start = stop
        return result


class Window(NamedTuple):
    """Modes during t steps."""

    omega: Tensor  # (S, m) rad/s and damping ratios
    ratio: Tensor
    states: Tensor  # (t, S, 2, m) states (omega eta, eta') after each step


@dataclass(frozen=True, eq=False)
class Steps:
    """What a step does to modes, at each of the levels of the motion that are told apart."""

    omega: Tensor  # (l, S, m) rad/s and damping ratios
    ratio: Tensor
    transition: Tensor  # (l, S, 2, 2, m) of the state, by what it comes from
    load: Tensor  # (l, S, e (factor + 1), 2, m) by the points of every column of the excitation

    @staticmethod
    def of(
        omega: Tensor, ratio: Tensor, participation: Tensor, time_step: float, factor: int
    ) -> "Steps":
        """For omega and ratio (l, S, m) of modes that the base drives by participation (S, e, m).

        The excitation is linear between factor + 1 points.
        """
        found = []
        for level in zip(omega, ratio, strict=True):
            transition, load = join_steps(*step_matrices(*level, time_step / factor), factor)
            each = load.permute(0, 3, 2, 1)[:, None] * participation[:, :, None, None]
            found.append((transition.permute(0, 3, 2, 1), each.flatten(1, 2)))
        transition, load = (torch.stack(parts) for parts in zip(*found, strict=True))
        return Steps(omega, ratio, transition, load)

    def windows(
        self, points: Tensor, level: Integers | None = None, length: int = 256
    ) -> Iterator[Window]:
        """Yield the states of all modes, a window of steps after the other, starting from rest.

        Args:
            points: (n - 1, e (factor + 1)) base acceleration, linear between its points.
            level: (S, w) number of the level in each window; the first throughout where None.
            length: steps of a window; 256 keep 50 samples of 60 modes within a few ten megabytes.
        """
        parts, samples = points.split(length), torch.arange(self.omega.shape[1])
        same = torch.zeros(len(samples), len(parts), dtype=torch.long)
        chosen = same if level is None else torch.from_numpy(level)
        before = self.omega[chosen[:, 0], samples]
        state = torch.zeros_like(self.transition[0, :, 0])
        for number, block in enumerate(parts):
            chunk = chosen[:, number], samples
            omega = self.omega[chunk]
            # The displacement goes on; the first part of the state is omega times it.
            state = torch.stack([state[:, 0] * (omega / before), state[:, 1]], dim=1)
            # (S, 2, m) slices: the loop below then needs two fused operations a step.
            from_first, from_second = (
                part.contiguous() for part in self.transition[chunk].unbind(1)
            )
            loads = self.load[chunk].transpose(0, 1).flatten(1)
            states = (block @ loads).view(len(block), *state.shape)
            for following in states:
                following.addcmul_(from_first, state[:, :1]).addcmul_(from_second, state[:, 1:])
                state = following
            yield Window(omega, self.ratio[chunk], states)
            # Motion that died away would sink into denormal numbers, a hundred times slower.
            state, before = torch.where(state.abs() < 1e-200, 0.0, state), omega
