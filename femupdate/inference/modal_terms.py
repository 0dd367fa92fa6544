"""Residuals of identified modes: frequencies, damping ratios and shapes of any scale.

Which mode of the model is which identified one is decided anew at every parameter vector: the
pairing with the smallest misfit of frequency, shape (a weighted MAC) and damping together, one to
one (assignment by Crouse 2016, IEEE Trans. Aerosp. Electron. Syst. 52, 1679). The scale a of an
identified shape y is taken out in closed form: with the weights W = 1 / sd^2 of its components the
best a = phi'Wy / phi'W phi leaves y'Wy (1 - MAC_W), which is also what a flat prior of a leaves for
shapes phi of one weighted length.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.system import System
from femupdate.measurement.modes import IdentifiedModes

_TINY = 1e-30
_MASSLESS = 1e-14  # of the largest 1 / omega^2


@dataclass(frozen=True)
class ModalErrors:
    """Errors beside those that a file states, and what is assumed where it states none.

    Attributes:
        model_frequency: sd of the model's own ln f, which idealisation leaves.
        model_shape: sd of the model's shape, over its largest component.
        model_damping: sd of the damping ratio of one mode about the building's, over it.
        frequency: sd of an identified ln f where the file gives none.
        shape: sd of an identified shape over its largest component, likewise.
        damping: sd of an identified damping ratio over it, likewise.
    """

    model_frequency: float = 0.01
    model_shape: float = 0.02
    model_damping: float = 0.2
    frequency: float = 0.005
    shape: float = 0.03
    damping: float = 0.25


@dataclass(frozen=True)
class ModalTerms:
    """Identified modes with their weights, which are zero where nothing is known.

    Attributes:
        rows: which of the model's floors have a sensor.
        log_frequency: (m,) ln of rad/s.
        frequency_root: (m,) 1 / sd.
        damping: (m,).
        damping_root: (m,) 1 / sd.
        shape: (m, f).
        shape_root: (m, f) 1 / sd.
    """

    rows: tuple[int, ...]
    log_frequency: Tensor
    frequency_root: Tensor
    damping: Tensor
    damping_root: Tensor
    shape: Tensor
    shape_root: Tensor

    @property
    def freedom(self) -> tuple[int, int, int]:
        """Independent figures: frequencies, damping ratios, components beyond the scales."""
        free = (self.shape_root > 0.0).sum(dim=1) - 1
        return (
            len(self.log_frequency),
            int((self.damping_root > 0.0).sum()),
            int(free.clamp_min(0).sum()),
        )

    def residuals(self, own: "Paired") -> tuple[Tensor, Tensor, Tensor]:
        """Whitened residuals, predicted less identified: (n, m), (n, m) and (n, m f)."""
        return (
            self.frequency_root * (own.log_frequency - self.log_frequency),
            self.damping_root * (own.damping - self.damping),
            (self.shape_root * (own.shape - self.shape)).flatten(1),
        )


def modal_terms(
    modes: IdentifiedModes, floors: tuple[str, ...], errors: ModalErrors, damping: bool
) -> ModalTerms:
    """Weights of identified modes.

    Args:
        modes: on floors of the model.
        damping: whether damping ratios count.
    """
    relative = np.where(
        np.isnan(modes.frequency_sd_hz),
        errors.frequency,
        modes.frequency_sd_hz / modes.frequency_hz,
    )
    seen = ~np.isnan(modes.damping) & damping
    ratio = np.where(seen, modes.damping, 0.0)
    ratio_sd = np.where(np.isnan(modes.damping_sd), errors.damping * ratio, modes.damping_sd)
    ratio_sd = np.where(seen, np.hypot(ratio_sd, errors.model_damping * ratio), np.inf)
    there = ~np.isnan(modes.shape)
    shape = np.where(there, modes.shape, 0.0)
    # One component alone has no scale to be compared with.
    there &= there.sum(axis=1, keepdims=True) > 1
    largest = np.abs(shape).max(axis=1, keepdims=True, initial=0.0)
    stated = np.where(np.isnan(modes.shape_sd), errors.shape * largest, modes.shape_sd)
    shape_sd = np.where(there, np.hypot(stated, errors.model_shape * largest), np.inf)
    return ModalTerms(
        rows=tuple(floors.index(name) for name in modes.floors),
        log_frequency=torch.from_numpy(np.log(2.0 * np.pi * modes.frequency_hz)),
        frequency_root=torch.from_numpy(1.0 / np.hypot(relative, errors.model_frequency)),
        damping=torch.from_numpy(ratio),
        damping_root=torch.from_numpy(1.0 / ratio_sd),
        shape=torch.from_numpy(shape),
        shape_root=torch.from_numpy(1.0 / shape_sd),
    )


@dataclass(frozen=True)
class Paired:
    """The modes of the model that belong to m identified ones.

    Attributes:
        column: (n, m) which modes, from the lowest on.
        log_frequency: (n, m) ln of rad/s.
        damping: (n, m) ratios.
        shape: (n, m, f) in the scale of the identified shapes, with their sign.
    """

    column: Tensor
    log_frequency: Tensor
    damping: Tensor
    shape: Tensor


@dataclass(frozen=True)
class ShownModes:
    """All modes of a model, r of them, as g floors with sensors show them.

    Attributes:
        log_frequency: (n, r) ln of rad/s.
        damping: (n, r) ratios.
        shape: (n, g, r) of unit modal mass.
    """

    log_frequency: Tensor
    damping: Tensor
    shape: Tensor


def shown_modes(system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> ShownModes:
    """Modes of a system on all its floors, at theta (n, p), zeta (n,) and sizes (n, q)."""
    modes, count = system.modes(theta, sizes, released=True), len(system.floors)
    shape = modes.rows[:, :count] * modes.omega[:, None, :]
    # What has no mass moves without end in its mode, and is no mode that anybody identifies.
    real = modes.inverse > _MASSLESS * modes.inverse.amax(dim=1, keepdim=True)
    return ShownModes(
        modes.omega.log(),
        system.ratio(modes.omega, zeta, sizes),
        torch.where(real[:, None, :], shape, 0.0),
    )


def paired(terms: ModalTerms, shown: ShownModes) -> Paired:
    """Every identified mode with one of the model's, which are shown on all floors."""
    shape = shown.shape[:, list(terms.rows)]
    column = _assigned(_cost(terms, shown, shape))
    own = shape.gather(2, column[:, None, :].expand(-1, shape.shape[1], -1)).mT
    weight = terms.shape_root.square()
    scale = (weight * terms.shape * own).sum(2) / _length(weight, own)
    return Paired(
        column,
        shown.log_frequency.gather(1, column),
        shown.damping.gather(1, column),
        own * scale[:, :, None],
    )


@torch.no_grad()
def _cost(terms: ModalTerms, shown: ShownModes, shape: Tensor) -> Floats:
    """Misfit (n, m, r) of every identified mode with each of the model's."""
    away = terms.log_frequency[:, None] - shown.log_frequency[:, None, :]
    cost = (terms.frequency_root[:, None] * away).square()
    more = terms.damping[:, None] - shown.damping[:, None, :]
    cost = cost + (terms.damping_root[:, None] * more).square()
    weight = terms.shape_root.square()
    product = torch.einsum("mf,nfr->nmr", weight * terms.shape, shape)
    length = torch.einsum("mf,nfr->nmr", weight, shape.square()).clamp_min(_TINY)
    whole = (weight * terms.shape.square()).sum(1)
    cost = cost + whole[:, None] - product.square() / length
    felt = shape.square().sum(1)
    share = felt / felt.amax(dim=1, keepdim=True)
    return (cost - 2.0 * share.clamp_min(_TINY).log()[:, None, :]).numpy()


def _length(weight: Tensor, shape: Tensor) -> Tensor:
    return (weight * shape.square()).sum(2).clamp_min(_TINY)


def _assigned(cost: Floats) -> Tensor:
    """Columns (n, m), each once, of the smallest sum of costs (n, m, r)."""
    finite = np.where(np.isfinite(cost), cost, np.finfo(np.float64).max / 1e9)
    return torch.tensor(np.array([linear_sum_assignment(one)[1] for one in finite]))
