"""What a model may err by in several kinds of data, each with a table of errors of its own."""

from collections.abc import Sequence

import torch
from torch import Tensor

from femupdate.inference.data import Data
from femupdate.inference.model_error import LearnedError

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
        fewer = [part.kept(chosen) for part, chosen in zip(self.parts, rows, strict=True)]
        return ModelError(fewer, self._sizes)

    def finer(self, row: Row) -> "ModelError":
        """With finer tables about a row."""
        finer = [part.finer(at) for part, at in zip(self.parts, row, strict=True)]
        return ModelError(finer, self._sizes)

    def with_known_of(self, other: "ModelError") -> "ModelError":
        """With the errors that another of the same data knows beforehand."""
        both = zip(self.parts, other.parts, strict=True)
        return ModelError([part.with_known_of(source) for part, source in both], self._sizes)

    def with_rows_of(self, other: "ModelError") -> "ModelError":
        """With the rows of the tables of another of the same data."""
        both = zip(self.parts, other.parts, strict=True)
        return ModelError([part.with_rows_of(source) for part, source in both], self._sizes)

    def counting(self, densities: Sequence[Tensor]) -> Rows:
        """Rows that count at one at least of some points, from log densities (n, g)."""
        parts = zip(self.parts, densities, strict=True)
        return tuple(tuple(part.counting(chosen)) for part, chosen in parts)

    def counting_beside(self, row: Row, densities: Sequence[Tensor]) -> Rows:
        """The same with a row first."""
        both = zip(row, self.counting(densities), strict=True)
        return tuple((at, *(other for other in others if other != at)) for at, others in both)

    def no_larger(self, row: Row) -> Rows:
        """Rows none of whose errors, and whose noise, is larger than a row's."""
        return tuple(tuple(part.no_larger(at)) for part, at in zip(self.parts, row, strict=True))

    def every(self) -> Rows:
        """All rows."""
        return tuple(tuple(range(len(part.levels))) for part in self.parts)

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


__all__ = ["ModelError", "Row", "Rows", "joint_error", "summed"]
