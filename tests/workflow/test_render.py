"""render: which modes, at what frequencies, and that the pictures show something."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.signal import lfilter

import femupdate
from femupdate.dynamics import RayleighDamping, ReducedModes, mesh_modes, reduced_modes, track_mode
from femupdate.effects import structure_of
from femupdate.errors import StudyError
from femupdate.inference import DrawnBy, Posterior, load_posterior, save_posterior
from femupdate.measurement import Observation, inspect_file, read_measured
from femupdate.report.plot_measured import inspected
from femupdate.workflow import open_study, render_study
from tests.workflow.by_hand import tower_modes


def shown(path):
    """The picture's pixels, which must not be of one colour."""
    pixels = imread(path)[..., :3]
    assert min(pixels.shape[:2]) > 200
    assert (pixels.min(axis=-1) < 0.95).mean() > 0.02
    return pixels


def test_the_modes_of_a_lumped_building(tower, tower_model):
    modes = render_study(tower, model=tower_model, samples=40, seed=1).modes
    assert [mode["mode"] for mode in modes] == [1, 2]
    theta = load_posterior(tower.path("posterior.nc")).thinned(40, 1)[:, :2].numpy()
    own = np.array([tower_modes(row)[0] for row in theta])
    np.testing.assert_allclose([m["frequency_hz"] for m in modes], own.mean(axis=0), rtol=1e-9)
    np.testing.assert_allclose([m["frequency_sd"] for m in modes], own.std(axis=0), rtol=1e-6)
    assert [mode["found"] for mode in modes] == [1.0, 1.0]
    # All modes of sticks fit one picture.
    assert [mode["picture"] for mode in modes] == [tower.path("pictures", "modes.png")] * 2
    shown(modes[0]["picture"])


def test_shapes_are_normalised_by_mass_and_read_again(tower, tower_model, tmp_path):
    rayleigh = replace(tower_model.system, law=RayleighDamping(0.05, (1.0, 4.0)))
    report = render_study(tower, model=replace(tower_model, system=rayleigh), samples=40, seed=1)
    frame = report.to_dataframe("shapes")
    floors = list(tower_model.reduced.floors)
    mass = [story.mass for story in tower_model.building.stories]
    # phi' M phi = 1 of every draw, and of their mean but for the spread.
    np.testing.assert_allclose((frame[floors] ** 2) @ mass, 1.0, atol=2e-3)
    # Rayleigh's law, its two anchors at 1 and 4 Hz: each mode has a ratio of its own.
    hertz = frame["frequency_hz"]
    np.testing.assert_allclose(frame["damping"], 0.05 * (4.0 / hertz + hertz) / 5.0, rtol=1e-6)
    assert np.ptp(frame["damping"]) > 0.003
    of_uff = [mode.damping for mode in read_measured(report.uff).modes]
    np.testing.assert_allclose(of_uff, frame["damping"], rtol=1e-5)  # six digits are written
    frame.to_csv(tmp_path / "shapes.csv", index=False)
    same = femupdate.compare(tower, *[str(tmp_path / "shapes.csv")] * 2)
    np.testing.assert_allclose([row["mac"] for row in same.pairs], 1.0)


@pytest.fixture
def cabin(cabin_study):
    """The cabin with draws around factors of 0.9 and 1.2 in place of a calibration."""
    model = open_study(cabin_study)
    rng = np.random.default_rng(3)
    theta = np.array([0.9, 1.2]) * (1 + 0.03 * rng.standard_normal((2, 20, 2)))
    grid = model.frequency_hz.numpy()
    blank = np.zeros((1, grid.size))
    observation = Observation(grid, ("RF",), blank, blank + 0.2, blank == 0, source="none")
    posterior = Posterior(
        parameters=model.parameters,
        values=np.concatenate([theta, np.full((2, 20, 1), 0.03)], axis=2),
        log_likelihood=np.zeros((2, 20)),
        drawn=DrawnBy(likelihood="exact", way="by hand", chains=2, evaluations=0),
        observation=observation,
        settings={},
    )
    save_posterior(posterior, cabin_study.path("posterior.nc"))
    cabin_study.record("posterior", "posterior.nc", "calibrate", model.made_from())
    return cabin_study, model, theta.reshape(-1, 2)


def full_frequencies(model, theta):
    """The two modes that move most mass, of the full model, not the reduced one, at one theta."""
    from femupdate.fe import lowest_modes

    parts = structure_of(model.building)
    modes = lowest_modes(parts.operators, theta, 20)
    effect = modes.shapes.T @ parts.operators.inertia(parts.mesh.direction)
    return modes.frequency_hz[np.sort(np.argsort(-(effect**2))[:2])]


def test_the_modes_of_a_frame(cabin):
    """PyVista's scenes where it can render, else matplotlib's: either way a picture a mode."""
    study, model, theta = cabin
    modes = render_study(study, model=model, modes=2, samples=20).modes
    assert [mode["picture"].name for mode in modes] == ["mode_2.png", "mode_15.png"]
    pictures = [shown(mode["picture"]) for mode in modes]
    assert not np.array_equal(pictures[0], pictures[1])
    # Modes across the motion are not among them: the lowest of all is one of those.
    expected = full_frequencies(model, theta.mean(axis=0))
    # 20 draws of 3 %: a frequency, half of that, is known to .4 %.
    np.testing.assert_allclose([m["frequency_hz"] for m in modes], expected, rtol=0.02)
    assert all(0.0 < m["frequency_sd"] < 0.03 * m["frequency_hz"] for m in modes)
    assert all(m["found"] > 0.8 for m in modes)
    # The lowest moves across the motion: no data changed it.
    with pytest.raises(StudyError, match="does not excite mode 1, so no data changed it"):
        render_study(study, model=model, wanted=[1, 2], samples=20)
    # A remnant of a mode that looks like it and lies far above it is not that mode.
    full = mesh_modes(structure_of(model.building))
    at_one = reduced_modes(model.reduced, np.ones((1, 2)))
    numbers = full.numbers_of(model.reduced, at_one)
    above = ReducedModes(1.2 * at_one.frequency_hz, at_one.vectors)
    assert numbers[0] == 2 != full.numbers_of(model.reduced, above)[0]


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def test_a_mode_is_followed_through_a_crossing():
    """The second sample's modes have changed places, the third's sign is turned round."""
    vectors = np.stack([rotation(0.1), rotation(0.1)[:, ::-1], -rotation(0.2)])
    frequency = np.array([[1.0, 2.0], [1.9, 1.1], [1.2, 2.2]])
    modes = ReducedModes(frequency, vectors)
    followed = track_mode(modes, vectors[0][:, 0])
    np.testing.assert_allclose(followed.frequency_hz, [1.0, 1.1, 1.2])
    np.testing.assert_allclose(followed.vectors[1], vectors[0][:, 0])
    np.testing.assert_allclose(followed.vectors[2], rotation(0.2)[:, 0])
    assert followed.found == 1.0


def test_the_mode_of_most_mass_is_shown_first(tower, tower_model):
    first, second = render_study(tower, model=tower_model, samples=5).modes
    assert (first["mode"], second["mode"]) == (1, 2)
    assert first["effective_mass"] > second["effective_mass"]
    (most,) = render_study(tower, model=tower_model, modes=1, samples=5).modes
    assert most["mode"] == 1


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
