"""Reads Nastran bulk data: cards in free, small and large fields."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import zip_longest
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.model_tables import file_text
from femupdate.errors import BuildingError

# A real of Nastran may leave the E of its exponent out: 1.2+3.
_REAL = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]([-+]?\d+)|([-+]\d+))?")
_ENTRIES = {8: 8, 16: 4}  # data on a line, by the width of its fields

# What becomes part of the model.
TAKEN = (
    *("GRID", "CQUAD4", "CQUADR", "CTRIA3", "CTRIAR", "CBAR", "CBEAM", "CROD", "CONROD", "CTUBE"),
    *("CONM2", "CMASS2", "CELAS1", "CELAS2", "CBUSH", "CDAMP2", "RBE2", "RBAR", "SPC", "SPC1"),
    *("SPCADD", "PSHELL", "PBAR", "PBARL", "PBEAM", "PBEAML", "PROD", "PTUBE", "PELAS", "PBUSH"),
    *("MAT1", "CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S", "PARAM", "GRDSET"),
    *("BAROR", "BEAMOR"),
)
# What modes do not depend on: loads, requests, sizing, and the choice of a method.
LEFT_OUT = re.compile(
    r"FORCE\d?|MOMENT\d?|PLOAD\w*|GRAV|LOAD|LOADSET|LSEQ|TEMP\w*|RFORCE|ACCEL1?|SPCD|DAREA|DLOAD"
    r"|[RT]LOAD[12]|DELAY|DPHASE|TIC|TABLE\w\w|TABDMP1|TABRND1|RANDPS|FREQ\d?|TSTEP(NL)?|EIG\w+"
    r"|PLOTEL\d?|SET[123]|[ABCQ]SET1?|OMIT1?|USET1?|NL\w+|DTI|MDLPRM|DOPTPRM|DESVAR|DRESP\d|DCONSTR"
    r"|P(SOLID|SHEAR|COMPG?|GAP|BEND|VISC|DAMP|MASS|FAST|WELD)|DVPREL1|DEFORM|BOUTPUT|MATT\d|MAT[2-9]|MAT1\d|CREEP|SUPORT1?|CMONPNT|MONPNT1|ECHO(ON|OFF)"
)
# Cards whose fields stand where those of another kind are empty.
_USUAL = {"GRID": "GRDSET", "CBAR": "BAROR", "CBEAM": "BEAMOR"}
MEND = {
    "RBE3": "write RBE2 where the nodes move as one body, or CONM2 at the nodes themselves",
    "RBE1": "write it as RBE2",
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

    def completed(self, usual: "Card") -> "Card":
        """The card with the data of another one where it has none; vectors are given whole."""
        data = [a or b or "" for a, b in zip_longest(self.data, usual.data)]
        if self.name != "GRID" and self.text(4):
            data[4:7] = [self.text(k) for k in (4, 5, 6)]
        return replace(self, data=tuple(data))

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

    def reals(self, start: int) -> Floats:
        """Three numbers, (3,), 0 where they are empty."""
        return np.array([self.real(start + k, 0.0) for k in range(3)])

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
    lines = _lines(file, ())
    starts = re.compile(r"\s*BEGIN(\s+BULK|\s*(\$.*)?$)", re.I)
    begin = next((n for n, (_, _, line) in enumerate(lines) if starts.match(line)), -1)
    control = "\n".join(line for _, _, line in lines[: max(begin, 0)])
    chosen = re.findall(r"^\s*SPC\s*=\s*(\d+)", control, re.I | re.M)
    if len(set(chosen)) > 1:
        raise BuildingError(f"{file.name}: it has SPC = {' and '.join(chosen)}; keep one of them")
    cards: dict[str, list[Card]] = {}
    for card in _cards(lines[begin + 1 :]):
        cards.setdefault(card.name, []).append(card)
    for name, usual in _USUAL.items():
        for given in cards.get(usual, [])[-1:]:
            cards[name] = [card.completed(given) for card in cards.get(name, [])]
    if "GRID" not in cards:
        raise BuildingError(
            f"{file.name}: it has no GRID between BEGIN BULK and ENDDATA; check that this is bulk "
            "data of Nastran"
        )
    return cards, int(chosen[-1]) if chosen else None


def whole_text(file: Path) -> str:
    """The text of a deck with all that it includes."""
    return "\n".join(line for _, _, line in _lines(file, ()))


def _lines(file: Path, users: tuple[Path, ...]) -> list[tuple[str, int, str]]:
    """Lines of a deck with their file and number, those of INCLUDE in its place."""
    lines: list[tuple[str, int, str]] = []
    numbered = enumerate(file_text(file).splitlines(), 1)
    for number, line in numbered:
        text = line.split("$", 1)[0].strip()
        if not re.match(r"INCLUDE\b", text, re.I):
            lines.append((file.name, number, line))
            continue
        for quote in "'\"":  # a long path goes on below
            while text.count(quote) % 2:
                text += next(numbered, (0, quote))[1].strip()
        named = text[7:].strip(" ='\",").replace("\\", "/")
        path = file.parent / named
        error = Card(file.name, "INCLUDE", number, ()).error
        if not path.is_file():
            raise error(f"there is no file {named}; put it beside the deck, or remove the line")
        if path in (file, *users):
            raise error(f"{named} includes itself; remove the line")
        lines += _lines(path, (file, *users))
    return lines


def _cards(lines: list[tuple[str, int, str]]) -> Iterator[Card]:
    """Yield the cards of bulk data, continued lines joined."""
    name, first, data, asked, of = "", 0, [""], "", ""
    for file, number, whole in lines:
        line = whole.split("$", 1)[0].rstrip().expandtabs(8)
        if not line.strip():
            continue
        if line.strip().upper().startswith("ENDDATA"):
            break
        head, fields, after = _fields(file, number, line)
        if head[:1] not in ("", "+", "*"):
            if name:
                yield Card(of, name, first, tuple(data))
            name, first, data, of = head.rstrip("* ").upper(), number, [], file
            if not re.fullmatch(r"[A-Z][A-Z0-9]*", name):
                cure = "begin the line with one, or with $ for a comment"
                if name.startswith("="):
                    cure = "cards that repeat the one before are not read: write them out"
                raise Card(file, name, number, ()).error(f"this is no name of a card; {cure}")
        elif not name:
            raise Card(file, head, number, ()).error("it continues no card; remove the line")
        elif (mark := head.strip("+* ")) and asked not in ("+", "*", f"+{mark}", f"*{mark}", mark):
            raise Card(file, name, number, tuple(data[:1])).error(
                f"the line {head} does not continue the one before, which asks for "
                f"{asked or 'none'}; put lines below the ones that they continue"
            )
        data += fields
        asked = after
    if name:
        yield Card(of, name, first, tuple(data))


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
