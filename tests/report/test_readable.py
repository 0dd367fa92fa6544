"""What makes a picture readable: ticks apart, the peak in the zoom, one unit, thin bands told."""

from itertools import pairwise

import numpy as np

from femupdate.report.figure import add_head, new_figure, thin_band_note
from femupdate.report.plot_diagnosis import Ranked, ranking
from femupdate.report.plot_frf import MeasuredFrf, Prediction, frf_fit
from femupdate.report.plot_history import strong_part
from femupdate.report.plot_intervals import theta_intervals
from femupdate.report.plot_members import member_force_bands
from femupdate.report.plot_posterior import SampleSet, posterior_pairs
from femupdate.report.plot_sticks import stick_mode_shapes


def test_ticks_of_a_ranking_do_not_run_into_one_another():
    effects = [Ranked("Added mass, 3F", 4000.0, "0.1", True), Ranked("Rocking, base", 3.0, "")]
    figure = ranking(effects, 9.5, "One sentence.\nAnother one.")
    figure.canvas.draw()
    labels = [text for text in figure.axes[0].get_xticklabels() if text.get_text()]
    boxes = [text.get_window_extent() for text in labels]
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))
    assert {"0", "9.5"} <= {text.get_text() for text in labels}


def test_the_zoom_shows_the_peak():
    """Long shaking holds more energy than a single spike, which is what counts."""
    time = np.arange(8000) * 0.01
    motion = np.sin(2 * np.pi * 2.0 * time) * ((time > 40) & (time < 60))
    motion[1000] = 3.0
    start, end = strong_part(time, motion)
    assert start <= 10.0 <= end


def test_members_share_a_unit_for_forces_and_one_for_moments():
    time = np.linspace(0, 10, 500)
    wave = np.sin(2 * np.pi * time)
    forces = ("N", "Vy", "Mz")
    small, large = (np.outer(size, wave) for size in ([2e2, 5.0, 30.0], [4e5, 3e4, 9e4]))
    members = [("beam", forces, small, 0.01 * small**0), ("column", forces, large, 0 * large)]
    figure = member_force_bands(time, members)
    units = [panel.get_ylabel().split(", ")[1] for panel in figure.axes]
    assert units == ["kN", "kN", "kN m"] * 2


def test_bands_that_cannot_be_seen_are_told():
    assert "0.4 % of the axis" in thin_band_note(0.004)
    assert thin_band_note(0.1) == ""


def test_a_band_that_is_wide_at_a_notch_alone_is_told_to_be_thin():
    log = np.zeros((1, 200))
    wide = np.where(np.arange(200) == 50, 3.0, 1e-3)[None]
    figure = frf_fit(np.linspace(0.1, 10, 200), ["RF"], Prediction(log, log - wide, log + wide))
    assert any("thinner than the lines" in text.get_text() for text in figure.texts)


def test_a_stick_says_that_its_bands_are_thin():
    for sd, told in ((1e-4, True), (0.2, False)):
        figure = stick_mode_shapes([0, 3], [[0, 1]], ["Mode 1"], shapes_sd=[[0, sd]], note="First.")
        texts = " ".join(text.get_text() for text in figure.texts)
        assert ("thinner than the lines" in texts) == told
        assert "First." in texts


def test_long_names_of_parameters_do_not_run_into_one_another():
    draws = np.random.default_rng(1).normal(size=(300, 6))
    names = [
        *(f"θ{k}" for k in range(4)),
        "softening in run, all: size",
        "softening in run: damping",
    ]
    figure = posterior_pairs([SampleSet("RF", draws)], names, np.array([[-9.0, 9.0]] * 6))
    figure.canvas.draw()
    panels = np.reshape(figure.axes, (6, 6))
    below = [panel.xaxis.label.get_window_extent() for panel in panels[-1]]
    assert all(a.x1 < b.x0 for a, b in pairwise(below))
    beside = [panel.yaxis.label.get_window_extent() for panel in panels[1:, 0]]
    assert all(a.y0 > b.y1 for a, b in pairwise(beside))
    assert min(box.y0 for box in (*below, *beside)) >= 0


def test_titles_and_notes_stay_inside_their_figure():
    figure = new_figure(4.0, 2.0)
    figure.subplots()
    add_head(figure, "Mode 9 (slabs), 26.10 Hz, 7.5 % of the mass, all factors 1", note="So " * 60)
    figure.canvas.draw()
    edge = figure.bbox.x1
    assert all(text.get_window_extent().x1 < edge for text in figure.texts)
    first, second = (text.get_window_extent() for text in figure.texts)
    assert second.y1 <= first.y0 + 1


def test_a_measured_line_shows_below_a_fit_that_hides_it():
    log = np.zeros((1, 50))
    figure = frf_fit(np.linspace(0.1, 10, 50), ["RF"], Prediction(log, log, log), MeasuredFrf(log))
    predicted, measured = figure.axes[0].lines
    assert measured.get_linewidth() > 2.5 * predicted.get_linewidth()
    assert measured.get_zorder() < predicted.get_zorder()


def test_intervals_shorter_than_their_stroke_are_told():
    rng = np.random.default_rng(0)
    for spread, told in ((1e-3, True), (0.3, False)):
        draws = 1.0 + spread * rng.standard_normal((500, 2))
        bounds = np.array([[0.3, 3.0]] * 2)
        figure = theta_intervals(["story S1", "story S2"], [SampleSet("RF", draws)], bounds)
        texts = " ".join(text.get_text() for text in figure.texts)
        assert ("shorter than the stroke" in texts) == told
