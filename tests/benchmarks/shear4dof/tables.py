"""Tables of the four-story benchmark."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..result import markdown_table
from .case import PUBLISHED_SOLUTIONS, Case, ExactPosterior
from .comparison import Comparison
from .observations import ObservationResult


def solutions_table(case: Case) -> str:
    """Table 1: ours and the published one."""
    head = ("", *(f"theta_{k + 1}" for k in range(4)), "published")
    rows = []
    for k, row in enumerate(case.solutions):
        known = k < len(PUBLISHED_SOLUTIONS)
        published = ", ".join(f"{v:.5f}" for v in PUBLISHED_SOLUTIONS[k]) if known else "-"
        rows.append((f"solution {k + 1}", *(f"{value:.5f}" for value in row), published))
    return markdown_table(head, rows)


def exact_table(exact: ExactPosterior) -> str:
    """Weight and standard deviations of every mode."""
    modes = exact.modes
    rows = [
        (f"mode {k + 1}", f"{modes.weight[k]:.4f}", *(f"{value:.4f}" for value in modes.sd[k]))
        for k in range(len(modes.weight))
    ]
    return markdown_table(("", "weight", *(f"sd theta_{k + 1}" for k in range(4))), rows)


def observation_table(results: Sequence[ObservationResult]) -> str:
    """Median (worst) of every figure."""
    errors = np.abs([result.evidence_error for result in results])
    evidence = f"{np.median(errors):.3f} ({errors.max():.3f})"

    def mean(name: str) -> str:
        return f"{np.mean([getattr(result, name) for result in results]):.0f}"

    def seconds(name: str) -> str:
        return f"{np.median([getattr(result, name) for result in results]):.2f}"

    rows = [
        *_comparison_rows(results),
        ("log evidence, difference from the exact one", "-", evidence),
        ("responses of the building", mean("latent_responses"), mean("responses")),
        ("latent likelihoods", mean("latent_evaluations"), "-"),
        ("seconds", seconds("latent_seconds"), seconds("bridge_seconds")),
    ]
    return markdown_table(("median (worst)", "latent", "bridge"), rows)


def _comparison_rows(results: Sequence[ObservationResult]) -> list[tuple[str, ...]]:
    names = (
        "sd inside each mode / exact, 5 to 95 %",
        "shift of a mode's mean in exact sd",
        "mode weights, total variation (cases with several modes)",
        "C2ST",
    )
    several = [result.solutions > 1 for result in results]
    latent = _comparison_cells([result.latent for result in results], several)
    bridged = _comparison_cells([result.bridged for result in results], several)
    return list(zip(names, latent, bridged, strict=True))


def _comparison_cells(parts: Sequence[Comparison], several: Sequence[bool]) -> tuple[str, ...]:
    """Every figure of one kind of posterior; `several` says which cases have several modes."""

    def pair(values: ArrayLike, style: str) -> str:
        numbers = np.asarray(values, dtype=float)
        return f"{np.nanmedian(numbers):{style}} ({np.nanmax(numbers):{style}})"

    ratios = np.concatenate([part.sd_ratio.ravel() for part in parts])
    shifts = np.concatenate([np.abs(part.mean_shift).ravel() for part in parts])
    distances = [p.weight_distance for p, many in zip(parts, several, strict=True) if many]
    return (
        f"{np.nanquantile(ratios, 0.05):.2f} to {np.nanquantile(ratios, 0.95):.2f}",
        pair(shifts, ".2f"),
        pair(distances or [np.nan], ".3f"),
        pair([part.c2st for part in parts], ".3f"),
    )
