"""What tests of several rooms take at hand."""

import hashlib
import multiprocessing
import os
import signal

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


class Killer(Recorded):
    """Kills a worker process of Dask when the first piece is done."""

    def __init__(self):
        super().__init__()
        self.killed = []

    def advance(self, count=1, note=""):
        super().advance(count, note)
        if not self.killed:
            self.killed.append(multiprocessing.active_children()[0].pid)
            os.kill(self.killed[0], signal.SIGKILL)


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
