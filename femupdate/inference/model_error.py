"""What a model errs by, learned from the data: a Gaussian process over frequency beside the noise.

    ln|H| measured = ln|H| of the model + error + noise

The error is one process common to all floors and one of each floor alone, both of zero mean and
with the covariance s^2 exp(-|f - f'| / l) (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63, 425;
kernels for structures: Kosikova et al. 2023, CMAME 417, 116357). Their sizes, the length and by how
much the noise exceeds the stated one are not known: the density is summed over a table of them. Its
first row holds no error: where the model is right that row takes over, and posteriors are as if
there were no such thing. The same holds for phases.

The processes are sums of harmonics with independent coefficients (Solin and Sarkka 2020, Stat.
Comput. 30, 419), so that a density costs some small matrix products.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, kw_only=True)
class ErrorTable:
    """What the error of a model may be, before the data are seen.

    Attributes:
        sizes: standard deviations of either process in ln|H| (or rad), beside zero.
        lengths: over which errors are alike, as shares of the measured band.
        noise: standard deviations of the noise over the stated one.
        finer: steps of the finer table about the likeliest row in one of the first.
        none: probability that there is no error, and the noise is as stated.
        harmonics: cycles of the shortest one in a period.
        period: over the measured band: its ends must not meet.
        start: size, length and noise from which fits start: wide enough for any model.
        counts: share of the likeliest row's weight below which a row is left out.
    """

    sizes: tuple[float, ...] = (0.02, 0.06, 0.18, 0.5)
    lengths: tuple[float, ...] = (1 / 60, 1 / 20, 1 / 6)
    noise: tuple[float, ...] = (1.0, 2.0, 4.0)
    finer: float = 3.0
    none: float = 0.5
    harmonics: int = 40
    period: float = 1.25
    start: tuple[float, float, float] = (0.18, 1 / 20, 2.0)
    counts: float = 1e-3


MODEL_ERROR = ErrorTable()

# Numbers in the factors of all rows, up to which these are kept.
_KEPT = 6e7


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
        (common, own, share)
        for common in sizes
        for own in sizes
        if common + own > 0.0
        for share in table.lengths
    ]
    rows = [(*kind, noise) for kind in kinds for noise in table.noise]
    other = math.log1p(-table.none) - math.log(table.none) - math.log(len(rows) - 1)
    return tuple(
        ErrorLevel(common, own, share * width_hz, noise, other if row else 0.0)
        for row, (common, own, share, noise) in enumerate(rows)
    )


def finer_levels(
    about: ErrorLevel, none: ErrorLevel, table: ErrorTable = MODEL_ERROR
) -> tuple[ErrorLevel, ...]:
    """Rows about one, in finer steps, behind that of no error; together they weigh as much."""

    def steps(value: float, coarse: Sequence[float], least: float = 0.0) -> list[float]:
        ratio = (coarse[-1] / coarse[0]) ** (1.0 / (len(coarse) - 1) / table.finer)
        return sorted({max(least, value * ratio**step) for step in (-1, 0, 1)})

    rows = [
        (common, own, length, noise)
        for common in steps(about.common, table.sizes)
        for own in steps(about.own, table.sizes)
        for length in steps(about.length_hz, table.lengths)
        for noise in steps(about.noise, table.noise, 1.0)
    ]
    free = sum(value > 0.0 for value in (about.common, about.own)) + 2
    weight = about.log_weight - free * math.log(table.finer)
    return (none, *(ErrorLevel(*row, weight) for row in rows))


@dataclass(frozen=True)
class Harmonics:
    """Functions of frequency of which errors are sums.

    Attributes:
        first_hz: where the measured band begins.
        width_hz: of it.
        period_hz: of all functions.
        count: cycles of the shortest in a period.
    """

    first_hz: float
    width_hz: float
    period_hz: float
    count: int

    @staticmethod
    def over(seen_hz: Tensor, table: ErrorTable = MODEL_ERROR) -> "Harmonics":
        """Over measured frequencies (k,)."""
        first, width = float(seen_hz[0]), float(seen_hz[-1] - seen_hz[0])
        return Harmonics(first, width, table.period * width, table.harmonics)

    def at(self, frequency_hz: Tensor) -> Tensor:
        """Values (k, j) at frequencies (k,)."""
        cycles = torch.arange(1, self.count + 1).to(frequency_hz)
        angle = 2.0 * torch.pi / self.period_hz * (frequency_hz - self.first_hz)[:, None] * cycles
        return torch.cat([torch.ones_like(angle[:, :1]), angle.cos(), angle.sin()], dim=1)

    def spread(self, length_hz: float) -> Tensor:
        """Standard deviations (j,) of the coefficients of a process of unit variance."""
        cycles = torch.arange(self.count + 1, dtype=torch.float64)
        density = 1.0 / (1.0 + (2.0 * torch.pi / self.period_hz * length_hz * cycles) ** 2)
        density[1:] *= 2.0
        share = (density / density.sum()).sqrt()
        return torch.cat([share, share[1:]])


@dataclass(frozen=True, eq=False)
class _Factor:
    """Cholesky factor of the precision of all coefficients, scaled to a prior of unit variance.

    Coefficients of one floor alone (a group is a floor in one part) are tied to those of another
    by what all share: the common process of their part, and errors known beforehand.

    Attributes:
        own: (f, j, j) of a floor's own, the same in all parts.
        across: (g, j, s) of these and the shared ones.
        shared: (s, s).
    """

    own: Tensor
    across: Tensor
    shared: Tensor

    def forward(self, own: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """The factor's inverse times values of all coefficients, (g, j, n) and (s, n)."""
        first = torch.linalg.solve_triangular(self._groups(own), own, upper=False)
        rest = shared - torch.einsum("gjs,gjn->sn", self.across, first)
        return first, torch.linalg.solve_triangular(self.shared, rest, upper=False)

    def solve(self, own: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """The precision's inverse times values of all coefficients, (g, j, n) and (s, n)."""
        first, rest = self.forward(own, shared)
        rest = torch.linalg.solve_triangular(self.shared.T, rest, upper=True)
        first = first - self.across @ rest
        return torch.linalg.solve_triangular(self._groups(own).mT, first, upper=True), rest

    @property
    def half_log_determinant(self) -> float:
        """Of the precision."""
        parts = len(self.across) // len(self.own)
        own = self.own.diagonal(dim1=1, dim2=2).log().sum()
        return parts * float(own) + float(self.shared.diagonal().log().sum())

    def _groups(self, like: Tensor) -> Tensor:
        return self.own.repeat(len(like) // len(self.own), 1, 1)


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
        parts: p.

    Attributes:
        levels: rows of the table that are summed over.
        harmonics: of the error.
        floors: how many.
    """

    def __init__(
        self,
        weight: Tensor,
        frequency_hz: Tensor,
        points: float | None = None,
        known: Tensor | None = None,
        table: ErrorTable = MODEL_ERROR,
        parts: int = 1,
    ) -> None:
        seen = frequency_hz[(weight > 0).any(0)]
        self._table = table
        self.levels = error_levels(float(seen[-1] - seen[0]), table)
        self.harmonics = Harmonics.over(seen, table)
        self.floors, self._parts = len(weight), parts
        self._points = float(parts * (weight > 0).sum()) if points is None else points
        # (f, k, j): what the harmonics of a floor do to its residuals.
        self._wide = weight.sqrt()[:, :, None] * self.harmonics.at(frequency_hz)
        self._known = weight.new_zeros(0, parts * weight.numel()) if known is None else known
        self._normal = self._wide.mT @ self._wide
        self._across = self._beside(self._known)
        self._factors: dict[int, _Factor] = {}

    def without_known(self) -> "LearnedError":
        """Without the errors that are known beforehand."""
        other = copy.copy(self)
        other._known, other._across = self._known[:0], self._across[:0]
        other._factors = {}
        return other

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

    def kept(self, rows: Sequence[int]) -> "LearnedError":
        """With some rows of the table alone."""
        fewer = copy.copy(self)
        fewer.levels = tuple(self.levels[row] for row in rows)
        fewer._factors = {
            k: self._factors[row] for k, row in enumerate(rows) if row in self._factors
        }
        return fewer

    def finer(self, row: int) -> "LearnedError":
        """With a finer table about a row of this one."""
        fewer = copy.copy(self)
        fewer.levels = finer_levels(self.levels[row], self.levels[0], self._table)
        fewer._factors = {}
        return fewer

    def counting(self, densities: Tensor) -> list[int]:
        """Rows that count at one at least of some points, from their log densities (n, g)."""
        most = (densities - densities.max()).max(0).values
        return (most > math.log(self._table.counts)).nonzero()[:, 0].tolist()

    def log_densities(self, residuals: Tensor) -> Tensor:
        """Log density (n, g) of residuals (n, p f k) by every row, whose prior is part of it.

        Up to the constant of the stated noise.
        """
        along, square = self._along(residuals), residuals.square().sum(1).to(self._wide)
        values = []
        for row, level in enumerate(self.levels):
            factor = self._factor(row)
            parts = factor.forward(*self._scaled(level, *along))
            explained = parts[0].square().sum((0, 1)) + parts[1].square().sum(0)
            constant = level.log_weight - self._points * math.log(level.noise)
            constant -= factor.half_log_determinant
            squares = (square - explained / level.noise**2) / level.noise**2
            values.append(constant - 0.5 * squares)
        return torch.stack(values, dim=1)

    def log_density(self, residuals: Tensor) -> Tensor:
        """Log density (n,) of residuals (n, f k), summed over the table."""
        return torch.logsumexp(self.log_densities(residuals), dim=1)

    def whiten(self, residuals: Tensor, row: int) -> Tensor:
        """Residuals (n, m) of unit covariance, were a row of the table true.

        What is left beside the likeliest error comes first (p f k), then its coefficients: those of
        every floor alone, and those that all share.
        """
        level = self.levels[row]
        own, shared = self._standard(residuals, row)
        left = residuals.to(self._wide) - self._along_back(*self._scaled(level, own, shared))
        return torch.cat([left / level.noise, own.flatten(0, 1).T, shared.T], dim=1)

    def floor_squares(self, residuals: Tensor, rows: Tensor) -> Tensor:
        """Squares (n, f) of residuals (n, p f k), each of unit covariance by its own row (n,)."""
        parts = residuals.new_zeros(len(residuals), self.floors, dtype=torch.float64)
        points, inner = residuals.shape[1], self._parts * self.floors * self._wide.shape[2]
        for row in rows.unique().tolist():
            chosen = (rows == row).nonzero()[:, 0]
            white = self.whiten(residuals[chosen], row).square()
            for part in (white[:, :points], white[:, points : points + inner]):
                parts[chosen] += part.unflatten(1, (self._parts, self.floors, -1)).sum((1, 3))
            parts[chosen] += white[:, points + inner :].sum(1, True) / self.floors
        return parts

    def likeliest(self, residuals: Tensor, row: int) -> Tensor:
        """Coefficients (n, p f, j) of the likeliest error, were a row of the table true.

        Without the errors that are known beforehand.
        """
        level = self.levels[row]
        own, shared = self._scaled(level, *self._standard(residuals, row))
        common = shared[len(self._known) :].unflatten(0, (self._parts, 1, -1))
        return (own.unflatten(0, (self._parts, -1)) + common).flatten(0, 1).permute(2, 0, 1)

    def _factor(self, row: int) -> _Factor:
        found = self._factors.get(row)
        if found is None:
            found = self._factored(self.levels[row])
            size = found.own.numel() + found.across.numel() + found.shared.numel()
            if size * len(self.levels) < _KEPT:
                self._factors[row] = found
        return found

    def _factored(self, level: ErrorLevel) -> _Factor:
        """In units of the noise's variance, to which the prior's precision is brought."""
        spread, noise = self.harmonics.spread(level.length_hz), level.noise
        count = len(spread)
        one = torch.eye(count).to(self._wide)
        scaled = spread[:, None] * self._normal * spread / noise**2
        own = torch.linalg.cholesky(one + level.own**2 * scaled)
        of_known = level.own * spread * self._across / noise**2  # (c, g, j)
        of_common = (
            level.own
            * level.common
            * torch.block_diag(*(scaled.flatten(0, 1) for _ in range(self._parts)))
        )
        both = torch.cat([of_known.permute(1, 2, 0), of_common.unflatten(0, (-1, count))], 2)
        groups = own.repeat(self._parts, 1, 1)
        across = torch.linalg.solve_triangular(groups, both, upper=False)
        shared = self._shared_precision(level, scaled) - torch.einsum("gjs,gjt->st", across, across)
        return _Factor(own, across, torch.linalg.cholesky(shared))

    def _shared_precision(self, level: ErrorLevel, scaled: Tensor) -> Tensor:
        """(s, s) of what all floors share, were there nothing of a floor's own."""
        spread, noise = self.harmonics.spread(level.length_hz), level.noise
        within = self._known @ self._known.T / noise**2
        of_part = self._across.unflatten(1, (self._parts, -1)).sum(2)  # (c, p, j)
        between = (level.common * spread * of_part / noise**2).flatten(1)
        common = level.common**2 * torch.block_diag(*[scaled.sum(0)] * self._parts)
        whole = torch.cat([torch.cat([within, between], 1), torch.cat([between.T, common], 1)])
        return whole + torch.eye(len(whole)).to(whole)

    def _standard(self, residuals: Tensor, row: int) -> tuple[Tensor, Tensor]:
        """Likeliest coefficients (g, j, n) and (s, n), whose prior is of unit variance."""
        level = self.levels[row]
        own, shared = self._scaled(level, *self._along(residuals))
        return self._factor(row).solve(own / level.noise**2, shared / level.noise**2)

    def _scaled(self, level: ErrorLevel, own: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """Values of the coefficients (g, j, n) and (s, n), times their standard deviations."""
        spread = self.harmonics.spread(level.length_hz)
        common = level.common * spread.repeat(self._parts)
        every = torch.cat([torch.ones(len(self._known)).to(common), common])
        return level.own * spread[:, None] * own, every[:, None] * shared

    def _beside(self, residuals: Tensor) -> Tensor:
        """Products (n, g, j) of residuals (n, p f k) with the harmonics of every floor."""
        parts = residuals.to(self._wide).unflatten(1, (self._parts, self.floors, -1))
        return torch.einsum("npfk,fkj->npfj", parts, self._wide).flatten(1, 2)

    def _along(self, residuals: Tensor) -> tuple[Tensor, Tensor]:
        """What residuals (n, p f k) say of all coefficients, (g, j, n) and (s, n)."""
        own = self._beside(residuals)
        common = own.unflatten(1, (self._parts, -1)).sum(2).flatten(1)
        known = residuals.to(self._wide) @ self._known.T
        return own.permute(1, 2, 0), torch.cat([known, common], 1).T

    def _along_back(self, own: Tensor, shared: Tensor) -> Tensor:
        """Residuals (n, p f k) that coefficients (g, j, n) and (s, n) bring."""
        count = len(self._known)
        common = shared[count:].unflatten(0, (self._parts, 1, -1))
        of_floors = own.unflatten(0, (self._parts, -1)) + common
        back = torch.einsum("pfjn,fkj->npfk", of_floors, self._wide).flatten(1)
        return back + shared[:count].T @ self._known
