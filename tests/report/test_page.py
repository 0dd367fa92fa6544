"""The page as a file: escaped, whole, small; histories and meshes thinned without losing peaks."""

import json
import re

import numpy as np
import pytest

from femupdate.report import (
    Geometry,
    Section,
    items_of,
    kept_items,
    page_html,
    scene_content,
    thinned_geometry,
)
from femupdate.report.figure import new_figure
from femupdate.report.page import prose_html
from femupdate.report.plot_measured import thinned
from femupdate.result import Note, Notes, Picture
from femupdate.tables import Table

NASTY = '</script><img src=x onerror=alert(1)> & "quotes" \'n all'


@pytest.fixture
def nasty_page():
    """Every place that a text can come to holds markup."""
    table = Table.of(
        name=NASTY, caption=NASTY, head=(NASTY, "b"), rows=((NASTY, NASTY),), note=NASTY
    )
    picture = Picture(NASTY, lambda: new_figure(1.0, 1.0))
    blocks = (Note(NASTY), Notes((NASTY,), warning=True), table, picture)
    sections = (Section("s", NASTY, blocks),)
    return page_html(sections, title=NASTY, subtitle=NASTY, made=NASTY, credits=(NASTY,))


def test_text_from_files_is_escaped(nasty_page):
    html = nasty_page
    assert "onerror=alert(1)>" not in html
    assert re.findall(r"<img [^s]", html) == []
    assert html.count("<script") == html.count("</script>")


def test_what_the_terminal_alone_shows_is_not_on_the_page():
    parts = (Note("told"), Note("a path", page=False), Note(content={"key": 1.0}), Notes(()))
    html = page_html((Section("s", "", parts),), title="")
    assert "<p>told</p>" in html
    assert "a path" not in html
    assert "<ul" not in html


def test_what_a_result_says_on_the_page_is_kept_as_json():
    table = Table.of(("a", "b"), (("1", "x"),), name="t", caption="c", note="n")
    said = [Note("told"), Notes(("one",), warning=True), table]
    kept = json.loads(json.dumps(kept_items([*said, Note("a path", page=False), Notes(())])))
    first, page = (
        page_html((Section("s", "", tuple(of)),), title="") for of in (said, items_of(kept))
    )
    assert page == first


def test_a_sentence_is_escaped_before_anything_in_it_is_marked_up():
    told = prose_html("`a <b>` is 3% +- 0.5% off; 100 %")
    assert told == "<code>a &lt;b&gt;</code> is 3\u00a0% ± 0.5\u00a0% off; 100\u00a0%"


def test_a_page_needs_nothing_else(nasty_page):
    assert re.findall(r"(?:src|href)=[\"'](?!#|data:image/png)", nasty_page) == []
    assert "default-src 'none'" in nasty_page
    assert ".scene .note { display: none; }" in nasty_page  # paper cannot be turned


def test_thinning_keeps_every_peak():
    time = np.arange(20_000)
    values = np.sin(0.01 * time) * np.exp(-(((time - 9000) / 4000) ** 2))
    values[1234], values[15_000] = -3.0, 2.5
    kept = thinned(values, 500)
    assert len(kept) <= 502
    assert (np.diff(kept) > 0).all()
    assert {0, 1234, 15_000, 19_999} <= set(kept.tolist())
    assert thinned(values[:400], 500).tolist() == list(range(400))


def grid(count):
    """A flat square of `count` by `count` shells with a beam along one side."""
    x, y = np.meshgrid(np.linspace(0, 10, count + 1), np.linspace(0, 10, count + 1))
    nodes = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    shells = np.column_stack([first, first + 1, first + count + 2, first + count + 1])
    line = np.arange(count)
    return Geometry.of(nodes, shells, np.column_stack([line, line + 1]))


def test_a_mesh_is_thinned_to_what_a_screen_can_draw():
    full = grid(60)
    thin, nodes, faces, lines = thinned_geometry(full, 900)
    assert 200 < len(faces) + len(lines) <= 900
    assert np.array_equal(thin.nodes, full.nodes[nodes])
    low, high = thin.nodes.min(axis=0), thin.nodes.max(axis=0)
    assert np.abs(low).max() < 1.0
    assert np.abs(high[:2] - 10.0).max() < 1.0
    same, _, faces, _ = thinned_geometry(full, 10_000)
    assert len(faces) == 3600
    assert np.array_equal(same.shells, full.shells)


def test_a_scene_colours_elements_by_their_own_values():
    full = grid(4)
    values = np.arange(16.0)
    colours = {"name": "factor", "unit": "", "map": "factor"}
    field = {**colours, "faces": values, "lines": np.full(4, np.nan)}
    content = scene_content(thinned_geometry(full), [field], [], [], [("base", 0.0)])
    (own,) = content["fields"]
    assert (own["low"], own["high"]) == (0.0, 15.0)
    assert own["faces"].tolist() == values.tolist()
    assert len(content["nodes"]) == 3 * 25
    assert all(len(color) == 3 for color in content["maps"]["factor"])
