"""TDMS files of LabVIEW, by npTDMS."""

from pathlib import Path
from typing import Any

import numpy as np

from femupdate.measurement.names import TIME_NAME
from femupdate.measurement.quantity import FORCES, is_acceleration
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import RecordedChannel, Recording
from femupdate.measurement.table import uniform_step
from femupdate.measurement.text import TextFile, reading_package

_STEP = "wf_increment"
_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")
_NO_UNIT = ("", "-", "None")


def _recognises(head: str, suffix: str) -> bool:
    return head.startswith("TDSm")


def _read(path: Path) -> Recording:
    """Channels whose time step the waveform's properties or a channel of times gives."""
    file = TextFile(path)
    nptdms = reading_package(file, "nptdms", "npTDMS", "TDMS files")
    try:
        groups = nptdms.TdmsFile.read(path).groups()
        channels = [(group.name, channel) for group in groups for channel in group.channels()]
        numbers = [
            (name, channel)
            for name, channel in channels
            if len(channel) > 1 and channel[:].dtype.kind in "fiu"
        ]
    except Exception as error:  # a damaged file makes npTDMS raise nearly anything
        raise file.error(
            f"this TDMS file cannot be read ({error}); save it again from its program"
        ) from None
    timed = _timed(file, numbers)
    if not timed:
        raise file.error(
            "no channel of the file has a time step (wf_increment), and none is called time; export"
            " the channels as CSV with a column of times"
        )
    several = len({name for name, *_ in timed}) > 1
    left_out = [
        channel.name
        for _, channel in channels
        if all(channel is not measured for _, measured, _ in timed)
    ]
    notes = (f"Channels without numbers or a time step: {', '.join(left_out)}.",)
    return Recording(
        file,
        tuple(
            _channel(f"{name}/{channel.name}" if several else channel.name, channel, step)
            for name, channel, step in timed
        ),
        notes=notes if left_out else (),
    )


def _timed(file: TextFile, numbers: list[tuple[str, Any]]) -> list[tuple[str, Any, float]]:
    """Group, channel and time step: of the waveform, else of the times in the channel's group."""
    # Three times tell a step.
    steps = {
        name: uniform_step(
            file, np.asarray(channel[:], float), np.arange(len(channel)) + 1, channel.name
        )
        for name, channel in numbers
        if TIME_NAME.match(channel.name) and len(channel) >= 3
    }
    timed = []
    for name, channel in numbers:
        step = float(channel.properties.get(_STEP, 0.0))
        if step <= 0.0 and not TIME_NAME.match(channel.name):
            step = steps.get(name, 0.0)
        if step > 0.0:
            timed.append((name, channel, step))
    return timed


def _channel(name: str, channel: Any, step: float) -> RecordedChannel:
    unit = next((str(channel.properties[key]) for key in _UNITS if key in channel.properties), "")
    known = unit.strip() not in _NO_UNIT
    quantity = "acceleration" if is_acceleration(unit) else "unknown"
    return RecordedChannel(
        name=name,
        values=np.asarray(channel[:], dtype=np.float64),
        time_step=step,
        unit=unit if known else None,
        quantity="force" if unit in FORCES else quantity,
        location=str(channel.properties.get("description", "")),
    )


READER = Reader("tdms", "TDMS files of LabVIEW", _recognises, _read)
