"""Writing the result of a benchmark: JSON for programs, Markdown for people."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import Any

from femupdate.study import write_text

from .machine import Machine


@dataclass(frozen=True)
class ResultFiles:
    """Where a result was written."""

    json: Path
    markdown: Path


def write_result(
    folder: Path, name: str, machine: Machine, seed: int, content: Mapping[str, Any], text: str
) -> ResultFiles:
    """Write NAME.json and NAME.md into a folder, each whole or not at all.

    Args:
        folder: made where missing.
        name: of the benchmark.
        machine: what it ran on.
        seed: of everything random in it.
        content: of the JSON file beside machine and seed; dataclasses and arrays are taken apart.
        text: Markdown below the line with the machine.

    Raises:
        StudyError: a file cannot be written.
    """
    files = ResultFiles(folder / f"{name}.json", folder / f"{name}.md")
    everything = {"benchmark": name, "machine": machine, "seed": seed, **content}
    write_text(files.json, json.dumps(plain(everything), indent=1) + "\n")
    write_text(files.markdown, f"{machine.sentence()}, seed {seed}.\n\n{text.rstrip()}\n")
    return files


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose first column is text and whose others are aligned to the right."""
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *rows))


def plain(value: Any) -> Any:
    """Return what JSON can hold: dataclasses as objects, what is not a number as null."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
