"""What the figures draw, read from the figures themselves before they are saved."""

import subprocess
import sys
from itertools import combinations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from scipy.stats import norm

from femupdate.measurement import Observation
from femupdate.report import (
    frf_fit,
    plus_minus,
    posterior_pairs,
    stick_mode_shapes,
    theta_intervals,
)
from femupdate.report.curves import history_curves, response_curves, spectrum_curves
from femupdate.report.plot_curves import (
    floor_history_bands,
    floor_spectra_bands,
    member_force_bands,
    story_shear_drift,
    strong_part,
)
from femupdate.report.plot_diagnosis import ResidualMap, ranking, residual_map
from femupdate.report.plot_posterior import density_1d, density_2d, mass_level
from femupdate.report.scale import force_scale, length_scale

FLOORS = ("2F", "3F", "4F", "5F", "6F", "RF")
RNG = np.random.default_rng(11)
FREQUENCY = 0.05 * np.arange(1, 1025)
TIME = 0.005 * np.arange(4000)


def log_frf(floors: int = 6) -> np.ndarray:
    place = np.linspace(3.0, 40.0, 5)
    width = 0.5 + np.arange(floors)[:, None, None]
    peaks = (width / (1.0 + (FREQUENCY - place[:, None]) ** 2)).sum(axis=1)
    return np.log(peaks + 0.01)


def prediction(floors: int = 6) -> np.ndarray:
    """Draws whose 5 and 95 % lie .2 below the mean and .2 above it."""
    return log_frf(floors) + np.linspace(-0.2, 0.2, 19)[:, None, None] / 0.9


def observation(floors: int = 6) -> Observation:
    values = log_frf(floors) + 0.1 * RNG.normal(size=(floors, 1024))
    values[2:3] = np.nan
    valid = np.isfinite(values)
    valid[:, :30] = False
    noise = 0.1 + np.exp(-FREQUENCY) + np.zeros((floors, 1))
    return Observation(FREQUENCY, FLOORS[-floors:], values, noise, valid)


def unseen(floors: int) -> Observation:
    nothing = np.full((floors, 1024), np.nan)
    return Observation(FREQUENCY, FLOORS[-floors:], nothing, nothing, np.isfinite(nothing))


def samples(parameters: int, spread: float, count: int = 600) -> np.ndarray:
    mix = np.eye(parameters) + 0.4 * RNG.normal(size=(parameters, parameters))
    return np.clip(1.0 + spread * RNG.normal(size=(count, parameters)) @ mix, 0.34, 2.9)


def cases(parameters: int, count: int = 2) -> dict[str, np.ndarray]:
    spreads = {"Case 1: all floors": 0.03, "Case 2: roof alone": 0.3}
    return {name: samples(parameters, sd) for name, sd in list(spreads.items())[:count]}


def bounds(parameters: int) -> np.ndarray:
    return np.tile([1.0 / 3.0, 3.0], (parameters, 1))


def names(parameters: int) -> list[str]:
    return [rf"$\theta_{i + 1}$" for i in range(parameters)]


def motion(rows: int = 6) -> np.ndarray:
    strength = np.exp(-(((TIME - 6.0) / 2.0) ** 2))
    return (
        strength
        * np.sin(30.0 * TIME + RNG.normal(size=(rows, 1)))
        * np.arange(1, rows + 1)[:, None]
    )


def bands(**more: object) -> Figure:
    sd = 0.1 * np.abs(motion()) + 0.01
    return floor_history_bands(history_curves(TIME, FLOORS, motion(), sd, **more))


def shear_drift(stories: int, count: int) -> Figure:
    drift = 1e-4 * RNG.normal(size=(count, stories, 700))
    stiffness = 3e8 * (1.0 + 0.05 * RNG.normal(size=(count, stories)))
    return story_shear_drift(drift * stiffness[..., None], drift, stiffness, "123456"[:stories])


def test_the_band_of_the_parameters_lies_inside_the_other() -> None:
    values = motion()
    both = (values, 0.4 + 0.0 * values), (values, 0.1 + 0.0 * values)
    figure = floor_history_bands(history_curves(TIME, FLOORS, *both[0], alone=both[1]))
    wide, narrow = (
        np.ptp(one.get_paths()[0].vertices[:, 1]) for one in figure.axes[1].collections[:2]
    )
    assert wide - narrow == pytest.approx(4.0 * 0.3)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["Predicted, mean", "Predicted, mean ± 2 sd", "Of the parameters alone"]


def spectra() -> Figure:
    grid = np.geomspace(0.2, 20.0, 40)
    mean = np.arange(1.0, 3.0)[:, None] * np.ones(40)
    return floor_spectra_bands(
        spectrum_curves(grid, ("2F", "RF"), mean, 0.1 * mean, np.full(40, 0.5))
    )


def member_forces() -> Figure:
    rows = np.array([[30.0], [200.0], [9.0]]) * np.sin(20.0 * TIME) * np.exp(-((TIME - 9.0) ** 2))
    curves = history_curves(TIME, ("N", "V", "M"), rows, 0.1 * np.abs(rows))
    return member_force_bands([("wall X2:S1", curves)], title="Forces")


def one_stick(heading: str = "Mode 1", sd: np.ndarray | None = None) -> Figure:
    heights, shape = np.array([0.0, 3.0]), np.array([[0.0, -2.0]])
    return stick_mode_shapes(heights, shape, [heading], ("base", "RF"), shapes_sd=sd)


EDGES = np.geomspace(0.5, 20.0, 6)
MISFIT = np.linspace(0.3, 40.0, 30).reshape(6, 5)
RANKED = [("soft story in S2", 80.0, "0.30 ± 0.02", True), ("mass", -1.0, "", False)]


def gappy_motion() -> np.ndarray:
    measured = motion() * 1.1
    measured[3] = np.nan
    return measured


FIGURES = {
    "frf": lambda: frf_fit(response_curves(prediction(), observation())),
    "frf with errors": lambda: frf_fit(
        response_curves(prediction(), observation(), (log_frf() - 0.5, log_frf() + 0.5))
    ),
    "frf roof alone": lambda: frf_fit(response_curves(prediction(1), unseen(1))),
    **{
        f"pairs {p}": lambda p=p: posterior_pairs(cases(p), names(p), bounds(p), np.ones(p))
        for p in (1, 7)
    },
    "pairs of one case": lambda: posterior_pairs(cases(4, 1), names(4), bounds(4)),
    "sharp pairs": lambda: posterior_pairs(
        {"sharp": samples(5, 2e-4) + np.linspace(-0.3, 0.3, 5)}, names(5), bounds(5)
    ),
    "pairs with a constant": lambda: posterior_pairs(
        {"fixed": np.hstack([samples(2, 0.1), np.ones((600, 1))])}, names(3), bounds(3)
    ),
    "intervals": lambda: theta_intervals(names(6), cases(6), bounds(6)),
    "history": lambda: bands(measured=gappy_motion()),
    "history of parameters": lambda: bands(alone=(motion(), 0.05 * np.abs(motion()))),
    "shear drift 6": lambda: shear_drift(6, 100),
    "shear drift 1": lambda: shear_drift(1, 5),
    "sticks": lambda: stick_mode_shapes(
        np.arange(5) * 3.0,
        np.hstack([np.zeros((4, 1)), RNG.normal(size=(4, 4))]),
        ["Mode 1", "Mode 2\n3.4 Hz", "Mode 3 (X)\n5.1 Hz\n12.3 % of the mass", "Mode 4"],
        ("base", "2F", "3F", "4F", "RF"),
        shapes_sd=np.full((4, 5), 0.03),
    ),
    "one stick": lambda: one_stick(),
    "spectra": lambda: spectra(),
    "members": lambda: member_forces(),
    "residual map": lambda: residual_map(
        [
            ("before", ResidualMap(FLOORS, EDGES, MISFIT)),
            ("after", ResidualMap(FLOORS, EDGES, MISFIT / 9)),
        ]
    ),
    "ranking": lambda: ranking(RANKED, 4.6, "The verdict in one sentence."),
}


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_covers_anything(name):
    figure = FIGURES[name]()
    figure.canvas.draw()
    assert_legends_cover_nothing(figure)
    assert_no_tick_labels_overlap(figure)
    assert_texts_inside(figure)


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def titles(figure: Figure) -> list[str]:
    return [panel.get_title(loc="left") for panel in figure.axes if panel.get_visible()]


def line(panel: Axes, label: str) -> np.ndarray:
    """The points (n, 2) of the line with this label."""
    return next(one for one in panel.lines if one.get_label() == label).get_xydata()


def edges_of(panel: Axes, label: str) -> tuple[float, float]:
    """Lowest and highest value of the band with this label."""
    band = next(one for one in panel.collections if one.get_label() == label)
    values = band.get_paths()[0].vertices[:, 1]
    return values.min(), values.max()


def test_frequency_responses_with_what_was_measured():
    data = observation()
    figure = frf_fit(response_curves(prediction(), data))
    assert titles(figure) == list(reversed(FLOORS))
    roof, bottom = figure.axes[0], figure.axes[5]
    np.testing.assert_allclose(line(roof, "Predicted, mean")[:, 1], np.exp(log_frf()[5]))
    low, high = edges_of(roof, "Predicted, 5 to 95 %")
    assert low == pytest.approx(np.exp(log_frf()[5].min() - 0.2))
    assert high == pytest.approx(np.exp(log_frf()[5].max() + 0.2))
    used, left_out = line(roof, "Measured")[:, 1], line(roof, "Measured, left out")[:, 1]
    np.testing.assert_allclose(used[30:], np.exp(data.log_frf[5, 30:]))
    np.testing.assert_allclose(left_out[:30], np.exp(data.log_frf[5, :30]))
    assert np.isnan(used[:30]).all()
    assert np.isnan(left_out[30:]).all()
    assert roof.get_yscale() == "log"
    assert (bottom.get_xlabel(), figure.axes[4].get_ylabel()) == ("Frequency, Hz", "|H|")
    assert figure.axes[3].get_title(loc="right") == "not measured"
    assert len(figure.axes[3].lines) == 1
    assert legend(figure) == [
        "Predicted, mean",
        "Predicted, 5 to 95 %",
        "Measured",
        "Measured, ±2 sd of its noise",
        "Measured, left out",
    ]
    assert legend(frf_fit(response_curves(prediction(1), unseen(1)))) == legend(figure)[:2]


def test_pairs_of_parameters():
    both = cases(3)
    figure = posterior_pairs(both, names(3), bounds(3), [1.0, 1.1, 1.2])
    panels = np.array(figure.axes).reshape(3, 3)
    assert [panel.get_xlabel() for panel in panels[2]] == names(3)
    assert [panel.get_ylabel() for panel in panels[:, 0]] == ["", *names(3)[1:]]
    for row in range(3):
        assert line(panels[row, row], "Truth")[0, 0] == 1.0 + 0.1 * row
        for text, draws in zip(panels[row, row].texts, both.values(), strict=True):
            mean = float(text.get_text().split(" ± ")[0])
            assert mean == pytest.approx(draws[:, row].mean(), abs=0.05)
    for text, draws in zip(panels[0, 2].texts, both.values(), strict=True):
        shown = float(text.get_text().replace("\u2212", "-"))
        assert shown == pytest.approx(np.corrcoef(draws[:, [0, 2]].T)[0, 1], abs=0.0051)
    points = panels[2, 0].lines[0].get_xydata()
    np.testing.assert_array_equal(points, next(iter(both.values()))[::2, [0, 2]])
    assert legend(figure) == ["Case 1: all floors", "Case 2: roof alone", "Truth"]


def test_intervals_of_stiffness_factors():
    both = cases(2)
    figure = theta_intervals(names(2), both, bounds(2))
    panel = figure.axes[0]
    assert [text.get_text() for text in panel.get_yticklabels()] == names(2)
    assert panel.get_xlabel() == "Stiffness over that in the building file"
    prior = panel.patches
    assert [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in prior] == [
        pytest.approx((1 / 3, 3.0))
    ] * 2
    for drawn, given in zip(panel.collections, both.values(), strict=True):
        ends = np.array([segment[:, 0] for segment in drawn.get_segments()])
        np.testing.assert_allclose(ends, np.quantile(given, [0.05, 0.95], axis=0).T)
    for row, text in enumerate(panel.texts[:2]):
        mean = both["Case 1: all floors"][:, row].mean()
        assert float(text.get_text().split()[0]) == pytest.approx(mean, abs=0.01)
    assert legend(figure) == [
        "Case 1: all floors: mean, 5 to 95 %",
        "Case 2: roof alone: mean, 5 to 95 %",
        "Prior",
    ]


def test_histories_and_the_strong_part():
    measured = gappy_motion()
    figure = bands(measured=measured)
    whole, zoomed = figure.axes[:2]
    assert whole.get_xlim() == (TIME[0], TIME[-1])
    start, end = zoomed.get_xlim()
    assert TIME[0] < start < 6.0 < end < TIME[-1]
    assert zoomed.get_title(loc="left") == f"{start:.1f} to {end:.1f} s"
    np.testing.assert_array_equal(whole.lines[1].get_ydata(), measured[5])
    assert len(figure.axes[5].lines) == 1, "no sensor on 4F"
    assert (whole.get_ylabel(), figure.axes[-1].get_xlabel()) == ("m/s²", "Time, s")
    assert legend(figure) == ["Predicted, mean", "Predicted, mean ± 2 sd", "Measured"]
    assert legend(bands()) == legend(figure)[:2]


def test_shear_and_drift_in_units_that_suit():
    drift = np.linspace(-2e-3, 2e-3, 50) * np.ones((4, 2, 1))
    stiffness = np.array([[2.9e8, 3e8], [3.1e8, 3e8]])
    figure = story_shear_drift(3e8 * drift, drift, stiffness, ["S1", "S2"])
    upper, lower = figure.axes[:2]
    assert lower.get_xlabel() == "Drift, mm"
    assert upper.get_ylabel() == "Shear, kN"
    curve = upper.collections[0].get_segments()[0]
    np.testing.assert_allclose(curve[[0, -1]], [[-2.0, -600.0], [2.0, 600.0]])
    assert upper.texts[0].get_text() == "300.0 kN/mm\n[300.0, 300.0]"
    assert lower.texts[0].get_text() == "300 kN/mm\n[291, 309]"
    assert upper.lines[0].get_slope() == pytest.approx(300.0)
    assert legend(figure) == ["4 posterior samples", "Mean stiffness [5, 95 %]"]
    assert legend(shear_drift(2, 1))[0] == "1 posterior sample"


def test_sticks_turn_their_top_to_the_right():
    sd = np.array([[0.0, 0.1]])
    figure = one_stick("Mode 1\n1.25 Hz", sd)
    panel = figure.axes[0]
    np.testing.assert_allclose(line(panel, "Posterior mean"), [[0.0, 0.0], [1.0, 3.0]])
    assert panel.get_title(loc="left") == "Mode 1\n1.25 Hz"
    band = panel.collections[0].get_paths()[0].vertices[:, 0]
    assert (band.min(), band.max()) == pytest.approx((0.0, 1.1))
    assert [text.get_text() for text in panel.get_yticklabels()] == ["base", "RF"]
    assert legend(figure) == ["Posterior mean", "± 2 sd", "At rest"]
    assert legend(one_stick()) == ["Shape", "At rest"]


def test_residuals_over_the_noise():
    grid = np.array([[0.5, 12.3], [np.nan, 2.0]])
    one = ResidualMap(("2F", "RF"), np.array([1.0, 4.0, 9.0]), grid)
    figure = residual_map([("model as it is", one)])
    panel = figure.axes[0]
    assert [text.get_text() for text in panel.texts] == ["0.5", "12", "2.0"]
    np.testing.assert_allclose([text.get_position()[0] for text in panel.texts], [2.0, 6.0, 6.0])
    assert panel.collections[0].norm.vmax == 12.3
    assert figure.axes[1].get_ylabel() == "Residual over noise, rms"
    assert [text.get_text() for text in panel.get_yticklabels()] == ["2F", "RF"]


def test_the_ranking_puts_the_strongest_on_top():
    panel = ranking(RANKED, 4.6, "Verdict.").axes[0]
    assert [text.get_text() for text in panel.get_yticklabels()] == ["mass", "soft story in S2"]
    assert [bar.get_width() for bar in panel.patches] == pytest.approx(np.arcsinh([-0.5, 40.0]))
    assert [text.get_text() for text in panel.texts] == ["-1", "80   0.30 ± 0.02"]
    assert panel.patches[0].get_facecolor() != panel.patches[1].get_facecolor()


def assert_legends_cover_nothing(figure: Figure) -> None:
    for legend in figure.legends:
        box = legend.get_window_extent()
        for panel in filter(Axes.get_visible, figure.axes):
            assert not box.overlaps(panel.get_tightbbox()), "the legend covers a panel"
        for text in figure.texts:
            assert not box.overlaps(text.get_window_extent()), "the legend covers the title"


def assert_no_tick_labels_overlap(figure: Figure) -> None:
    for panel in figure.axes:
        assert not panel.xaxis.get_offset_text().get_text()  # +1.1 beside the figures
        for labels in drawn_tick_labels(panel) if panel.get_visible() else ():
            for first, second in combinations([t.get_window_extent() for t in labels], 2):
                assert not first.overlaps(second)


def drawn_tick_labels(panel: Axes) -> list[list[Text]]:
    """Matplotlib keeps labels of ticks beyond the view, and hidden ones, but does not draw them."""
    drawn = []
    for axis in (panel.xaxis, panel.yaxis):
        low, high = sorted(axis.get_view_interval())
        drawn.append(
            [
                tick.label1
                for tick in axis.get_major_ticks()
                if low <= tick.get_loc() <= high
                and tick.label1.get_visible()
                and axis.get_visible()
            ]
        )
    return drawn


def assert_texts_inside(figure: Figure) -> None:
    page = figure.bbox.padded(1.0)
    texts = [*figure.texts, *(t for legend in figure.legends for t in legend.get_texts())]
    for panel in figure.axes:
        if panel.get_visible() and panel.axison:
            texts += [*panel.texts, panel.title, panel._left_title, panel.xaxis.label]
            texts += [
                panel.yaxis.label,
                *(t for labels in drawn_tick_labels(panel) for t in labels),
            ]
    for text in texts:
        box = text.get_window_extent()
        inside = page.x0 <= box.x0 and box.x1 <= page.x1
        inside = inside and page.y0 <= box.y0 and box.y1 <= page.y1
        assert inside or not text.get_text(), f"{text.get_text()!r} leaves the page"


def test_drawing_needs_no_pyplot_and_importing_no_vtk():
    code = (
        "import sys, femupdate.report.scenes, femupdate.report.curves;"
        "import femupdate.report.plot_curves, femupdate.report.plot_building;"
        "import femupdate.report.plot_posterior;"
        "found = {'matplotlib.pyplot', 'pyvista', 'torch'} & set(sys.modules);"
        "sys.exit(', '.join(found) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()


def test_strong_part_is_found():
    start, end = strong_part(TIME, motion()[0])  # 4.77 Hz, strongest at 6 s
    assert (start + end) / 2.0 == pytest.approx(6.0, abs=0.2)
    assert end - start == pytest.approx(0.12 * TIME[-1], rel=0.01), "the whole share: few cycles"
    fast = np.exp(-((TIME - 6.0) ** 2)) * np.sin(2.0 * np.pi * 25.0 * TIME)
    start, end = strong_part(TIME, fast)
    assert end - start == pytest.approx(20 / 25.0, rel=0.05), "twenty cycles"
    assert strong_part(TIME, np.zeros_like(TIME))[0] == 0.0


NORMAL = np.random.default_rng(2).normal(size=(2, 40000))


def test_density_is_that_of_the_normal_distribution():
    centres, density = density_1d(NORMAL[0], (-5.0, 5.0))
    exact = norm.pdf(centres) * (centres[1] - centres[0])
    assert np.abs(density - exact).max() < 0.03 * exact.max()  # 40,000 samples, smoothed


def test_separate_modes_are_not_smeared():
    """Two narrow modes far apart: the higher is as high as its own normal, within a tenth."""
    rng = np.random.default_rng(3)
    samples = np.concatenate([rng.normal(1.0, 0.02, 6000), rng.normal(2.5, 0.02, 4000)])
    centres, density = density_1d(samples, (0.9, 2.6))
    cell = centres[1] - centres[0]
    assert density.max() == pytest.approx(0.6 * norm.pdf(0.0, scale=0.02) * cell, rel=0.1)


def test_contours_hold_their_share_of_samples():
    x, y = NORMAL[0], 0.5 * NORMAL[0] + 2.0 * NORMAL[1]
    *centres, density = density_2d(x, y, (-5.0, 5.0), (-9.0, 9.0))
    cell = tuple(
        np.clip(np.searchsorted(axis, values), 0, 79)
        for axis, values in zip(centres[::-1], (y, x), strict=True)
    )
    for share in (0.5, 0.9):
        inside = density[cell] >= mass_level(density, share)
        assert inside.mean() == pytest.approx(share, abs=0.03)  # cells and smoothing


@pytest.mark.parametrize(
    ("values", "unit"),
    [([3.0, -900.0], "N"), ([0.0], "N"), ([-2.5e5], "kN"), ([3e6], "kN"), ([6e6, 1.0], "MN")],
)
def test_force_unit(values, unit):
    assert force_scale(values).unit == unit


@pytest.mark.parametrize(
    ("values", "unit"), [([2e-6], "µm"), ([-3e-4], "mm"), ([0.3], "mm"), ([2.4], "m"), ([], "µm")]
)
def test_length_unit(values, unit):
    assert length_scale(values).unit == unit


@pytest.mark.parametrize(
    ("mean", "sd", "text"),
    [
        (1.23456, 0.0456, "1.235 ± 0.046"),
        (123.4, 11.9, "123 ± 12"),
        (5.0, 0.0, "5"),
        (-0.5, 0.2, "-0.50 ± 0.20"),
    ],
)
def test_plus_minus(mean, sd, text):
    assert plus_minus(mean, sd) == text
