"""What makes a picture readable: ticks apart, the peak in the zoom, one unit, thin bands told."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from femupdate.measurement.ambient import AmbientModes, Pole
from femupdate.measurement.inspection import inspect_file
from femupdate.measurement.observation import Observation
from femupdate.measurement.recording import RecordedMode
from femupdate.report import plot_repair
from femupdate.report.curves import history_curves, response_curves
from femupdate.report.figure import thin_band_note
from femupdate.report.plot_curves import frf_fit, member_force_bands, strong_part
from femupdate.report.plot_diagnosis import Ranked, ranking
from femupdate.report.plot_measured import inspected
from femupdate.report.plot_poles import stabilisation
from femupdate.report.plot_posterior import SampleSet, posterior_pairs, theta_intervals
from femupdate.report.plot_sticks import stick_mode_shapes
from femupdate.workflow.identify import Identified


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


def test_forces_whose_bands_cannot_be_seen_say_so():
    time = np.linspace(0, 10, 500)
    wave = np.outer([1e3, 1e4, 1e5], np.sin(2 * np.pi * time))
    for share, thin in ((0.001, True), (0.2, False)):
        curves = history_curves(time, ("N", "V", "M"), wave, share * np.abs(wave))
        figure = member_force_bands([("wall", curves)], note="Alone.")
        texts = " ".join(text.get_text() for text in figure.texts)
        assert ("thinner than the lines" in texts) == thin
        assert "Alone." in texts


def test_bands_that_cannot_be_seen_are_told():
    assert "0.4 % of the axis" in thin_band_note(0.004)
    assert thin_band_note(0.1) == ""


def seen(log):
    """A roof whose response (1, m) was measured with little noise."""
    grid, noise = np.linspace(0.1, 10, log.size), np.full(log.shape, 1e-3)
    return Observation(grid, ("RF",), log, noise, np.ones(log.shape, dtype=bool))


def test_a_band_that_is_wide_at_a_notch_alone_is_told_to_be_thin():
    log = np.zeros((1, 200))
    wide = np.where(np.arange(200) == 50, 3.0, 1e-3)[None]
    figure = frf_fit(response_curves(np.stack([log - wide, log, log + wide]), seen(log)))
    assert any("thinner than the lines" in text.get_text() for text in figure.texts)


def test_a_stick_says_that_its_bands_are_thin():
    for sd, told in ((1e-4, True), (0.2, False)):
        figure = stick_mode_shapes(
            np.array([0.0, 3.0]),
            np.array([[0.0, 1.0]]),
            ["Mode 1"],
            shapes_sd=np.array([[0.0, sd]]),
            note="First.",
        )
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


def luminance(color):
    from matplotlib.colors import to_rgb

    linear = [(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4) for c in to_rgb(color)]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_series_stay_apart_in_grey_print():
    """Two posteriors: colours of nearly one grey, so their lines differ, and from the truth's."""
    draws = np.random.default_rng(1).normal(size=(2, 300, 2))
    sets = [SampleSet("roof", draws[0]), SampleSet("all", draws[1])]
    figure = posterior_pairs(sets, ["θ1", "θ2"], np.array([[-9.0, 9.0]] * 2), truth=[0.0, 0.0])
    lines = figure.axes[0].lines
    assert len(lines) == 3
    assert luminance(lines[1].get_color()) - luminance(lines[0].get_color()) < 0.1
    # matplotlib keeps the pattern of a line that is not solid here alone.
    patterns = {str((line.get_linestyle(), line._unscaled_dash_pattern)) for line in lines}
    assert len(patterns) == 3
    contours = figure.axes[2].collections
    assert len({str(one.get_linestyle()) for one in contours if len(one.get_edgecolor())}) == 2


def test_before_and_after_stay_apart_in_grey_print():
    assert plot_repair._BEFORE["linestyle"] != plot_repair._AFTER.get("linestyle", "-")


def test_no_tick_of_a_pair_stands_at_an_end():
    """There its label would push the panels apart, one more than the other."""
    figure = posterior_pairs(
        [SampleSet("RF", np.random.default_rng(3).normal(0.9, 0.0048, size=(500, 4)))],
        [f"θ{k}" for k in range(4)],
        np.array([[0.3, 3.0]] * 4),
    )
    figure.canvas.draw()
    panels = np.reshape(figure.axes, (4, 4))
    for panel in panels[-1]:
        low, high = panel.get_xlim()
        ticks = np.array(panel.get_xticks())
        assert len(ticks) >= 1
        assert ((ticks > low + 0.1 * (high - low)) & (ticks < high - 0.1 * (high - low))).all()
    gaps = np.diff([panel.get_position().x0 for panel in panels[-1]])
    assert np.ptp(gaps) < 0.02 * gaps.mean()


def test_a_measured_line_shows_below_a_fit_that_hides_it():
    log = np.zeros((1, 50))
    figure = frf_fit(response_curves(log[None], seen(log)))
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


@pytest.fixture
def two_identified():
    """Two modes that are known better than their dots are wide."""
    shape = np.array([0.5, 1.0])
    modes = tuple(
        RecordedMode(
            frequency_hz=frequency,
            sensors=("2F", "RF"),
            shape=shape * [sign, 1.0],
            frequency_sd_hz=0.0026,
            damping=0.0142,
            damping_sd=0.0011,
            name=str(sign),
        )
        for frequency, sign in ((1.672, 1), (4.16, -1))
    )
    poles = tuple(
        Pole(order=k, frequency_hz=one.frequency_hz, damping=0.01, shape=one.shape)
        for k in (4, 6, 8)
        for one in modes
    )
    return AmbientModes(
        modes=modes,
        poles=poles,
        group=np.array([0, 1] * 3),
        band_hz=(0.5, 10.0),
        frequency_hz=np.linspace(0.5, 10, 40),
        spectra=np.ones((2, 40)),
        channels=("2F", "RF"),
        notes=(),
    )


def test_modes_known_better_than_their_dots_are_told_in_figures(two_identified):
    figure = stabilisation(two_identified, "Modes")
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:2] == ["1.6720 ± 0.0026 Hz", "4.1600 ± 0.0026 Hz"]
    shapes = figure.axes[1].lines
    assert len({str(one._unscaled_dash_pattern) for one in shapes}) == 2


def test_identified_modes_have_as_many_figures_as_their_deviations(two_identified):
    lines = Identified(two_identified, "a.csv", Path("m.csv"), ()).lines()[1]
    assert "1.6720 ± 0.0026 Hz" in lines
    assert "1.42 ± 0.11 %" in lines


def test_channels_of_a_measured_file_stay_apart_in_grey_print(tmp_path):
    """Spectra, responses and coherence lie over one another: colour alone does not name them."""
    rng = np.random.default_rng(1)
    base = rng.standard_normal(4000)
    values = {"base": base, "2F": 2.0 * base, "RF": base + rng.standard_normal(4000)}
    columns = np.column_stack([np.arange(4000) * 0.01, *values.values()])
    path, head = tmp_path / "file.csv", f"time_s,{','.join(values)}"
    np.savetxt(path, columns, "%.9g", ",", header=head, comments="")
    figure = inspected(inspect_file(path))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["1 base", "2 2F", "3 RF"]
    looks = [(line.get_color(), str(line._unscaled_dash_pattern)) for line in legend.get_lines()]
    assert len({dashes for _, dashes in looks}) == 3
    shown = {axes.get_title(loc="left") or axes.get_title(): axes for axes in figure.axes}
    for title, first in (("Spectra", 0), ("Floor over base", 1), ("Coherence", 1)):
        lines = shown[title].lines
        found = [(line.get_color(), str(line._unscaled_dash_pattern)) for line in lines]
        assert found == looks[first:]
