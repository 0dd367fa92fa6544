"""The likelihood of all that was measured, in the parameters of a model that may err."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.dynamics.system import System
from femupdate.inference.data import Data
from femupdate.inference.frf_data import FrfData
from femupdate.inference.joint_error import JointError, Row, Rows, joint_error
from femupdate.inference.parameters import Parameters
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed, torch_generator
from femupdate.workers import in_threads


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
        known_is_met: whether what errors known beforehand, as a mesh's, make up for is no misfit.
    """

    data: tuple[Data, ...]
    system: System
    prior: Parameters
    error: JointError
    row: Row
    constant: float = 0.0
    known_is_met: bool = False

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""

        def of_some(some: Tensor) -> Tensor:
            return self.error.log_density(self._raw(some))

        return self._in_batches(of_some, parameters).to(parameters.device) - self.constant

    def raw(self, parameters: Tensor) -> Tensor:
        """Residuals (n, m) of parameters (n, p), observed less predicted, in the unit of noise."""
        return self._in_batches(self._raw, parameters).to(parameters.device)

    def residuals(self, parameters: Tensor) -> Tensor:
        """Residuals (n, m) of parameters (n, p), of unit covariance by the row."""
        raw = self.raw(parameters)
        return self.error.whiten(self.error.tame(raw, self.row), self.row)

    def log_density(self, parameters: Tensor) -> Tensor:
        """Log density (n,) of parameters (n, p), were the row true, up to a constant."""

        def of_some(some: Tensor) -> Tensor:
            left = self.error.whiten(self.error.tame(self._raw(some), self.row), self.row)
            return -0.5 * left.square().sum(1)

        return self._in_batches(of_some, parameters).to(parameters.device)

    def log_densities(self, parameters: Tensor) -> tuple[Tensor, ...]:
        """Log density (n, g) of every kind of data by every row of its table of errors."""
        return self.error.log_densities(self.raw(parameters))

    def at_row(self, row: Row) -> "Likelihood":
        """The same, residuals whitened by another row."""
        return replace(self, row=row)

    def kept(self, rows: Rows) -> "Likelihood":
        """The same with some rows of the tables alone; residuals are whitened by the first."""
        return replace(self, error=self.error.kept(rows), row=(0,) * len(rows))

    def coarse(self, noise: float) -> "Likelihood":
        """The same as if there were so much more noise: peaks that do not meet show a distance."""
        data = tuple(one.coarse(noise) for one in self.data)
        error = joint_error(data)
        return replace(self, data=data, error=error, row=error.first)

    def with_rows_of(self, other: "Likelihood") -> "Likelihood":
        """The same with the rows of the tables of errors that another of the same data has."""
        return replace(self, error=self.error.with_rows_of(other.error), row=other.row)

    @property
    def effective(self) -> float:
        """Number of the numbers compared that err independently."""
        return sum(one.effective for one in self.data)

    @property
    def learns(self) -> bool:
        """Whether larger errors are allowed for than the stated noise."""
        return any(one.learns for one in self.error.parts)

    @property
    def base(self) -> FrfData | None:
        """FRFs under base motion, the first of the data; None where there are none."""
        first = self.data[0]
        return first if isinstance(first, FrfData) and not first.forced else None

    def misfit(self, parameters: Tensor) -> Tensor:
        """Mean squared residual (n,) of parameters (n, p), by the stated noise alone."""
        raw = self.raw(parameters)
        parts = zip(self.error.parts, self.error.apart(raw), strict=True)
        known = self.known_is_met
        squares = [one.by_noise_alone(own, known=known).square().sum(1) for one, own in parts]
        return torch.stack(squares).sum(0) / max(self.effective, 1.0)

    def explained(self, parameters: Tensor) -> float | None:
        """Share of the variation over frequency that the best of parameters (n, p) has.

        Of ln|H| under base motion; None where it was not measured.
        """
        if self.base is None:
            return None
        return self.base.explained(self.error.apart(self.raw(parameters))[0])

    def checked(self, parameters: Tensor, seed: Seed) -> list[tuple[str, Tensor, Tensor]]:
        """Name, squares (n,) and independent numbers (n,) of each part that is checked.

        Squares hold what the model may err by; of every draw by one row of its own. What is wilder
        than counts in the likelihood is in neither.
        """
        raw, generator = self.raw(parameters), torch_generator(seed)
        shares = [own.softmax(1) for own in self.error.log_densities(raw)]
        parts = zip(self.data, self.error.parts, self.error.apart(raw), shares, strict=True)
        found: list[tuple[str, Tensor, Tensor]] = []
        for data, error, own, share in parts:
            rows = torch.multinomial(share, 1, generator=generator)[:, 0]
            found += data.checked(*error.floor_squares(own, rows))
        return found

    def _raw(self, parameters: Tensor) -> Tensor:
        values = self.prior.split(parameters)
        return missed(self.data, self.system, (values.theta, values.zeta, values.sizes))

    def _in_batches(self, task: Callable[[Tensor], Tensor], parameters: Tensor) -> Tensor:
        """On all processors, but where ln|H| is made by the thousand or slopes are asked for."""
        parts = parameters.split(min(one.at_once for one in self.data))
        alone = len(self.data) == 1 and self.base is not None and self.base.logs is not None
        if alone or len(parts) == 1 or parameters.requires_grad:
            return torch.cat([task(some) for some in parts])
        return torch.cat(in_threads(task, parts))


def missed(data: Sequence[Data], system: System, known: tuple[Tensor, Tensor, Tensor]) -> Tensor:
    """Residuals (n, m) in the unit of the noise, of theta (n, p), zeta (n,) and sizes (n, q)."""
    parts = [one.compared(one.predicted(system, *known)) for one in data]
    return torch.cat([part.to(known[0].device) for part in parts], dim=1)


def likelihood_of(
    data: Sequence[Data],
    system: System,
    prior: Parameters,
    constant: float = 0.0,
) -> Likelihood:
    """The likelihood by all rows of the tables of errors, whitened by that of no error."""
    error = joint_error(data)
    return Likelihood(tuple(data), system, prior, error, error.first, constant)


def cost_of_scatter(observation: Observation, data: FrfData) -> float:
    """Half the scatter of runs about what they were pooled into, at independent points."""
    if observation.scatter is None:
        return 0.0
    own = float(observation.scatter[observation.valid].sum())
    return 0.5 * data.blocks[0].independent * own


__all__ = ["Likelihood", "cost_of_scatter", "likelihood_of", "missed"]
