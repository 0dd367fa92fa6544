"""Keys of every command's JSON, files of a study, headings of tables: nothing recorded vanishes.

What is new is free. To record it all anew after a change that users are told of:
FEMUPDATE_RECORD=1 pytest tests/cli/test_contract.py
"""

import json
import os
from pathlib import Path

RECORDED = Path(__file__).with_name("contract.json")


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


def test_nothing_that_users_rely_on_has_vanished(walk):
    now = {command: sorted(set(key_paths(answer))) for command, answer in walk.answers.items()}
    now["study"] = list(layout(walk.study))
    if os.environ.get("FEMUPDATE_RECORD"):
        RECORDED.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    recorded = json.loads(RECORDED.read_text(encoding="utf-8"))
    missing = {
        name: gone
        for name, entries in recorded.items()
        if (gone := [entry for entry in entries if entry not in now[name]])
    }
    assert not missing
