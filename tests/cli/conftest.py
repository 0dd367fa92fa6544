"""The whole work on the tower, done once."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.cli.commands import femupdate
from tests.helpers import write_record


@pytest.fixture(scope="session")
def record(tmp_path_factory, tower_observation):
    """The base motion of the observation, as a record of its own."""
    from femupdate.measurement import GroundMotion

    histories = tower_observation.histories
    motion = GroundMotion(histories.acceleration[0], histories.time_step)
    return write_record(tmp_path_factory.mktemp("record") / "record.csv", motion)


@dataclass(frozen=True)
class Walk:
    """The whole work on the tower, from its file to its repair."""

    # Of every command with --json; "calibrate --name=latent" has options of its own
    answers: dict[str, dict[str, Any]]
    folder: Path  # that all lies in

    @property
    def study(self) -> Path:
        """With exact and latent posterior, prediction, diagnosis and repair."""
        return self.folder / "study"

    @property
    def heavy(self) -> Path:
        """A run of the tower with a damper in its upper story; `kept` is another."""
        return self.folder / "heavy.csv"

    @property
    def kept(self) -> Path:
        return self.folder / "kept.csv"


@pytest.fixture(scope="session")
def walk(
    built_once: Callable[..., Path],
    tower_file: Path,
    tower_observation: Any,
    record: Path,
) -> Walk:
    """Run every command once; tests that write do so in a copy of the study."""
    path = tower_observation.path
    folder = built_once("walk", lambda folder: _walk(folder, tower_file, path, record))
    return Walk(json.loads((folder / "answers.json").read_text()), folder)


def _walk(folder: Path, tower: Path, plain: Path, record: Path) -> None:
    study, other, heavy, kept = (folder / n for n in ("study", "other", "heavy.csv", "kept.csv"))
    building, where = ("--building", tower), ("--study", study)
    truth = ("--theta", "0.8,1.3", "--zeta", 0.05, "--duration", 60, "--sampling", 50)
    shaken = (*building, *truth, "--band", "0.3,20", "--effect", "story_damper@RF=0.06")
    exact = ("--exact", "--particles", 200)
    measured = ("--record", record, "--measured", plain)
    commands: dict[str, tuple[object, ...]] = {
        "simulate": ("-o", heavy, *shaken, "--seed", 1),
        "simulate --seed=2": ("-o", kept, *shaken),
        "build-model": (tower, *where),
        "train": ("--samples", 400, "--epochs", 2, "--batch", 64, *where),
        "calibrate --name=latent": (plain, *where, "--particles", 200, "--no-pictures"),
        "calibrate": (plain, *exact, *where),
        "calibrate --chains=1": (heavy, *building, *exact, "--study", other),
        "compare": (study, other),
        "predict": (*measured, "--samples", 50, *where, "--floor-spectra"),
        "render": ("--samples", 20, *where),
        "diagnose": (heavy, *where),
        "repair": (heavy, "--holdout", kept, *where),
        "report": where,
        "status": where,
        "inspect": (heavy,),
        "list": (),
        "examples": (folder / "examples",),
    }
    answers = {}
    for command, words in commands.items():
        done = femupdate(*command.split(), *words, "--json")
        told = [line for line in done.err.splitlines() if not line.startswith("  ")]
        assert told == [line for line in done.progress if not line.startswith("  ")], command
        answers[command] = done.answer
    (folder / "answers.json").write_text(json.dumps(answers))


@pytest.fixture
def walked(walk: Walk, tmp_path: Path) -> Path:
    """The study of the walk, for one test alone."""
    return Path(shutil.copytree(walk.study, tmp_path / "walked"))
