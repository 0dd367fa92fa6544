"""The result of a benchmark: a JSON file, and tables as text."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from pathlib import Path
from typing import Any

from femupdate.progress import SILENT, Progress
from femupdate.study import write_text

from .machine import Machine, this_machine


@dataclass(frozen=True, kw_only=True)
class Report:
    """What a benchmark found."""

    machine: Machine  # it ran on
    text: str  # tables, which the command prints
    json: Path  # file written
    answer: Mapping[str, Any] = field(default_factory=dict)  # main figures, for --json

    def as_dict(self) -> dict[str, Any]:
        """What the command prints with --json."""
        return {"machine": self.machine.sentence(), **self.answer, "results": (self.json,)}

    def lines(self, details: bool = False) -> list[str]:
        """What the command prints without it; there are no further details."""
        return [self.text]

    def content(self) -> dict[str, Any]:
        """Read the JSON file."""
        found: dict[str, Any] = json.loads(self.json.read_text(encoding="utf-8"))
        return found


@dataclass(frozen=True)
class Job:
    """One run of a benchmark."""

    folder: Path  # of the results, made where missing
    seed: int = 0  # of everything random
    progress: Progress = SILENT  # told what is done

    def write(
        self,
        name: str,
        content: Mapping[str, Any],
        text: str,
        *,
        packages: Sequence[str] = (),
        answer: Mapping[str, Any] | None = None,
    ) -> Report:
        """Write NAME.json into the folder, whole or not at all."""
        machine = this_machine(*packages)
        report = Report(
            machine=machine,
            text=text,
            json=self.folder / f"{name}.json",
            answer=answer or {},
        )
        everything = {"benchmark": name, "machine": machine, "seed": self.seed, **content}
        everything["tables"] = text.splitlines()
        write_text(report.json, json.dumps(json_content(everything), indent=1) + "\n")
        return report


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose first column is text and whose others are aligned to the right."""
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *rows))


def json_content(value: Any) -> Any:
    """Return what JSON can hold: dataclasses as objects, what is not a number as null."""
    if is_dataclass(value) and not isinstance(value, type):
        return json_content(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): json_content(item) for key, item in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return json_content(value.tolist())
    if isinstance(value, list | tuple):
        return [json_content(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
