"""What makes a picture readable: ticks apart, the peak in the zoom, one unit, thin bands told."""

from itertools import pairwise

import numpy as np

from femupdate.report import posterior_pairs, stick_mode_shapes
from femupdate.report.curves import history_curves
from femupdate.report.plot_curves import member_force_bands, strong_part


def test_the_zoom_shows_the_peak():
    """Long shaking holds more energy than a single spike, which is what counts."""
    time = np.arange(8000) * 0.01
    motion = np.sin(2 * np.pi * 2.0 * time) * ((time > 40) & (time < 60))
    motion[1000] = 3.0
    start, end = strong_part(time, motion)
    assert start <= 10.0 <= end


def test_forces_whose_bands_cannot_be_seen_say_so():
    time = np.linspace(0, 10, 500)
    wave = np.outer([1e3, 1e4, 1e5], np.sin(2 * np.pi * time))
    for share, thin in ((0.001, True), (0.2, False)):
        curves = history_curves(time, ("N", "V", "M"), wave, share * np.abs(wave))
        figure = member_force_bands([("wall", curves)], note="Alone.")
        texts = " ".join(text.get_text() for text in figure.texts)
        assert ("thinner than the lines" in texts) == thin
        assert "Alone." in texts


def test_a_stick_says_that_its_bands_are_thin():
    for sd, told in ((1e-4, True), (0.2, False)):
        figure = stick_mode_shapes(
            np.array([0.0, 3.0]),
            np.array([[0.0, 1.0]]),
            ["Mode 1"],
            ("base", "RF"),
            shapes_sd=np.array([[0.0, sd]]),
        )
        texts = " ".join(text.get_text() for text in figure.texts)
        assert ("thinner than the lines" in texts) == told


def test_long_names_of_parameters_do_not_run_into_one_another():
    draws = np.random.default_rng(1).normal(0.8995, 0.0045, size=(300, 8))
    long = "softening in run, all: size", "softening in run: damping"
    names = [*(f"θ{k}" for k in range(6)), *long]
    figure = posterior_pairs({"RF": draws}, names, np.array([[-9.0, 9.0]] * 8))
    figure.canvas.draw()
    panels = np.reshape(figure.axes, (8, 8))
    for panel in panels[-1]:
        marks = [label.get_window_extent() for label in panel.get_xticklabels()]
        assert all(a.x1 < b.x0 for a, b in pairwise(marks))
    below = [panel.xaxis.label.get_window_extent() for panel in panels[-1]]
    assert all(a.x1 < b.x0 for a, b in pairwise(below))
    beside = [panel.yaxis.label.get_window_extent() for panel in panels[1:, 0]]
    assert all(a.y0 > b.y1 for a, b in pairwise(beside))
    assert min(box.y0 for box in (*below, *beside)) >= 0


def luminance(color):
    from matplotlib.colors import to_rgb

    linear = [(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4) for c in to_rgb(color)]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_series_stay_apart_in_grey_print():
    """Two posteriors: colours of nearly one grey, so their lines differ, and from the truth's."""
    draws = np.random.default_rng(1).normal(size=(2, 300, 2))
    sets = {"roof": draws[0], "all": draws[1]}
    figure = posterior_pairs(sets, ["θ1", "θ2"], np.array([[-9.0, 9.0]] * 2), truth=[0.0, 0.0])
    lines = figure.axes[0].lines
    assert len(lines) == 3
    assert luminance(lines[1].get_color()) - luminance(lines[0].get_color()) < 0.1
    # matplotlib keeps the pattern of a line that is not solid here alone.
    patterns = {str((line.get_linestyle(), line._unscaled_dash_pattern)) for line in lines}
    assert len(patterns) == 3
    contours = figure.axes[2].collections
    assert len({str(one.get_linestyle()) for one in contours if len(one.get_edgecolor())}) == 2
