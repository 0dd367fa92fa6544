"""Every figure is drawn from realistic arrays, written, opened again and looked over."""

import subprocess
import sys
from itertools import combinations
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text

from femupdate.errors import ReportError
from femupdate.report.figure import new_figure, save_figure
from femupdate.report.plot_frf import Observation, Prediction, frf_fit
from femupdate.report.plot_history import floor_history_bands, story_shear_drift, strong_part
from femupdate.report.plot_intervals import mode_frequencies, theta_intervals
from femupdate.report.plot_members import member_force_bands
from femupdate.report.plot_posterior import SampleSet, correlation, most_correlated, posterior_pairs
from femupdate.report.plot_sticks import stick_mode_shapes

FLOORS = ("2F", "3F", "4F", "5F", "6F", "RF")
RNG = np.random.default_rng(11)
FREQUENCY = 0.05 * np.arange(1, 1025)
TIME = 0.005 * np.arange(4000)


def log_frf(floors: int = 6) -> np.ndarray:
    place = np.linspace(3.0, 40.0, 5)
    width = 0.5 + np.arange(floors)[:, None, None]
    peaks = (width / (1.0 + (FREQUENCY - place[:, None]) ** 2)).sum(axis=1)
    return np.log(peaks + 0.01)


def prediction(floors: int = 6) -> Prediction:
    mean = log_frf(floors)
    return Prediction(mean, mean - 0.2, mean + 0.3)


def observation() -> Observation:
    values = log_frf() + 0.1 * RNG.normal(size=(6, 1024))
    values[2] = np.nan
    valid = np.ones(values.shape, dtype=bool)
    valid[:, :30] = False
    return Observation(values, 0.1 + np.exp(-FREQUENCY) + np.zeros((6, 1)), valid)


def samples(parameters: int, spread: float, count: int = 600) -> np.ndarray:
    mix = np.eye(parameters) + 0.4 * RNG.normal(size=(parameters, parameters))
    return np.clip(1.0 + spread * RNG.normal(size=(count, parameters)) @ mix, 0.34, 2.9)


def cases(parameters: int) -> list[SampleSet]:
    return [
        SampleSet("Case 1: all floors", samples(parameters, 0.03)),
        SampleSet("Case 2: roof alone", samples(parameters, 0.3)),
    ]


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
    return floor_history_bands(TIME, motion(), 0.1 * np.abs(motion()) + 0.01, FLOORS, **more)


def shear_drift(stories: int, count: int) -> Figure:
    drift = 1e-4 * RNG.normal(size=(count, stories, 700))
    stiffness = 3e8 * (1.0 + 0.05 * RNG.normal(size=(count, stories)))
    return story_shear_drift(drift * stiffness[..., None], drift, stiffness)


def gappy_motion() -> np.ndarray:
    measured = motion() * 1.1
    measured[3] = np.nan
    return measured


FIGURES = {
    "frf": lambda: frf_fit(FREQUENCY, FLOORS, prediction(), observation()),
    "frf prior only": lambda: frf_fit(FREQUENCY, FLOORS[:5], prediction(5)),
    "frf roof alone": lambda: frf_fit(FREQUENCY, FLOORS[-1:], prediction(1)),
    **{
        f"pairs {p}": lambda p=p: posterior_pairs(cases(p), names(p), bounds(p), np.ones(p))
        for p in (1, 2, 4, 7)
    },
    "pairs of one case": lambda: posterior_pairs(cases(4)[:1], names(4), bounds(4)),
    "pairs with a constant": lambda: posterior_pairs(
        [SampleSet("fixed", np.hstack([samples(2, 0.1), np.ones((600, 1))]))], names(3), bounds(3)
    ),
    "intervals": lambda: theta_intervals(names(6), cases(6), bounds(6), np.ones(6)),
    "intervals of one": lambda: theta_intervals(names(4), cases(4)[:1], bounds(4)),
    "frequencies": lambda: mode_frequencies(
        np.array([5.4, 14.0, 25.0]) * samples(3, 0.02),
        prior=np.array([5.4, 14.0, 25.0]) * samples(3, 0.2),
        measured=[5.5, 13.8, np.nan],
    ),
    "frequencies alone": lambda: mode_frequencies(5.0 * samples(1, 0.02)),
    "history": lambda: bands(measured=gappy_motion()),
    "history window": lambda: bands(window=(3.0, 4.5)),
    "shear drift 6": lambda: shear_drift(6, 100),
    "shear drift 3": lambda: shear_drift(3, 1),
    "shear drift 1": lambda: shear_drift(1, 5),
    "sticks": lambda: stick_mode_shapes(
        np.arange(5) * 3.0,
        np.hstack([np.zeros((4, 1)), RNG.normal(size=(4, 4))]),
        [1.2, 3.4, 5.1, 6.6],
        shapes_sd=np.full((4, 5), 0.03),
        frequency_sd=[0.01, 0.03, 0.05, 0.2],
        floors=("base", "2F", "3F", "4F", "RF"),
    ),
    "one stick": lambda: stick_mode_shapes([0.0, 3.0], [[0.0, -2.0]], [1.2]),
}


@pytest.mark.parametrize("name", FIGURES)
def test_figure_is_written_and_nothing_covers_anything(name, tmp_path):
    figure = FIGURES[name]()
    path = save_figure(figure, tmp_path / "figure.png")
    picture = imread(path)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    height, width = picture.shape[:2]
    assert (width, height) == pytest.approx(figure.get_size_inches() * 150, abs=1.0)
    assert picture[..., :3].std() > 0.02  # a blank page has 0
    assert_legends_cover_nothing(figure)
    assert_no_tick_labels_overlap(figure)
    assert_texts_inside(figure)


def assert_legends_cover_nothing(figure: Figure) -> None:
    for legend in figure.legends:
        box = legend.get_window_extent()
        for panel in filter(Axes.get_visible, figure.axes):
            assert not box.overlaps(panel.get_tightbbox()), "the legend covers a panel"
        for text in figure.texts:
            assert not box.overlaps(text.get_window_extent()), "the legend covers the title"


def assert_no_tick_labels_overlap(figure: Figure) -> None:
    for panel in figure.axes:
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


def test_settings_of_matplotlib_are_left_alone():
    before = dict(matplotlib.rcParams)
    shear_drift(2, 3)
    assert dict(matplotlib.rcParams) == before


def test_drawing_needs_no_pyplot_and_importing_no_vtk():
    code = (
        "import sys, femupdate.report.scenes, femupdate.report.plot_frf;"
        "import femupdate.report.plot_history, femupdate.report.plot_sticks;"
        "import femupdate.report.plot_intervals;"
        "found = {'matplotlib.pyplot', 'pyvista', 'torch'} & set(sys.modules);"
        "sys.exit(', '.join(found) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()


def test_picture_is_whole_or_absent(tmp_path, monkeypatch):
    figure = new_figure(3.0, 2.0)
    target = tmp_path / "figure.png"
    target.write_bytes(b"the one before")

    def fail(name, **_):
        Path(name).write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(figure, "savefig", fail)
    with pytest.raises(ReportError, match=r"cannot write .*the disk is full"):
        save_figure(figure, target)
    assert target.read_bytes() == b"the one before"
    assert list(tmp_path.iterdir()) == [target]


def test_picture_may_be_interrupted(tmp_path, monkeypatch):
    figure = new_figure(3.0, 2.0)
    monkeypatch.setattr(
        figure, "savefig", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    with pytest.raises(KeyboardInterrupt):
        save_figure(figure, tmp_path / "figure.png")
    assert list(tmp_path.iterdir()) == []


def test_folder_that_is_a_file_and_name_that_is_no_picture(tmp_path):
    figure = new_figure(3.0, 2.0)
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(ReportError, match=r"cannot write .*figure\.png"):
        save_figure(figure, tmp_path / "taken" / "figure.png")
    with pytest.raises(ReportError, match=r"end in \.png"):
        save_figure(figure, tmp_path / "figure.pdf")


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: frf_fit(FREQUENCY[:9], FLOORS, prediction()), r"mean has the shape \(6, 1024\)"),
        (lambda: frf_fit(FREQUENCY, FLOORS[:4], prediction()), "floors holds 4 names"),
        (
            lambda: frf_fit(FREQUENCY, FLOORS, prediction(), Observation(np.zeros((5, 1024)))),
            r"observed log_frf has the shape \(5, 1024\); the figure needs \(6, 1024\)",
        ),
        (lambda: posterior_pairs(cases(4), names(3), bounds(3)), r"needs \(any, 3\)"),
        (lambda: posterior_pairs([], names(3), bounds(3)), "0 sets of samples"),
        (lambda: posterior_pairs(cases(3), names(3), bounds(4)), "bounds has the shape"),
        (
            lambda: posterior_pairs([SampleSet("A", np.full((9, 3), np.nan))], names(3), bounds(3)),
            "A needs two samples or more, all of them finite",
        ),
        (lambda: theta_intervals(names(3), cases(3), bounds(3), [1.0]), "truth has the shape"),
        (lambda: mode_frequencies(np.ones((1, 3))), "two samples or more"),
        (lambda: mode_frequencies(np.ones((5, 3)), names=["a"]), "1 names are given for 3"),
        (lambda: floor_history_bands(TIME, motion(5), motion(5), FLOORS), "mean has the shape"),
        (lambda: bands(measured=np.zeros((6, 7))), "measured has the shape"),
        (lambda: bands(window=(5.0, 500.0)), "lies outside the record"),
        (
            lambda: story_shear_drift(np.ones((2, 3, 9)), np.ones((2, 2, 9)), np.ones((2, 3))),
            "drift",
        ),
        (
            lambda: story_shear_drift(np.ones((0, 3, 9)), np.ones((0, 3, 9)), np.ones((2, 3))),
            "no sample",
        ),
        (lambda: stick_mode_shapes([0.0, 3.0], np.ones((2, 3)), [1.0, 2.0]), "shapes has"),
    ],
)
def test_wrong_arrays_are_told_in_one_sentence(draw, message):
    with pytest.raises(ReportError, match=message):
        draw()


def test_strong_part_is_found():
    start, end = strong_part(TIME, motion()[0])  # 4.77 Hz, strongest at 6 s
    assert (start + end) / 2.0 == pytest.approx(6.0, abs=0.2)
    assert end - start == pytest.approx(0.12 * TIME[-1], rel=0.01), "the whole share: few cycles"
    fast = np.exp(-((TIME - 6.0) ** 2)) * np.sin(2.0 * np.pi * 25.0 * TIME)
    start, end = strong_part(TIME, fast)
    assert end - start == pytest.approx(20 / 25.0, rel=0.05), "twenty cycles"
    assert strong_part(TIME, np.zeros_like(TIME))[0] == 0.0


def test_correlation_of_known_and_of_constant_rows():
    x, y = RNG.normal(size=(2, 500))
    z = 0.6 * x + 0.2 * y
    assert correlation(x, z) == pytest.approx(np.corrcoef(x, z)[0, 1])
    assert correlation(x, np.ones(500)) == 0.0


def test_bands_are_where_the_numbers_are():
    """The band of the top floor, in the first panel, is mean plus and minus two sd."""
    figure = floor_history_bands(TIME, np.zeros((2, 4000)), np.full((2, 4000), 0.7), ("2F", "RF"))
    vertices = figure.axes[0].collections[0].get_paths()[0].vertices
    assert vertices[:, 1].min() == pytest.approx(-1.4)
    assert vertices[:, 1].max() == pytest.approx(1.4)


def test_top_floor_comes_first():
    assert [axes.get_title(loc="left") for axes in bands().axes[::2]] == list(reversed(FLOORS))
    titles = [axes.get_title(loc="left") for axes in shear_drift(3, 2).axes if axes.get_visible()]
    assert titles == ["Story 3", "Story 2", "Story 1"]


def test_forces_of_members_and_their_units(tmp_path):
    wave = np.sin(20.0 * TIME) * np.exp(-((TIME - 9.0) ** 2))
    rows = np.array([[3e4], [2e5], [9e6]]) * wave
    names = ("N_with_columns", "V", "M")
    figure = member_force_bands(
        TIME, [("wall X2:S1", names, rows, 0.1 * np.abs(rows))], title="Forces"
    )
    labels = [panel.get_ylabel() for panel in figure.axes]
    assert labels == ["N with columns (kN)", "V (kN)", "M (MN m)"]
    assert imread(save_figure(figure, tmp_path / "members.png"))[..., :3].std() > 0.01
    with pytest.raises(ReportError, match="mean has the shape"):
        member_force_bands(TIME, [("wall", names, rows[:, 1:], rows)])


def test_of_many_parameters_the_most_correlated_are_paired():
    free = RNG.normal(size=(2000, 24))
    free[:, 20] += free[:, 3]
    free[:, 9] -= 2.0 * free[:, 14]
    free[:, 5] = 1.0  # one that does not vary
    assert most_correlated(free, 4) == [3, 9, 14, 20]
    limits = np.tile([-9.0, 9.0], (24, 1))
    figure = posterior_pairs([SampleSet("A", free)], names(24), limits, np.zeros(24))
    assert len(figure.axes) == 12 * 12
    shown = [axes.get_xlabel() for axes in figure.axes[-12:]]
    assert {names(24)[k] for k in (3, 9, 14, 20)} <= set(shown)
    assert shown == sorted(shown, key=list(names(24)).index)
    assert any("12 of 24" in text.get_text() for text in figure.texts)
