"""The page: sections of what results tell and draw, and a model that turns, in one HTML file.

Everything is inside the file: data, styles, scripts and pictures. All text is escaped.
"""

import json
import math
import re
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.errors import ReportError
from femupdate.report.geometry import (
    MAGNITUDE_MAP,
    SPREAD_MAP,
    Geometry,
    Glyphs,
    at_levels,
    outline,
)
from femupdate.result import Item, Note, Notes, Picture
from femupdate.study import write_text
from femupdate.tables import Table

BUDGET = 8_000_000  # bytes: what mail servers and phones still take
DOTS = 110  # of a figure's inch on the page
_PNG, _JPEG = b"\x89PNG", b"\xff\xd8\xff"


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A model that turns and moves; `content` is what `scene.js` draws, see `scene_content`."""

    caption: str
    content: Mapping[str, Any]
    note: str = ""


@dataclass(frozen=True)
class Image:
    """A picture that is drawn already, a PNG or JPEG file; so many dots make one on the page."""

    path: Path
    density: float = 1.0

    @classmethod
    def of(cls, path: Path) -> "Image":
        """Such a file.

        Raises:
            ReportError: it is none.
        """
        if not path.is_file() or not path.read_bytes()[:8].startswith((_PNG, _JPEG)):
            raise ReportError(f"{path} is no picture; give a PNG or JPEG file")
        return cls(path)

    @property
    def name(self) -> str:
        """Of the file, without ending."""
        return self.path.stem


Block = Item | Picture | Image | Scene


@dataclass(frozen=True)
class Section:
    """A part of the page that collapses, by its anchor; without blocks it is left out."""

    name: str
    title: str
    blocks: tuple[Block, ...]


def page_html(
    sections: Sequence[Section],
    *,
    title: str,
    subtitle: str = "",
    made: str = "",
    credits: Sequence[str] = (),
    logo: Image | None = None,
) -> str:
    """Return the page as one HTML text that needs nothing else.

    Args:
        made: when and by what.
        credits: for whom and by whom.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    assets = files("femupdate.report") / "assets"
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["data"] = lambda value: Markup(data_json(value))
    environment.filters["css"] = lambda text: Markup(css_text(text))
    environment.filters["drawn"] = _picture_data
    environment.filters["prose"] = lambda text: Markup(prose_html(text))
    template = environment.from_string((assets / "page.html").read_text(encoding="utf-8"))

    def asset(name: str) -> Markup:
        return Markup((assets / name).read_text(encoding="utf-8"))

    shown = [
        (part, [(type(block).__name__.lower(), block) for block in part.blocks if _shows(block)])
        for part in sections
    ]
    head = {"title": title, "subtitle": subtitle, "made": made, "credits": credits, "logo": logo}
    return template.render(
        page=head,
        sections=[(part, blocks) for part, blocks in shown if blocks],
        asset=asset,
        scene=any(kind == "scene" for _, blocks in shown for kind, _ in blocks),
    )


_KINDS: dict[str, Callable[..., Item]] = {"note": Note, "notes": Notes, "table": Table.of}


def kept_items(items: Iterable[Item]) -> list[dict[str, Any]]:
    """What the page shows of a result, as JSON keeps it."""
    kept: list[dict[str, Any]] = []
    for item in filter(_shows, items):
        if isinstance(item, Table):
            told = {key: getattr(item, key) for key in ("head", "rows", "name", "caption", "note")}
            kept.append({"table": told})
        elif isinstance(item, Notes):
            kept.append({"notes": {"sentences": item.sentences, "warning": item.warning}})
        else:
            kept.append({"note": {"text": item.text}})
    return kept


def items_of(kept: Iterable[Mapping[str, Any]]) -> Iterator[Item]:
    """What `kept_items` gave."""
    return (_KINDS[kind](**told) for each in kept for kind, told in each.items())


def _shows(block: Block) -> bool:
    """Whether a block has anything for people."""
    if isinstance(block, Note):
        return block.page and bool(block.text)
    if isinstance(block, Notes):
        return bool(block.sentences)
    return not isinstance(block, Table) or bool(block.rows)


def _picture_data(picture: Picture | Image) -> str:
    """A picture as the address of its own content."""
    if isinstance(picture, Image):
        content = picture.path.read_bytes()
        kind = "png" if content.startswith(_PNG) else "jpeg"
    else:
        from femupdate.report.figure import styled

        drawn = BytesIO()
        styled(picture.figure().savefig)(drawn, format="png", dpi=DOTS)
        content, kind = drawn.getvalue(), "png"
    return f"data:image/{kind};base64,{b64encode(content).decode()}"


def added_section(path: Path, name: str) -> Section:
    """A section of the reader's own: a picture, or text whose paragraphs blank lines divide.

    A first line that begins with "# " is its title, which is else the name of the file.

    Raises:
        ReportError: the file is neither.
    """
    title = path.stem.replace("_", " ")
    head = path.read_bytes()[:8]
    if head.startswith((_PNG, _JPEG)):
        return Section(name, title, (Image(path),))
    if path.suffix.lower() not in (".md", ".txt"):
        raise ReportError(
            f"{path} cannot stand on the page; give pictures as PNG or JPEG and text as .md or .txt"
        )
    parts = path.read_text(encoding="utf-8").strip().split("\n\n")
    if parts[0].startswith("# "):
        title, _, parts[0] = parts[0][2:].partition("\n")
    blocks: list[Block] = []
    for part in parts:
        lines = [line.strip() for line in part.replace("**", "").splitlines()]
        listed = all(line.startswith(("- ", "* ")) for line in lines)
        told = Notes(tuple(line[2:] for line in lines))
        blocks.append(told if listed else Note(" ".join(lines).lstrip("# ")))
    return Section(name, title, tuple(blocks))


def css_text(text: str) -> str:
    """A text as a string of a style sheet, whatever is in it."""
    return '"' + re.sub(r"[^\w .,()-]", lambda sign: f"\\{ord(sign[0]):x} ", text) + '"'


def prose_html(text: str) -> str:
    """A sentence, escaped, with what stands between backticks as code, and signs as in print."""
    from markupsafe import escape

    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    for typed, printed in ((" +- ", " ± "), (" -&gt; ", " → ")):
        escaped = escaped.replace(typed, printed)
    return re.sub(r"(\d) ?%", "\\1\u00a0%", escaped)


def write_page(path: Path, sections: Sequence[Section], **head: Any) -> Path:
    """Write the page, with a head as for `page_html`, whole or not at all.

    Raises:
        ReportError: the name does not end in .html, or the page is larger than `BUDGET`.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise ReportError(f"{path} is not the name of a page; let it end in .html")
    text = page_html(sections, **head)
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
    if not isinstance(value, float):
        return value
    if not math.isfinite(value):
        return None
    short = float(f"{value:.5g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


MOST_FACES = 6000  # that a phone's processor sorts and draws ten times a second
_MAPS = {"magnitude": MAGNITUDE_MAP, "spread": SPREAD_MAP, "factor": "cividis"}


def thinned_geometry(
    geometry: Geometry, most: int = MOST_FACES
) -> tuple[Geometry, Integers, Integers, Integers]:
    """A geometry of at most about `most` faces and lines; which nodes, faces and lines it keeps.

    Nodes that lie in one cube of a grid become one node, that nearest to their middle; what then
    has no length or area is left out, and of faces between the same nodes one is kept.
    """
    size, cells = geometry.size, 0
    groups = np.arange(len(geometry.nodes))
    while True:
        faces, lines = _kept(geometry, groups)
        if len(faces) + len(lines) <= most:
            break
        cells = int(0.75 * cells) if cells else 160
        groups = _clustered(geometry.nodes, size / cells)
    shells, beams = groups[geometry.shells[faces]], groups[geometry.beams[lines]]
    nodes, place = np.unique(np.concatenate([shells.ravel(), beams.ravel()]), return_inverse=True)
    numbers = place.reshape(-1)
    thinned = Geometry.of(
        geometry.nodes[nodes],
        numbers[: shells.size].reshape(-1, 4),
        numbers[shells.size :].reshape(-1, 2),
    )
    return thinned, nodes, faces, lines


def _clustered(nodes: Floats, side: float) -> Integers:
    """For every node the node (N,) that stands for its cube."""
    cube = np.floor((nodes - nodes.min(axis=0)) / side).astype(np.int64)
    _, group = np.unique(cube, axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    middle = np.column_stack([np.bincount(group, nodes[:, k]) / count for k in range(3)])
    order = np.argsort(np.linalg.norm(nodes - middle[group], axis=1), kind="stable")
    first = np.full(len(count), -1)
    first[group[order][::-1]] = order[::-1]
    return np.asarray(first[group])


def _kept(geometry: Geometry, groups: Integers) -> tuple[Integers, Integers]:
    """Faces with three or more different corners and lines with two, each once."""
    kept = []
    for pieces, least in ((geometry.shells, 2), (geometry.beams, 1)):
        rows = np.sort(groups[pieces], axis=1)
        chosen = np.flatnonzero((np.diff(rows, axis=1) != 0).sum(axis=1) >= least)
        _, first = np.unique(rows[chosen], axis=0, return_index=True)
        kept.append(np.asarray(chosen[np.sort(first)]))
    return kept[0], kept[1]


def scene_content(
    thinned: tuple[Geometry, Integers, Integers, Integers],
    fields: Sequence[Mapping[str, Any]],
    modes: Sequence[tuple[str, Floats, Floats]],
    signs: Sequence[tuple[Glyphs, bool]],
    floors: Sequence[tuple[str, float]],
) -> dict[str, Any]:
    """Return what `scene.js` draws.

    Args:
        thinned: the building, see `thinned_geometry`.
        fields: name, unit and colour map of what colours elements, with its values at all faces
            and lines of the full geometry, NaN where there is none.
        modes: name, displacements (N, 3) of the full geometry's nodes, of any scale, and standard
            deviations (N,) of these, % of the largest.
        signs: glyphs, and whether they are of an effect (else of sensors).
        floors: name and height, m.
    """
    from matplotlib import colormaps

    geometry, nodes, faces, lines = thinned
    low, high = geometry.nodes.min(axis=0), geometry.nodes.max(axis=0)
    plan = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    colored, moving = [], []
    for field in fields:
        of_faces, of_lines = field["faces"][faces], field["lines"][lines]
        known = np.concatenate([of_faces, of_lines])
        known = known[np.isfinite(known)]
        span = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        values = {"faces": of_faces, "lines": of_lines, "low": span[0], "high": span[1]}
        colored.append({**field, **values})
    for name, shape, spread in modes:
        largest = np.linalg.norm(shape, axis=1).max() or 1.0
        moved = (shape[nodes] / largest).round(4).ravel()
        moving.append({"name": name, "shape": moved, "spread": spread[nodes].round(2)})
    return {
        "nodes": geometry.nodes.round(3).ravel(),
        "faces": geometry.shells.ravel(),
        "lines": geometry.beams.ravel(),
        "edges": outline(geometry).ravel(),
        "size": geometry.size,
        "span": float(np.hypot(*(high - low)[:2])) or geometry.size,
        "height": float(high[2] - low[2]) or geometry.size,
        "centre": 0.5 * (low + high),
        "fields": colored,
        "modes": moving,
        "signs": [
            {
                "effect": effect,
                "faces": [np.asarray(face).round(3).ravel() for face in glyphs.faces],
                "lines": [np.asarray(line).round(3).ravel() for line in glyphs.lines],
                "balls": [
                    [*np.asarray(centre).round(3), float(radius)] for centre, radius in glyphs.balls
                ],
            }
            for glyphs, effect in signs
        ],
        "labels": [
            {"text": name, "places": [[*corner, float(height)] for corner in plan]}
            for name, height in at_levels(floors, geometry.size)
        ],
        # Red, green and blue, 0 to 255, at even steps of every colour map.
        "maps": {
            name: (255 * colormaps[used](np.linspace(0.0, 1.0, 9))[:, :3])
            .round()
            .astype(int)
            .tolist()
            for name, used in _MAPS.items()
        },
    }
