"""Mutations of files: a few changes each, as disks, editors, programs and strangers make them."""

import re
from collections.abc import Callable

import numpy as np

Mutation = Callable[[bytes, np.random.Generator], bytes]

_NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_NUMBERS = (
    b"0", b"-1", b"nan", b"inf", b"1e300", b"-1e300", b"1e-300", b"1e9999", b"2147483648",
    b"99999999999999999999", b"0.0000001", b"1000000", b"", b"1,5", b"0x10", b"1_000", b"9" * 5000,
)  # fmt: skip
_PIECES = (
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n\n\n", b"\t", b",", b";", b'"', b"'", b"#",
    b"[", b"]", b"{", b"}", b"=", b"<", b">", b"&", b"..", b"/", b"\\", b"%s", b"NaN",
    "θ構".encode(), "構".encode("cp932"), b"[" * 20_000, b"a." * 20_000, b" " * 20_000,
)  # fmt: skip
_CHANGES = (1, 1, 1, 2, 3)


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes after one to three changes of kinds drawn at random."""
    for _ in range(int(rng.choice(_CHANGES))):
        data = MUTATIONS[int(rng.integers(len(MUTATIONS)))](data, rng)
    return data


def _at(data: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(data) + 1))


def _span(data: bytes, rng: np.random.Generator) -> tuple[int, int]:
    """A stretch: mostly short, at times most of the file."""
    start = _at(data, rng)
    length = int(2.0 ** rng.uniform(0.0, np.log2(max(len(data), 2))))
    return start, min(start + length, len(data))


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for _ in range(int(2 ** rng.integers(0, 6)) if data else 0):
        changed[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: _at(data, rng)]


def _delete(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def _repeat(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    return data[:end] + data[start:end] * int(rng.integers(1, 4)) + data[end:]


def _overwrite(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    value = int(rng.choice([0, 255, 32, 48]))
    return data[:start] + bytes([value]) * (end - start) + data[end:]


def _junk(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    return data[:at] + rng.bytes(int(rng.integers(1, 200))) + data[at:]


def _piece(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    return data[:at] + _PIECES[int(rng.integers(len(_PIECES)))] + data[at:]


def _number(data: bytes, rng: np.random.Generator) -> bytes:
    """Another number in place of one, the first ones (those of a header) more often."""
    found = list(_NUMBER.finditer(data[:200_000]))
    if not found:
        return data
    one = found[int(len(found) * rng.random() ** 2)]
    new = _NUMBERS[int(rng.integers(len(_NUMBERS)))]
    return data[: one.start()] + new + data[one.end() :]


def _lines(data: bytes, rng: np.random.Generator) -> bytes:
    """Two lines change places, or one goes, or comes twice."""
    lines = data.split(b"\n")
    a, b = (int(k) for k in rng.integers(len(lines), size=2))
    how = int(rng.integers(3))
    if how == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif how == 1:
        del lines[a]
    else:
        lines.insert(b, lines[a])
    return b"\n".join(lines)


def _encoding(data: bytes, rng: np.random.Generator) -> bytes:
    """As another program would save the text."""
    text = data.decode("latin-1")
    how = int(rng.integers(5))
    if how == 0:
        return text.encode("utf-16")
    if how == 1:
        return b"\xef\xbb\xbf" + data
    if how == 2:
        return data.replace(b"\n", b"\r\n")
    if how == 3:
        return re.sub(rb"(\d)\.(\d)", rb"\1,\2", data)
    return data.swapcase()


def _word(data: bytes, rng: np.random.Generator) -> bytes:
    """A word of the file in place of another."""
    words = list(re.finditer(rb"[A-Za-z_][\w.]*", data[:50_000]))
    if not words:
        return data
    one, other = (words[int(k)] for k in rng.integers(len(words), size=2))
    return data[: one.start()] + other[0] + data[one.end() :]


MUTATIONS: tuple[Mutation, ...] = (
    _flip, _cut, _delete, _repeat, _overwrite, _junk, _piece, _number, _number, _lines, _encoding,
    _word,
)  # fmt: skip
