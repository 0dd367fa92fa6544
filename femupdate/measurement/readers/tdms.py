"""TDMS files of LabVIEW, by npTDMS."""

import logging
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.clock import even_step, interpolated
from femupdate.measurement.names import FORCES, TIME_NAME, is_acceleration
from femupdate.measurement.recording import RecordedChannel, Recording
from femupdate.measurement.text import TextFile, reading_package

READS = "TDMS files of LabVIEW"

_STEP = "wf_increment"
_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")
_NO_UNIT = ("", "-", "None")


def recognises(head: str, suffix: str) -> bool:
    return head.startswith("TDSm")


def read(path: Path) -> Recording:
    """Channels whose time step the waveform's properties or a channel of times gives."""
    file = TextFile(path)
    nptdms = reading_package(file, "nptdms", "npTDMS", "TDMS files")
    import_module("nptdms.log").log_manager.set_level(logging.ERROR)  # what is cut is told below
    groups = nptdms.TdmsFile.read(path).groups()
    channels = [(group.name, channel) for group in groups for channel in group.channels()]
    numbers = [
        (name, channel)
        for name, channel in channels
        if len(channel) > 1 and channel[:].dtype.kind in "fiu"
    ]
    # Three times tell a step.
    clocks = {
        name: np.asarray(channel[:], float)
        for name, channel in numbers
        if TIME_NAME.match(channel.name) and len(channel) >= 3
    }
    timed = [
        (name, channel)
        for name, channel in numbers
        if float(channel.properties.get(_STEP, 0.0)) > 0.0
        or (name in clocks and not TIME_NAME.match(channel.name))
    ]
    if not timed:
        raise file.error(
            "no channel of the file has a time step (wf_increment), and none is called time; export"
            " the channels as CSV with a column of times"
        )
    several = len({name for name, _ in timed}) > 1
    measured = {id(channel) for _, channel in timed}
    left_out = [channel.name for _, channel in channels if id(channel) not in measured]
    notes = (f"Channels without numbers or a time step: {', '.join(left_out)}.",)
    found = (_channel(file, group, several, channel, clocks) for group, channel in timed)
    return Recording(file, tuple(found), notes=notes if left_out else ())


def _channel(
    file: TextFile, group: str, several: bool, channel: Any, clocks: Mapping[str, Floats]
) -> RecordedChannel:
    """A channel at the step and the start of its waveform, else at its group's times."""
    given = channel.properties
    step, begin = float(given.get(_STEP, 0.0)), given.get("wf_start_time")
    values = np.asarray(channel[:], dtype=np.float64)
    start: float | None = float(given.get("wf_start_offset", 0.0)) or None
    if begin is not None:
        start = int(np.datetime64(begin, "ns").astype(np.int64)) / 1e9 + (start or 0.0)
    done: tuple[str, ...] = ()
    if step <= 0.0:
        time = clocks[group]
        step, even, done = even_step(file, time, np.arange(time.size) + 1, channel.name)
        start = float(time[0])
        if even is not None and values.size == time.size:
            values = interpolated(values, time, even)
    unit = next((str(given[key]) for key in _UNITS if key in given), "")
    quantity = "acceleration" if is_acceleration(unit) else "unknown"
    return RecordedChannel(
        name=f"{group}/{channel.name}" if several else channel.name,
        values=values,
        time_step=step,
        unit=unit if unit.strip() not in _NO_UNIT else None,
        quantity="force" if unit in FORCES else quantity,
        location=str(given.get("description", "")),
        start=start,
        done=done,
    )
