"""A structure and the data by which the effect finder judges it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from femupdate.discrepancy.thresholds import FIT
from femupdate.dynamics.damping import DampingLaw
from femupdate.dynamics.reduced import ReducedStructure
from femupdate.dynamics.system import System
from femupdate.effects.effect import Effect, Placed
from femupdate.inference.data import Data
from femupdate.inference.joint_error import JointError, Row, Rows, joint_error
from femupdate.inference.likelihood import missed
from femupdate.inference.parameters import Parameters

Effects = tuple[Placed, ...]


@dataclass(frozen=True, eq=False)
class Problem:
    """A structure, what was observed of it, and what may be said of both.

    Attributes:
        reduced: the structure through its basis.
        law: of its damping.
        prior: of the p stiffness factors, and behind them of the damping ratio.
        data: one entry a kind of observation.
        left_open: gives one standard deviation (c, n) of every error of the model that many points
            share, in the unit of the residuals, of this problem with some effects at theta (1, p),
            zeta (1,) and sizes (1, q); None where there is none.
        own_error: share of an effect's size by which the model of the effect may err.
        search: the structure on a basis for the whole prior, on which only instruments and damping
            may have effects; None where `reduced` serves there.
        known: (c, n) such errors of the model about one fit, for all models alike; None for none.
        rows_kept: of the tables of what the model may err by (see `error`); None for all.
        chosen: which of them residuals are whitened by; None for those of no error.
    """

    reduced: ReducedStructure
    law: DampingLaw
    prior: Parameters
    data: tuple[Data, ...]
    left_open: "Callable[[Problem, Effects, Tensor, Tensor, Tensor], Tensor] | None" = None
    own_error: float = 0.0
    search: ReducedStructure | None = None
    known: Tensor | None = None
    rows_kept: Rows | None = None
    chosen: Row | None = None

    def for_search(self) -> "Problem":
        """The same on the basis that serves over the whole prior."""
        if self.search is None:
            return self
        return replace(self, reduced=self.search, left_open=None, known=None)

    def on_fewer(self) -> "Problem":
        """The same on the shapes that count most: for searches, which the whole basis ends."""
        return self._with_tables(replace(self, reduced=self._fewer, left_open=None))

    def coarse(self, noise: float) -> "Problem":
        """For searches, as if there were so much more noise and every point erred alone."""
        data = tuple(one.coarse(noise) for one in self.data)
        return replace(
            self, reduced=self._fewer, data=data, left_open=None, known=None, chosen=None
        )

    @property
    def _fewer(self) -> ReducedStructure:
        return self.reduced.first(FIT.fewer_shapes)

    def _with_tables(self, other: "Problem") -> "Problem":
        """Another of the same data, with the same tables of errors, whose factors are dear."""
        other.__dict__["error"] = self.error
        return other

    @property
    def divisible(self) -> bool:
        """Whether the data can be parted in two halves that err independently."""
        return len(self.data) > 1 or any(one.halves for one in self.data)

    def half(self, number: int) -> "Problem":
        """One half of the data, for the same structure on the same basis.

        Of data that cannot be parted every other kind goes to the same half.
        """
        parts, whole = [], 0
        for one in self.data:
            if one.halves:
                parts.append(one.halves[number])
                continue
            parts.append(one if whole % 2 == number else one.emptied())
            whole += 1
        return replace(self, data=tuple(parts), known=None)

    @property
    def row(self) -> Row:
        """The row of every table by which residuals are whitened."""
        return self.chosen or (0,) * len(self.data)

    def at_row(self, row: Row) -> "Problem":
        """The same, residuals whitened by other rows of the tables of errors."""
        if row == self.row:
            return self
        return self._with_tables(replace(self, chosen=row))

    def same_errors(self, other: "Problem") -> bool:
        """Whether both have one table of errors, and one set of those known beforehand."""
        return self.known is other.known and self.rows_kept == other.rows_kept

    def same_tables(self, other: "Problem") -> bool:
        """Whether the data of both are of the same kinds, with the same tables of errors."""
        kinds = [[one.name for one in problem.data] for problem in (self, other)]
        whole = [replace(problem, rows_kept=None).error.every() for problem in (self, other)]
        return kinds[0] == kinds[1] and whole[0] == whole[1]

    def with_rows(self, rows: Rows) -> "Problem":
        """The same with some rows of the tables of errors alone, its own among them."""
        before = self.rows_kept or self.error.every()
        kept = tuple(
            tuple(all_[row] for row in own) for all_, own in zip(before, rows, strict=True)
        )
        own_row = tuple(own.index(at) for own, at in zip(rows, self.row, strict=True))
        return replace(self, rows_kept=kept, chosen=own_row)

    @cached_property
    def error(self) -> JointError:
        """What the model may err by, beside the noise."""
        sizes = [one.residuals for one in self.data]
        known = () if self.known is None else self.known.split(sizes, dim=1)
        whole = joint_error(self.data, known)
        return whole if self.rows_kept is None else whole.kept(self.rows_kept)

    @property
    def points(self) -> int:
        """Number of numbers compared."""
        return sum(one.points for one in self.data)

    @property
    def effective(self) -> float:
        """Number of them that err independently."""
        return sum(one.effective for one in self.data)

    @property
    def top_hz(self) -> float:
        """The highest frequency that was measured."""
        return max(one.top_hz for one in self.data)

    @property
    def levels(self) -> tuple[float, ...]:
        """Of motion, in doublings above the first, each once."""
        return tuple(dict.fromkeys(level for one in self.data for level in one.levels))

    @property
    def measured_floors(self) -> tuple[str, ...]:
        """Floors with a sensor, bottom to top."""
        rows = sorted({row for one in self.data for row in one.rows})
        return tuple(self.reduced.model.floors[row] for row in rows)

    def shows(self, effect: Effect) -> bool:
        """Whether an effect can show in any of the data."""
        if effect.needs_levels and len(self.levels) == 1:
            return False
        return any(one.shows(effect) for one in self.data)

    def system(self, placed: tuple[Placed, ...] = ()) -> System:
        """The structure with effects."""
        terms = tuple(self.reduced.terms(one) for one in placed)
        return System(self.reduced.model, self.law, placed, terms)

    def own_errors(self, placed: Sequence[Placed]) -> Tensor:
        """(q,) share of every parameter of effects by which the effects themselves may err."""
        return own_errors(placed, self.own_error)

    def residuals(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """Residuals (N, m), observed less predicted, of unit covariance by the problem's row.

        Args:
            system: with the effects.
            theta: (N, p); zeta: (N,); sizes: (N, q) of the effects.
        """
        return self.whitened(self.missed(system, (theta, zeta, sizes)))

    def missed(self, system: System, known: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        """Residuals (N, n) in the unit of the noise, of theta (N, p), zeta (N,), sizes (N, q)."""
        return missed(self.data, system, known)

    def whitened(self, residuals: Tensor) -> Tensor:
        """Residuals (N, m) of unit covariance by the problem's row, of those by the noise alone."""
        return self.error.whiten(self.error.tame(residuals, self.row), self.row)


def own_errors(placed: Sequence[Placed], of_all: float) -> Tensor:
    """(q,) share of every parameter of effects by which the effects themselves may err.

    Args:
        placed: the effects.
        of_all: share by which any effect may err on a building's model.
    """
    own = [one.effect.own_error for one in placed for _ in one.effect.parameters]
    return (torch.tensor(own, dtype=torch.float64) ** 2 + of_all**2).sqrt()
