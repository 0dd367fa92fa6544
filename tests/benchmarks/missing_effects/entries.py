"""What enters: this program, itself without effects, free modes, and an impulse-response filter."""

import csv
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import femupdate
from femupdate.arrays import Floats
from femupdate.building import load_building
from femupdate.dynamics.excitation import BASE_MOTION
from femupdate.errors import FemupdateError
from femupdate.measurement import Histories, read_observation_file

from ..measured.free_fit import fit_free
from ..measured.impulse_filter import fit_filter
from .score import FOLDER, read_csv

# Names of the catalogue, in the words of the tasks.
KINDS = {
    "added_mass": "mass",
    "story_damper": "damper",
    "channel_delay": "delay",
    "channel_gain": "gain",
    "tuned_appendage": "appendage",
    "swapped_channels": "exchanged",
    "reversed_channel": "reversed",
    "damping_law": "damping",
    "cracked_columns": "columns",
    "wall_stiffness": "walls",
    "non_structural_walls": "walls",
}
_DIRECTION = "x"
_SECONDS = "seconds"


def with_effects(number: str, task: Mapping[str, Any], folder: Path) -> None:
    """Repair, then predict by the repaired building."""
    study = folder / "studies" / number
    measured = FOLDER / "tasks" / number / "measured.csv"
    building = FOLDER / task["building"]
    started = time.process_time()
    femupdate.calibrate(study, measured, building=building, exact=True, anyway=True)
    report = femupdate.repair(study, measured)
    done = report.repair
    verdict = "effects" if done.rounds else done.last.verdict
    effects = [
        {
            "kind": KINDS.get(placed.effect.name, placed.effect.name),
            "places": places_of(placed.effect.name, placed.place, building),
            "size": added.finding.told[0],  # at the fitted factors
            "size_sd": added.finding.told[1],
        }
        for added in done.rounds
        for placed in [added.finding.placed]
    ]
    if verdict == "nonlinear":
        leading = done.last.leading
        places = [] if leading is None else places_of("", leading.placed.place, building)
        effects.append({"kind": "nonlinear", "places": places})
    _forecast(number, report.study or study, folder)
    _write(number, folder, started, {
        "verdict": verdict,
        "sentence": done.last.sentence,
        "effects": effects,
        "factors": report.theta_after.mean(axis=0).tolist(),
        "factors_sd": report.theta_after.std(axis=0).tolist(),
    })  # fmt: skip


def without_effects(number: str, task: Mapping[str, Any], folder: Path) -> None:
    """Calibrate alone, as if nothing could be missing."""
    study = folder / "studies" / number
    measured = FOLDER / "tasks" / number / "measured.csv"
    started = time.process_time()
    building = FOLDER / task["building"]
    found = femupdate.calibrate(study, measured, building=building, exact=True, anyway=True)
    factors = found.posterior.of("stiffness").samples
    _forecast(number, study, folder)
    _write(number, folder, started, {
        "factors": factors.mean(axis=0).tolist(),
        "factors_sd": factors.std(axis=0).tolist(),
    })  # fmt: skip


def free_modes(number: str, task: Mapping[str, Any], folder: Path) -> None:
    """As many modes as floors, which no building ties; they forecast, and name nothing."""

    def answer(seen: Histories, base: Floats) -> Floats:
        fitted = fit_free([seen], _DIRECTION, (0.5, 18.0), len(task["floors"]))
        return fitted.answer(base, seen.time_step)

    _rival(number, folder, answer)


def impulse_filter(number: str, task: Mapping[str, Any], folder: Path) -> None:
    """An impulse response from the base to each floor; it forecasts, and names nothing."""
    _rival(number, folder, lambda seen, base: fit_filter([seen], _DIRECTION).answer(base))


Entry = Callable[[str, Mapping[str, Any], Path], None]
ENTRIES: Mapping[str, Entry] = {
    "femupdate": with_effects,
    "femupdate without effects": without_effects,
    "free modes": free_modes,
    "impulse-response filter": impulse_filter,
}


def enter(name: str, number: str, folder: Path) -> None:
    """Answer a task; one that cannot be answered is left out, with the reason beside it."""
    task = json.loads((FOLDER / "tasks" / number / "task.json").read_text())
    folder.mkdir(parents=True, exist_ok=True)
    try:
        ENTRIES[name](number, task, folder)
    except FemupdateError as error:
        (folder / f"{number}.failed").write_text(f"{error}\n")


def places_of(effect: str, place: str, building: Path) -> list[str]:
    """A place as a list: floors of an exchange, all stories, no place of a law, or itself."""
    known = load_building(building)
    if effect == "damping_law":
        return []
    if effect == "story_damper":  # named by the floor above it
        return [known.story_names[known.floors.index(place.partition("/")[0])]]
    if place == "all":
        walls = {story for wall in getattr(known, "walls", ()) for story in wall.stories}
        only = walls if "wall" in effect and "*" not in walls else set(known.story_names)
        return [story for story in known.story_names if story in only]
    first, _, last = place.partition(" to ")
    for names in (known.floors, known.story_names):
        if last and first in names:
            return list(names[names.index(first) : names.index(last) + 1])
    return place.split(",")


def _rival(number: str, folder: Path, answer: Callable[[Histories, Floats], Floats]) -> None:
    """A forecast from what was measured, where it is a record of base motion."""
    seen = read_observation_file(FOLDER / "tasks" / number / "measured.csv")
    started = time.process_time()
    if isinstance(seen, Histories) and seen.excitation == BASE_MOTION:
        base = read_csv(FOLDER / "tasks" / number / "next_base.csv")["base"][None]
        _write_forecast(number, folder, seen.floors, answer(seen, base))
        _write(number, folder, started, {})


def _forecast(number: str, study: Any, folder: Path) -> None:
    """Floors under the next motion by a study's posterior."""
    record = FOLDER / "tasks" / number / "next_base.csv"
    predicted = femupdate.predict(study, record, unit="m/s2", channel="base")
    _write_forecast(number, folder, predicted.summary.floors, predicted.best)


def _write_forecast(number: str, folder: Path, floors: Sequence[str], values: Floats) -> None:
    time_s = read_csv(FOLDER / "tasks" / number / "next_base.csv")["time_s"]
    with (folder / f"{number}.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time_s", *floors])
        for second, row in zip(time_s, values.T, strict=True):
            writer.writerow([f"{second:.2f}", *(f"{value:.5f}" for value in row)])


def _write(number: str, folder: Path, started: float, content: Mapping[str, Any]) -> None:
    everything = {**content, _SECONDS: time.process_time() - started}
    (folder / f"{number}.json").write_text(json.dumps(everything, indent=1) + "\n")
