"""All element tests together: the table, and how the errors fall with the mesh."""

import re
from collections.abc import Sequence
from dataclasses import asdict
from itertools import chain
from typing import Any

import numpy as np

from femupdate.progress import SILENT, Progress

from ..result import markdown_table
from .dynamic_scores import vibration_scores
from .peers import static_peers
from .plot_convergence import ConvergencePanel
from .score import Score
from .static_scores import static_scores

OURS = "femupdate"
_EXPECTED = 217  # lines of the table, for the progress bar
_SHOWN = ("ASDShellQ4", "ShellMITC4", "Pynite DKMQ")

# Panels of the figure: title, test, case, the key of the peers' figures with {n} for the mesh.
_PANELS = (
    ("Cook's membrane", "Cook's membrane", "middle of the loaded edge", "Cook N={n}"),
    (
        "Clamped square plate, force",
        "Rectangular plate b/a = 1",
        "clamped, force in the middle",
        "plate b/a=1 cl p N={n}",
    ),
    (
        "Clamped 1:5 plate, force",
        "Rectangular plate b/a = 5",
        "clamped, force in the middle",
        "plate b/a=5 cl p N={n}",
    ),
    ("Scordelis-Lo roof", "Scordelis-Lo roof", "middle of the free edge", "Scordelis-Lo N={n}"),
    ("Hemisphere", "Hemisphere with a hole", "under the load", "hemisphere N={n}"),
    ("Pinched cylinder", "Pinched cylinder", "under the load", "pinched cylinder N={n}"),
    ("FV13 thin plate, mode 4", "FV13 simply supported thin plate", "mode 4", ""),
    ("FV15 thin rhombus, mode 2", "FV15 clamped thin rhombic plate", "mode 2", ""),
)


def element_scores(progress: Progress = SILENT) -> tuple[Score, ...]:
    """Run all element tests, in about ten seconds."""
    progress.start("Element tests", _EXPECTED)
    found = []
    for score in chain(static_scores(), vibration_scores()):
        found.append(score)
        progress.advance(note=score.test)
    return tuple(found)


def score_record(score: Score) -> dict[str, Any]:
    """A score with all that follows from it, for the JSON file."""
    more = {"ratio": score.ratio, "reached": score.reached, "verdict": score.verdict}
    return {**asdict(score), **more}


def score_rows(scores: Sequence[Score]) -> list[tuple[str, ...]]:
    """Test and case, mesh, target, ours, ratio, best peer, verdict."""
    return [
        (
            f"{score.test}: {score.case}",
            score.mesh,
            f"{score.target:.5g} {score.unit}".replace(" -", ""),
            f"{score.value:.5g}" if score.target else f"{score.value:.1e}",
            f"{score.ratio:.3f}" if score.target else "",
            f"{score.peer.ratio:.3f} {score.peer.name}" if score.peer else "",
            "behind" if not score.reached else score.verdict,
        )
        for score in scores
    ]


SCORE_HEAD = ("test", "mesh", "target", "ours", "ratio", "best other", "verdict")


def score_markdown(scores: Sequence[Score]) -> str:
    """The table, a count, the reasons of the rows that are behind, and the sources."""
    behind = [score for score in scores if not score.reached]
    parts = [
        "## Elements",
        f"{len(scores) - len(behind)} of {len(scores)} rows reach the best other four-node element "
        "on the same mesh, or the target where none is known, within 2 %.",
        markdown_table(SCORE_HEAD, score_rows(scores)),
    ]
    if behind:
        rows = [(s.reason or "not known", f"{s.test}, {s.case} ({s.mesh})") for s in behind]
        reasons = [f"* {'; '.join(rows)}: {reason}." for reason, rows in _gathered(rows).items()]
        parts += ["Why the others do not:", "\n".join(reasons)]
    tests = _gathered([(score.source, score.test) for score in scores])
    named = "; ".join(f"{source} ({', '.join(found)})" for source, found in tests.items())
    return "\n\n".join([*parts, f"Sources of the targets: {named}."])


def _gathered(pairs: Sequence[tuple[str, str]]) -> dict[str, list[str]]:
    """Different second texts by the first, in the order in which they come."""
    found: dict[str, list[str]] = {}
    for key, value in dict.fromkeys(pairs):
        found.setdefault(key, []).append(value)
    return found


def convergence_panels(scores: Sequence[Score]) -> tuple[ConvergencePanel, ...]:
    """What the figure shows."""
    return tuple(
        _panel(title, [s for s in scores if (s.test, s.case) == (test, case)], key)
        for title, test, case, key in _PANELS
    )


def _panel(title: str, scores: Sequence[Score], key: str) -> ConvergencePanel:
    scores = [score for score in scores if score.target == scores[0].target]
    divisions = [int(re.findall(r"\d+", score.mesh)[0]) for score in scores]
    errors = {OURS: np.array([score.error for score in scores])}
    if key:
        peers = [static_peers(key.format(n=count)) for count in divisions]
        for name in _SHOWN:
            values = [abs(found.get(name, np.nan) - 1.0) for found in peers]
            errors[name] = np.array(values)
    return ConvergencePanel(title, np.array(divisions, dtype=float), errors)
