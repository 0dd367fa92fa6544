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

from femupdate.dynamics.system import System
from femupdate.effects.effect import Effect, Placed, observed, split_sizes
from femupdate.errors import InferenceError
from femupdate.inference.model_error import (
    MODES_OFF,
    WILD,
    Cell,
    ErrorTable,
    LearnedError,
    Remains,
)
from femupdate.measurement.modes import IdentifiedModes
from femupdate.units import percent

_TINY = 1e-30
# Errors of a shape, of its largest component, and of a damping ratio, of it, over those of ln of a
# frequency. Of shapes, wrong sticks fitted to their modes have .5 to 2.4.
_SHAPE_OFF, _DAMPING_OFF = 2.0, 20.0
_FREQUENCY, _DAMPING = "frequency", "damping ratio"
_GROUPS = ("frequencies", "damping ratios", "shapes")


@dataclass(frozen=True)
class ModalErrors:
    """What is assumed where a file states no error, and errors of the model that nobody learns.

    Attributes:
        model_frequency: sd of the model's ln f, where somebody states it.
        model_damping: sd of the damping ratio of one mode about the building's, over it.
        frequency: sd of an identified ln f where the file gives none.
        shape: sd of an identified shape over its largest component, likewise.
        damping: sd of an identified damping ratio over it, likewise.
    """

    model_frequency: float = 0.0
    model_damping: float = 0.2
    frequency: float = 0.005
    shape: float = 0.03
    damping: float = 0.25


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeData:
    """Identified modes of one file, with the errors that the model's own modes have.

    Predictions (N, 2 + f, r) hold ln of the frequency (rad/s), the damping ratio and the shape on
    all floors of every mode of the model; residuals are frequencies (m), damping ratios (m) and
    shapes (m g) on the floors with a sensor. Modes cannot be parted: no half of them would leave
    the stiffness factors known. Roots are 1 / sd, and zero where nothing is known.

    Attributes:
        names: (m,) of the modes.
        rows: which of the model's floors have a sensor.
        log_frequency: (m,) ln of rad/s.
        frequency_root: (m,).
        damping: (m,).
        damping_root: (m,).
        shape: (m, g).
        shape_root: (m, g).
        source: the file, where there are several.
        table: what the model may err by beside their errors.
        wild: standard deviations beyond which a figure counts as that many.
    """

    floors: tuple[str, ...]
    names: tuple[str, ...]
    rows: tuple[int, ...]
    log_frequency: Tensor
    frequency_root: Tensor
    damping: Tensor
    damping_root: Tensor
    shape: Tensor
    shape_root: Tensor
    source: str = ""
    table: ErrorTable = MODES_OFF
    wild: float = WILD

    at_once = 64
    """Points at a time."""
    name = "modes"
    """What they are."""
    levels = (0.0,)
    """Of motion: one."""

    @property
    def halves(self) -> "tuple[ModeData, ...]":
        """None."""
        return ()

    @property
    def residuals(self) -> int:
        """Number of residuals, with those of figures that the file lacks."""
        return len(self._root)

    @property
    def points(self) -> int:
        """Number of numbers compared."""
        return int((self._root > 0.0).sum())

    @property
    def freedom(self) -> tuple[int, int, int]:
        """Independent figures: frequencies, damping ratios, components beyond the scales."""
        free = (self.shape_root > 0.0).sum(dim=1) - 1
        ratios = int((self.damping_root > 0.0).sum())
        return len(self.names), ratios, int(free.clamp_min(0).sum())

    @property
    def effective(self) -> float:
        """Of frequencies, damping ratios and components of shapes beyond their scales."""
        return float(sum(self.freedom)) if self.points else 0.0

    def checked(self, squares: Tensor, wild: Tensor) -> list[tuple[str, Tensor, Tensor]]:
        """Name, squares (n,), and independent numbers (n,), of each group that is checked apart.

        Args:
            squares: (n, f) of `LearnedError.floor_squares`.
            wild: (n, m) residuals that are not in them, likewise.
        """
        count = len(self.names)
        sizes = [count, count, squares.shape[1] - 2 * count]
        parts = squares.split(sizes, dim=1), wild.split(sizes, dim=1)
        several = f" of {self.source}" if self.source else ""
        groups = zip(_GROUPS, *parts, self.freedom, strict=True)
        return [
            (f"{name}{several}", part.sum(1), float(free) - out.sum(1))
            for name, part, out, free in groups
            if free
        ]

    @property
    def frequency_hz(self) -> Tensor:
        """(m,)."""
        return self.log_frequency.exp() / (2.0 * torch.pi)

    @property
    def top_hz(self) -> float:
        """The highest frequency."""
        return float(self.frequency_hz.max())

    @property
    def _root(self) -> Tensor:
        """(n,) of the residuals."""
        return torch.cat([self.frequency_root, self.damping_root, self.shape_root.flatten()])

    def shows(self, effect: Effect) -> bool:
        """Whether an effect can show in it at all."""
        return _shows(effect)

    def error(self, known: Tensor | None) -> LearnedError:
        """More noise than stated, beside errors (c, n) that are known beforehand."""
        weight = self._learned[:, None]
        points, origin = self.effective, weight.new_zeros(1)
        error = LearnedError(weight, origin, points, known, table=self.table, wild=self.wild)
        squares = (self.shape_root * self.shape).square()
        wider = self._learned[2 * len(self.names) :].view_as(squares)
        sizes = torch.tensor([level.own for level in error.levels], dtype=torch.float64)
        # A scale is sought with the parameters: the error of one component less is seen.
        known = (squares / (1.0 + sizes[:, None, None].square() * wider)).sum(2)
        scales = torch.where(known > 0.0, known, 1.0).log().sum(1)
        return error.weighted(-0.5 * scales)

    @property
    def _learned(self) -> Tensor:
        """(n,) variance, over that stated, of a model that is e times off in frequency."""
        largest = self.shape.abs().amax(dim=1, keepdim=True) if self.rows else self.shape
        shapes = (_SHAPE_OFF * largest).expand_as(self.shape).flatten()
        sizes = torch.ones_like(self.damping), _DAMPING_OFF * self.damping, shapes
        return (self._root * torch.cat(sizes)).square()

    def predicted(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """All modes of the model (N, 2 + f, r), as their sensors give them."""
        # Two million numbers in the matrices of a batch of eigenproblems.
        count = max(16, 2**21 // system.model.size**2)
        parts = zip(theta.split(count), zeta.split(count), sizes.split(count), strict=True)
        return torch.cat([modes_as_read(system, *some) for some in parts])

    def read_with(self, predicted: Tensor, placed: Placed) -> Tensor:
        """Modes with channels exchanged or reversed."""
        none = predicted.new_zeros(len(predicted), 0)
        shape = _read(predicted[:, 2:], self.floors, placed, none)
        return torch.cat([predicted[:, :2], shape], dim=1)

    def compared(self, predicted: Tensor) -> Tensor:
        """Residuals (N, n), identified less predicted, each mode beside its own."""
        beside = self.paired(predicted)
        parts = (
            self.frequency_root * (self.log_frequency - beside[:, :, 0]),
            self.damping_root * (self.damping - beside[:, :, 1]),
            (self.shape_root * (self.shape - beside[:, :, 2:])).flatten(1),
        )
        return torch.cat(parts, dim=1)

    def paired(self, predicted: Tensor) -> Tensor:
        """The modes of predictions that belong to the identified ones, (N, m, 2 + g).

        ln of the frequency, the damping ratio, and the shape in the identified scale and sign.
        """
        seen = predicted[:, [0, 1, *(row + 2 for row in self.rows)]]
        column = self.columns(predicted)
        chosen = seen.gather(2, column[:, None, :].expand(-1, seen.shape[1], -1)).mT
        shape, weight = chosen[:, :, 2:], self.shape_root.square()
        length = (weight * shape.square()).sum(2).clamp_min(_TINY)
        scale = (weight * self.shape * shape).sum(2) / length
        return torch.cat([chosen[:, :, :2], shape * scale[:, :, None]], dim=2)

    @torch.no_grad()
    def columns(self, predicted: Tensor) -> Tensor:
        """Which mode of the model each identified one is, (N, m): those of the smallest misfit."""
        from scipy.optimize import linear_sum_assignment

        shape = predicted[:, [row + 2 for row in self.rows]]
        away = self.log_frequency[:, None] - predicted[:, :1]
        # As if the model erred by 1 %: far from the data, shapes must count, too.
        squares = self._root.square() / (1.0 + 1e-4 * self._learned)
        count = len(self.names)
        frequency, damping, shapes = squares.split([count, count, len(squares) - 2 * count])
        cost = frequency[:, None] * away.square()
        cost = cost + damping[:, None] * (self.damping[:, None] - predicted[:, 1:2]).square()
        weight = shapes.view_as(self.shape)
        product = torch.einsum("mf,nfr->nmr", weight * self.shape, shape)
        length = torch.einsum("mf,nfr->nmr", weight, shape.square()).clamp_min(_TINY)
        whole = (weight * self.shape.square()).sum(1)
        cost = cost + whole[:, None] - product.square() / length
        # Where no sensor says what moves, all floors do.
        felt = (shape if self.rows else predicted[:, 2:]).square().sum(1)
        share = felt / felt.amax(dim=1, keepdim=True)
        cost = cost - 2.0 * share.clamp_min(_TINY).log()[:, None, :]
        finite = torch.where(cost.isfinite(), cost, np.finfo(np.float64).max / 1e9).numpy()
        return torch.tensor(np.array([linear_sum_assignment(each)[1] for each in finite]))

    def moved(self, from_: Tensor, to: Tensor) -> Tensor:
        """Change (N, n) from one prediction to others, in the unit of the residuals."""
        return self.compared(from_) - self.compared(to)

    def by_floor(self, moved: Tensor) -> Tensor:
        """Nothing (f, n): the errors of shapes hold what one floor shows more than another."""
        return moved.new_zeros(len(self.rows), len(moved))

    def coarse(self, noise: float) -> "ModeData":
        """The same with so much more noise, as a share of frequency, damping and largest part."""

        def wider(root: Tensor, noise: Tensor | float) -> Tensor:
            return torch.where(root > 0.0, (root.clamp_min(1e-30) ** -2 + noise**2) ** -0.5, 0.0)

        largest = self.shape.abs().amax(dim=1, keepdim=True) if self.rows else self.shape
        return replace(
            self,
            frequency_root=wider(self.frequency_root, noise),
            damping_root=wider(self.damping_root, noise * self.damping),
            shape_root=wider(self.shape_root, noise * largest),
        )

    def emptied(self) -> "ModeData":
        """The same as if nothing had been observed."""
        roots = (self.frequency_root, self.damping_root, self.shape_root)
        frequency, damping, shape = (torch.zeros_like(root) for root in roots)
        return replace(self, frequency_root=frequency, damping_root=damping, shape_root=shape)

    def cells(self, left: Tensor) -> tuple[Cell, ...]:
        """Every frequency, damping ratio and component of a shape."""
        count = len(self.names)
        squared = (left**2).split([count, count, count * len(self.rows)])
        parts = [squared[0], squared[1], *squared[2].reshape(count, -1).T]
        roots = [self.frequency_root, self.damping_root, *self.shape_root.T]
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
        """What residuals (n,) hold beside noise, by a row of the table of errors."""
        if not error.levels[row].own:
            return Remains()
        off = error.tame(raw[None], row)[0] * torch.where(self._root > 0.0, 1.0 / self._root, 0.0)
        frequency = off[: len(self.names)].abs().numpy()
        size, worst = float(np.sqrt((frequency**2).mean())), int(frequency.argmax())
        hertz = float(self.frequency_hz[worst])
        there = float(frequency[worst])
        text = (
            "The identified modes are farther off than their errors allow; frequencies by "
            f"{percent(np.expm1(size), 1)} (rms), most that of mode {self.names[worst]} at "
            f"{hertz:.3g} Hz ({percent(np.expm1(there), 1)})."
        )
        return Remains(size, 0.0, f"mode {self.names[worst]}", (hertz, hertz), there, 1.0, text)

    def changed(self, from_: Tensor, to: Tensor, instrument: bool) -> float:
        """Largest change of a component of a shape (rms over the modes), over the largest one."""
        before, after = (self.paired(side)[0, :, 2:] for side in (from_, to))  # (m, g)
        there = (self.shape_root > 0.0).to(before)
        if not there.any():
            return 0.0
        largest = self.shape.abs().amax(dim=1, keepdim=True).clamp_min(1e-300)
        change = there * ((after - before) / largest) ** 2
        return float((change.sum(0) / there.sum(0).clamp_min(1.0)).sqrt().max())


def _shows(effect: Effect) -> bool:
    return not (effect.tables_only or effect.needs_levels)


def modes_as_read(system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
    """Modes of a system on all its floors (N, 2 + f, r), as their sensors give them.

    ln of the frequency (rad/s), damping ratio, and shape of unit modal mass.

    Args:
        theta: (N, p); zeta: (N,); sizes: (N, q) of the effects.
    """
    modes = system.modes(theta, sizes, released=True)
    shape = modes.rows[:, : len(system.floors)] * modes.omega[:, None, :]
    # What has no mass moves without end in its mode, and is no mode that anybody identifies.
    real = modes.inverse > 1e-14 * modes.inverse.amax(dim=1, keepdim=True)
    shape = torch.where(real[:, None, :], shape, 0.0)
    for listed, size in zip(system.placed, split_sizes(system.placed, sizes), strict=True):
        if listed.effect.instrument and _shows(listed.effect):
            shape = _read(shape, system.floors, listed, size)
    ratio = system.ratio(modes.omega, zeta, sizes)
    return torch.cat([modes.omega.log()[:, None], ratio[:, None], shape], dim=1)


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
    shape_sd = np.where(there, stated, np.inf)
    return ModeData(
        floors=system.floors,
        names=modes.names,
        rows=tuple(system.floors.index(name) for name in modes.floors),
        log_frequency=torch.from_numpy(np.log(2.0 * np.pi * modes.frequency_hz)),
        frequency_root=torch.from_numpy(1.0 / np.hypot(relative, errors.model_frequency)),
        damping=torch.from_numpy(ratio),
        damping_root=torch.from_numpy(1.0 / ratio_sd),
        shape=torch.from_numpy(shape),
        shape_root=torch.from_numpy(1.0 / shape_sd),
        source=source,
    )
