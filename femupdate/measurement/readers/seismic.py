"""Records of seismic networks and instruments, by ObsPy: miniSEED, SAC, GSE, SEG-2 and others."""

import math
import re
import warnings
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.measurement.channel import RecordedChannel, azimuth_of
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import TextFile, reading_package
from femupdate.measurement.thresholds import TIMES

# Second letter of a channel's code in the SEED convention: what the instrument feels.
_QUANTITIES = {"N": "acceleration", "G": "acceleration", "H": "velocity", "L": "velocity"}
_SEED = re.compile(r"[A-Z][A-Z][A-Z0-9]")
_SUFFIXES = {".mseed": "MSEED", ".msd": "MSEED", ".ms": "MSEED", ".sac": "SAC", ".sg2": "SEG2"}
_HEADS = (
    (r"\d{6}[DRQMVAST][ *\0]", "MSEED"),
    (r"(?s)(.{0,4000}\n)?WID2 ", "GSE2"),
    (r"(?s)(.{0,4000}\n)?WID1 ", "GSE1"),
    (r"\x55\x3a|\x3a\x55", "SEG2"),
    (r"(?s)K[\x00-\x03].{14}KMI", "KINEMETRICS_EVT"),
    (r"TIMESERIES [^\n]*, SLIST,", "SLIST"),
    (r"TIMESERIES [^\n]*, TSPAIR,", "TSPAIR"),
)
# A SAC file says the version of its header, 6, in either order of bytes.
_SAC_VERSION, _SAC_AT, _SAC_HEADER = ("\x06\0\0\0", "\0\0\0\x06"), slice(304, 308), 632
_HEAD = 5000  # bytes
_ALTUS = "KINEMETRICS_EVT"  # accelerographs, whose files say volts per count and per g


def _format(head: str, suffix: str) -> str | None:
    told = next((name for begins, name in _HEADS if re.match(begins, head)), None)
    if told is None and len(head) >= _SAC_HEADER and head[_SAC_AT] in _SAC_VERSION:
        return "SAC"
    binary = "\0" in head and not head.startswith("MS\x03")  # which is miniSEED 3
    return told or (_SUFFIXES.get(suffix) if binary else None)


def _recognises(head: str, suffix: str) -> bool:
    return _format(head, suffix) is not None


def _read(path: Path) -> Recording:
    """The traces over the time that all of them have.

    Raises:
        MeasurementError: ObsPy is not installed, the file is damaged, a trace has a gap, or the
            traces have no time in common.
    """
    file = TextFile(path)
    obspy = reading_package(file, "obspy", "ObsPy", "records of seismic networks")
    with warnings.catch_warnings(), path.open("rb") as stream:
        warnings.simplefilter("ignore")
        kind = _format(stream.read(_HEAD).decode("latin-1"), path.suffix.lower())
        stream.seek(0)
        try:
            traces = list(_traces(obspy, stream, kind or "MSEED").merge(method=-1))
        except Exception as error:  # a damaged file makes ObsPy raise nearly anything
            raise file.error(
                f"this {kind} file cannot be read ({error}); fetch it again from its source"
            ) from None
    traces = [trace for trace in traces if trace.data.dtype.kind in "fiu"]  # others are logs
    _require_whole(file, traces)
    common, notes = _together(file, traces)
    return Recording(file, tuple(_channel(trace, kind == _ALTUS) for trace in common), notes=notes)


def _traces(obspy: Any, stream: BinaryIO, kind: str) -> Any:
    """As ObsPy reads them, but for the samples of GSE files; those of Kinemetrics in m/s2."""
    if kind == _ALTUS:
        return obspy.read(stream, format=kind, apply_calib=True)
    if not kind.startswith("GSE"):
        return obspy.read(stream, format=kind)
    found = obspy.read(stream, format=kind, headonly=True)
    stream.seek(0)
    kinds = [(one.stats[kind.lower()].datatype, one.stats.npts) for one in found]
    for trace, values in zip(found, gse_samples(stream.read(), kinds), strict=True):
        trace.data = values
    return found


def _require_whole(file: TextFile, traces: list[Any]) -> None:
    if not traces:
        raise file.error("there is no trace of numbers in the file; fetch it again from its source")
    seen: dict[str, Any] = {}
    for trace in sorted(traces, key=lambda one: one.stats.starttime):
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


def _together(file: TextFile, traces: list[Any]) -> tuple[list[Any], tuple[str, ...]]:
    """The traces cut to the time that all have, and sentences on what was done."""
    start = max(trace.stats.starttime for trace in traces)
    end = min(trace.stats.endtime for trace in traces)
    if end <= start:
        raise file.error("the traces have no time in common; give records of the same event")
    cut = [trace.copy().trim(start, end, nearest_sample=True) for trace in traces]
    shortest = min(trace.stats.npts for trace in cut if trace.stats.delta == cut[0].stats.delta)
    for trace in cut:
        if trace.stats.delta == cut[0].stats.delta:
            trace.data = trace.data[:shortest]
    notes = []
    if any(trace.stats.npts != own.stats.npts for trace, own in zip(cut, traces, strict=True)):
        notes.append(f"Cut to the time that all traces have: {start} to {end}.")
    late = [abs(one.stats.starttime - cut[0].stats.starttime) / one.stats.delta for one in cut]
    if max(late) > TIMES.apart:
        notes.append(
            f"Traces begin up to {max(late):.2g} of a sample apart; resample them to one clock."
        )
    return cut, tuple(notes)


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
    )


READER = Reader(
    "seismic", "miniSEED, SAC, GSE, SEG-2 and Kinemetrics EVT, by ObsPy", _recognises, _read
)


_SECTION = re.compile(rb"(?m)^DAT[12][^\n]*\n(?P<data>.*?)^CHK[12][ \t]+(?P<sum>-?\d+)", re.S)
_LETTERS = b"+-0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
_CODES = np.full(256, -1, dtype=np.int64)
_CODES[list(_LETTERS)] = np.arange(64)
_MORE, _NEGATIVE = 32, 16  # bits of a character: the number goes on; its sign, in the first one
_LONGEST = 7  # characters of a number
_MODULUS = 100_000_000


def gse_samples(content: bytes, kinds: list[tuple[str, int]]) -> list[Floats]:
    """The samples of all traces of a file, in counts.

    Args:
        content: of the file.
        kinds: data type, "CM6" or "INT", and number of samples of each trace, from its header.

    Raises:
        ValueError: a section is missing or damaged, or a type is not known.
    """
    sections = list(_SECTION.finditer(content.replace(b"\r\n", b"\n")))
    if len(sections) != len(kinds):
        raise ValueError(f"{len(kinds)} headers, but {len(sections)} whole sections of samples")
    found = []
    for section, (kind, count) in zip(sections, kinds, strict=True):
        if kind == "CM6":
            values = _unpacked(section["data"])
        elif kind == "INT":
            values = np.array(section["data"].split(), dtype=np.int64)
        else:
            raise ValueError(f"samples of the type {kind} are not supported")
        if len(values) != count:
            raise ValueError(f"{len(values)} samples where the header says {count}")
        if _checksum(values) != abs(int(section["sum"])):
            raise ValueError("the sum of its samples is not that which it gives")
        found.append(values.astype(np.float64))
    return found


def _unpacked(data: bytes) -> Integers:
    """Samples from their second differences, each of one character or several."""
    codes = _CODES[np.frombuffer(data.translate(None, b" \t\n"), dtype=np.uint8)]
    if not codes.size or codes.min() < 0 or codes[-1] & _MORE:
        raise ValueError("its packed samples are damaged")
    ends = np.flatnonzero(codes & _MORE == 0)
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends - starts + 1
    if lengths.max() > _LONGEST:
        raise ValueError("its packed samples are damaged")
    values = codes[starts] & (_NEGATIVE - 1)
    for k in range(1, int(lengths.max())):
        longer = lengths > k
        values[longer] = 32 * values[longer] + (codes[starts[longer] + k] & (_MORE - 1))
    values = np.where(codes[starts] & _NEGATIVE, -values, values)
    return np.cumsum(np.cumsum(values))


def _checksum(values: Integers) -> int:
    """Sum of the samples, of which no more than eight digits are ever kept."""
    total = 0
    for value in values.tolist():
        total = int(math.fmod(total + math.fmod(value, _MODULUS), _MODULUS))
    return abs(total)
