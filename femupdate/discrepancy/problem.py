"""The data as the effect finder judges them: whitened residuals of ln|H| and of the phase."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from femupdate.discrepancy.thresholds import FIT
from femupdate.discrepancy.thresholds import MODEL_ERROR as THRESHOLDS
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.inference.model_error import ErrorLevel, ErrorTable, LearnedError
from femupdate.measurement.estimated import HANN, Estimator
from femupdate.measurement.observation import Observation

Effects = tuple[Placed, ...]

# Coarser than that of a calibration: a hundred fits share it, and only their differences count.
_TABLE = ErrorTable(sizes=(0.03, 0.1, 0.3), lengths=(1 / 30, 1 / 8), harmonics=24)


@dataclass(frozen=True)
class Block:
    """Some neighbouring points of the frequency axis, which one record gave.

    Attributes:
        points: how many.
        independent: share of them that err independently.
        estimator: what the estimate makes of FRFs; None for those read from a table.
        level: doublings of the amplitude above that of the first record.
    """

    points: int
    independent: float
    estimator: Estimator | None = None
    level: float = 0.0


@dataclass(frozen=True, eq=False)
class Problem:
    """A structure, what was observed of it in one record or several, and what may be said of both.

    Attributes:
        reduced: the structure through its basis.
        law: of its damping.
        lower, upper: (p,) box of the stiffness factors.
        zeta: (lower, upper) where the damping ratio is a nuisance.
        fixed_zeta: the damping ratio where it is not.
        frequency_hz: (k,), one record after the other.
        rows: which floors are observed.
        log_frf: (f, k) observed; zero where not valid.
        phase: (f, k) observed, rad, or None.
        sd: (f, k) of ln|H| and phase; infinite where not valid.
        blocks: the records.
        left_open: gives one standard deviation (c, n) of every error of the model that many points
            share, in the unit of the residuals, of this problem with some effects at theta (1, p),
            zeta (1,) and sizes (1, q); None where there is none.
        own_error: share of an effect's size by which the model of the effect may err.
        search: the structure on a basis for the whole prior, on which only instruments and damping
            may have effects; None where `reduced` serves there.
        known: (c, n) such errors of the model about one fit, for all models alike; None for none.
        rows_kept: of the table of what the model may err by (see `error`); None for all.
        row: which of them residuals are whitened by.
        halves: the data in two parts that err independently; none where they cannot be parted.
    """

    reduced: ReducedStructure
    law: DampingLaw
    lower: Tensor
    upper: Tensor
    zeta: tuple[float, float] | None
    fixed_zeta: float
    frequency_hz: Tensor
    rows: tuple[int, ...]
    log_frf: Tensor
    phase: Tensor | None
    sd: Tensor
    blocks: tuple[Block, ...]
    left_open: "Callable[[Problem, Effects, Tensor, Tensor, Tensor], Tensor] | None" = None
    own_error: float = 0.0
    search: ReducedStructure | None = None
    known: Tensor | None = None
    rows_kept: tuple[int, ...] | None = None
    row: int = 0
    halves: "tuple[Problem, ...]" = ()

    def for_search(self) -> "Problem":
        """The same on the basis that serves over the whole prior."""
        if self.search is None:
            return self
        return replace(self, reduced=self.search, left_open=None, known=None)

    def on_fewer(self) -> "Problem":
        """The same on the shapes that count most: for searches, which the whole basis ends."""
        fewer = self.reduced.first(FIT.fewer_shapes)
        return replace(self, reduced=fewer, left_open=None, known=None)

    def half(self, number: int) -> "Problem":
        """One half of the data, for the same structure on the same basis."""
        own = self.halves[number]
        return replace(
            own,
            reduced=self.reduced,
            left_open=self.left_open,
            rows_kept=self.rows_kept,
            row=self.row,
        )

    def at_row(self, row: int) -> "Problem":
        """The same, residuals whitened by another row of the table of errors."""
        if row == self.row:
            return self
        other = replace(self, row=row)
        # The table stays; its factors are dear.
        other.__dict__["error"] = self.error
        return other

    def same_errors(self, other: "Problem") -> bool:
        """Whether both have one table of errors, and one set of those known beforehand."""
        return self.known is other.known and self.rows_kept == other.rows_kept

    def with_rows(self, rows: list[int]) -> "Problem":
        """The same with some rows of the table of errors alone, its own among them."""
        before = self.rows_kept or range(len(self.error.levels))
        kept = tuple(before[row] for row in rows)
        return replace(self, rows_kept=kept, row=rows.index(self.row))

    @cached_property
    def error(self) -> LearnedError:
        """What the model may err by, beside the noise."""
        weight = self.independent / self.sd**2
        parts = 1 if self.phase is None else 2
        whole = LearnedError(
            weight,
            self.frequency_hz,
            self.effective,
            self.known,
            table=_TABLE,
            parts=parts,
            wild=THRESHOLDS.wild,
        )
        return whole if self.rows_kept is None else whole.kept(self.rows_kept)

    @property
    def level(self) -> ErrorLevel:
        """The row by which residuals are whitened."""
        return self.error.levels[self.row]

    @property
    def points(self) -> int:
        """Number of numbers compared."""
        valid = int(torch.isfinite(self.sd).sum())
        return valid if self.phase is None else 2 * valid

    @property
    def effective(self) -> float:
        """Number of them that err independently."""
        valid = float((torch.isfinite(self.sd) * self.independent).sum())
        return valid if self.phase is None else 2.0 * valid

    @property
    def independent(self) -> Tensor:
        """(k,) share by which a point counts."""
        parts = [torch.full((b.points,), b.independent, dtype=torch.float64) for b in self.blocks]
        return torch.cat(parts)

    @property
    def estimated(self) -> bool:
        """Whether FRFs were estimated from histories here."""
        return any(block.estimator is not None for block in self.blocks)

    @property
    def levels(self) -> bool:
        """Whether there are records of different levels."""
        return len({block.level for block in self.blocks}) > 1

    def system(self, placed: tuple[Placed, ...] = ()) -> System:
        """The structure with effects."""
        terms = tuple(self.reduced.terms(one) for one in placed)
        return System(self.reduced.model, self.law, placed, terms)

    def predicted(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """Complex FRFs (N, f, k) of all floors, as each record shows them."""
        parts, first = [], 0
        for block in self.blocks:
            frequency = self.frequency_hz[first : first + block.points]
            first += block.points
            own = system.at_level(theta, zeta, sizes, block.level)
            if block.estimator is None:
                parts.append(system.frf(*own, sizes, frequency))
                continue
            asked = torch.from_numpy(block.estimator.frequency_hz)
            parts.append(block.estimator(system.frf(*own, sizes, asked)))
        return torch.cat(parts, dim=2)

    def residuals(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """Residuals (N, m), observed less predicted, of unit covariance by the problem's row.

        Args:
            system: with the effects.
            theta: (N, p); zeta: (N,); sizes: (N, q) of the effects.
        """
        return self.whitened(self.missed(system, (theta, zeta, sizes)))

    def missed(self, system: System, known: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        """Residuals (N, n) in the unit of the noise, of theta (N, p), zeta (N,), sizes (N, q)."""
        return self.compared(self.predicted(system, *known))

    def whitened(self, residuals: Tensor) -> Tensor:
        """Residuals (N, m) of unit covariance by the problem's row, of those by the noise alone."""
        return self.error.whiten(self.error.tame(residuals, self.row), self.row)

    def compared(self, predicted: Tensor) -> Tensor:
        """Residuals (N, n) of complex FRFs (N, f, k) of all floors, in the unit of their noise.

        Zero where not valid.
        """
        frf = predicted[:, list(self.rows)]
        weight = (1.0 / self.sd) * self.independent**0.5
        size = frf.abs().clamp_min(1e-12).log()
        parts = [((self.log_frf - size) * weight).flatten(1)]
        if self.phase is not None:
            # Half a turn off is half a turn ahead: were it at either end of the range, errors of a
            # reversed channel would change sign from point to point.
            least = 0.75 * torch.pi
            turn = torch.remainder(self.phase - frf.angle() + least, 2.0 * torch.pi) - least
            parts.append((turn * weight).flatten(1))
        return torch.cat(parts, dim=1)

    def moved(self, from_: Tensor, to: Tensor) -> Tensor:
        """Change (N, n) of predictions, (1, f, k) and (N, f, k), in the unit of the residuals."""
        rows = list(self.rows)
        weight = (1.0 / self.sd) * self.independent**0.5
        ratio = to[:, rows] / from_[:, rows]
        parts = [(ratio.abs().log() * weight).flatten(1)]
        if self.phase is not None:
            parts.append((ratio.angle() * weight).flatten(1))
        return torch.cat(parts, dim=1)


def together(first: Problem, second: Problem, level: float) -> Problem:
    """Two records of the same structure as one problem.

    Args:
        first: its level is the reference.
        second: of the other record.
        level: of the second, in doublings of the amplitude.
    """
    rows = tuple(sorted({*first.rows, *second.rows}))
    joined = [
        _on_rows(one.phase, one.rows, rows, 0.0) for one in (first, second) if one.phase is not None
    ]
    return replace(
        first,
        frequency_hz=torch.cat([first.frequency_hz, second.frequency_hz]),
        rows=rows,
        log_frf=torch.cat([_on_rows(p.log_frf, p.rows, rows, 0.0) for p in (first, second)], dim=1),
        phase=torch.cat(joined, dim=1) if len(joined) == 2 else None,
        sd=torch.cat([_on_rows(p.sd, p.rows, rows, torch.inf) for p in (first, second)], dim=1),
        blocks=(*first.blocks, *(replace(one, level=level) for one in second.blocks)),
        halves=tuple(
            together(*both, level) for both in zip(first.halves, second.halves, strict=False)
        ),
    )


def _on_rows(values: Tensor, own: tuple[int, ...], rows: tuple[int, ...], missing: float) -> Tensor:
    """Values (f, k) of some floors on the rows of more."""
    wide = values.new_full((len(rows), values.shape[1]), missing)
    wide[[rows.index(row) for row in own]] = values
    return wide


# Errors of H1 at frequencies x / T apart are correlated by 1, 4/9, 1/36, 0 at x = 0, 1, 2, 3: the
# spectrum of the squared window, squared, as base and noise both have it. What changes slowly with
# frequency is therefore known no better than from points 1.94 / T apart.
_CORRELATED = (1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)) / HANN


def make_problem(
    reduced: ReducedStructure,
    law: DampingLaw,
    box: tuple[Tensor, Tensor],
    zeta: tuple[float, float] | float,
    observation: Observation,
    *,
    use_phase: bool = True,
    model_error: float = 0.0,
    own_error: float = 0.0,
) -> Problem:
    """Bring an observation and a structure together.

    Args:
        reduced: the structure.
        law: of its damping.
        box: lower and upper stiffness factors.
        zeta: range of the damping ratio, or its value.
        observation: on its own grid.
        use_phase: compare phases where they were measured.
        model_error: added to the noise of ln|H|.
        own_error: share of an effect's size by which the model of the effect may err.
    """
    table = observation.coherence is None
    valid = torch.from_numpy(observation.valid)
    noise = torch.from_numpy(np.nan_to_num(observation.noise_sd, nan=1.0))
    if not table:
        # Where noise reaches the response, ln|H| of an estimate lies too high, and what is kept
        # for its coherence higher still.
        valid = valid & (noise < THRESHOLDS.noisy)
    infinite = torch.full_like(noise, torch.inf)
    spacing = float(np.median(np.diff(observation.frequency_hz)))
    resolution = observation.resolution_hz or spacing
    phase = observation.phase if use_phase else None
    floors = reduced.model.floors
    return Problem(
        reduced=reduced,
        law=law,
        lower=box[0],
        upper=box[1],
        zeta=zeta if isinstance(zeta, tuple) else None,
        fixed_zeta=0.02 if isinstance(zeta, tuple) else zeta,
        frequency_hz=torch.from_numpy(observation.frequency_hz),
        rows=tuple(floors.index(name) for name in observation.floors),
        log_frf=torch.where(valid, torch.from_numpy(np.nan_to_num(observation.log_frf)), 0.0),
        phase=None if phase is None else torch.from_numpy(np.nan_to_num(phase)),
        sd=torch.where(valid, (noise**2 + model_error**2).sqrt(), infinite),
        blocks=(
            Block(
                observation.frequency_hz.size,
                min(1.0, spacing / (resolution * (1.0 if table else _CORRELATED))),
                observation.estimator,
            ),
        ),
        own_error=own_error,
    )
