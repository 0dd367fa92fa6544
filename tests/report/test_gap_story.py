"""The picture of a repair: what is drawn before and after."""

import numpy as np
from matplotlib.figure import Figure

from femupdate.building import load_building
from femupdate.discrepancy.held_out import Held
from femupdate.effects import CATALOGUE, DrawnBuilding, Placed, structure_of
from femupdate.report.curves import Curve
from femupdate.report.plot_diagnosis import ResidualMap
from femupdate.report.plot_repair import gap_story

GRID, FLOORS = np.linspace(1.0, 9.0, 30), ("2F", "3F", "4F", "RF")
MEASURED = np.sin(GRID) * np.ones((4, 1))
GAP = np.array([[0.5], [0.1], [0.3], [0.4]])  # of the model before, per floor
DRAWS = np.random.default_rng(4).normal(1.0, 0.1, (50, 3))


def curve(row: int, *, mended: bool) -> Curve:
    return Curve(
        title=FLOORS[row],
        across="frequency, Hz",
        up=f"{FLOORS[row]}, ln|H|",
        x=GRID,
        mean=MEASURED[row] + GAP[row],
        measured=MEASURED[row],
        beside=MEASURED[row] if mended else None,
    )


def drawn(*, mended: bool) -> Figure:
    edges = np.array([1.0, 3.0, 9.0])
    maps = [ResidualMap(FLOORS, edges, np.full((4, 2), level)) for level in (7.0, 1.0)]
    held = Held(
        name="second.csv",
        compared="FRFs",
        error_before=1.0,
        error_after=0.25,
        own_before=1.0,
        own_after=0.25,
        chi2_before=9.0,
        chi2_after=1.0,
        floors=("2F", "RF"),
        time=np.linspace(0.0, 20.0, 200),
        measured=np.ones((2, 200)),
        before=np.zeros((2, 200)),
        after=np.ones((2, 200)),
    )
    return gap_story(
        maps if mended else maps[:1],
        DrawnBuilding(structure_of(load_building("shear_4dof"))),
        [Placed(CATALOGUE["added_mass"], "3F")] if mended else [],
        [curve(row, mended=mended) for row in reversed(range(4))],
        ("S1", "S2", "S3"),
        [DRAWS, DRAWS - 0.2] if mended else [DRAWS],
        held if mended else None,
        "matplotlib",
    )


def test_a_repair_from_residuals_to_held_out_data():
    figure = drawn(mended=True)
    before, marked, after, *curves, theta, held = figure.axes[:3] + figure.axes[4:9]
    assert [text.get_text() for text in before.texts] == ["7.0"] * 8
    assert [text.get_text() for text in after.texts] == ["1.0"] * 8
    assert marked.get_title() == "Added mass at 3F"
    assert "Added: added mass at 3F" in [text.get_text() for text in figure.texts]
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
    assert figure.texts[0].get_text() == "Nothing was added"


def test_what_is_written_stays_inside_the_picture():
    figure = drawn(mended=True)
    figure.canvas.draw()
    edge = figure.bbox.x1
    written = [*figure.texts, *(panel.xaxis.label for panel in figure.axes)]
    assert all(text.get_window_extent().x1 <= edge for text in written)
    assert any("the upper is before" in text.get_text() for text in figure.texts)
