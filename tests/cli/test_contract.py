"""Keys of every command's JSON, files of a study, headings of tables: nothing recorded vanishes.

What is new is free. To record it all anew after a change that users are told of:
FEMUPDATE_RECORD=1 pytest tests/cli/test_contract.py
"""

import json
import os
from pathlib import Path

import pytest

RECORDED = Path(__file__).with_name("contract.json")
SIMULATE = ("--theta", "0.8,1.3", "--zeta", 0.05, "--duration", 60, "--sampling", 50)
EXACT = ("--exact", "--particles", 200)


def key_paths(content, path=""):
    """Every key of a JSON object with the keys above it; elements of a list are taken together."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield f"{path}.{key}".lstrip(".")
            yield from key_paths(value, f"{path}.{key}")
    elif isinstance(content, list):
        for value in content:
            yield from key_paths(value, f"{path}[]")


def layout(study):
    """Files of a study, with the headings of its tables."""
    for path in sorted(study.rglob("*")):
        if path.is_file() and not path.name.startswith("."):
            yield str(path.relative_to(study))
            if path.suffix == ".csv" and path.parent.name == "tables":
                yield f"{path.name}: {path.read_text(encoding='utf-8-sig').splitlines()[0]}"


@pytest.fixture(scope="module")
def now(femupdate, tmp_path_factory, tower_file, tower_observation, record):
    """What the commands answer and leave behind, from a building file to its repair."""
    folder = tmp_path_factory.mktemp("contract")
    study, other, heavy = folder / "study", folder / "other", folder / "heavy.csv"
    building, plain = ("--building", tower_file), tower_observation.path
    measured = ("--record", record, "--measured", plain)
    kept = folder / "kept.csv"
    heavier = (*building, *SIMULATE, "--band", "0.3,20", "--effect", "story_damper@RF=0.06")
    commands = {
        "simulate": ("-o", heavy, *heavier, "--seed", 1),
        "simulate --seed=2": ("-o", kept, *heavier),
        "build-model": (tower_file, "--study", study),
        "train": ("--samples", 400, "--epochs", 2, "--batch", 64, "--study", study),
        "calibrate": (plain, "--study", study),
        "calibrate --exact": (heavy, *building, *EXACT, "--study", other),
        "compare": (study, other),
        "predict": (*measured, "--samples", 20, "--study", study, "--floor-spectra"),
        "render": ("--samples", 20, "--study", study),
        "diagnose": (heavy, "--study", study),
        "repair": (heavy, "--holdout", kept, "--study", study),
        "report": ("--study", study),
        "status": ("--study", study),
        "inspect": (heavy,),
        "list": (),
        "examples": (folder / "examples",),
    }
    answers = {}
    for command, words in commands.items():
        name, *options = command.split()
        answers[command] = femupdate(name, *options, *words, "--json").answer
    keys = {command: sorted(set(key_paths(answer))) for command, answer in answers.items()}
    return {**keys, "study": list(layout(study))}


@pytest.fixture(scope="module")
def recorded(now):
    if os.environ.get("FEMUPDATE_RECORD"):
        RECORDED.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    return json.loads(RECORDED.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_nothing_that_users_rely_on_has_vanished(now, recorded):
    missing = {
        name: gone
        for name, entries in recorded.items()
        if (gone := [entry for entry in entries if entry not in now[name]])
    }
    assert not missing
