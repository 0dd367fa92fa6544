"""Reads Nastran bulk data: cards in free, small and large fields."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from femupdate.building.model_tables import file_text
from femupdate.errors import BuildingError

# A real of Nastran may leave the E of its exponent out: 1.2+3.
_REAL = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]([-+]?\d+)|([-+]\d+))?")
_ENTRIES = {8: 8, 16: 4}  # data on a line, by the width of its fields

# What becomes part of the model.
TAKEN = (
    *("GRID", "CQUAD4", "CQUADR", "CTRIA3", "CTRIAR", "CBAR", "CBEAM", "CROD", "CONM2", "CMASS2"),
    *("CELAS2", "RBE2", "SPC", "SPC1", "SPCADD", "PSHELL", "PBAR", "PBARL", "PBEAM", "PBEAML"),
    *("PROD", "MAT1", "CORD2R", "PARAM"),
)
# What modes do not depend on: loads, requests, and the choice of a method.
LEFT_OUT = (
    *("FORCE", "MOMENT", "PLOAD", "PLOAD1", "PLOAD2", "PLOAD4", "GRAV", "LOAD", "TEMP", "TEMPD"),
    *("RFORCE", "ACCEL", "ACCEL1", "SPCD", "DAREA", "DLOAD", "RLOAD1", "RLOAD2", "TLOAD1"),
    *("TLOAD2", "TABLED1", "TABLED2", "TABDMP1", "FREQ", "FREQ1", "TSTEP", "EIGR", "EIGRL"),
    *("PLOTEL", "SET1", "SET3", "ASET", "ASET1", "TSTEPNL", "NLPARM", "DTI"),
)
MEND = {
    "RBE3": "write RBE2 where the nodes move as one body, or CONM2 at the nodes themselves",
    "CELAS1": "write it as CELAS2",
    "CORD2C": "write the nodes in a rectangular system (CORD2R)",
    "PCOMP": "write PSHELL with the stiffness of the whole section",
    "INCLUDE": "other files are not read; put the content of that file here",
}


@dataclass(frozen=True, slots=True)
class Card:
    """One entry; its first datum has the number 0."""

    file: str
    name: str
    line: int
    data: tuple[str, ...]

    def text(self, number: int) -> str:
        """A datum as it is written; empty where there is none."""
        return self.data[number] if number < len(self.data) else ""

    def whole(self, number: int, usual: int | None = None) -> int:
        """A whole number."""
        text = self.text(number)
        if not text and usual is not None:
            return usual
        if not re.fullmatch(r"[-+]?\d{1,18}", text):
            said = repr(text) if text else "empty"
            raise self.error(f"field {number + 2} is {said}; write a whole number")
        return int(text)

    def real(self, number: int, usual: float | None = None) -> float:
        """A number, with the short exponents of Nastran."""
        text = self.text(number)
        if not text and usual is not None:
            return usual
        match = _REAL.fullmatch(text)
        value = float(f"{match[1]}e{match[2] or match[3] or 0}") if match else np.inf
        if not np.isfinite(value):
            said = repr(text) if text else "empty"
            raise self.error(f"field {number + 2} is {said}; write a number, such as 2.1+11")
        return value

    def error(self, text: str) -> BuildingError:
        """A complaint about this card, with its file and line."""
        named = f"{self.name} {self.text(0)}".strip()
        return BuildingError(f"{self.file}, line {self.line}: {named}: {text}")

    def components(self, number: int) -> tuple[int, ...]:
        """Directions 0 to 5 of components written as digits 1 to 6."""
        text = self.text(number)
        if not set(text) <= set("123456"):
            raise self.error(f"components {text!r} are no digits from 1 to 6; correct them")
        return tuple(sorted({int(digit) - 1 for digit in text}))

    def numbers(self, start: int) -> Iterator[int]:
        """Whole numbers from a datum on, in which "THRU" stands for all between two."""
        previous, through = 0, False
        for place in (k for k in range(start, len(self.data)) if self.data[k]):
            if self.data[place].upper() == "THRU":
                through = True
                continue
            value = self.whole(place)
            if through and not 0 < previous < value < previous + 10_000_000:
                raise self.error(f"THRU runs from {previous} to {value}; correct the two")
            yield from range(previous + 1 if through else value, value + 1)
            previous, through = value, False


def read_deck(file: Path) -> tuple[dict[str, list[Card]], int | None]:
    """Cards by their name, and the set of SPC that case control, before BEGIN BULK, chooses."""
    status = file.stat()
    return _read(file, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=2)
def _read(file: Path, changed: int, size: int) -> tuple[dict[str, list[Card]], int | None]:
    lines = file_text(file).splitlines()
    begins = (n for n, line in enumerate(lines) if re.match(r"\s*BEGIN\s*BULK", line, re.I))
    begin = next(begins, -1)
    control = "\n".join(lines[: max(begin, 0)])
    chosen = re.findall(r"^\s*SPC\s*=\s*(\d+)", control, re.I | re.M)
    cards: dict[str, list[Card]] = {}
    for card in _cards(file.name, lines, begin + 1):
        cards.setdefault(card.name, []).append(card)
    if "GRID" not in cards:
        raise BuildingError(
            f"{file.name}: it has no GRID between BEGIN BULK and ENDDATA; check that this is bulk "
            "data of Nastran"
        )
    return cards, int(chosen[-1]) if chosen else None


def _cards(file: str, lines: list[str], start: int) -> Iterator[Card]:
    """Yield the cards of bulk data, continued lines joined."""
    name, first, data, mark = "", 0, [""], ""
    for number, line in enumerate(lines[start:], start + 1):
        line = line.split("$", 1)[0].rstrip().expandtabs(8)
        if not line.strip():
            continue
        if line.strip().upper().startswith("ENDDATA"):
            break
        if line.lstrip().upper().startswith("INCLUDE"):
            raise Card(file, "INCLUDE", number, ()).error(f"{MEND['INCLUDE']}")
        head, fields, after = _fields(file, number, line)
        if head[:1] not in ("", "+", "*"):
            if name:
                yield Card(file, name, first, tuple(data))
            name, first, data = head.rstrip("* ").upper(), number, []
            if not re.fullmatch(r"[A-Z][A-Z0-9]*", name):
                raise Card(file, name, number, ()).error(
                    "this is no name of a card; begin the line with one, or with $ for a comment"
                )
        elif not name:
            raise Card(file, head, number, ()).error("it continues no card; remove the line")
        elif mark and head.strip("+* ") and head.strip("+* ") != mark:
            raise Card(file, name, number, tuple(data[:1])).error(
                f"the line {head} does not continue the one before, which asks for {mark}; put "
                "lines below the ones that they continue"
            )
        data += fields
        mark = after.strip("+* ")
    if name:
        yield Card(file, name, first, tuple(data))


def _fields(file: str, number: int, line: str) -> tuple[str, list[str], str]:
    """Name or mark, data and mark of the continuation of one line."""
    if "," in line:
        parts = [part.strip() for part in line.split(",")]
        count = _ENTRIES[16 if "*" in parts[0] else 8]
        if len(parts) > count + 2 and any(parts[count + 2 :]):
            raise BuildingError(
                f"{file}, line {number}: {len(parts)} fields are more than a line of {parts[0]} "
                "has; write the rest on a line that begins with +"
            )
        data = parts[1 : count + 1]
        return parts[0], data + [""] * (count - len(data)), "".join(parts[count + 1 : count + 2])
    head = line[:8].strip()
    width = 16 if "*" in head else 8
    data = [line[8 + k * width : 8 + (k + 1) * width].strip() for k in range(_ENTRIES[width])]
    return head, data, line[72:80].strip()
