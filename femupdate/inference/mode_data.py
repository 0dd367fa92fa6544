"""Identified modes as a model is judged by them: frequencies, damping ratios and shapes.

Which mode of the model is which identified one is decided anew at every parameter vector: the
pairing with the smallest misfit of frequency, shape (a weighted MAC) and damping together, one to
one (assignment by Crouse 2016, IEEE Trans. Aerosp. Electron. Syst. 52, 1679). The scale a of an
identified shape y is taken out in closed form: with the weights W = 1 / sd^2 of its components the
best a = phi'Wy / phi'W phi leaves y'Wy (1 - MAC_W).
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.special import chdtrc
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.system import System
from femupdate.effects.effect import Effect, Placed, observed, split_sizes
from femupdate.errors import InferenceError
from femupdate.inference.data import WILD, Cell, Remains
from femupdate.inference.model_error import NOISE_ALONE, ErrorTable, LearnedError
from femupdate.measurement.modes import IdentifiedModes
from femupdate.units import percent

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

    def residuals(self, modelled: "Paired") -> tuple[Tensor, Tensor, Tensor]:
        """Whitened residuals, predicted less identified: (n, m), (n, m) and (n, m f)."""
        return (
            self.frequency_root * (modelled.log_frequency - self.log_frequency),
            self.damping_root * (modelled.damping - self.damping),
            (self.shape_root * (modelled.shape - self.shape)).flatten(1),
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
    from scipy.optimize import linear_sum_assignment

    shape = shown.shape[:, list(terms.rows)]
    cost = _cost(terms, shown, shape)
    cost = np.where(np.isfinite(cost), cost, np.finfo(np.float64).max / 1e9)
    column = torch.tensor(np.array([linear_sum_assignment(each)[1] for each in cost]))
    chosen = shape.gather(2, column[:, None, :].expand(-1, shape.shape[1], -1)).mT
    weight = terms.shape_root.square()
    scale = (weight * terms.shape * chosen).sum(2) / (weight * chosen.square()).sum(2).clamp_min(
        _TINY
    )
    return Paired(
        column,
        shown.log_frequency.gather(1, column),
        shown.damping.gather(1, column),
        chosen * scale[:, :, None],
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


_FREQUENCY, _DAMPING = "frequency", "damping ratio"
_GROUPS = ("frequencies", "damping ratios", "shapes")
_MATRICES = 2**21  # numbers in the matrices of a batch of eigenproblems


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeData:
    """Identified modes of one file, with the errors that the model's own modes have.

    Predictions (N, 2 + f, r) hold ln of the frequency (rad/s), the damping ratio and the shape on
    all floors of every mode of the model; residuals are frequencies (m), damping ratios (m) and
    shapes (m g) on the floors with a sensor. Modes cannot be parted: no half of them would leave
    the stiffness factors known.

    Attributes:
        names: (m,) of the modes.
        terms: the modes with their weights.
        source: the file, where there are several.
        table: what the model may err by beside their errors.
        wild: standard deviations beyond which a figure counts as that many.
    """

    floors: tuple[str, ...]
    names: tuple[str, ...]
    terms: ModalTerms
    source: str = ""
    table: ErrorTable = NOISE_ALONE
    wild: float = WILD

    @property
    def at_once(self) -> int:
        """Points at a time."""
        return 64

    @property
    def name(self) -> str:
        """What they are."""
        return "modes"

    @property
    def halves(self) -> "tuple[ModeData, ...]":
        """None."""
        return ()

    @property
    def rows(self) -> tuple[int, ...]:
        """Which floors have a sensor."""
        return self.terms.rows

    @property
    def residuals(self) -> int:
        """Number of residuals, with those of figures that the file lacks."""
        return len(self._root)

    @property
    def points(self) -> int:
        """Number of numbers compared."""
        return int((self._root > 0.0).sum())

    @property
    def effective(self) -> float:
        """Of frequencies, damping ratios and components of shapes beyond their scales."""
        return float(sum(self.terms.freedom)) if self.points else 0.0

    def checked(self, squares: Tensor, wild: Tensor) -> list[tuple[str, Tensor, Tensor]]:
        """The same of frequencies, damping ratios and shapes."""
        count = len(self.terms.log_frequency)
        sizes = [count, count, squares.shape[1] - 2 * count]
        parts = squares.split(sizes, dim=1), wild.split(sizes, dim=1)
        several = f" of {self.source}" if self.source else ""
        groups = zip(_GROUPS, *parts, self.terms.freedom, strict=True)
        return [
            (f"{name}{several}", part.sum(1), float(free) - out.sum(1))
            for name, part, out, free in groups
            if free
        ]

    @property
    def frequency_hz(self) -> Tensor:
        """(m,)."""
        return self.terms.log_frequency.exp() / (2.0 * torch.pi)

    @property
    def top_hz(self) -> float:
        """The highest frequency."""
        return float(self.frequency_hz.max())

    @property
    def levels(self) -> tuple[float, ...]:
        """Of motion: one."""
        return (0.0,)

    @property
    def _root(self) -> Tensor:
        """(n,) 1 / sd of the residuals."""
        terms = self.terms
        return torch.cat([terms.frequency_root, terms.damping_root, terms.shape_root.flatten()])

    def shows(self, effect: Effect) -> bool:
        """Whether an effect can show in it at all."""
        return _shows(effect)

    def error(self, known: Tensor | None) -> LearnedError:
        """More noise than stated, beside errors (c, n) that are known beforehand."""
        weight = (self._root > 0.0).to(torch.float64)[:, None]
        origin = weight.new_zeros(1)
        return LearnedError(weight, origin, self.effective, known, table=self.table, wild=self.wild)

    def predicted(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """All modes of the model (N, 2 + f, r), as their sensors give them."""
        count = max(16, _MATRICES // system.model.size**2)
        parts = []
        for some in zip(theta.split(count), zeta.split(count), sizes.split(count), strict=True):
            shown = modes_as_read(system, *some)
            columns = [shown.log_frequency[:, None], shown.damping[:, None], shown.shape]
            parts.append(torch.cat(columns, dim=1))
        return torch.cat(parts)

    def read_with(self, predicted: Tensor, placed: Placed) -> Tensor:
        """Modes with channels exchanged or reversed."""
        none = predicted.new_zeros(len(predicted), 0)
        shape = _read(predicted[:, 2:], self.floors, placed, none)
        return torch.cat([predicted[:, :2], shape], dim=1)

    def compared(self, predicted: Tensor) -> Tensor:
        """Residuals (N, n), identified less predicted, each mode beside its own."""
        return -torch.cat(self.terms.residuals(self.paired(predicted)), dim=1)

    def paired(self, predicted: Tensor) -> Paired:
        """The modes of predictions that belong to the identified ones."""
        shown = ShownModes(predicted[:, 0], predicted[:, 1], predicted[:, 2:])
        return paired(self.terms, shown)

    def moved(self, from_: Tensor, to: Tensor) -> Tensor:
        """Change (N, n) from one prediction to others, in the unit of the residuals."""
        return self.compared(from_) - self.compared(to)

    def by_floor(self, moved: Tensor) -> Tensor:
        """Nothing (f, n): the errors of shapes hold what one floor shows more than another."""
        return moved.new_zeros(len(self.rows), len(moved))

    def coarse(self, noise: float) -> "ModeData":
        """The same with so much more noise, as a share of frequency, damping and largest part."""
        terms = self.terms
        largest = terms.shape.abs().amax(dim=1, keepdim=True) if self.rows else terms.shape
        return replace(
            self,
            terms=replace(
                terms,
                frequency_root=_wider(terms.frequency_root, noise),
                damping_root=_wider(terms.damping_root, noise * terms.damping),
                shape_root=_wider(terms.shape_root, noise * largest),
            ),
        )

    def emptied(self) -> "ModeData":
        """The same as if nothing had been observed."""
        terms = self.terms
        nothing = replace(
            terms,
            frequency_root=torch.zeros_like(terms.frequency_root),
            damping_root=torch.zeros_like(terms.damping_root),
            shape_root=torch.zeros_like(terms.shape_root),
        )
        return replace(self, terms=nothing)

    def cells(self, left: Tensor) -> tuple[Cell, ...]:
        """Every frequency, damping ratio and component of a shape."""
        count = len(self.names)
        squared = (left**2).split([count, count, count * len(self.rows)])
        parts = [squared[0], squared[1], *squared[2].reshape(count, -1).T]
        roots = [self.terms.frequency_root, self.terms.damping_root, *self.terms.shape_root.T]
        what = (_FREQUENCY, _DAMPING, *(self.floors[row] for row in self.rows))
        cells = []
        for name, values, root in zip(what, parts, roots, strict=True):
            for hertz, value, there in zip(self.frequency_hz, values, root > 0.0, strict=True):
                band = (float(hertz), float(hertz))
                excess = float(value) - 1.0 if there else 0.0
                tail = float(chdtrc(1, float(value))) if there else 1.0
                cells.append(Cell(name, band, excess, tail, self.name))
        return tuple(cells)

    def remains(self, error: LearnedError, row: int, raw: Tensor) -> Remains:
        """What residuals (n,) hold beside noise: something where the stated noise is too little."""
        noise = error.levels[row].noise
        if noise == 1.0:
            return Remains()
        off = error.tame(raw[None], row)[0] * torch.where(self._root > 0.0, 1.0 / self._root, 0.0)
        count = len(self.names)
        frequency = off[:count].abs().numpy()
        size, worst = float(np.sqrt((frequency**2).mean())), int(frequency.argmax())
        hertz = float(self.frequency_hz[worst])
        there = float(frequency[worst])
        text = (
            f"The identified modes are {noise:.0f} times farther off than their errors allow; "
            f"frequencies by {percent(np.expm1(size), 1)} (rms), most that of mode "
            f"{self.names[worst]} at {hertz:.3g} Hz ({percent(np.expm1(there), 1)})."
        )
        return Remains(size, 0.0, f"mode {self.names[worst]}", (hertz, hertz), there, noise, text)

    def changed(self, from_: Tensor, to: Tensor, instrument: bool) -> float:
        """Largest change of a component of a shape (rms over the modes), over the largest one."""
        before, after = (self.paired(side).shape[0] for side in (from_, to))  # (m, g)
        there = (self.terms.shape_root > 0.0).to(before)
        if not there.any():
            return 0.0
        largest = self.terms.shape.abs().amax(dim=1, keepdim=True).clamp_min(1e-300)
        change = there * ((after - before) / largest) ** 2
        return float((change.sum(0) / there.sum(0).clamp_min(1.0)).sqrt().max())


def _wider(root: Tensor, noise: Tensor | float) -> Tensor:
    """1 / sd with so much more noise; zero where nothing is known."""
    return torch.where(root > 0.0, (root.clamp_min(1e-30) ** -2 + noise**2) ** -0.5, 0.0)


def _shows(effect: Effect) -> bool:
    return not (effect.tables_only or effect.needs_levels)


def modes_as_read(system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> ShownModes:
    """Modes of a system on all its floors, as their sensors give them.

    Args:
        theta: (N, p); zeta: (N,); sizes: (N, q) of the effects.
    """
    shown = shown_modes(system, theta, zeta, sizes)
    shape = shown.shape
    for listed, size in zip(system.placed, split_sizes(system.placed, sizes), strict=True):
        if listed.effect.instrument and _shows(listed.effect):
            shape = _read(shape, system.floors, listed, size)
    return replace(shown, shape=shape)


def _read(shape: Tensor, floors: tuple[str, ...], placed: Placed, size: Tensor) -> Tensor:
    """Real shapes (N, f, r) as an instrument gives them."""
    still = shape.new_zeros(shape.shape[2])
    return observed((placed,), floors, shape.to(torch.complex128), still, size).real


def mode_data(
    modes: IdentifiedModes,
    system: System,
    errors: ModalErrors,
    *,
    damping: bool = True,
    source: str = "",
) -> ModeData:
    """Identified modes that a model is judged by.

    Args:
        modes: on floors of the model.
        damping: whether damping ratios count. Even where the building's is known they show where
            its law is wrong; of one that is right they say nothing.
        source: the file, where there are several.

    Raises:
        InferenceError: something acts along lines (dampers, appendages), so that the model has no
            real modes; or more modes are identified than the model has.
    """
    size = system.model.size
    if system.complex_modes:
        raise InferenceError(
            "a building with dampers or appendages has no real modes, and identified modes"
            " cannot be compared with it; give histories or FRFs"
        )
    if len(modes.names) > size:
        raise InferenceError(
            f"{modes.source} holds {len(modes.names)} modes but the model has {size} in all; leave"
            " out those that are doubtful, or the highest by --band"
        )
    return ModeData(
        floors=system.floors,
        names=modes.names,
        terms=modal_terms(modes, system.floors, errors, damping),
        source=source,
    )


__all__ = ["ModeData", "mode_data", "modes_as_read"]
