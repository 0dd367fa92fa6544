"""Names of floors, sensors, directions and columns, and units as measured files write them.

Floors are told from the own words of stations: `Roof - center` is RF, `4th floor, east core` 4F.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.errors import UnitError
from femupdate.measurement.text import TextFile
from femupdate.units import UNITS, factor

BASE = "base"
TIME = "time_s"
FREQUENCY = "frequency_hz"
# What else files call them, and what they call times whose unit is known.
TIME_NAME = re.compile(
    r"^(t|time)([_ .].*)?$|^sec(ond)?s?$|^time_?stamp$|^date_?time$|^時[刻間]|^时间"
    r"|^(zeit|temps|tiempo|tempo|tijd|zaman)\b",
    re.IGNORECASE,
)
# How columns that are named by other people end where they say a direction.
DIRECTION_END = re.compile(
    r"(?:^a?|[ _.-])(x|y|z|ns|ew|ud|n-s|e-w|u-d|up|north|east|vert(?:ical)?)$", re.IGNORECASE
)
SECONDS_NAME = re.compile(
    r"^(t|time)([_ .]s(ec(ond)?s?)?)?$|^sec(ond)?s?$|^time_?stamp$", re.IGNORECASE
)
FREQUENCY_WORD = r"fr[eé]q(s|uenc(y|ies|es?)|uenz(a|e|en)?|u[eê]ncias?)?|fre[kc]uencias?|frekans"
FREQUENCY_NAME = re.compile(
    rf"^((?P<w>ω|omega|(circular|angular) f.+)|(f|{FREQUENCY_WORD})([_ ]?hz)?)$|^周波数|^频率", re.I
)

_FLOOR = r"RF|(?:[2-9]|[1-9]\d+)F"
_CHANNEL = re.compile(
    rf"(?P<floor>{BASE}|{_FLOOR})(?::(?P<sensor>[^\s.:]+))?(?:\.(?P<direction>[xyz]))?",
    re.IGNORECASE,
)
_VERTICAL = re.compile(rf"{BASE}@(?P<place>[+-]?\d+(?:\.\d+)?)\.z", re.IGNORECASE)
_FORCE = re.compile(rf"force/(?P<floor>{_FLOOR})(?:\.(?P<direction>[xyz]))?", re.IGNORECASE)
_FRF = re.compile(
    rf"(?P<floor>{_FLOOR})(?:/(?P<force>{_FLOOR}))?(?:_(?P<part>re|im|sd))?", re.IGNORECASE
)

HISTORY_COLUMNS = (
    "time_s, base, 2F ... RF, several sensors 2F:1 and 2F:2, other directions RF.y, a force at"
    " RF as force/RF, and vertical sensors of the base at places along the motion, in m,"
    " base@-2.5.z and base@2.5.z"
)
FRF_COLUMNS = (
    "frequency_hz, 2F ... RF as |H| or 2F_re and 2F_im, and 2F_sd; or under a force at 3F, 2F/3F"
    " ... RF/3F"
)


@dataclass(frozen=True)
class FloorChannel:
    """One channel of a building: an acceleration, or the force of a hammer or a shaker.

    Attributes:
        name: of its column, such as `2F:1.y` or `force/RF`.
        floor: `base`, `2F`, ... or `RF`.
        sensor: what tells the sensors of a floor apart; empty where there is one.
        direction: `x`, `y` or `z`.
        place: of a vertical sensor of the base that stands at a known place along the motion, m.
        force: whether it is the force that acts there.
    """

    name: str
    floor: str
    sensor: str = ""
    direction: str = "x"
    place: float | None = None
    force: bool = False


@dataclass(frozen=True)
class FrfColumn:
    """One column of an FRF table.

    Attributes:
        part: `abs`, `re`, `im` or `sd`.
        force: floor at which a force acts; empty where the base moves.
    """

    floor: str
    part: str
    force: str = ""

    @property
    def name(self) -> str:
        """As we write it, without the force: `2F`, `2F_re`."""
        return self.floor if self.part == "abs" else f"{self.floor}_{self.part}"


def parse_history(name: str) -> FloorChannel | None:
    """Return the motion or the force that a column of histories stands for, or None."""
    match = _FORCE.fullmatch(name.strip())
    if match is None:
        return parse_channel(name)
    floor, direction = match["floor"].upper(), (match["direction"] or "x").lower()
    name = f"force/{channel_name(floor, direction=direction)}"
    return FloorChannel(name, floor, direction=direction, force=True)


def parse_channel(name: str) -> FloorChannel | None:
    """Return the channel that a column name stands for, or None."""
    vertical = _VERTICAL.fullmatch(name.strip())
    if vertical is not None:
        return vertical_channel(float(vertical["place"]))
    match = _CHANNEL.fullmatch(name.strip())
    if match is None:
        return None
    floor, sensor = _floor_name(match["floor"]), match["sensor"] or ""
    direction = (match["direction"] or "x").lower()
    return FloorChannel(channel_name(floor, sensor, direction), floor, sensor, direction)


def vertical_channel(place: float) -> FloorChannel:
    """A vertical sensor of the base at a place along the motion, m."""
    return FloorChannel(f"{BASE}@{place:g}.z", BASE, "", "z", place)


def channel_name(floor: str, sensor: str = "", direction: str = "x") -> str:
    """Return the column name of a channel; the direction x goes without saying."""
    return floor + (f":{sensor}" if sensor else "") + (f".{direction}" if direction != "x" else "")


def parse_frf_column(name: str) -> FrfColumn | None:
    """Return what a column of an FRF table stands for, or None."""
    match = _FRF.fullmatch(name.strip())
    if match is None:
        return None
    force = _floor_name(match["force"]) if match["force"] else ""
    return FrfColumn(_floor_name(match["floor"]), (match["part"] or "abs").lower(), force)


def is_ours(name: str) -> bool:
    """Whether a name is one of ours for a column."""
    axis = name.lower() in (TIME, FREQUENCY)
    return axis or bool(parse_history(name) or parse_frf_column(name))


def floor_height(floor: str) -> float:
    """Return a key that sorts floors from bottom to top: base, 2F, 3F, ..., RF."""
    if floor == BASE:
        return 1.0
    return float("inf") if floor == "RF" else float(floor[:-1])


def _floor_name(text: str) -> str:
    return BASE if text.lower() == BASE else text.upper()


_ROOF = re.compile(
    r"\b(roof\w*|RF|top|dach\w*|DG|toit\w*|terrasse|techo|azotea|cubierta|tetto|copertura"
    r"|cobertura|telhado|[cç]at[iı]|dak)\b|屋[上根顶]|顶层|[RＲ]階",
    re.IGNORECASE,
)
_STORY = (
    r"floor|flr?|level|lvl|stor(?:e?y|ies)|stockwerk|(?:ober)?geschoss|etage|étage|niveau|piso"
    r"|planta|piano|andar|kat|verdieping|stock|OG"
)
_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth")
_ORDINAL = re.compile(rf"\b({'|'.join(_ORDINALS)})\b", re.IGNORECASE)
_NUMBERED = re.compile(
    rf"\b(\d+)(?:st|nd|rd|th|er|[eè]re|[eè]me|[eºª°.])?[ -]*(?:{_STORY})\b"
    rf"|\b(?:{_STORY})[ -]*(\d+)\b|^R\+(\d+)$"
    r"|(?<![A-Za-z0-9])(?:x|a|acc)?(\d+)F\b|^[LF][ -]?(\d+)$|(\d+)[階层楼]|^(\d+)(?:st|nd|rd|th)$",
    re.IGNORECASE,
)
_GROUND_FLOOR = re.compile(
    r"\b(ground floor|lobby|GF|EG|PB|erdgescho\w+|rez|RDC|planta baja|t[eé]rreo|piano terra"
    r"|zemin)\b",
    re.IGNORECASE,
)
_BELOW = re.compile(
    rf"{_GROUND_FLOOR.pattern}|\b(basement\w*|foundation\w*|base(?!line)\w*|B\d?F?|UG|KG"
    r"|keller\w*|fundament\w*|sous-sol|cimentaci[oó]n|fondazion[ei]"
    r"|funda[cç][aã]o|temel|bodrum|s[oó]tano|(shak\w+ )?table)\b"
    r"|基[礎础]|地下",
    re.IGNORECASE,
)
_CEILING = re.compile(r"\b(decke\w*|ceiling|plafond|soffitto)\b", re.IGNORECASE)
_BESIDE = re.compile(
    r"\bgr(?:oun|n)d\w*|free[ -]?field|\b(pit|boden\w*|soil|sol|solo|suelo|terreno|terrain|input)\b"
    r"|地[表盤面]|^地$",
    re.IGNORECASE,
)


def floors_of(texts: Sequence[str]) -> tuple[str | None, ...]:
    """Return the floors that columns' names or sensors' locations tell, None where they do not.

    `Roof - center` is RF, `4th floor, east core` 4F; `Basement`, `Free field` and `1st Floor` are
    the base. Where a first floor stands beside a base, basement or the ground, the count begins
    above that, and without a roof the last floor of an unbroken count in short names is RF.
    """
    numbers = [_number(text) for text in texts]
    ranks = [base_rank(text) for text in texts]
    others = any(parse_channel(text) not in (None, parse_channel(BASE)) for text in texts)
    below = [rank for rank, number in zip(ranks, numbers, strict=True) if number in (None, 0)]
    # Free fields of station archives are named beside a first floor that is the base.
    grounds = [t for t, rank in zip(texts, ranks, strict=True) if rank == 1]
    beside = any(re.search(r"free|pit", text, re.IGNORECASE) for text in grounds)
    based = 0 in below or (1 in below and not beside)
    shift = 1 if based and 1 in numbers and not others else 0
    floors: list[str | None] = []
    for text, number in zip(texts, numbers, strict=True):
        channel = parse_channel(text)
        if channel is not None:
            floors.append(channel.floor)
        elif _ROOF.search(text.replace("_", " ")):
            floors.append("RF")
        elif _CEILING.search(text):  # of the story, or the floor that bears its name?
            floors.append(None)
        elif number is not None:
            above = number + (shift if number else 0)
            floors.append(f"{above}F" if above > 1 else BASE)
        else:
            floors.append(BASE if base_rank(text) < 2 else None)
    counted = sorted({number for number in numbers if number})
    whole = shift and counted == list(range(1, len(counted) + 1)) and len(counted) > 1
    short = all(len(text) <= 12 for text in texts)  # of a station each sensor's place is told
    if whole and short and "RF" not in floors:
        floors = ["RF" if floor == f"{counted[-1] + 1}F" else floor for floor in floors]
    return tuple(floors)


def two_bases(texts: Sequence[str]) -> bool:
    """Whether of places that are each taken for the base some are a first floor, others below."""
    first = {_number(t) == 1 or bool(_GROUND_FLOOR.search(t.replace("_", " "))) for t in texts}
    return len(first) > 1


def base_rank(text: str) -> int:
    """Return 0 for a place in the building's base, 1 for the ground beside it, 2 for no base."""
    number, words = _number(text), text.replace("_", " ")
    if number in (0, 1) or (number is None and _BELOW.search(words)):
        return 0
    return 1 if number is None and _BESIDE.search(words) else 2


def _number(text: str) -> int | None:
    if parse_channel(text) is not None or _ROOF.search(text.replace("_", " ")):
        return None
    plain = text.replace("_", " ")
    plain = _ORDINAL.sub(lambda word: f"{_ORDINALS.index(word[1].lower()) + 1}.", plain)
    match = _NUMBERED.search(plain)
    return int(next(group for group in match.groups() if group)) if match else None


FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605, "kip": 4448.2216152605}
QUANTITIES = ("receptance", "mobility", "accelerance")
"""Displacement, velocity and acceleration per unit force, by their power of i omega."""
_NEWTONS = "|".join(FORCES)
_RATIO = re.compile(rf"\(?(?P<motion>[^()*]+?)\)?/\(?(?P<force>{_NEWTONS})\)?")
_PRODUCT = re.compile(rf"\(?1/(?P<force>{_NEWTONS})\)?[*·.]?\(?(?P<motion>[^()]+?)\)?")
_MASS = re.compile(r"1/\(?(?P<mass>kg|t|lb)\)?")
_VELOCITY = re.compile(r"(?P<length>[a-z]+)/s", re.IGNORECASE)


def newtons(file: TextFile, values: Floats, unit: str | None, column: str) -> Floats:
    """Forces in N."""
    if unit not in FORCES:
        raise file.error(
            f"the force's unit is {unit or 'not given'}; write one of {', '.join(FORCES)} behind"
            f" its name, such as force/RF (kN)",
            column=column,
        )
    found = np.asarray(values * FORCES[unit])
    # 1e10 N is the weight of a million tonnes.
    if found.size and np.abs(found).max() > 1e10:
        raise file.error(
            f"a force of {np.abs(found).max():.3g} N acts on no building; correct the value or the"
            " unit",
            column=column,
        )
    return found


def force_unit(text: str) -> tuple[int, float] | None:
    """The unit per force that a text such as `m/s2/N`, `g/kN` or `(1/N)*(m/s²)` names, or None.

    Returns:
        Power of i omega (see `QUANTITIES`), and factor to SI.
    """
    plain = re.sub(r"\s", "", text).replace("²", "2").replace("**", "").replace("^", "")
    mass = _MASS.fullmatch(plain)
    if mass is not None:
        return 2, 1.0 / UNITS["mass"][mass["mass"]]
    match = _PRODUCT.fullmatch(plain) or _RATIO.fullmatch(plain)
    if match is None:
        return None
    newton, lengths = FORCES[match["force"]], UNITS["length"]
    velocity = _VELOCITY.fullmatch(match["motion"])
    if match["motion"] in lengths:
        return 0, lengths[match["motion"]] / newton
    if velocity is not None and velocity["length"] in lengths:
        return 1, lengths[velocity["length"]] / newton
    try:
        return 2, factor(match["motion"], "acceleration") / newton
    except UnitError:
        return None


_EXPLAINED = re.compile(r"^([A-Za-z]+)\s*\(.*\)$")  # gal(cm/s/s), as JMA writes
RAW = re.compile(r"[mµμu]?V(olts?)?|counts?|cts|LSB", re.IGNORECASE)  # of a digitiser
_MEASURED = ("acceleration", "time", "frequency", "length")


def plain_unit(unit: str) -> str:
    """Return a unit's name without what files wrap around it: `gal(cm/s/s)`, `cm/sec2.`, `[g]`."""
    name = unit.strip().strip("[]").rstrip(".,; ").strip()
    if name.startswith("(") and name.endswith(")"):
        name = name[1:-1].strip()
    explained = _EXPLAINED.match(name)
    if explained:
        name = explained.group(1)
    return re.sub(r"(?<![^\W\d])sec(?:ond)?s?(?=\b|\d|\^|\*|²|-|⁻)", "s", name, flags=re.IGNORECASE)


def is_unit(text: str) -> bool:
    """Return whether a text names a unit of motion, time, frequency, force, or per force."""
    known = any(_known(plain_unit(text), kind) for kind in _MEASURED)
    speed = _VELOCITY.fullmatch(plain_unit(text))
    known = known or (speed is not None and speed["length"] in UNITS["length"])
    return known or text in FORCES or bool(force_unit(text) or RAW.fullmatch(text))


def is_acceleration(unit: str) -> bool:
    """Return whether a text names a unit of acceleration."""
    return _known(plain_unit(unit), "acceleration")


def acceleration_factor(unit: str | None) -> float:
    """SI factor of a unit of acceleration, 1 of any other or none."""
    return _factor(plain_unit(unit), "acceleration") if unit and is_acceleration(unit) else 1.0


def split_unit(cell: str) -> tuple[str, str | None]:
    """Split a column's title into name and unit: `RF (m/s2)` gives `("RF", "m/s2")`."""
    name, unit = bracketed(cell)
    return (name, unit) if unit is not None and is_unit(unit) else (cell.strip(), None)


def bracketed(title: str) -> tuple[str, str | None]:
    """Split a title into a name and what stands in brackets behind it, or None: `damping (%)`.

    Without a pattern, which takes seconds to refuse a name with thousands of blanks.
    """
    text = title.strip()
    at = max(text.rfind("("), text.rfind("["))
    inside = text[at + 1 : -1].strip()
    if at < 1 or text[-1] not in ")]" or not inside or ")" in inside or "]" in inside:
        return text, None
    return text[:at].rstrip(), inside


def si_factor(file: TextFile, unit: str, kind: str, column: str | None = None) -> float:
    """Return the SI factor of a unit that a file or an option names."""
    try:
        return _factor(plain_unit(unit), kind)
    except UnitError as error:
        speed = kind == "acceleration" and _VELOCITY.fullmatch(plain_unit(unit))
        words = f"{unit} is a unit of velocity; give accelerations" if speed else str(error)
        raise file.error(words, column=column) from None


def _known(name: str, kind: str) -> bool:
    try:
        _factor(name, kind)
    except UnitError:
        return False
    return True


def _factor(name: str, kind: str) -> float:
    several = re.fullmatch(r"(\d+\.?\d*(?:[eE][-+]?\d+)?)\s*\*?\s*([^\d\s.].*)", name)
    if several and kind == "acceleration":  # 4.7e-6 m/s2 is what a count of a digitiser may be
        return float(several[1]) * factor(several[2], kind)
    # The first digitised CSMIP records are written in tenths of g.
    if kind == "acceleration" and name.lower().replace(" ", "") == "g/10":
        return factor("g", kind) / 10.0
    return factor(name, kind)
