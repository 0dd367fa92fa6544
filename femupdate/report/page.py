"""The page: sections of text, tables, charts and a model that turns, in one HTML file.

Everything is inside the file: data, styles, scripts and the plotting library. All text is escaped.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.errors import ReportError
from femupdate.study import write_text
from femupdate.tables import Table

BUDGET = 8_000_000  # bytes: what mail servers and phones still take
_DIGITS = 5


@dataclass(frozen=True)
class Text:
    """Paragraphs."""

    paragraphs: tuple[str, ...]
    kind: str = "text"


@dataclass(frozen=True)
class Remarks:
    """A list of sentences; `warning` makes them stand out."""

    sentences: tuple[str, ...]
    warning: bool = False
    kind: str = "remarks"


@dataclass(frozen=True, kw_only=True)
class Chart:
    """Panels of a plot, one shown at a time behind tabs.

    Attributes:
        name: of its CSV file, without ending.
        caption: what it shows.
        panels: title of the tab and Plotly figure, a mapping with `data` and `layout`.
        note: how to read it, and what was left out for the screen.
        height: px.
    """

    name: str
    caption: str
    panels: tuple[tuple[str, Mapping[str, Any]], ...]
    note: str = ""
    height: int = 380
    kind: str = "chart"


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A model that turns and moves.

    Attributes:
        caption: what it shows.
        content: what `scene.js` draws; see `femupdate.report.page_scene`.
        note: how to read it.
    """

    caption: str
    content: Mapping[str, Any]
    note: str = ""
    kind: str = "scene"


Block = Text | Remarks | Table | Chart | Scene


@dataclass(frozen=True)
class Section:
    """A part of the page that collapses.

    Attributes:
        name: anchor.
        title: heading.
        blocks: from top to bottom; a section without blocks is left out.
    """

    name: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, kw_only=True)
class Page:
    """A whole page.

    Attributes:
        title: of the page.
        subtitle: one line under it.
        made: when and by what.
        sections: from top to bottom.
    """

    title: str
    subtitle: str
    made: str
    sections: tuple[Section, ...]


def page_html(page: Page) -> str:
    """Return the page as one HTML text that needs nothing else."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    assets = files("femupdate.report") / "assets"
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["data"] = lambda value: Markup(data_json(value))
    environment.filters["prose"] = lambda text: Markup(prose_html(text))
    template = environment.from_string((assets / "page.html").read_text(encoding="utf-8"))

    def asset(name: str) -> Markup:
        return Markup((assets / name).read_text(encoding="utf-8"))

    sections = [section for section in page.sections if section.blocks]
    return template.render(
        page=page, sections=sections, asset=asset, plotly=Markup(_plotly()), scene=_has_scene(page)
    )


def prose_html(text: str) -> str:
    """A sentence, escaped, with what stands between backticks as code, and signs as in print."""
    from markupsafe import escape

    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    return re.sub(r"(\d) ?%", "\\1\u00a0%", escaped.replace(" +- ", " ± "))


def write_page(page: Page, path: Path) -> Path:
    """Write the page, whole or not at all.

    Raises:
        ReportError: the name does not end in .html, or the page is larger than `BUDGET`.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise ReportError(f"{path} is not the name of a page; let it end in .html")
    text = page_html(page)
    size = len(text.encode("utf-8"))
    if size > BUDGET:
        raise ReportError(
            f"{path}: the page would have {size / 1e6:.1f} MB, more than {BUDGET / 1e6:.0f} MB; "
            "predict with a shorter record, or report on a study of a coarser mesh"
        )
    write_text(path, text)
    return path


def data_json(value: Any) -> str:
    """JSON to stand inside a script element: no markup in it, short numbers, NaN as null."""
    text = json.dumps(_short(value), separators=(",", ":"), allow_nan=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def _short(value: Any) -> Any:
    """Plain values with five significant digits."""
    if isinstance(value, Mapping):
        return {str(key): _short(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _short(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_short(item) for item in value]
    if isinstance(value, float):
        return _rounded(value)
    return value


def _rounded(value: float) -> float | int | None:
    if not math.isfinite(value):
        return None
    short = float(f"{value:.{_DIGITS}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def _plotly() -> str:
    """The plotting library, as its Python package brings it."""
    return (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


def _has_scene(page: Page) -> bool:
    return any(isinstance(block, Scene) for part in page.sections for block in part.blocks)
