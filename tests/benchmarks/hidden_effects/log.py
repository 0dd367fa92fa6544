"""Outcomes of trials on disk, one line each, so that trials that were cut off go on from there."""

import json
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from ..result import plain
from .cases import Outcome, Trial, TrialSettings


@dataclass(frozen=True)
class TrialLog:
    """A file whose first line says what is tried, and every other line what came out of one trial.

    Attributes:
        path: of the file.
        building: hash of the building.
        settings: of the measurement.
    """

    path: Path
    building: str
    settings: TrialSettings

    def read(self) -> dict[Trial, Outcome]:
        """What is known already; nothing where the file is about something else."""
        try:
            lines = self.path.read_text(encoding="utf-8").splitlines()
        except OSError:
            return {}
        if not lines or lines[0] != self._header():
            return {}
        found = (_outcome(line) for line in lines[1:])
        return {Trial(one.number, one.kind): one for one in found if one is not None}

    def start(self, known: dict[Trial, Outcome]) -> None:
        """Begin the file with what is known."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(self._header() + "\n", encoding="utf-8")
        for one in known.values():
            self.add(one)

    def add(self, outcome: Outcome) -> None:
        """Write one outcome at once."""
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps(plain(outcome)) + "\n")

    def _header(self) -> str:
        return json.dumps({"building": self.building, "settings": asdict(self.settings)})


def _outcome(line: str) -> Outcome | None:
    """An outcome read back; None for half a line."""
    try:
        content: dict[str, Any] = json.loads(line)
    except json.JSONDecodeError:
        return None
    values = {one.name: content[one.name] for one in fields(Outcome)}
    for name, value in values.items():
        if value is None:  # JSON knows neither NaN nor infinity
            values[name] = -math.inf if name == "log_evidence" else math.nan
        elif isinstance(value, list):
            values[name] = tuple(value)
    return Outcome(**values)
