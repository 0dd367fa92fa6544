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


class LearnedError:
    """The density of residuals that hold an error of the model, summed over what it may be.

    Residuals (n, f k) are whitened by the stated noise alone, zero where a point is not valid.

    Args:
        weight: (f, k) inverse variance of the noise, zero where a point is not valid.
        frequency_hz: (k,).
        independent: share of the points that err independently.
        known: (c, f, k) changes of ln|H| by one standard deviation of every error that is known
            beforehand, as that of a mesh.
        table: what the error may be.

    Attributes:
        levels: rows of the table that are summed over.
        harmonics: of the error.
        floors: how many.
    """

    def __init__(
        self,
        weight: Tensor,
        frequency_hz: Tensor,
        independent: float = 1.0,
        known: Tensor | None = None,
        table: ErrorTable = MODEL_ERROR,
    ) -> None:
        seen = frequency_hz[(weight > 0).any(0)]
        self._table = table
        self.levels = error_levels(float(seen[-1] - seen[0]), table)
        self.harmonics = Harmonics.over(seen, table)
        self.floors = len(weight)
        self._points = independent * float((weight > 0).sum())
        root = weight.sqrt()
        # (f, k, j): every floor's own; products of different floors vanish.
        self._wide = root[:, :, None] * self.harmonics.at(frequency_hz)
        steps = weight.new_zeros(0, *weight.shape) if known is None else known
        self._known = (steps * root).flatten(1)
        self._prepare()

    def _prepare(self) -> None:
        floors = torch.block_diag(*(one.T @ one for one in self._wide))
        across = self._beside(self._known)
        within = self._known @ self._known.T
        normal = torch.cat([torch.cat([floors, across.T], 1), torch.cat([across, within], 1)])
        one = torch.eye(len(normal)).to(normal)
        self._roots = [self._root(level) for level in self.levels]
        self._factors = [
            torch.linalg.cholesky(one + root @ normal @ root / level.noise**2)
            for root, level in zip(self._roots, self.levels, strict=True)
        ]
        self._constants = [
            level.log_weight
            - self._points * math.log(level.noise)
            - float(factor.diagonal().log().sum())
            for level, factor in zip(self.levels, self._factors, strict=True)
        ]

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
        fewer._roots = [self._roots[row] for row in rows]
        fewer._factors = [self._factors[row] for row in rows]
        fewer._constants = [self._constants[row] for row in rows]
        return fewer

    def finer(self, row: int) -> "LearnedError":
        """With a finer table about a row of this one."""
        fewer = copy.copy(self)
        fewer.levels = finer_levels(self.levels[row], self.levels[0], self._table)
        fewer._prepare()
        return fewer

    def counting(self, densities: Tensor) -> list[int]:
        """Rows that count at one at least of some points, from their log densities (n, g)."""
        most = (densities - densities.max()).max(0).values
        return (most > math.log(self._table.counts)).nonzero()[:, 0].tolist()

    def log_densities(self, residuals: Tensor) -> Tensor:
        """Log density (n, g) of residuals (n, f k) by every row, whose prior is part of it.

        Up to the constant of the stated noise.
        """
        along, square = self._along(residuals), residuals.square().sum(1).to(self._wide)
        values = []
        for level, root, factor, constant in zip(
            self.levels, self._roots, self._factors, self._constants, strict=True
        ):
            inner = torch.linalg.solve_triangular(factor, root @ along.T, upper=False)
            explained = inner.square().sum(0) / level.noise**4
            values.append(constant - 0.5 * (square / level.noise**2 - explained))
        return torch.stack(values, dim=1)

    def log_density(self, residuals: Tensor) -> Tensor:
        """Log density (n,) of residuals (n, f k), summed over the table."""
        return torch.logsumexp(self.log_densities(residuals), dim=1)

    def whiten(self, residuals: Tensor, row: int) -> Tensor:
        """Residuals (n, m) of unit covariance, were a row of the table true.

        What is left beside the likeliest error comes first (f k), then its coefficients.
        """
        noise, standard = self.levels[row].noise, self._likeliest(residuals, row)
        left = residuals.to(self._wide) - self._along_back(standard @ self._roots[row])
        return torch.cat([left / noise, standard], dim=1)

    def floor_squares(self, residuals: Tensor, rows: Tensor) -> Tensor:
        """Squares (n, f) of residuals (n, f k), each of unit covariance by its own row (n,)."""
        parts = residuals.new_zeros(len(residuals), self.floors, dtype=torch.float64)
        inner = self.floors * self._wide.shape[2]
        points = residuals.shape[1]
        for row in rows.unique().tolist():
            chosen = (rows == row).nonzero()[:, 0]
            white = self.whiten(residuals[chosen], row)
            for part in (white[:, :points], white[:, points : points + inner]):
                parts[chosen] += part.unflatten(1, (self.floors, -1)).square().sum(2)
            parts[chosen] += white[:, points + inner :].square().sum(1, True) / self.floors
        return parts

    def likeliest(self, residuals: Tensor, row: int) -> Tensor:
        """Coefficients (n, f, j) of the likeliest error, were a row of the table true."""
        values = self._likeliest(residuals, row) @ self._roots[row]
        return values[:, : self.floors * self._wide.shape[2]].unflatten(1, (self.floors, -1))

    def _likeliest(self, residuals: Tensor, row: int) -> Tensor:
        """Standard coefficients (n, d), whose prior is of unit variance."""
        inner = self._along(residuals) @ self._roots[row] / self.levels[row].noise ** 2
        return torch.cholesky_solve(inner.T, self._factors[row]).T

    def _root(self, level: ErrorLevel) -> Tensor:
        """Symmetric root (d, d) of the covariance of the coefficients."""
        mean = torch.full((self.floors, self.floors), 1.0 / self.floors, dtype=torch.float64)
        together = math.hypot(level.own, self.floors**0.5 * level.common)
        between = level.own * (torch.eye(self.floors).to(mean) - mean) + together * mean
        harmonic = torch.diag(self.harmonics.spread(level.length_hz))
        known = torch.eye(len(self._known), dtype=torch.float64)
        return torch.block_diag(torch.kron(between, harmonic), known)

    def _beside(self, residuals: Tensor) -> Tensor:
        """Products (n, f j) of residuals (n, f k) with the harmonics of every floor."""
        parts = residuals.to(self._wide).unflatten(1, (self.floors, -1))
        return torch.einsum("nfk,fkj->nfj", parts, self._wide).flatten(1)

    def _along(self, residuals: Tensor) -> Tensor:
        """What residuals (n, f k) say of all coefficients, (n, d)."""
        return torch.cat([self._beside(residuals), residuals.to(self._wide) @ self._known.T], 1)

    def _along_back(self, values: Tensor) -> Tensor:
        """Residuals (n, f k) that coefficients (n, d) bring."""
        inner = self.floors * self._wide.shape[2]
        of_floors = values[:, :inner].unflatten(1, (self.floors, -1))
        back = torch.einsum("nfj,fkj->nfk", of_floors, self._wide).flatten(1)
        return back + values[:, inner:] @ self._known
