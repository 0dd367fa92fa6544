"""Cases of the calibration benchmark on disk, one line each: one that was cut off goes on."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.inference.predictive_check import PredictiveCheck
from femupdate.surrogate.storage import TrainedSurrogate

from ..result import plain
from .cases import CalibrationCase, Judged, Widths
from .coverage_power import SimulatedCase


def surrogate_mark(surrogate: TrainedSurrogate) -> str:
    """A hash of all weights and the power: cases of another likelihood are other cases."""
    digest = hashlib.sha256(repr(surrogate.info.likelihood_power).encode())
    for tensor in surrogate.mvae.state_dict().values():
        digest.update(tensor.detach().cpu().numpy().tobytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class CaseLog:
    """A file whose first line says what the cases are of, and every other line is one case.

    Attributes:
        path: of the file.
        header: what all cases share; a file with another one is begun anew.
    """

    path: Path
    header: str

    def read(self) -> dict[int, CalibrationCase]:
        """Cases by number; none where the file is about something else."""
        try:
            lines = self.path.read_text(encoding="utf-8").splitlines()
        except OSError:
            return {}
        if not lines or lines[0] != self.header:
            return {}
        return dict(found for line in lines[1:] if (found := _case(line)) is not None)

    def start(self, known: dict[int, CalibrationCase]) -> None:
        """Begin the file with what is known."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(self.header + "\n", encoding="utf-8")
        for number, case in known.items():
            self.add(number, case)

    def add(self, number: int, case: CalibrationCase) -> None:
        """Write one case at once."""
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps({"number": number, **plain(case)}) + "\n")


def _case(line: str) -> tuple[int, CalibrationCase] | None:
    """A case read back; None for half a line."""
    try:
        content: dict[str, Any] = json.loads(line)
    except json.JSONDecodeError:
        return None
    exact, widths, kept = content["exact"], content["widths"], content["likelihoods"]
    return content["number"], CalibrationCase(
        _judged(content["latent"]),
        None if exact is None else _judged(exact),
        SimulatedCase(
            np.array(kept["log_likelihood"]), _number(kept["log_likelihood_of_truth"], -np.inf)
        ),
        content["misfit"],
        content["responses"],
        _number(content["effective_share"], np.nan),
        None if widths is None else Widths(*(np.array(widths[k]) for k in ("ratio", "shift"))),
    )


def _judged(content: dict[str, Any]) -> Judged:
    kept = content.get("check")  # files of before have none
    check = None
    if kept is not None:
        floors = tuple(_number(value, np.nan) for value in kept["floors"])
        check = PredictiveCheck(kept["whole"], floors, tuple(kept["names"]))
    return Judged(content["density"], np.array(content["rank"]), content["tarp"], check)


def _number(value: float | None, otherwise: float) -> float:
    """JSON knows neither NaN nor infinity."""
    return otherwise if value is None else value
