"""What a command has found, described once; terminal, page, JSON and CSV read its items."""

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femupdate.errors import ReportError
from femupdate.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True)
class Note:
    """A line for people, figures for programs, or both.

    Attributes:
        text: as it stands on the terminal; empty for programs alone.
        content: figures by their keys in JSON.
        detail: on the terminal it is shown to those who ask for more.
        page: the page has it as well.
    """

    text: str = ""
    content: Mapping[str, Any] = field(default_factory=dict)
    detail: bool = False
    page: bool = True

    def lines(self) -> list[str]:
        """For the terminal."""
        return [self.text] if self.text else []


@dataclass(frozen=True)
class Notes:
    """Sentences that the user should know, the decisive first.

    Attributes:
        rest: where those are that the terminal leaves out; it shows all where this is empty.
        key: in JSON.
        detail: on the terminal they are shown to those who ask for more.
        warning: they stand out on the page.
    """

    sentences: tuple[str, ...]
    rest: str = ""
    key: str = ""
    detail: bool = False
    warning: bool = False

    @property
    def content(self) -> Mapping[str, Any]:
        """For JSON."""
        return {self.key: self.sentences} if self.key else {}

    def lines(self) -> list[str]:
        """For the terminal."""
        most = 6 if self.rest else len(self.sentences)
        shown = [f"  - {sentence}" for sentence in self.sentences[:most]]
        if (more := len(self.sentences) - most) > 0:
            shown.append(f"  - {more} more {'note' if more == 1 else 'notes'}: {self.rest}")
        return shown


@dataclass(frozen=True)
class Picture:
    """A figure, made when it is drawn, by the name of its file without ending."""

    name: str
    figure: "Callable[[], Figure]"


Item = Note | Notes | Table


class Result:
    """Something found, which says of itself what it is by its items.

    At a prompt it shows what the terminal would and its tables, in a notebook both as HTML.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        """A dataclass keeps the `__repr__` that its class has already."""
        super().__init_subclass__(**more)
        cls.__repr__ = Result.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """What the terminal shows, and tables."""
        shown = (item for item in self.items() if isinstance(item, Table) or not item.detail)
        return "\n".join(line for item in shown for line in item.lines())

    def _repr_html_(self) -> str:
        """For notebooks."""
        from html import escape

        parts = []
        for item in self.items():
            if isinstance(item, Table):
                cells = [
                    "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row)
                    for row, tag in [(item.head, "th"), *((row, "td") for row in item.rows)]
                ]
                if item.rows:
                    body = "</tr><tr>".join(cells)
                    parts.append(f"<b>{escape(item.caption)}</b><table><tr>{body}</tr></table>")
            elif not item.detail:
                text = "".join(f"<p>{escape(line)}</p>" for line in item.lines())
                parts.append(re.sub("`(.+?)`", r"<code>\1</code>", text))
        return "".join(parts)

    def plot(self, name: str = "") -> "Figure":
        """One of its figures, the first or that of the name.

        Raises:
            ReportError: it has none of that name.
        """
        pictures = {picture.name: picture for picture in self.figures()}
        if (name or next(iter(pictures), "")) not in pictures:
            known = ", ".join(pictures) or "tables alone"
            raise ReportError(f"there is no figure {name or 'to draw'}; known: {known}")
        return pictures[name or next(iter(pictures))].figure()

    def to_dataframe(self, name: str = "") -> "DataFrame":
        """One of its tables, the first or that of the name, one observation a row.

        Raises:
            ReportError: it has none of that name.
        """
        from pandas import DataFrame

        tables = {table.name: table for table in self.tables()}
        if (name or next(iter(tables), "")) not in tables:
            raise ReportError(f"there is no table {name!r}; known: {', '.join(tables) or 'none'}")
        head, rows = tables[name or next(iter(tables))].sheet()
        return DataFrame(rows, columns=head)

    def items(self) -> Iterable[Item]:
        """Everything that there is to tell, in the order in which people read it."""
        raise NotImplementedError

    def figures(self) -> Iterable[Picture]:
        """What can be drawn of it; what draws is imported here, for it is slow to import."""
        return ()

    def as_dict(self) -> dict[str, Any]:
        """For programs: what `--json` holds."""
        content: dict[str, Any] = {}
        for item in self.items():
            content.update(item.as_dict() if isinstance(item, Table) else item.content)
        return dict(plain(content))

    def lines(self, details: bool = False) -> tuple[str, ...]:
        """For people, on the terminal.

        Args:
            details: those as well that few ask for.
        """
        shown = [item for item in self.items() if details or not item.detail]
        return tuple(line for item in shown for line in item.lines())

    def tables(self) -> tuple[Table, ...]:
        """Those for spreadsheets."""
        tables = [item for item in self.items() if isinstance(item, Table)]
        return tuple(table for table in tables if any(column.csv for column in table.columns))


def wrapped(line: str) -> str:
    """A line as wide as a terminal."""
    return textwrap.fill(line, 98, subsequent_indent="  ")


def first_lines(verdict: str, figures: str, then: str) -> Iterable[Note]:
    """What is said first: the verdict, the main figures and what to do, which pages say apart."""
    for line in (verdict, figures):
        yield Note(wrapped(line), page=False)
    yield Note(f"Next: {then}; -v tells more.", page=False)


class Told(Result):
    """A result by its items alone; its figures are attributes, by their keys in JSON."""

    def __init__(self, items: Iterable[Item], figures: Iterable[Picture] = ()) -> None:
        self._items, self._figures = tuple(items), tuple(figures)

    def items(self) -> Iterable[Item]:
        """As they were given."""
        return self._items

    def figures(self) -> Iterable[Picture]:
        """As they were given."""
        return self._figures

    def __getattr__(self, name: str) -> Any:
        for item in () if name.startswith("_") else self._items:
            content = item.as_dict() if isinstance(item, Table) else item.content
            if name in content:
                return content[name]
        raise AttributeError(f"there is no figure {name!r}; known: {', '.join(self.as_dict())}")


def took(seconds: float) -> str:
    """How long something took, after a comma; nothing of what was read back."""
    return "" if math.isnan(seconds) else f", {seconds:.1f} s"


def plain(value: Any) -> Any:
    """What JSON holds of a value; numbers that are not finite become null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
