"""All element tests together, and their table."""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import chain
from typing import Any

from femupdate.progress import SILENT, Progress

from ..result import markdown_table
from .dynamic_scores import vibration_scores
from .score import Score
from .static_scores import static_scores

_EXPECTED = 217  # lines of the table, for the progress bar


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
