"""What the picture of a measured file shows."""

import numpy as np
import pytest
from scipy.signal import lfilter

from femupdate.measurement import inspect_file
from femupdate.report.plot_measured import inspected


def panels(path):
    figure = inspected(inspect_file(path))
    return {axes.get_title(loc="left") or axes.get_title(): axes for axes in figure.axes}


def test_response_to_a_force_in_the_units_that_are_drawn(tmp_path):
    force = np.random.default_rng(0).normal(size=4000)
    motion = lfilter([0.2], [1.0, -1.2, 0.9], force)
    rows = [
        f"{k * 0.01:.2f},{f:.6f},{a / 9.80665:.8f}"
        for k, (f, a) in enumerate(zip(force, motion, strict=True))
    ]
    path = tmp_path / "shaker.csv"
    path.write_text("time_s,force/RF (kN),RF (g)\n" + "\n".join(rows) + "\n")
    shown = panels(path)
    assert shown["Spectra"].get_ylabel() == "kN or m/s² per √Hz"
    response = shown["Response to the force"]
    assert response.get_ylabel() == "|H|, m/s² per kN"
    (line,) = response.lines
    middle = np.searchsorted(line.get_xdata(), 5.0)
    exact = 0.2 / np.polyval([0.9, -1.2, 1.0], np.exp(-2j * np.pi * 5.0 * 0.01))
    assert line.get_ydata()[middle] == pytest.approx(abs(exact), rel=0.1)
    assert "Floor over base" not in shown


def test_components_of_shapes_by_their_names(tmp_path):
    path = tmp_path / "modes.csv"
    path.write_text("mode,frequency_hz,2F,RF\n1,1.7,0.4j,1j\n2,5.0,1j,-0.4j\n")
    (axes,) = panels(path).values()
    assert [label.get_text() for label in axes.get_xticklabels()] == ["2F", "RF"]
    np.testing.assert_allclose(np.abs(axes.lines[0].get_ydata()), [0.4, 1.0])
