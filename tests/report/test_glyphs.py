"""Signs on a building: what they are made of, and that an unknown one is refused."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from femupdate.effects import Glyph
from femupdate.errors import ReportError
from femupdate.report import Geometry, Glyphs, drawn
from femupdate.report.scenes import draw_marked

LOW, HIGH = np.zeros(3), np.array([0.0, 0.0, 2.0])


def sign(kind, *arguments):
    return drawn([Glyph.of(kind, *arguments)])


def test_an_unknown_sign_is_refused():
    with pytest.raises(ReportError, match=r"no sign is named 'hook' .*ball, arrow, spring"):
        sign("hook", LOW, HIGH)


@pytest.mark.parametrize("kind", ["arrow", "spring", "dashpot"])
def test_signs_between_two_points_touch_both(kind):
    points = np.concatenate(sign(kind, LOW, HIGH).lines)
    assert points[:, 2].min() == 0.0
    assert points[:, 2].max() == 2.0
    assert np.ptp(points[:, :2]) > 0.1, "they are no plain line"


def test_a_ball_and_surfaces():
    ((centre, radius),) = sign("ball", HIGH, 0.3).balls
    assert (centre.tolist(), radius) == ([0.0, 0.0, 2.0], 0.3)
    wall = np.ones((4, 3))
    assert sign("surfaces", [wall]).faces == (wall,)


def test_a_marked_building_shows_signs_and_floors():
    geometry = Geometry.of([[0, 0, 0], [0, 0, 3], [2, 0, 3], [2, 0, 0]], [[0, 1, 2, 3]], [[0, 1]])
    panel = Figure().subplots()
    wall = sign("surfaces", [np.ones((4, 3))])
    signs = sign("ball", HIGH, 0.1) + sign("spring", LOW, HIGH) + wall
    draw_marked(panel, geometry, signs, [("RF", 3.0)])
    shells, edges, faces, lines, balls, _ = panel.collections
    parts = [len(one.get_paths()) for one in (shells, faces, lines, balls)]
    assert parts == [1, 1, 1, 1]
    assert len(edges.get_segments()) == 4, "the beam lies on an edge of the shell"
    assert [text.get_text() for text in panel.texts] == ["RF", *"xyz"]
    assert signs == signs + Glyphs()
