"""The likelihood of all that was measured, in the parameters of a model that may err."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import torch
from torch import Tensor

from femupdate.building.document import Building
from femupdate.dynamics.reduced import ReducedStructure
from femupdate.dynamics.system import Sample, System
from femupdate.effects.effect import Effect, Placed
from femupdate.errors import brief
from femupdate.inference.frf_data import FrfData
from femupdate.inference.mode_data import ModeData
from femupdate.inference.model_error import LearnedError
from femupdate.inference.parameters import Parameters, Values, effect_parameters
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, torch_generator
from femupdate.workers import in_threads

Data: TypeAlias = FrfData | ModeData
"""One kind of observation of a building.

Predictions are tensors (N, ...) of the kind's own shape; residuals are (N, n), observed less
predicted, in the unit of the noise, and zero where nothing was observed.
"""

Row = tuple[int, ...]
"""One row of the table of every kind of data."""
Rows = tuple[tuple[int, ...], ...]
"""Some rows of each."""


class ModelError:
    """What a model errs by, learned from the data: of every kind an error of its own.

    The kinds are independent: their densities multiply.

        >>> import femupdate, torch
        >>> from femupdate.inference.model_error import LearnedError
        >>> frequency_hz = torch.linspace(1.0, 10.0, 50).double()
        >>> weight = torch.full((3, 50), 1 / 0.05**2).double()  # noise of .05 in ln|H|, 3 floors
        >>> error = femupdate.ModelError([LearnedError(weight, frequency_hz)], [150])
        >>> off = torch.full((1, 150), 4.0).double()  # by .2 everywhere, four times the noise
        >>> of_noise_alone = -0.5 * off.square().sum()
        >>> bool(error.log_density(off) > 0.1 * of_noise_alone)
        True

    Args:
        parts: the error of each kind.
        sizes: number of residuals of each.
    """

    def __init__(self, parts: Sequence[LearnedError], sizes: Sequence[int]) -> None:
        self.parts, self._sizes = tuple(parts), list(sizes)

    @property
    def first(self) -> Row:
        """The row of no error."""
        return (0,) * len(self.parts)

    @property
    def start(self) -> Row:
        """The row from which fits start."""
        return tuple(part.start for part in self.parts)

    @property
    def largest(self) -> list[Row]:
        """The rows of the largest errors, one for every noise."""
        kinds = [part.largest for part in self.parts]
        count = max(len(rows) for rows in kinds)
        return [tuple(rows[min(k, len(rows) - 1)] for rows in kinds) for k in range(count)]

    @property
    def knows(self) -> bool:
        """Whether there are errors that are known beforehand."""
        return any(part.knows for part in self.parts)

    def apart(self, residuals: Tensor) -> tuple[Tensor, ...]:
        """Residuals (n, m) of every kind of data."""
        return residuals.split(self._sizes, dim=1)

    def tame(self, residuals: Tensor, row: Row) -> Tensor:
        """Residuals (n, m) none of which is wilder than counts (see `LearnedError`)."""
        parts = zip(self.parts, self.apart(residuals), row, strict=True)
        return torch.cat([part.tame(values, at) for part, values, at in parts], dim=1)

    def whiten(self, residuals: Tensor, row: Row) -> Tensor:
        """Residuals (n, m) of unit covariance, were a row true."""
        parts = zip(self.parts, self.apart(residuals), row, strict=True)
        return torch.cat([part.whiten(values, at) for part, values, at in parts], dim=1)

    def log_densities(self, residuals: Tensor) -> tuple[Tensor, ...]:
        """Log density (n, g) of every kind's residuals (n, m) by every row of its table."""
        parts = zip(self.parts, self.apart(residuals), strict=True)
        return tuple(part.log_densities(values) for part, values in parts)

    def log_density(self, residuals: Tensor) -> Tensor:
        """Log density (n,) of residuals (n, m), summed over the tables."""
        return summed(self.log_densities(residuals))

    def kept(self, rows: Rows) -> "ModelError":
        """With some rows of the tables alone."""
        return self._each(LearnedError.kept, rows)

    def finer(self, row: Row) -> "ModelError":
        """With finer tables about a row."""
        return self._each(LearnedError.finer, row)

    def with_rows_of(self, other: "ModelError") -> "ModelError":
        """With the rows of the tables of another of the same data."""
        return self._each(LearnedError.with_rows_of, other.parts)

    def _each(self, change: Callable[[Any, Any], LearnedError], by: Sequence[Any]) -> "ModelError":
        return ModelError([change(*both) for both in zip(self.parts, by, strict=True)], self._sizes)

    def counting_beside(self, row: Row, densities: Sequence[Tensor]) -> Rows:
        """A row, and those that count at one at least of some points, by log densities (n, g)."""
        apart = zip(self.parts, row, densities, strict=True)
        return tuple(
            (at, *(other for other in part.counting(chosen) if other != at))
            for part, at, chosen in apart
        )

    def no_larger(self, row: Row) -> Rows:
        """Rows by which residuals are no larger, in the mean square, than by a row."""
        return tuple(tuple(part.no_larger(at)) for part, at in zip(self.parts, row, strict=True))

    def forget(self) -> None:
        """Give back the memory of what is kept for speed."""
        for part in self.parts:
            part.forget()


def joint_error(data: Sequence[Data], known: Sequence[Tensor | None] = ()) -> ModelError:
    """What a model may err by in data, beside errors (c, n) of each that are known beforehand."""
    both = zip(data, known or [None] * len(data), strict=True)
    return ModelError(
        [measured.error(errors) for measured, errors in both], [kind.residuals for kind in data]
    )


def summed(densities: Sequence[Tensor]) -> Tensor:
    """Log density (...) of all data, from that of every kind by every row, (..., g)."""
    return torch.stack([torch.logsumexp(density, dim=-1) for density in densities]).sum(dim=0)


class KnownErrors(Protocol):
    """Errors of a model that are known beforehand about given parameters, as those of a mesh.

    Attributes:
        likeliest: (m,) of the first ones, in standard deviations; the system holds them.
    """

    @property
    def likeliest(self) -> Tensor: ...

    def __call__(self, data: Sequence[Data], system: System, values: Values) -> Tensor:
        """One standard deviation of every error (c, n), in the unit of the residuals."""

    def held(self, likeliest: Tensor, system: System) -> "tuple[KnownErrors, System]":
        """The same, and the system, with others (m,) of the first errors in it."""

    def freed(self, system: System) -> tuple[System, Callable[[Tensor], Tensor]]:
        """The system with effects that stand for these errors, and their sizes by errors (n, m)."""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """ln of the density of all that was measured, what the model errs by summed over.

        >>> import femupdate, torch
        >>> from femupdate.inference.frf_data import base_logs
        >>> from femupdate.inference.likelihood import likelihood_of
        >>> how = {"exact": True, "particles": 400}
        >>> found = femupdate.calibrate("house", "run.csv", building="shear_3dof", **how)
        >>> system, parameters = found.model.system, found.model.parameters
        >>> data = base_logs(found.posterior.observation, system)
        >>> likelihood = likelihood_of((data,), system, parameters)
        >>> middle = parameters.from_normal(torch.zeros(1, parameters.size).double())
        >>> isinstance(likelihood, femupdate.Likelihood), len(likelihood(middle))
        (True, 1)

    Attributes:
        data: one entry a kind of observation.
        system: the model with its effects.
        prior: of the parameters: stiffness factors, parameters of the effects, damping ratio.
        error: what the model may err by.
        row: of its tables, by which residuals are whitened.
        constant: taken off, the same for all parameters: what the scatter of several runs costs
            that were pooled into one observation.
        within: the structure in which further effects may act; None where none are asked for.
        search: the structure on a basis for the whole prior, on which only instruments and damping
            may have effects; None where `within` serves there.
        known: errors of the model about given parameters; None where there are none.
        changes: (c, n) of the residuals by these, where they were last asked for.
    """

    __repr__ = brief

    data: tuple[Data, ...]
    system: System
    prior: Parameters
    error: ModelError
    row: Row
    constant: float = 0.0
    within: ReducedStructure | None = None
    search: ReducedStructure | None = None
    known: KnownErrors | None = None
    changes: Tensor | None = None

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""
        density = self._in_batches(lambda some: self.error.log_density(self._raw(some)), parameters)
        return density - self.constant

    def raw(self, parameters: Tensor) -> Tensor:
        """Residuals (n, m) of parameters (n, p), observed less predicted, in the unit of noise."""
        return self._in_batches(self._raw, parameters)

    def residuals(self, parameters: Tensor) -> Tensor:
        """Residuals (n, m) of parameters (n, p), of unit covariance by the row."""
        return self.whitened(self.raw(parameters))

    def whitened(self, raw: Tensor) -> Tensor:
        """Residuals (n, m) of unit covariance by the row, of those in the unit of noise."""
        return self.error.whiten(self.error.tame(raw, self.row), self.row)

    def log_density(self, parameters: Tensor) -> Tensor:
        """Log density (n,) of parameters (n, p), were the row true, up to a constant."""
        return -0.5 * self._in_batches(
            lambda some: self.whitened(self._raw(some)).square().sum(1), parameters
        )

    def log_densities(self, parameters: Tensor) -> tuple[Tensor, ...]:
        """Log density (n, g) of every kind of data by every row of its table of errors."""
        return self.error.log_densities(self.raw(parameters))

    def at_row(self, row: Row) -> "Likelihood":
        """The same, residuals whitened by another row."""
        return self if row == self.row else replace(self, row=row)

    def kept(self, rows: Rows) -> "Likelihood":
        """The same with some rows of the tables alone, its own among them."""
        row = tuple(some.index(at) for some, at in zip(rows, self.row, strict=True))
        return replace(self, error=self.error.kept(rows), row=row)

    def without_effects_on(self, reduced: ReducedStructure) -> "Likelihood":
        """The same on another basis, without effects."""
        system = replace(self.system, model=reduced.model, placed=(), terms=())
        prior = self.prior.of("stiffness", "damping")
        return replace(self, system=system, prior=prior, within=reduced)

    def with_effects(self, placed: tuple[Placed, ...]) -> "Likelihood":
        """The same of a model with these effects in place of its own."""
        if placed == self.system.placed:
            return self
        if placed in self._made:
            return self._made[placed]
        terms = tuple(self.reduced.terms(effect) for effect in placed)
        system = replace(self.system, placed=placed, terms=terms)
        added = effect_parameters(placed, searched=True)
        prior = self.prior.of("stiffness", "damping") + added
        self._made[placed] = replace(self, system=system, prior=prior)
        return self._made[placed]

    @cached_property
    def _made(self) -> dict[tuple[Placed, ...], "Likelihood"]:
        return {}

    def of(self, other: "Likelihood") -> "Likelihood":
        """The likelihood of the same data by the model of another."""
        return replace(self, system=other.system, prior=other.prior, within=other.within)

    @property
    def reduced(self) -> ReducedStructure:
        """The structure in which further effects may act."""
        assert self.within is not None
        return self.within

    @property
    def building(self) -> Building:
        """Whose structure it is."""
        return self.reduced.structure.building

    def for_search(self) -> "Likelihood":
        """The same on the basis that serves over the whole prior, nothing known beforehand."""
        if self.search is None:
            return self
        error = joint_error(self.data).with_rows_of(self.error)
        return replace(self.without_effects_on(self.search), error=error, known=None)

    def on_fewer(self, shapes: int) -> "Likelihood":
        """The same on the shapes that count most: for searches, which the whole basis ends."""
        return self.without_effects_on(self.reduced.first(shapes))

    def about(self, parameters: Tensor) -> "Likelihood":
        """The same beside the errors that are known about parameters (1, p)."""
        if self.known is None:
            return self
        found = self.known(self.data, self.system, self.prior.split(parameters))
        return replace(self, error=self._beside(found), changes=found)

    def holding_likeliest(self, parameters: Tensor) -> "Likelihood":
        """The same of the system with known errors as if residuals were straight in them."""
        if self.known is None or self.changes is None:
            return self
        held = self.error.whiten(self.changes[: len(self.known.likeliest)], self.row)
        return self.holding(held @ self.residuals(parameters)[0], parameters)

    def holding(self, errors: Tensor, parameters: Tensor) -> "Likelihood":
        """The same of the system with known errors (m,), and about parameters (1, p) with them."""
        assert self.known is not None
        known, system = self.known.held(errors, self.system)
        return replace(self, known=known, system=system).about(parameters)

    def with_errors(self) -> Callable[[Tensor], Tensor]:
        """Residuals (n, r) of normal coordinates (n, d) and the m errors that the system may hold.

        Of unit covariance by the row beside the errors that it does not hold.
        """
        assert self.known is not None
        assert self.changes is not None
        beside = self._beside(self.changes[len(self.known.likeliest) :])
        (system, sizes), size = self.known.freed(self.system), self.prior.size

        def residuals(z: Tensor) -> Tensor:
            values = self.prior.split(self.prior.from_normal(z[:, :size]))
            both = torch.cat([values.sizes, sizes(z[:, size:])], dim=1)
            raw = missed(self.data, system, (values.theta, values.zeta, both))
            return beside.whiten(beside.tame(raw, self.row), self.row)

        return residuals

    @property
    def divisible(self) -> bool:
        """Whether the data can be parted in two halves that err independently."""
        return len(self.data) > 1 or any(kind.halves for kind in self.data)

    def half(self, number: int) -> "Likelihood":
        """By one half of the data, nothing known beforehand.

        Of data that cannot be parted every other kind goes to the same half.
        """
        parts, whole = [], 0
        for kind in self.data:
            if kind.halves:
                parts.append(kind.halves[number])
                continue
            parts.append(kind if whole % 2 == number else kind.emptied())
            whole += 1
        return replace(self, data=tuple(parts), error=joint_error(parts).with_rows_of(self.error))

    def up_to(self, hz: float) -> "Likelihood":
        """By what was measured up to a frequency, and by all modes."""
        parts = tuple(kind.emptied(hz) if isinstance(kind, FrfData) else kind for kind in self.data)
        return replace(self, data=parts, error=joint_error(parts).with_rows_of(self.error))

    def coarse(self, noise: float) -> "Likelihood":
        """The same as if there were so much more noise: peaks that do not meet show a distance."""
        data = tuple(kind.coarse(noise) for kind in self.data)
        error = joint_error(data)
        return replace(self, data=data, error=error, row=error.first)

    def with_rows_of(self, other: "Likelihood") -> "Likelihood":
        """The same with the rows of the tables of errors that another of the same data has."""
        return replace(self, error=self.error.with_rows_of(other.error), row=other.row)

    @property
    def top_hz(self) -> float:
        """The highest frequency that was measured."""
        return max(kind.top_hz for kind in self.data)

    @property
    def levels(self) -> tuple[float, ...]:
        """Of motion, in doublings above the first, each once."""
        return tuple(dict.fromkeys(level for kind in self.data for level in kind.levels))

    @property
    def measured_floors(self) -> tuple[str, ...]:
        """Floors with a sensor, bottom to top."""
        rows = sorted({row for kind in self.data for row in kind.rows})
        return tuple(self.system.floors[row] for row in rows)

    def shows(self, effect: Effect) -> bool:
        """Whether an effect can show in any of the data."""
        if effect.needs_levels and len(self.levels) == 1:
            return False
        return any(kind.shows(effect) for kind in self.data)

    @property
    def effective(self) -> float:
        """Number of the numbers compared that err independently."""
        return sum(kind.effective for kind in self.data)

    @property
    def learns(self) -> bool:
        """Whether larger errors are allowed for than the stated noise."""
        return any(part.learns for part in self.error.parts)

    @property
    def base(self) -> FrfData | None:
        """FRFs under base motion, the first of the data; None where there are none."""
        first = self.data[0]
        return first if isinstance(first, FrfData) and not first.forced else None

    def misfit(self, raw: Tensor) -> Tensor:
        """Mean square (n,) of residuals (n, m), by the stated noise alone.

        What errors known beforehand make up for, as a mesh's, is no misfit.
        """
        parts = zip(self.error.parts, self.error.apart(raw), strict=True)
        squares = [error.by_noise_alone(missed_by).square().sum(1) for error, missed_by in parts]
        return torch.stack(squares).sum(0) / max(self.effective, 1.0)

    def explained(self, raw: Tensor) -> float | None:
        """Share of the variation over frequency that the best has of residuals (n, m).

        Of ln|H| under base motion; None where it was not measured.
        """
        if self.base is None:
            return None
        return self.base.explained(self.error.apart(raw)[0])

    def checked(self, raw: Tensor, seed: Seed) -> list[tuple[str, Tensor, Tensor]]:
        """Name, squares (n,) and independent numbers (n,) of each part of residuals (n, m).

        Squares hold what the model may err by; of every draw by one row of its own. What is wilder
        than counts in the likelihood is in neither.
        """
        generator = torch_generator(seed)
        shares = [left.softmax(1) for left in self.error.log_densities(raw)]
        parts = zip(self.data, self.error.parts, self.error.apart(raw), shares, strict=True)
        found: list[tuple[str, Tensor, Tensor]] = []
        for data, error, left, share in parts:
            rows = torch.multinomial(share, 1, generator=generator)[:, 0]
            found += data.checked(*error.floor_squares(left, rows))
        return found

    def _beside(self, known: Tensor) -> ModelError:
        """What the model may err by beside errors (c, n) that are known."""
        parts = known.split([kind.residuals for kind in self.data], dim=1)
        return joint_error(self.data, parts).with_rows_of(self.error)

    def _raw(self, parameters: Tensor) -> Tensor:
        values = self.prior.split(parameters)
        left = missed(self.data, self.system, (values.theta, values.zeta, values.sizes))
        if self.known is None or self.changes is None:
            return left
        # What the system holds of the errors is as likely as before.
        held = self.known.likeliest
        return left + (held @ self.changes[: len(held)]).to(left)

    def _in_batches(self, task: Callable[[Tensor], Tensor], parameters: Tensor) -> Tensor:
        """On all processors, but where ln|H| is made by the thousand or slopes are asked for."""
        parts = parameters.split(min(kind.at_once for kind in self.data))
        alone = len(self.data) == 1 and self.base is not None and self.base.logs is not None
        if alone or len(parts) == 1 or parameters.requires_grad:
            return torch.cat([task(some) for some in parts])
        return torch.cat(in_threads(task, parts))


def missed(data: Sequence[Data], system: System, known: Sample) -> Tensor:
    """Residuals (n, m) in the unit of the noise, of theta (n, p), zeta (n,) and sizes (n, q)."""
    parts = [kind.compared(kind.predicted(system, *known)) for kind in data]
    return torch.cat(parts, dim=1)


def likelihood_of(
    data: Sequence[Data],
    system: System,
    prior: Parameters,
    constant: float = 0.0,
    reduced: ReducedStructure | None = None,
) -> Likelihood:
    """The likelihood by all rows of the tables of errors, whitened by that of no error."""
    error = joint_error(data)
    return Likelihood(tuple(data), system, prior, error, error.first, constant, reduced)


def cost_of_scatter(observation: Observation, data: FrfData) -> float:
    """Half the scatter of runs about what they were pooled into, at independent points."""
    if observation.scatter is None:
        return 0.0
    scatter = float(observation.scatter[observation.valid].sum())
    return 0.5 * data.blocks[0].independent * scatter
