"""Samples of GSE files: integers, or six bits a character (CM6).

After the description of the format (GSETT-3 Documentation, 1995, volume 2; the same in IMS 1.0).
ObsPy reads the headers. Its library for the samples writes beyond its memory where a file is cut
short or damaged, which ends the process or worse.
"""

import math
import re

import numpy as np

from femupdate.arrays import Floats, Integers

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
