"""What tests of several rooms take at hand."""

import hashlib
import re
from pathlib import Path

import numpy as np
import torch


class Recorded:
    """Progress that remembers what it was told."""

    def __init__(self):
        self.started, self.counts, self.notes, self.said = [], [], [], []

    def start(self, label, total):
        self.started.append((label, total))

    def advance(self, count=1, note=""):
        self.counts.append(count)
        self.notes.append(note)

    def say(self, text):
        self.said.append(text)


def write_record(path, motion):
    """Write a ground motion as a table of time and acceleration, and return its path."""
    head = f"time_s,{motion.channel or 'acceleration'}\ns,m/s2"
    columns = np.column_stack([motion.time, motion.acceleration])
    np.savetxt(path, columns, fmt=["%.10g", "%.9g"], delimiter=",", header=head, comments="")
    return path


def snapshot(folder):
    """The content of all files of a folder, none where it is absent."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def tensor(values):
    return torch.as_tensor(np.asarray(values), dtype=torch.float64)


def of_contributing(section):
    """The pieces of code of a section of CONTRIBUTING.md."""
    page = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text()
    text = page.split(f"\n## {section}\n")[1].split("\n## ")[0]
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def contribute(section, package, name, tmp_path, monkeypatch):
    """Put the first piece of code of a section beside the modules of a package."""
    more = tmp_path / "more"
    more.mkdir()
    (more / f"{name}.py").write_text(of_contributing(section)[0])
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(more)])
