"""Scores an entry: python score.py ENTRY. It needs numpy, and nothing of femupdate.

README.md says what an entry holds.
"""

import csv
import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FOLDER = Path(__file__).parent
FIGURES = {
    "named": "tasks told right, of those tried",
    "false": "names of what is not there, of all names",
    "sizes": "sizes of right names within two standard deviations",
    "factors": "stiffness factors: rms of relative errors, %",
    "held": "stiffness factors within 90 % intervals",
    "forecast": "median error of the next event at measured floors, rms over rms",
}


def task_numbers() -> tuple[str, ...]:
    """Of all tasks, such as "07"."""
    return tuple(sorted(path.name for path in (FOLDER / "tasks").iterdir()))


def score(entry: Path) -> dict[str, dict[str, Any]]:
    """What an entry is right in, by task; tasks that it leaves out are left out."""
    return {
        number: _task_score(number, entry)
        for number in task_numbers()
        if (entry / f"{number}.json").exists() or (entry / f"{number}.csv").exists()
    }


def _task_score(number: str, entry: Path) -> dict[str, Any]:
    truth = json.loads((FOLDER / "answers" / number / "answer.json").read_text())
    path = entry / f"{number}.json"
    said = json.loads(path.read_text()) if path.exists() else {}
    scores: dict[str, Any] = {"words": truth["words"]}
    if "verdict" in said:
        names = {_name(effect): effect for effect in said.get("effects", ())}
        right = {_name(effect): effect for effect in truth["missing"]}
        # What an unknown verdict lists are candidates, no names.
        candidates = said["verdict"] == "unknown"
        false = [] if candidates else [*(names.keys() - right.keys())]
        told = said["verdict"] in truth["verdicts"]
        scores |= {
            "verdict": said["verdict"],
            "names": 0 if candidates else len(names),
            "false": [f"{kind} {' '.join(places)}" for kind, places in sorted(false)],
            "right": told and (names.keys() == right.keys() or "unknown" in truth["verdicts"]),
        }
        both = [(names[key], right[key]["size"]) for key in names.keys() & right.keys()]
        scores["sizes"] = [
            abs(effect["size"] - size) <= 2.0 * effect["size_sd"]
            for effect, size in both
            if size is not None and effect.get("size_sd")
        ]
    if said.get("factors") and truth["factors"]:
        mean, sd, true = map(np.array, (said["factors"], said["factors_sd"], truth["factors"]))
        if not len(mean) == len(sd) == len(true):
            raise ValueError(
                f"{path}: give {len(true)} factors and as many factors_sd, a story each"
            )
        scores["factors"] = (mean / true - 1.0).tolist()
        scores["held"] = (abs(mean - true) <= 1.645 * sd).tolist()
    if (entry / f"{number}.csv").exists():
        scores["forecast"] = _forecast_error(number, entry)
    return scores


def _name(effect: Mapping[str, Any]) -> tuple[str, tuple[str, ...]]:
    return effect["kind"], tuple(sorted(effect["places"]))


def _forecast_error(number: str, entry: Path) -> float:
    """Error of the floors that were measured, rms over rms, their mean."""
    truth = read_csv(FOLDER / "answers" / number / "next.csv")
    forecast = read_csv(entry / f"{number}.csv")
    measured = read_csv(FOLDER / "tasks" / number / "measured.csv")
    floors = [name for name in truth if name in measured and name not in ("time_s", "base")]
    floors = floors or [name for name in forecast if name in truth and name != "time_s"]
    errors = [
        np.sqrt(np.mean((forecast[name] - truth[name]) ** 2) / np.mean(truth[name] ** 2))
        for name in floors
    ]
    return float(np.mean(errors))


def read_csv(path: Path) -> dict[str, NDArray[np.float64]]:
    """Columns of a file by their names, without their units."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip((name.split()[0] for name in head), np.array(rows, dtype=float).T, strict=True))


def figures(scores: Mapping[str, Mapping[str, Any]]) -> dict[str, tuple[float, float]]:
    """What a table of entries shows: value and number of cases, by the keys of `FIGURES`."""
    told = [task for task in scores.values() if "verdict" in task]
    named = sum(task["names"] for task in told)
    sizes = [size for task in told for size in task["sizes"]]
    errors = [error for task in scores.values() for error in task.get("factors", ())]
    held = [inside for task in scores.values() for inside in task.get("held", ())]
    forecasts = [task["forecast"] for task in scores.values() if "forecast" in task]
    return {
        "named": (sum(task["right"] for task in told), len(told)),
        "false": (sum(len(task["false"]) for task in told), named),
        "sizes": (sum(sizes), len(sizes)),
        "factors": (100.0 * math.sqrt(np.mean(np.square(errors))) if errors else 0.0, len(errors)),
        "held": (sum(held), len(held)),
        "forecast": (float(np.median(forecasts)) if forecasts else 0.0, len(forecasts)),
    }


if __name__ == "__main__":
    if sys.argv[1:] in ([], ["--help"]):
        print(__doc__)
    else:
        scored = score(Path(sys.argv[1]))
        print(json.dumps({"figures": figures(scored), "tasks": scored}, indent=1))
