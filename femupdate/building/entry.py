"""Tables of the building file and their fields: quantities with units, names, and complaints."""

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    GetCoreSchemaHandler,
    PlainSerializer,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import CoreSchema, core_schema

from femupdate.errors import BuildingError, UnitError, close
from femupdate.units import UNITS, factor, parse_quantity


class Complaint(ValueError):  # noqa: N818 - it never leaves this room: users get a BuildingError
    """A complaint about one key, told relative to the table that raises it."""

    def __init__(self, key: str, text: str) -> None:
        super().__init__(text)
        self.key = key


Complaints = Iterator[tuple[str, str]]
"""What an entry says that does not fit: the key, and a sentence."""


@contextmanager
def complaining() -> Iterator[None]:
    """Tell users a complaint of this room, as a context or as a decorator."""
    try:
        yield
    except Complaint as complaint:
        raise BuildingError(f"{complaint.key}: {complaint}") from None


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """Return the sentence for a name that is not among the known ones."""
    names = list(known)
    listed = ", ".join(names) if names else "none"
    return f"no {what} is named {name!r} (known: {listed}){close(name, names)}"


class Entry(BaseModel):
    """A table of the building file: frozen, with no key but its own."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)
    removed: ClassVar[Mapping[str, str]] = {}  # keys of former versions: what to do instead

    @model_validator(mode="before")
    @classmethod
    def _no_unknown_key(cls, document: Any) -> Any:
        if isinstance(document, Mapping):
            known = {name: field.alias or name for name, field in cls.model_fields.items()}
            for key in document:
                if key in cls.removed:
                    raise Complaint(key, cls.removed[key])
                if key not in known and key not in known.values():
                    names = sorted(known.values())
                    hint = close(str(key), names) or f"; the known ones are {', '.join(names)}"
                    raise Complaint(str(key), f"unknown key{hint}")
        return document

    @model_validator(mode="after")
    def _fitting(self) -> Self:
        for kind in reversed(type(self).__mro__):
            if "_complaints" in vars(kind):
                for key, text in vars(kind)["_complaints"](self):
                    raise Complaint(key, text)
        return self


def dotted(parts: Iterable[str | int]) -> str:
    """Return `walls[2].thickness` for ("walls", 2, "thickness")."""
    path = ""
    for part in parts:
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += f".{part}" if path and not part.startswith("[") else part
    return path


_PLAIN = {
    "missing": "the key is missing; add it",
    "frequency_grid": "the table is missing; add one with the lines [frequency_grid]"
    ', start = "0.1 Hz", step = "0.1 Hz" and count = 200, say',
    "damping": "the table is missing; add one with the lines [damping]"
    ', law = "constant" and ratio = 0.02, say',
    "tuple_type": "must be a list",
    "dict_type": "must be a table",
    "mapping_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "string_type": "must be text in quotes",
    "bool_type": "must be true or false",
}


def _sentence(problem: Any) -> tuple[str, str]:
    """Return (key below the reported path, sentence)."""
    kind, context = problem["type"], problem.get("ctx", {})
    original = context.get("error")
    if isinstance(original, Complaint):
        return original.key, str(original)
    if original is not None:
        return "", str(original)
    if kind == "literal_error":
        return "", f"{problem['input']!r} is not known; write one of {context['expected']}"
    if kind == "union_tag_invalid":
        tag = context["discriminator"].strip("'")
        return tag, f"{context['tag']!r} is not known; write one of {context['expected_tags']}"
    if kind == "union_tag_not_found":
        return context["discriminator"].strip("'"), _PLAIN["missing"]
    if kind in ("too_long", "too_short"):
        wanted = context.get("max_length", context.get("min_length"))
        return "", f"the list has {context['actual_length']} entries; write {wanted}"
    kind = problem["loc"][-1] if kind == "missing" and problem["loc"][-1] in _PLAIN else kind
    return "", _PLAIN.get(kind, problem["msg"][:1].lower() + problem["msg"][1:])


def as_building_error(error: ValidationError, document: Any, where: str) -> BuildingError:
    """Return what pydantic complains of as sentences with file, key and mend.

    It is the first complaint alone; where that is a missing key, all that its table lacks.
    """
    problems = error.errors(include_url=False)
    first, *rest = problems
    also = [
        each for each in rest if each["type"] == "missing" and each["loc"][:-1] == first["loc"][:-1]
    ]
    told = [first, *also] if first["type"] == "missing" else [first]
    sentences = []
    for problem in told:
        below, sentence = _sentence(problem)
        # A path of pydantic names the tags of unions as well, which no file contains.
        path: list[str | int] = []
        missing = len(problem["loc"]) - 1 if problem["type"] == "missing" else -1
        inside = document
        for number, part in enumerate(problem["loc"]):
            try:
                inside = inside[part]
            except (KeyError, IndexError, TypeError):
                if number != missing:
                    continue
            path.append(part)
        key = dotted([*path, below] if below else path)
        sentences.append(f"{key + ': ' if key else ''}{sentence}")
    others = len(problems) - len(told)
    more = f" ({others} more to mend in this file)" if others else ""
    return BuildingError(f"{where}: {'; '.join(sentences)}{more}")


# Units tried when a building is written, in order of preference at equal length of the text, and
# figures beyond which, SI, is no building and no model of one on a bench: one or its unit is wrong.
_KINDS = {
    "length": (("m", "mm"), 1e-6, 1e5),
    "area": (("m2", "mm2"), 1e-12, 1e8),
    "inertia": (("m4", "mm4"), 1e-20, 1e12),
    "mass": (("kg", "t"), 1e-6, 1e10),
    "stress": (("kN/mm2", "N/mm2", "Pa"), 1e3, 1e17),
    "density": (("kg/m3",), 1e-3, 1e6),
    "stiffness": (("N/m", "kN/m"), 1e-3, 1e20),
    "rotational stiffness": (("N m/rad", "kN m/rad"), 1e-3, 1e24),
    "damping": (("N s/m", "kN s/m"), 1e-3, 1e15),
    "rotational damping": (("N m s/rad", "kN m s/rad"), 1e-3, 1e18),
    "stiffness per mass": (("1/s2",), 1e-6, 1e15),
    "frequency": (("Hz",), 1e-6, 1e6),
    "time": (("ms",), 0.0, 1e9),
    "share": (("%",), 0.0, 1e3),
}


def format_quantity(value: float, kind: str) -> str:
    """Return the shortest text that `parse_quantity` reads back as exactly this SI value."""
    texts = []
    for unit in _KINDS[kind][0]:
        scaled = value / factor(unit, kind)
        plain = int(scaled) if scaled.is_integer() and abs(scaled) < 1e15 else scaled
        texts.append(f"{plain!r} {unit}")
    exact = [text for text in texts if parse_quantity(text, kind) == value]
    if exact:
        return min(exact, key=len)
    unit = max(UNITS[kind], key=lambda unit: UNITS[kind][unit] == 1.0)
    return f"{value / UNITS[kind][unit]!r} {unit}"


@dataclass(frozen=True)
class Quantity:
    """Marks a float that the file writes as text with a unit of this kind.

    In a file (validation context `{"file": ...}`) a bare number is refused; built in Python, a
    number is taken as SI.
    """

    kind: str
    sign: str = "positive"

    def read(self, value: Any, info: ValidationInfo) -> float:
        """Return the SI value, or raise a ValueError with a plain sentence."""
        number = self._number(value, from_file=bool((info.context or {}).get("file")))
        low = -math.inf if self.sign == "any" else 0.0
        if not math.isfinite(number) or number < low or (self.sign == "positive" and number == low):
            raise ValueError(f"{value!r} is not a {self.sign} {self.kind}; correct the figure")
        _, least, most = _KINDS[self.kind]
        too_small = self.sign == "positive" and number < least
        if too_small or abs(number) > most:
            raise ValueError(
                f"{value!r} is a {self.kind} that no building has; is the unit wrong? Correct it"
            )
        return number

    def _number(self, value: Any, *, from_file: bool) -> float:
        if isinstance(value, str):
            try:
                return parse_quantity(value, self.kind)
            except UnitError as error:
                raise ValueError(str(error)) from error
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{value!r} is not a {self.kind}; write {self._example()}")
        if from_file:
            raise ValueError(f"{value!r} has no unit; write it as text, such as {self._example()}")
        return float(value)

    def _example(self) -> str:
        return f'"1.5 {_KINDS[self.kind][0][0]}"'

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Tell pydantic how to read and write the field."""
        write = core_schema.plain_serializer_function_ser_schema(
            lambda value: format_quantity(value, self.kind), when_used="json"
        )
        return core_schema.with_info_plain_validator_function(self.read, serialization=write)


def _number(value: Any) -> float:
    """Read a plain number; a fraction such as "1/3" may be written as text."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{value!r} is not a number; write one, such as 0.5")
    try:
        top, _, bottom = str(value).partition("/")
        number = float(top) / float(bottom) if bottom else float(top)
    except (ValueError, ZeroDivisionError):
        raise ValueError(f"{value!r} is not a number; write one, such as 0.5 or '1/3'") from None
    if not math.isfinite(number):
        raise ValueError(f"{value!r} is not a finite number; write one, such as 0.5")
    return number


def _positive(value: Any) -> float:
    number = _number(value)
    if number <= 0.0:
        raise ValueError(f"{value!r} must be greater than 0; correct the figure")
    return number


def _names(value: Any) -> tuple[str, ...]:
    listed = (value,) if isinstance(value, str) else value
    if not isinstance(listed, list | tuple) or not all(isinstance(name, str) for name in listed):
        raise ValueError(f'{value!r} must be a name, a list of names, or "*" for all')
    if not listed:
        raise ValueError('the list is empty; name at least one, or write "*" for all')
    if len(set(listed)) < len(listed):
        raise ValueError("a name is listed twice; keep one of the two")
    return tuple(listed)


def _plain(kind: type, complaint: str) -> BeforeValidator:
    """Values of just one type are taken as they are; the complaint follows another one."""

    def read(value: Any) -> Any:
        if type(value) is not kind:
            raise ValueError(f"{value!r} {complaint}")
        return value

    return BeforeValidator(read)


def _label(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"{value!r} is not a name; write some text in quotes")
    if not value.isprintable():
        text = "TOML reads a backslash in double quotes as the start of a special character"
        raise ValueError(f"{value!r} is not what was meant: {text}; write / or single quotes")
    return value


ALL = ("*",)  # a list of names that means every one

Length = Annotated[float, Quantity("length")]
LengthOrZero = Annotated[float, Quantity("length", "not negative")]
Coordinate = Annotated[float, Quantity("length", "any")]
Point = tuple[Coordinate, Coordinate, Coordinate]
Area = Annotated[float, Quantity("area")]
Inertia = Annotated[float, Quantity("inertia")]
Mass = Annotated[float, Quantity("mass")]
Stress = Annotated[float, Quantity("stress")]
Density = Annotated[float, Quantity("density", "not negative")]
Stiffness = Annotated[float, Quantity("stiffness")]
RotationalStiffness = Annotated[float, Quantity("rotational stiffness")]
Damping = Annotated[float, Quantity("damping")]
RotationalDamping = Annotated[float, Quantity("rotational damping")]
StiffnessPerMass = Annotated[float, Quantity("stiffness per mass")]
Frequency = Annotated[float, Quantity("frequency")]
Time = Annotated[float, Quantity("time", "not negative")]
Share = Annotated[float, Quantity("share", "not negative")]
FrequencyOrZero = Annotated[float, Quantity("frequency", "not negative")]
Number = Annotated[float, BeforeValidator(_number)]
PositiveNumber = Annotated[float, BeforeValidator(_positive)]
Whole = Annotated[int, _plain(int, "is not a whole number; write one, such as 1024")]
Flag = Annotated[bool, _plain(bool, "must be true or false, without quotes")]
Label = Annotated[str, BeforeValidator(_label)]
Names = Annotated[
    tuple[str, ...],
    BeforeValidator(_names),
    PlainSerializer(lambda names: "*" if names == ALL else list(names), when_used="json"),
]
