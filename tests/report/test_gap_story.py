"""The picture of a repair: what is drawn before and after."""

from types import SimpleNamespace

import numpy as np
from matplotlib.figure import Figure

from femupdate.report.geometry import Geometry
from femupdate.report.glyphs import sign
from femupdate.report.plot_diagnosis import Columns
from femupdate.report.plot_repair import Curves, GapStory, Scene, gap_story

GRID, FLOORS = np.linspace(1.0, 9.0, 30), ("2F", "3F", "4F", "RF")
MEASURED = np.sin(GRID) * np.ones((4, 1))
GAP = np.array([[0.5], [0.1], [0.3], [0.4]])  # of the model before, per floor
DRAWS = np.random.default_rng(4).normal(1.0, 0.1, (50, 3))


def drawn(*, mended: bool) -> Figure:
    after = MEASURED if mended else None
    scene = Scene(
        FLOORS,
        Columns(np.array([1.0, 3.0, 9.0])),
        np.full((4, 2), 7.0),
        np.full((4, 2), 1.0),
        Geometry.of([[0, 0, 0], [0, 0, 3], [2, 0, 3], [2, 0, 0]], [[0, 1, 2, 3]], []),
        sign("ball", np.zeros(3), 0.2),
        [("RF", 3.0)],
        "added mass",
    )
    held = SimpleNamespace(
        name="second.csv",
        floors=("2F", "RF"),
        time=np.linspace(0.0, 20.0, 200),
        measured=np.ones((2, 200)),
        before=np.zeros((2, 200)),
        after=np.ones((2, 200)),
        error_before=1.0,
        error_after=0.25,
    )
    return gap_story(
        GapStory(
            "The mass of the roof",
            scene if mended else None,
            Curves(GRID, FLOORS, MEASURED, MEASURED + GAP, after),
            ("S1", "S2", "S3"),
            DRAWS,
            DRAWS - 0.2 if mended else None,
            held if mended else None,
        ),
        "matplotlib",
    )


def test_a_repair_from_residuals_to_held_out_data():
    figure = drawn(mended=True)
    before, marked, after, *curves, theta, held = figure.axes[:3] + figure.axes[4:9]
    assert [text.get_text() for text in before.texts] == ["7.0"] * 8
    assert [text.get_text() for text in after.texts] == ["1.0"] * 8
    assert marked.get_title() == "added mass"
    labels = [panel.get_ylabel() for panel in curves]
    assert labels == ["RF, ln|H|", "4F, ln|H|", "2F, ln|H|"], "the three worst, top down"
    for panel, place in zip(curves, (3, 2, 0), strict=True):
        measured, first, second = (one.get_ydata() for one in panel.lines)
        np.testing.assert_allclose(first - measured, GAP[place, 0])
        np.testing.assert_array_equal(second, measured)
    assert curves[-1].get_xlabel() == "Frequency, Hz"
    ends = np.array([segment[:, 0] for segment in theta.collections[0].get_segments()])
    np.testing.assert_allclose(ends, np.quantile(DRAWS, [0.05, 0.95], axis=0).T)
    assert held.get_title(loc="left") == "second.csv, kept out: error 1.00 before, 0.25 after"
    assert held.get_ylabel() == "RF, m/s²"
    assert held.get_xlim()[1] - held.get_xlim()[0] < 6.1, "around the largest acceleration"
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["Measured", "Model before", "Model after"]


def test_where_nothing_was_added():
    figure = drawn(mended=False)
    *curves, theta = figure.axes
    assert [len(panel.lines) for panel in curves] == [2, 2, 2]
    assert len(theta.collections) == 1
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["Measured", "Model before"]


def test_what_is_written_stays_inside_the_picture():
    figure = drawn(mended=True)
    figure.canvas.draw()
    edge = figure.bbox.x1
    written = [*figure.texts, *(panel.xaxis.label for panel in figure.axes)]
    assert all(text.get_window_extent().x1 <= edge for text in written)
    assert any("the upper is before" in text.get_text() for text in figure.texts)
