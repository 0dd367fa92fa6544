"""TDMS files of LabVIEW, by npTDMS."""

from pathlib import Path
from typing import Any

import numpy as np

from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.columns import TIME_NAME
from femupdate.measurement.quantity import FORCES, is_acceleration
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.sampling import uniform_step
from femupdate.measurement.text import TextFile, reading_package
from femupdate.measurement.thresholds import TIMES

_STEP = "wf_increment"
_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")
_NO_UNIT = ("", "-", "None")


def _recognises(head: str, suffix: str) -> bool:
    return head.startswith("TDSm")


def _read(path: Path) -> Recording:
    """Channels whose time step the waveform's properties or a channel of times gives.

    Raises:
        MeasurementError: npTDMS is not installed, the file is damaged, or no channel of numbers
            has a time step.
    """
    file = TextFile(path)
    nptdms = reading_package(file, "nptdms", "npTDMS", "TDMS files")
    try:
        groups = nptdms.TdmsFile.read(path).groups()
        found = [(group.name, one) for group in groups for one in group.channels()]
        numbers = [
            (name, one) for name, one in found if len(one) > 1 and one[:].dtype.kind in "fiu"
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
    left_out = [one.name for _, one in found if all(one is not other for _, other, _ in timed)]
    notes = (f"Channels without numbers or a time step: {', '.join(left_out)}.",)
    return Recording(
        file,
        tuple(
            _channel(f"{name}/{one.name}" if several else one.name, one, step)
            for name, one, step in timed
        ),
        notes=notes if left_out else (),
    )


def _timed(file: TextFile, numbers: list[tuple[str, Any]]) -> list[tuple[str, Any, float]]:
    """Group, channel and time step: of the waveform, else of the times in the channel's group."""
    steps = {
        name: uniform_step(file, np.asarray(one[:], float), np.arange(len(one)) + 1, one.name)
        for name, one in numbers
        if TIME_NAME.match(one.name) and len(one) >= TIMES.fewest
    }
    found = []
    for name, one in numbers:
        step = float(one.properties.get(_STEP, 0.0))
        if step <= 0.0 and not TIME_NAME.match(one.name):
            step = steps.get(name, 0.0)
        if step > 0.0:
            found.append((name, one, step))
    return found


def _channel(name: str, one: Any, step: float) -> RecordedChannel:
    unit = next((str(one.properties[key]) for key in _UNITS if key in one.properties), "")
    known = unit.strip() not in _NO_UNIT
    quantity = "acceleration" if is_acceleration(unit) else "unknown"
    return RecordedChannel(
        name=name,
        values=np.asarray(one[:], dtype=np.float64),
        time_step=step,
        unit=unit if known else None,
        quantity="force" if unit in FORCES else quantity,
        location=str(one.properties.get("description", "")),
    )


READER = Reader("tdms", "TDMS files of LabVIEW", _recognises, _read)
