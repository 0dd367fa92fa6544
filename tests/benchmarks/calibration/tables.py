"""Tables of the calibration benchmark."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats

from ..result import markdown_table
from .cases import CalibrationCase, Widths

REGIONS = (0.5, 0.68, 0.9, 0.95)


@dataclass(frozen=True)
class Coverage:
    """How often highest-density regions of nominal probability held the truth."""

    nominal: Floats  # (k,) probabilities of the regions
    found: Floats  # (k,) shares of the cases
    error: Floats  # (k,) binomial standard deviation of a share that is as it should be
    cases: int  # how many


def coverage(level: ArrayLike) -> Coverage:
    """Share of cases whose credibility level (n,) is at most each nominal probability."""
    levels, regions = np.asarray(level, dtype=float), np.array(REGIONS)
    found = (levels[:, None] <= regions).mean(axis=0)
    error = np.sqrt(regions * (1.0 - regions) / len(levels))
    return Coverage(regions, found, error, len(levels))


def calibration_text(names: Sequence[str], cases: Sequence[CalibrationCase]) -> str:
    """All tables in Markdown."""
    kinds = {
        "latent": [case.latent for case in cases],
        "data-space": [case.exact for case in cases if case.exact is not None],
    }
    rows = []
    for name, levels in kinds.items():
        if levels:
            found = coverage(levels)
            pairs = zip(found.found, found.error, strict=True)
            rows.append((name, *(f"{share:.3f} ± {sd:.3f}" for share, sd in pairs)))
    parts = [markdown_table(("region", *(f"{region:.0%}" for region in REGIONS)), rows)]
    widths = [case.widths for case in cases if case.widths is not None]
    if widths:
        parts.append(markdown_table(_WIDTH_HEAD, width_rows(names, widths)))
    parts.append(
        "Responses of the building that a latent likelihood took: "
        f"{np.median([case.responses for case in cases]):.0f} (median)."
    )
    return "\n\n".join(parts)


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
