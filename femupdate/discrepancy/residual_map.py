"""Where model and measurement disagree: parts of the data whose residuals exceed the noise."""

from scipy.special import chdtrc

from femupdate.discrepancy.fit import Fit
from femupdate.inference.data import Cell
from femupdate.inference.likelihood import Likelihood


def residual_cells(problem: Likelihood, fitted: Fit) -> tuple[Cell, ...]:
    """Mean squared residual of every part of the data."""
    error = fitted.likelihood.error
    parts = zip(problem.data, error.parts, error.apart(fitted.raw[None]), strict=True)
    cells: list[Cell] = []
    for data, table, raw in parts:
        left = table.whiten(table.tame(raw, 0), 0)[0, : data.residuals]
        cells += data.cells(left)
    return tuple(cells)


def p_value(problem: Likelihood, fitted: Fit) -> float:
    """Probability that noise alone leaves residuals as large as these."""
    freedom = max(problem.effective - fitted.steps.size, 1.0)
    return float(chdtrc(freedom, fitted.chi2))


__all__ = ["Cell", "p_value", "residual_cells"]
