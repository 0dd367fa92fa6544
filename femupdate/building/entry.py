"""The base of every table of a building file, and how a complaint about one finds its words."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from femupdate.errors import BuildingError, close


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

    @model_validator(mode="before")
    @classmethod
    def _no_unknown_key(cls, document: Any) -> Any:
        if isinstance(document, Mapping):
            known = {name: field.alias or name for name, field in cls.model_fields.items()}
            for key in document:
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
    """Return the first complaint of pydantic as one sentence with file, key and mend."""
    problem = error.errors(include_url=False)[0]
    below, sentence = _sentence(problem)
    # A path of pydantic names the tags of unions as well, which no file contains.
    path: list[str | int] = []
    missing = len(problem["loc"]) - 1 if problem["type"] == "missing" else -1
    for number, part in enumerate(problem["loc"]):
        try:
            document = document[part]
        except (KeyError, IndexError, TypeError):
            if number != missing:
                continue
        path.append(part)
    key = dotted([*path, below] if below else path)
    others = error.error_count() - 1
    more = f" ({others} more to mend in this file)" if others else ""
    return BuildingError(f"{where}: {key + ': ' if key else ''}{sentence}{more}")
