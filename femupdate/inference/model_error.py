"""What a model errs by, learned from the data: a Gaussian process over frequency beside the noise.

    ln|H| measured = ln|H| of the model + error + noise

The error is one process common to all floors and one of each floor alone, both of zero mean and
with the covariance s^2 exp(-|f - f'| / l) (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63, 425;
kernels for structures: Kosikova et al. 2023, CMAME 417, 116357). Their sizes, the length and by how
much the noise exceeds the stated one are not known: the density is summed over a table of them. Its
first row holds no error: where the model is right that row takes over, and posteriors are as if
there were no such thing. The same holds for phases.

A response is a sum of parts, one a mode, and a wrong model errs in these. Where they cancel, ln|H|
errs by as much more as they are larger than their sum, and too fast for a smooth process: rows with
an error count such points less. Counted whole, they outweigh peaks: of an aluminium frame, factors
by hammers at two floors were a tenth to a fifth apart, and damping was two to three times too high.

The processes are sums of harmonics with independent coefficients (Solin and Sarkka 2020, Stat.
Comput. 30, 419), so that a density costs some small matrix products.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from torch import Tensor


@dataclass(frozen=True, kw_only=True)
class ErrorTable:
    """What the error of a model may be, before the data are seen."""

    # Standard deviations of what all floors share and of each alone, in ln|H| or rad, beside zero.
    sizes: tuple[float, ...] = (0.02, 0.06, 0.18, 0.5)
    # Probabilities of these sizes alone, where there is an error; empty: alike.
    likely: tuple[float, ...] = ()
    # Over which errors are alike, of the band.
    lengths: tuple[float, ...] = (1 / 60, 1 / 20, 1 / 6)
    # Standard deviations of the noise over the stated one.
    noise: tuple[float, ...] = (1.0, 2.0, 4.0)
    # Steps of the finer table about the likeliest row, in one of the first.
    finer: float = 3.0
    # Probability that there is no error and the noise is as stated, before the data.
    none: float = 0.5
    # Cycles of the shortest harmonic in a period, and that of the longest: its ends must not meet.
    harmonics: int = 40
    period: float = 1.25
    # Size, length and noise from which fits start: wide enough for any model.
    start: tuple[float, float, float] = (0.18, 1 / 20, 2.0)
    # Weight over that of the likeliest row, below which a row is left out.
    counts: float = 1e-3
    # Of an error known beforehand, variance over the noise's, below which it is left out: of 192
    # of a six-story frame 84 remain.
    lost: float = 1e-3


MODEL_ERROR = ErrorTable()
# A hundred fits share it, and only their differences count.
COARSE_ERROR = ErrorTable(sizes=(0.03, 0.1, 0.3), lengths=(1 / 30, 1 / 8))
# Of figures that lie on no frequency axis: nothing but more noise than stated.
NOISE_ALONE = ErrorTable(
    sizes=(),
    lengths=(1.0,),
    noise=(1.0, 2.0, 4.0, 8.0, 16.0, 32.0),
    harmonics=0,
    start=(0.0, 1.0, 8.0),
)

# Of identified modes, in ln of a frequency. Sticks of three and five stories with a mass off by a
# tenth, with all masses off by 5 %, tied over two stories or with bending, fitted to their modes,
# miss frequencies by .017 (rms), times or over 2. Any other building is a millionth.
MODES_OFF = ErrorTable(
    sizes=(0.003, 0.01, 0.03, 0.1, 0.3, 1.0),
    likely=(0.03, 0.48, 0.46, 0.03, 2e-4, 1e-6),
    lengths=(1.0,),
    noise=(1.0,),
    harmonics=0,
    none=0.2,
    start=(0.03, 1.0, 1.0),
)

# Of figures that are taken at their word.
STATED = ErrorTable(sizes=(), lengths=(1.0,), noise=(1.0,), harmonics=0, start=(0.0, 1.0, 1.0))

# Numbers in the factors of rows, up to which these are kept; and rows that are worked at once.
_KEPT, _AT_ONCE = 3e7, 24


@dataclass(frozen=True)
class ErrorLevel:
    """One row of the table.

    Attributes:
        common, own: standard deviations of what all floors share and of each alone.
        length_hz: over which errors are alike.
        noise: standard deviation of the noise over the stated one.
        log_weight: of the prior, over that of no error, so that evidence is not lowered where the
            model is right.
    """

    common: float
    own: float
    length_hz: float
    noise: float
    log_weight: float


def error_levels(width_hz: float, table: ErrorTable = MODEL_ERROR) -> tuple[ErrorLevel, ...]:
    """All rows for frequencies over a band; that of no error comes first."""
    sizes = (0.0, *table.sizes)
    kinds = [(0.0, 0.0, table.lengths[-1])]
    kinds += [
        (common, alone, share)
        for common in (sizes if table.harmonics else (0.0,))
        for alone in sizes
        if common + alone > 0.0
        for share in table.lengths
    ]
    rows = [(*kind, noise) for kind in kinds for noise in table.noise]
    other = math.log1p(-table.none) - math.log(table.none)
    each = dict(zip(table.sizes, table.likely, strict=False))
    alike = 1.0 / max(len(rows) - 1, 1)
    return tuple(
        ErrorLevel(
            common,
            alone,
            share * width_hz,
            noise,
            other + math.log(each.get(alone, alike)) if row else 0.0,
        )
        for row, (common, alone, share, noise) in enumerate(rows)
    )


def finer_levels(
    about: ErrorLevel, none: ErrorLevel, table: ErrorTable = MODEL_ERROR
) -> tuple[ErrorLevel, ...]:
    """Rows about one, in finer steps, behind that of no error; together they weigh as much."""

    def steps(value: float, coarse: Sequence[float], least: float = 0.0) -> list[float]:
        ratio = (coarse[-1] / coarse[0]) ** (1.0 / (len(coarse) - 1) / table.finer)
        return sorted({max(least, value * ratio**step) for step in (-1, 0, 1)})

    rows = [
        (common, alone, length, noise)
        for common in steps(about.common, table.sizes)
        for alone in steps(about.own, table.sizes)
        for length in steps(about.length_hz, table.lengths)
        for noise in steps(about.noise, table.noise, 1.0)
    ]
    free = sum(value > 0.0 for value in (about.common, about.own)) + 2
    weight = about.log_weight - free * math.log(table.finer)
    return (none, *(ErrorLevel(*row, weight) for row in rows))


def noisier_levels(none: ErrorLevel, table: ErrorTable = MODEL_ERROR) -> tuple[ErrorLevel, ...]:
    """Rows without an error and with more noise than stated, but less than the next row has.

    A thousand points tell noise to a fiftieth: between the rows of a table nothing would fit.
    """
    steps = 2 * round(table.finer)
    weight = error_levels(1.0, table)[1].log_weight - math.log(steps)
    ratio = (table.noise[1] / table.noise[0]) ** (1.0 / steps)
    return tuple(
        replace(none, noise=none.noise * ratio**step, log_weight=weight) for step in range(1, steps)
    )


@dataclass(frozen=True)
class Harmonics:
    """Functions of frequency of which errors are sums.

    Attributes:
        first_hz: where the measured band begins.
        count: cycles of the shortest in a period.
    """

    first_hz: float
    width_hz: float
    period_hz: float
    count: int

    @staticmethod
    def over(seen_hz: Tensor, table: ErrorTable = MODEL_ERROR) -> "Harmonics":
        """Over measured frequencies (k,)."""
        first, width = _band(seen_hz)
        return Harmonics(first, width, table.period * width, table.harmonics)

    def at(self, frequency_hz: Tensor) -> Tensor:
        """Values (k, j) at frequencies (k,)."""
        cycles = torch.arange(1, self.count + 1).to(frequency_hz)
        angle = 2.0 * torch.pi / self.period_hz * (frequency_hz - self.first_hz)[:, None] * cycles
        return torch.cat([angle.new_ones(len(angle), 1), angle.cos(), angle.sin()], dim=1)

    @lru_cache(maxsize=512)  # noqa: B019  (a few numbers)
    def spread(self, length_hz: float) -> Tensor:
        """Standard deviations (j,) of the coefficients of a process of unit variance."""
        cycles = torch.arange(self.count + 1, dtype=torch.float64)
        density = 1.0 / (1.0 + (2.0 * torch.pi / self.period_hz * length_hz * cycles) ** 2)
        density[1:] *= 2.0
        share = (density / density.sum()).sqrt()
        return torch.cat([share, share[1:]])


def _band(seen_hz: Tensor) -> tuple[float, float]:
    """First of measured frequencies (k,) and their width; 1 Hz where they have none."""
    if not len(seen_hz):
        return 0.0, 1.0
    return float(seen_hz.min()), float(seen_hz.max() - seen_hz.min()) or 1.0


@dataclass(frozen=True, eq=False)
class _Factor:
    """Cholesky factors of the precision of all coefficients, scaled to a prior of unit variance.

    One for each of r rows of the table. Coefficients of one floor alone (a group is a floor in one
    part) are tied to those of another by what all share: the common process of their part, and
    errors known beforehand. Rows that differ by their common process alone share what is dear.

    Attributes:
        kind: (r,) which of u kinds of groups each row has.
        firsts: (u,) the first row of each kind.
        groups: (u, g, j, j) of each.
        across: (u, g, j, s) of these and the shared ones, were their common process of size one.
        sizes: (r, 1, s) by which these are larger.
        shared: (r, s, s).
    """

    kind: Tensor
    firsts: Tensor
    groups: Tensor
    across: Tensor
    sizes: Tensor
    shared: Tensor

    def forward(self, alone: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """The factors' inverses times values of all coefficients, (r, g, j, n) and (r, s, n).

        Where the rows of a kind have the same values of floors alone, (u, g, j, n) are enough.
        """
        groups, across = self.groups, self.across
        if len(alone) != len(groups):
            groups, across = groups[self.kind], across[self.kind]
        first = torch.linalg.solve_triangular(groups, alone, upper=False)
        rest = shared - self.sizes.mT * self.each(across.flatten(1, 2).mT @ first.flatten(1, 2))
        return first, torch.linalg.solve_triangular(self.shared, rest, upper=False)

    def solve(self, alone: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """The precisions' inverses times values of all coefficients, shaped likewise."""
        first, rest = self.forward(alone, shared)
        rest = torch.linalg.solve_triangular(self.shared.mT, rest, upper=True)
        first = first - self.each(self.across) @ (self.sizes.mT * rest)[:, None]
        return torch.linalg.solve_triangular(self.each(self.groups).mT, first, upper=True), rest

    def each(self, kinds: Tensor) -> Tensor:
        """Of every row what its kind has."""
        return kinds if len(kinds) == len(self.kind) else kinds[self.kind]

    @property
    def size(self) -> int:
        """Numbers in it."""
        return self.groups.numel() + self.across.numel() + self.shared.numel()


class LearnedError:
    """The density of residuals that hold an error of the model, summed over what it may be.

    Residuals (n, p f k) are whitened by the stated noise alone, zero where a point is not valid.
    They have p parts: ln|H|, and where it is compared the phase, whose error is as large (rad) and
    independent.

    Args:
        weight: (f, k) inverse variance of the noise, zero where a point is not valid.
        frequency_hz: (k,).
        points: how many numbers err independently; by default every valid one.
        known: (c, p f k) changes of the residuals by one standard deviation of every error that is
            known beforehand, as that of a mesh.
        table: what the error may be.
        wild: standard deviations of a point, error and noise together, beyond which it counts as
            that many; by default every point counts whole.
        cancelled: (f, k) by how much more than the noise a point errs at random where the model
            errs, as by errors known beforehand, one or above; by default nowhere.
        leaking: (f, k) by how much more than the noise a point errs with what leaks, one or above.
            A model that errs, as by errors known beforehand, errs in that as well.
        shared: (f, k) share of the noise's standard deviation that all floors have in common at a
            frequency, as that of the base's sensor; by default nothing. Rows with an error count
            it whole at every floor, which is never too sure.

    Attributes:
        levels: rows of the table that are summed over.
    """

    def __init__(
        self,
        weight: Tensor,
        frequency_hz: Tensor,
        points: float | None = None,
        known: Tensor | None = None,
        table: ErrorTable = MODEL_ERROR,
        parts: int = 1,
        wild: float = math.inf,
        cancelled: Tensor | None = None,
        leaking: Tensor | None = None,
        shared: Tensor | None = None,
    ) -> None:
        seen = frequency_hz[(weight > 0).any(0)]
        self._table = table
        self.levels = error_levels(_band(seen)[1], table)
        self.harmonics = Harmonics.over(seen, table)
        self.floors, self._parts = len(weight), parts
        self._points = float(parts * (weight > 0).sum()) if points is None else points
        self._weight, self._wild = weight.flatten().repeat(parts), wild
        # (e, p f k): of residuals by rows without an error, then by those with one if that differs.
        scale, determinant, self._together = torch.ones_like(weight)[None], 0.0, None
        wider = torch.ones_like(weight) if leaking is None else leaking
        if known is not None and not (leaking is None and cancelled is None):
            random = wider if cancelled is None else wider * cancelled
            scale, shared = 1.0 / random[None], None
        if shared is not None:
            wider = torch.maximum(wider, (1.0 - shared**2 + shared * shared.sum(0)).sqrt())
            column = shared.T[:, :, None]
            covariance = torch.diag_embed(1.0 - shared.T**2) + column @ column.mT
            values, vectors = torch.linalg.eigh(covariance)
            self._together = (vectors / values[:, None].sqrt()) @ vectors.mT  # (k, f, f)
            determinant = float(values.log().sum())
        if cancelled is not None or leaking is not None or shared is not None:
            wider = wider if cancelled is None else wider * cancelled
            scale = torch.cat([scale, 1.0 / wider[None]])
        self._scale = scale.flatten(1).repeat(1, parts)
        # (e, f, k, j): what the harmonics of a floor do to its residuals.
        root = scale * weight.sqrt()
        self._wide = root[..., None] * self.harmonics.at(frequency_hz)
        share = self._points / max(parts * float((weight > 0).sum()), 1.0)
        self._narrower = share * (self._scale.log() * (self._weight > 0)).sum(1)
        self._narrower[0] -= 0.5 * share * parts * determinant
        if known is None:
            known = weight.new_zeros(0, parts * weight.numel())
        else:
            # Orthogonal ones of the same covariance, without those lost in the noise: of a mesh's
            # half are.
            variance, directions = torch.linalg.eigh(known @ known.T)
            known = directions[:, variance > table.lost].T @ known
        self._known = torch.stack([self._apart(known, errs) for errs in range(len(self._scale))])
        self._normal = self._wide.mT @ self._wide
        self._across = torch.stack(
            [self._beside(beside, k) for k, beside in enumerate(self._known)]
        )
        self._factors: dict[tuple[int, ...], _Factor] = {}
        self._scales: dict[tuple[int, ...], tuple[Tensor, Tensor]] = {}

    def forget(self) -> None:
        """Give back the memory of what is kept for speed."""
        self._factors.clear()

    @property
    def learns(self) -> bool:
        """Whether the table holds more than the stated noise."""
        return bool(self._table.sizes) or len(self._table.noise) > 1

    @property
    def knows(self) -> bool:
        """Whether there are errors that are known beforehand."""
        return self._known.shape[1] > 0

    @property
    def start(self) -> int:
        """Row from which fits start."""
        size, share, noise = self._table.start
        length = share * self.harmonics.width_hz
        return min(
            range(len(self.levels)),
            key=lambda row: (
                abs(self.levels[row].common - size)
                + abs(self.levels[row].own - size)
                + abs(self.levels[row].length_hz / length - 1.0)
                + abs(self.levels[row].noise - noise)
            ),
        )

    @property
    def largest(self) -> list[int]:
        """Rows of the largest error over the longest length, one for every noise."""
        sizes = [(level.own + level.common, level.length_hz) for level in self.levels]
        return [row for row, size in enumerate(sizes) if size == max(sizes)]

    def kept(self, rows: Sequence[int]) -> "LearnedError":
        """With some rows of the table alone."""
        return self._with(levels=tuple(self.levels[row] for row in rows))

    def finer(self, row: int) -> "LearnedError":
        """With a finer table about a row of the whole one.

        About that of no error, this one with rows of a little more noise behind it.
        """
        if not self._table.harmonics:
            return self
        none = self.levels[0]
        if row == 0:
            return self._with(levels=(*self.levels, *noisier_levels(none, self._table)))
        return self._with(levels=finer_levels(self.levels[row], none, self._table))

    def with_rows_of(self, other: "LearnedError") -> "LearnedError":
        """With the rows of the table of another of the same points."""
        return self._with(levels=other.levels)

    def weighted(self, more: Tensor) -> "LearnedError":
        """With so much more ln of the weight of every row (g,), over that of the first."""
        more = more - more[0]
        both = zip(self.levels, more.tolist(), strict=True)
        return self._with(
            levels=tuple(replace(row, log_weight=row.log_weight + each) for row, each in both)
        )

    def _with(self, **changes: Any) -> "LearnedError":
        changed = copy.copy(self)
        vars(changed).update(changes, _factors={}, _scales={})
        return changed

    def no_larger(self, row: int) -> list[int]:
        """Rows of no larger squares of residuals in the mean, whichever error makes them up."""
        weight = float(self._weight.sum() / (self._weight > 0).sum().clamp_min(1))
        squares = [(at.common**2 + at.own**2) * weight + at.noise**2 for at in self.levels]
        return [number for number, square in enumerate(squares) if square <= squares[row]]

    def apart_from(self, row: int) -> list[int]:
        """All rows but one of a table of errors that have no axis; none of another."""
        few = self._table.sizes and not self._table.harmonics
        return [k for k in range(len(self.levels)) if k != row] if few else []

    def counting(self, densities: Tensor) -> list[int]:
        """Rows that count at one at least of some points, from their log densities (n, g).

        All of a table without an axis, see `apart_from`.
        """
        if self.apart_from(0):
            return list(range(len(self.levels)))
        most = (densities - densities.max()).max(0).values
        return (most > math.log(self._table.counts)).nonzero()[:, 0].tolist()

    def log_densities(self, residuals: Tensor) -> Tensor:
        """Log density (n, g) of residuals (n, p f k) by every row, whose prior is part of it.

        Up to the constant of the stated noise.
        """
        kinds: tuple[list[int], list[int]] = [], []
        for row in sorted(range(len(self.levels)), key=self._kind):
            kinds[self._errs(row)].append(row)
        chunks = [
            tuple(rows[k : k + _AT_ONCE]) for rows in kinds for k in range(0, len(rows), _AT_ONCE)
        ]
        back = torch.tensor(kinds[0] + kinds[1]).argsort()
        # Every row may have its own tamed residuals: a few hundred megabytes of them at a time.
        count = max(1, int(_KEPT / (min(len(back), _AT_ONCE) * residuals.shape[1])))
        return torch.cat(
            [
                torch.cat([self._densities(some, rows) for rows in chunks], dim=1)[:, back]
                for some in residuals.split(count)
            ]
        )

    def _errs(self, row: int) -> int:
        """One of a row whose error counts points differently, zero of another."""
        level = self.levels[row]
        return int(len(self._scale) > 1 and level.common + level.own > 0.0)

    def _apart(self, residuals: Tensor, errs: int) -> Tensor:
        """Residuals (..., p f k) in units in which the noise of floors is independent."""
        scaled = residuals.to(self._wide) * self._scale[errs]
        if errs or self._together is None:
            return scaled
        of_floors = scaled.unflatten(-1, (self._parts, self.floors, -1))
        return torch.einsum("kij,...jk->...ik", self._together, of_floors).flatten(-3)

    def _densities(self, residuals: Tensor, rows: tuple[int, ...]) -> Tensor:
        """Log density (n, r) of residuals (n, p f k) by some rows, alike in `_errs`."""
        tamed = residuals.to(self._wide)[None]
        least = min(self.levels[row].noise for row in rows)
        # Where no residual is wilder than counts beside the noise of any row, none needs taming.
        if math.isfinite(self._wild) and not (tamed.abs() <= self._wild * least).all():
            tamed = torch.cat([self.tame(tamed, row) for row in rows])
        errs, factor, noise = self._errs(rows[0]), self._factor(rows), self._of(rows, "noise")
        tamed = self._apart(tamed, errs)
        # Rows of a kind have the same residuals but where these were tamed.
        kinds = factor.firsts if len(tamed) == 1 else slice(None)
        first, rest = factor.forward(*self._scaled(rows, *self._along(tamed, errs), kinds))
        explained = factor.each(first.square().sum((1, 2))) + rest.square().sum(1)  # (r, n)
        squares = (tamed.square().sum(2) - explained / noise[:, None] ** 2) / noise[:, None] ** 2
        constant = self._of(rows, "log_weight") - self._points * noise.log()
        alone = factor.groups.diagonal(dim1=2, dim2=3).log().sum((1, 2))
        shared = factor.shared.diagonal(dim1=1, dim2=2).log().sum(1)
        # Less half the log determinants of the precisions.
        constant = constant - (factor.each(alone) + shared) + self._narrower[errs]
        return (constant[:, None] - 0.5 * squares).T

    def tame(self, residuals: Tensor, row: int) -> Tensor:
        """Residuals (n, p f k) of which none is wilder than counts, were a row of the table true.

        One point, where an anti-resonance is a sample off, must not decide anything. A model that
        is none (a negative stiffness gives no number) misses every point by the most.
        """
        if math.isinf(self._wild):
            return residuals
        level = self.levels[row]
        error = (level.common**2 + level.own**2) * self._weight
        noise = level.noise / self._scale[self._errs(row)]
        most = self._wild * (noise**2 + error).sqrt()
        return torch.minimum(torch.maximum(residuals.nan_to_num(nan=math.inf), -most), most)

    def by_noise_alone(self, residuals: Tensor) -> Tensor:
        """Residuals (n, m) beside the stated noise and the errors that are known beforehand."""
        none = self._with(levels=(replace(self.levels[0], common=0.0, own=0.0, noise=1.0),))
        return none.whiten(none.tame(residuals, 0), 0)

    def whiten(self, residuals: Tensor, row: int) -> Tensor:
        """Residuals (n, m) of unit covariance, were a row of the table true; along straight lines.

        What is left beside the likeliest error comes first (p f k), then its coefficients: those of
        every floor alone, and those that all share.
        """
        level = self.levels[row]
        errs = self._errs(row)
        left = self._apart(residuals, errs)
        if level.common == level.own == 0.0:
            # Harmonics of floors alone and of what they share count for nothing.
            none = left.new_zeros(len(left), self._parts * self._wide.shape[3])
            known, found = self._known[errs] / level.noise, left[:, :0]
            if self.knows:
                factor = self._factor((row,)).shared[0, : len(known), : len(known)]
                found = torch.cholesky_solve(known @ left.T / level.noise, factor).T
            beside = left / level.noise - found @ known
            return torch.cat([beside, none.repeat(1, self.floors), found, none], dim=1)
        alone, shared = self._standard(left, row)
        left = left - self._along_back(*self._scaled((row,), alone, shared), errs)
        return torch.cat([left / level.noise, alone[0].flatten(0, 1).T, shared[0].T], dim=1)

    def floor_squares(self, residuals: Tensor, rows: Tensor) -> tuple[Tensor, Tensor]:
        """Squares (n, f) of residuals (n, p f k), each of unit covariance by its own row (n,).

        With them which residuals (n, p f k) are left out, for they are wilder than counts.
        """
        parts = residuals.new_zeros(len(residuals), self.floors, dtype=torch.float64)
        wild = torch.zeros_like(residuals, dtype=torch.bool)
        points, inner = residuals.shape[1], self._parts * self.floors * self._wide.shape[3]
        for row in rows.unique().tolist():
            chosen = (rows == row).nonzero()[:, 0]
            tamed = self.tame(residuals[chosen], row)
            wild[chosen] = tamed != residuals[chosen]
            white = self.whiten(tamed, row).square()
            white[:, :points] *= ~wild[chosen]
            for part in (white[:, :points], white[:, points : points + inner]):
                parts[chosen] += part.unflatten(1, (self._parts, self.floors, -1)).sum((1, 3))
            parts[chosen] += white[:, points + inner :].sum(1, True) / self.floors
        return parts, wild

    def likeliest(self, residuals: Tensor, row: int) -> Tensor:
        """Coefficients (n, p f, j) of the likeliest error, were a row of the table true.

        Without the errors that are known beforehand.
        """
        apart = self._apart(residuals, self._errs(row))
        alone, shared = self._scaled((row,), *self._standard(apart, row))
        common = shared[0, self._known.shape[1] :].unflatten(0, (self._parts, 1, -1))
        return (alone[0].unflatten(0, (self._parts, -1)) + common).flatten(0, 1).permute(2, 0, 1)

    def _factor(self, rows: tuple[int, ...]) -> _Factor:
        found = self._factors.get(rows)
        if found is None:
            found = self._factored(rows)
            if found.size + sum(factor.size for factor in list(self._factors.values())) < _KEPT:
                self._factors[rows] = found
        return found

    def _of(self, rows: tuple[int, ...], name: str) -> Tensor:
        """(r,) of one attribute of rows of the table."""
        values = [getattr(self.levels[row], name) for row in rows]
        return torch.tensor(values, dtype=torch.float64)

    def _spread(self, rows: tuple[int, ...]) -> Tensor:
        """(r, j) standard deviations of the harmonics' coefficients, of a process of size one."""
        return torch.stack([self.harmonics.spread(self.levels[row].length_hz) for row in rows])

    def _factored(self, rows: tuple[int, ...]) -> _Factor:
        kinds: dict[tuple[float, ...], int] = {}
        of_row = [kinds.setdefault(self._kind(row), row) for row in rows]
        firsts = tuple(kinds.values())
        kind = torch.tensor([firsts.index(first) for first in of_row])
        places = torch.tensor([rows.index(first) for first in firsts])
        noise, owns = (self._of(firsts, name)[:, None, None, None] for name in ("noise", "own"))
        spread = (self._spread(firsts)[:, None] / noise[:, 0])[..., None]  # (u, 1, j, 1)
        errs = self._errs(rows[0])
        scaled = spread * self._normal[errs] * spread.mT
        alone = torch.eye(scaled.shape[3]).to(scaled) + owns**2 * scaled
        groups = torch.linalg.cholesky(alone).repeat(1, self._parts, 1, 1)
        known = spread * self._across[errs].permute(1, 2, 0) / noise
        apart = torch.eye(self._parts).to(scaled)  # every part has a common process of its own
        common = torch.einsum("pq,ufij->upfiqj", apart, scaled).flatten(4).flatten(1, 2)
        across = owns * torch.cat([known, common], 3)
        across = torch.linalg.solve_triangular(groups, across, upper=False).contiguous()
        # What all floors share, were there nothing of a floor's own, less what that explains.
        beside, flat = self._known[errs], across.flatten(1, 2)
        between = known.unflatten(1, (self._parts, -1)).sum(2).flatten(1, 2)
        common = common.unflatten(1, (self._parts, -1)).sum(2).flatten(1, 2)
        top = torch.cat([beside @ beside.T / noise[:, 0] ** 2, between.mT], 2)
        within = torch.cat([top, torch.cat([between, common], 2)], 1) - flat.mT @ flat
        sizes = self._of(rows, "common")[:, None, None].repeat(1, 1, within.shape[1])
        sizes[:, :, : len(beside)] = 1.0
        shared = torch.eye(within.shape[1]).to(within) + sizes.mT * within[kind] * sizes
        return _Factor(kind, places, groups, across, sizes, torch.linalg.cholesky(shared))

    def _kind(self, row: int) -> tuple[float, ...]:
        """All of a row but what is common to floors."""
        level = self.levels[row]
        return level.own, level.length_hz, level.noise

    def _standard(self, apart: Tensor, row: int) -> tuple[Tensor, Tensor]:
        """Likeliest coefficients (1, g, j, n) and (1, s, n), whose prior is of unit variance."""
        alone, shared = self._scaled((row,), *self._along(apart[None], self._errs(row)))
        squared = self.levels[row].noise ** 2
        return self._factor((row,)).solve(alone / squared, shared / squared)

    def _scaled(
        self,
        rows: tuple[int, ...],
        alone: Tensor,
        shared: Tensor,
        some: Tensor | slice = slice(None),
    ) -> tuple[Tensor, Tensor]:
        """Coefficients (r, g, j, n), or of some rows, and (r, s, n), times their spreads."""
        if rows not in self._scales:
            spread = self._spread(rows)
            owns, commons = (self._of(rows, name)[:, None] for name in ("own", "common"))
            common = (commons * spread).repeat(1, self._parts)
            every = torch.cat([common.new_ones(len(rows), self._known.shape[1]), common], 1)
            self._scales[rows] = (owns * spread)[:, None, :, None], every[:, :, None]
        first, rest = self._scales[rows]
        return first[some] * alone, rest * shared

    def _beside(self, residuals: Tensor, errs: int) -> Tensor:
        """Products (..., g, j) of residuals (..., p f k) with the harmonics of every floor."""
        parts = residuals.unflatten(-1, (self._parts, self.floors, -1))
        return torch.einsum("...pfk,fkj->...pfj", parts, self._wide[errs]).flatten(-3, -2)

    def _along(self, residuals: Tensor, errs: int) -> tuple[Tensor, Tensor]:
        """What residuals (r, n, p f k) say of all coefficients, (r, g, j, n) and (r, s, n)."""
        alone = self._beside(residuals, errs)  # (r, n, g, j)
        common = alone.unflatten(2, (self._parts, -1)).sum(3).flatten(2)
        known = residuals @ self._known[errs].T
        return alone.permute(0, 2, 3, 1), torch.cat([known, common], 2).mT

    def _along_back(self, alone: Tensor, shared: Tensor, errs: int) -> Tensor:
        """Residuals (n, p f k) that coefficients (1, g, j, n) and (1, s, n) bring."""
        count = self._known.shape[1]
        common = shared[0, count:].unflatten(0, (self._parts, 1, -1))
        of_floors = alone[0].unflatten(0, (self._parts, -1)) + common  # (p, f, j, n)
        back = self._wide[errs] @ of_floors.permute(1, 2, 3, 0).flatten(2)  # (f, k, n p)
        back = back.unflatten(2, (-1, self._parts)).permute(2, 3, 0, 1).flatten(1)
        return back + shared[0, :count].T @ self._known[errs]


WILD = 8.0  # sd of error and noise beyond which a residual counts no more


@dataclass(frozen=True)
class Cell:
    """A part of the data whose residuals are told together.

    Attributes:
        floor: its name, or what else was compared.
        excess: mean squared whitened residual less one; zero when only noise is left, and where
            there are too few points to tell.
        p_value: of noise alone leaving as much.
        data: the kind of observation; empty for FRFs under base motion.
    """

    floor: str
    band_hz: tuple[float, float]
    excess: float
    p_value: float
    data: str = ""


@dataclass(frozen=True)
class Remains:
    """The error of a model beside noise, as its likeliest values have it.

    Attributes:
        size: rms over all points, in ln|H|, or of what else was compared; zero where none is
            likely.
        turn: the same of the phase, rad; zero where none was compared.
        floor, band_hz: where it is largest.
        there: rms there, like the size.
        noise: of the data, over the stated one.
        sentence: how much and where, for an engineer.
    """

    size: float = 0.0
    turn: float = 0.0
    floor: str = ""
    band_hz: tuple[float, float] = (0.0, 0.0)
    there: float = 0.0
    noise: float = 1.0
    sentence: str = ""

    def as_dict(self) -> dict[str, float | str | list[float]]:
        """For files: the share of the response, and where most of it is."""
        return {
            "share": float(np.expm1(self.size)),
            "phase_rad": self.turn,
            "floor": self.floor,
            "band_hz": list(self.band_hz),
            "share_there": float(np.expm1(self.there)),
            "noise_over_stated": self.noise,
        }
