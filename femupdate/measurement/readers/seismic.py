"""Records of seismic networks and instruments, by ObsPy: miniSEED, SAC, SEG-2 and others."""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.measurement.recording import RecordedChannel, Recording, azimuth_of
from femupdate.measurement.text import TextFile, reading_package

READS = "miniSEED, SAC, SEG-2 and Kinemetrics EVT, by ObsPy"

# Second letter of a channel's code in the SEED convention: what the instrument feels.
_QUANTITIES = {"N": "acceleration", "G": "acceleration", "H": "velocity", "L": "velocity"}
_SEED = re.compile(r"[A-Z][A-Z][A-Z0-9]")
_SUFFIXES = {".mseed": "MSEED", ".msd": "MSEED", ".ms": "MSEED", ".sac": "SAC", ".sg2": "SEG2"}
_HEADS = (
    (r"\d{6}[DRQMVAST][ *\0]", "MSEED"),
    (r"\x55\x3a|\x3a\x55", "SEG2"),
    (r"(?s)K[\x00-\x03].{14}KMI", "KINEMETRICS_EVT"),
    (r"TIMESERIES [^\n]*, SLIST,", "SLIST"),
    (r"TIMESERIES [^\n]*, TSPAIR,", "TSPAIR"),
)
# A SAC file says the version of its header, 6, in either order of bytes.
_SAC_VERSION, _SAC_AT, _SAC_HEADER = ("\x06\0\0\0", "\0\0\0\x06"), slice(304, 308), 632
_ALTUS = "KINEMETRICS_EVT"  # accelerographs, whose files say volts per count and per g


def _format(head: str, suffix: str) -> str | None:
    named = next((name for begins, name in _HEADS if re.match(begins, head)), None)
    if named is None and len(head) >= _SAC_HEADER and head[_SAC_AT] in _SAC_VERSION:
        return "SAC"
    binary = "\0" in head and not head.startswith("MS\x03")  # which is miniSEED 3
    return named or (_SUFFIXES.get(suffix) if binary else None)


def recognises(head: str, suffix: str) -> bool:
    return _format(head, suffix) is not None


def read(path: Path) -> Recording:
    """The traces, each with its start."""
    file = TextFile(path)
    obspy = reading_package(file, "obspy", "ObsPy", "records of seismic networks")
    with warnings.catch_warnings(), path.open("rb") as stream:
        warnings.simplefilter("ignore")
        kind = _format(stream.read(5000).decode("latin-1"), path.suffix.lower())
        stream.seek(0)
        # Kinemetrics say volts per count and per g: theirs come in m/s2.
        found = obspy.read(stream, format=kind or "MSEED", apply_calib=kind == _ALTUS)
        traces = list(found.merge(method=-1))
    traces = [trace for trace in traces if trace.data.dtype.kind in "fiu"]  # others are logs
    _require_whole(file, traces)
    return Recording(file, tuple(_channel(trace, kind == _ALTUS) for trace in traces))


def _require_whole(file: TextFile, traces: list[Any]) -> None:
    if not traces:
        raise file.error("there is no trace of numbers in the file; fetch it again from its source")
    seen: dict[str, Any] = {}
    for trace in sorted(traces, key=lambda item: item.stats.starttime):
        before = seen.get(trace.id)
        if before is not None:
            gap = trace.stats.starttime - before.stats.endtime - before.stats.delta
            what = f"a gap of {gap:.3g} s" if gap > 0.0 else f"an overlap of {-gap:.3g} s"
            raise file.error(
                f"{trace.id} has {what} after {before.stats.endtime}; cut the record before or"
                " after it, or fill it"
            )
        seen[trace.id] = trace
        if not np.isfinite(trace.data).all() or trace.stats.npts < 2:
            raise file.error(f"{trace.id} holds no history of finite numbers")


def _channel(trace: Any, known: bool) -> RecordedChannel:
    """A trace; in m/s2 where the file's own constants are known and applied."""
    code = trace.stats.channel
    seed = _SEED.fullmatch(code) is not None
    quantity = _QUANTITIES.get(code[1:2], "unknown") if seed else "unknown"
    last = code[-1:].upper()
    direction = "Up" if last == "Z" else last
    place = [trace.stats.network, trace.stats.station, trace.stats.location]
    return RecordedChannel(
        name=trace.id,
        values=np.asarray(trace.data, dtype=np.float64),
        time_step=float(trace.stats.delta),
        unit="m/s2" if known else None,
        quantity="acceleration" if known else quantity,
        location=".".join(word for word in place if word),
        direction=direction,
        azimuth_deg=azimuth_of(direction) if last in "NE" else None,
        start=float(trace.stats.starttime.timestamp),
    )
