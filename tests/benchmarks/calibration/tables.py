"""Tables of the calibration benchmark."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..result import markdown_table
from .cases import CalibrationCase, Judged, Widths
from .coverage import (
    REGIONS,
    Coverage,
    central_level,
    coverage,
    rank_histogram_p_value,
    uniformity_p_value,
)


@dataclass(frozen=True)
class Scores:
    """How one kind of posterior does over all cases."""

    density: Coverage  # coverage of highest-density regions
    central: Coverage  # coverage of the central intervals of all parameters together
    rank_p: tuple[float, ...]  # (p,) chi-square p-values of the rank histograms
    tarp_p: float  # Kolmogorov-Smirnov p-value of the TARP levels


def scores(judged: Sequence[Judged]) -> Scores:
    """Scores of some cases."""
    rank = np.array([case.rank for case in judged])
    central = coverage(central_level(rank.ravel()))
    # The parameters of a case are not independent: count cases, not parameters.
    error = np.sqrt(central.nominal * (1.0 - central.nominal) / len(judged))
    return Scores(
        coverage([case.density for case in judged]),
        replace(central, error=error, cases=len(judged)),
        tuple(rank_histogram_p_value(column) for column in rank.T),
        uniformity_p_value([case.tarp for case in judged]),
    )


def calibration_text(names: Sequence[str], cases: Sequence[CalibrationCase]) -> str:
    """All tables in Markdown."""
    kinds = {
        "latent": [case.latent for case in cases],
        "data-space": [case.exact for case in cases if case.exact is not None],
    }
    parts = [coverage_table(kinds)]
    widths = [case.widths for case in cases if case.widths is not None]
    if widths:
        parts.append(markdown_table(_WIDTH_HEAD, width_rows(names, widths)))
    parts.append(
        "Responses of the building that a latent likelihood took: "
        f"{np.median([case.responses for case in cases]):.0f} (median)."
    )
    return "\n\n".join(parts)


def coverage_table(kinds: Mapping[str, Sequence[Judged]]) -> str:
    """Coverage of both kinds of regions, for every kind of posterior that there is."""
    head = ("region", *(f"{region:.0%}" for region in REGIONS), "p, ranks (least)", "p, TARP")
    rows = []
    for name, judged in kinds.items():
        if judged:
            found = scores(judged)
            last = (f"{min(found.rank_p):.3f}", f"{found.tarp_p:.3f}")
            rows.append((f"{name}, highest density", *_cells(found.density), *last))
            rows.append((f"{name}, central intervals", *_cells(found.central), "", ""))
    return markdown_table(head, rows)


_WIDTH_HEAD = (
    "latent against data-space",
    "cases",
    "sd ratio, median",
    "5 to 95 %",
    "shift of the mean, exact sd",
)


def width_rows(names: Sequence[str], widths: Sequence[Widths]) -> list[tuple[str, ...]]:
    """A row a parameter: how wide the latent posterior is, and how far its mean is off."""
    ratio = np.array([one.ratio for one in widths])
    shift = np.abs([one.shift for one in widths])
    low, middle, high = np.quantile(ratio, [0.05, 0.5, 0.95], axis=0)
    return [
        (
            name,
            str(len(widths)),
            f"{middle[k]:.2f}",
            f"{low[k]:.2f} to {high[k]:.2f}",
            f"{np.median(shift[:, k]):.2f} (largest {shift[:, k].max():.2f})",
        )
        for k, name in enumerate(names)
    ]


def _cells(found: Coverage) -> list[str]:
    return [f"{share:.3f} ± {sd:.3f}" for share, sd in zip(found.found, found.error, strict=True)]
