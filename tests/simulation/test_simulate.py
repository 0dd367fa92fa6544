"""Synthetic observations against direct solutions, closed forms and their own labels."""

import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from femupdate.building import from_document, load_building, mechanics_hash, mesh_building
from femupdate.dynamics import damping_law
from femupdate.errors import BuildingError, MeasurementError, StructureError
from femupdate.fe import assemble
from femupdate.measurement import GroundMotion, Histories, estimate_frf, read_observation_file
from femupdate.simulation import (
    SimulationSettings,
    fine_model,
    simulate_observation,
    truth_of,
    truth_path,
    write_simulation,
)
from femupdate.study import file_hash
from tests import documents
from tests.chains import Chain
from tests.documents import rectangle

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
SHIPPED = EXAMPLES / "six_story_white_noise.csv"
RAYLEIGH = {"law": "rayleigh", "ratio": 0.05, "anchors": [6.0, 25.0]}
GRID = {"start": 0.1, "step": 0.1, "count": 300}
PRIOR = {"theta": {"lower": 0.4, "upper": 2.5}}
STEP = 0.005


def frame(direction="x", points=("P-B", "Q-B"), **changes):
    """Two stories, two bays by one, a wall on one side: nothing is symmetric."""
    known = {
        "name": "small",
        "sections": {"column": rectangle(0.3, 0.5), "beam": rectangle(0.25, 0.4)},
        "walls": [{"along": "P", "from": "A", "to": "B", "thickness": 0.08}],
        "slabs": [{"x": ["A", "C"], "y": ["P", "Q"], "thickness": 0.15}],
        "floor_mass": [{"total": 60e3}],
        "sensors": {"direction": direction, "points": list(points)},
        "frequency_grid": GRID,
        "prior": PRIOR,
    }
    x, heights = {"A": 0.0, "B": 4.0, "C": 7.0}, {"low": 3.2, "high": 2.8}
    made = documents.frame(x, {"P": 0.0, "Q": 5.0}, heights, size=2.0, ratio=0.03, **known)
    return from_document(made | changes)


def chain(masses, springs, damping=None):
    known = {"frequency_grid": GRID, "prior": PRIOR} | ({"damping": damping} if damping else {})
    return from_document(documents.stick(masses, springs, ratio=0.03, **known))


THREE = ([3000.0, 2000.0, 1200.0], [9e6, 4e6, 1.5e6])
QUIET = SimulationSettings(sensor_noise_m_s2=0.0, duration_s=20.0)


def pulse(seconds=12.0):
    """A wave packet around 14 Hz that starts and ends at rest: its spectrum has no leakage."""
    t = np.arange(round(seconds / STEP)) * STEP - 1.0
    wave = np.exp(-((t / 0.05) ** 2)) * np.sin(2 * np.pi * 14.0 * t + 0.3)
    return GroundMotion(wave, STEP, "wave packet")


@pytest.mark.parametrize("direction", ["x", "y"])
def test_every_sensor_of_a_frame_follows_the_direct_solution(harmonic, direction):
    """In the time domain and back, against (K + i w C - w^2 M)^-1 f of the whole model."""
    building = frame(direction, damping=RAYLEIGH)
    theta = np.array([0.6, 1.9])
    asked = replace(QUIET, theta=tuple(theta), base_motion=pulse(), sensors=("Q-C", "P-A", "Q-B"))
    found = simulate_observation(building, asked)

    names = [channel.name for channel in found.histories.channels]
    mark = "" if direction == "x" else ".y"
    assert names == [f"base{mark}", *(f"{f}:{n}{mark}" for f in ("2F", "RF") for n in (1, 2, 3))]
    spectrum = np.fft.rfft(found.histories.acceleration)
    frequency = np.fft.rfftfreq(found.histories.acceleration.shape[1], STEP)
    bins = np.searchsorted(frequency, [5.0, 8.0, 11.0, 14.0, 18.0, 22.0])
    measured = spectrum[1:, bins] / spectrum[0, bins]

    mesh = mesh_building(building, 0.8)  # .4 of the building's own
    operators = assemble(mesh.model)
    force = -operators.expand(operators.inertia(mesh.direction))
    first, second = 2 * np.pi * np.array([6.0, 25.0])
    law = 2 * 0.05 * first * second / (first + second), 2 * 0.05 / (first + second)
    motion = np.array(harmonic(operators, theta, frequency[bins], force, law))
    at = {tuple(np.round(p, 9)): n for n, p in enumerate(mesh.model.nodes)}
    places = [(7.0, 5.0), (0.0, 0.0), (4.0, 5.0)]
    rows = [6 * at[(x, y, z)] + mesh.direction for z in (3.2, 6.0) for x, y in places]
    omega = 2 * np.pi * frequency[bins]
    direct = 1.0 - omega**2 * motion[:, rows].T
    # The shapes are right within 1e-3 in the mean up to 100 Hz, and far better at 22 Hz.
    assert np.abs(measured - direct).max() < 2e-4 * np.abs(direct).max()


def test_static_shapes_stand_for_what_is_left_out():
    building, theta = frame(), np.array([0.6, 1.9])
    fine, law = fine_model(building), damping_law(building)
    few, many = (truth_of(fine, theta, law, top).system.model for top in (30.0, 150.0))

    def flexibility(model):
        own = model.stiffness_constant
        return model.floor_shapes @ np.linalg.solve(own, model.excitation)

    assert few.size < many.size / 2
    # Static displacement under uniform acceleration of the base, to round-off.
    np.testing.assert_allclose(flexibility(few), flexibility(many), rtol=1e-7)


def test_welch_frf_of_a_chain_matches_the_closed_form():
    masses, springs = map(np.array, THREE)
    theta, zeta = np.array([0.7, 1.4, 0.9]), 0.05
    found = simulate_observation(
        chain(*THREE), SimulationSettings(theta=tuple(theta), zeta=zeta, duration_s=120.0, seed=4)
    )
    # Segments of 20 s: at 3 Hz and 5 % zeta f T = 3, so the smearing of the peaks stays below 4 %.
    seen = estimate_frf(found.histories, np.arange(1.0, 45.0, 0.05))
    hand = Chain(np.array(masses), theta * np.array(springs), zeta=zeta)
    asked = hand.frf(seen.estimator.frequency_hz)
    exact = seen.estimator(torch.from_numpy(asked)[None])[0].numpy()
    assert seen.floors == ("2F", "3F", "RF")
    used = seen.valid
    assert used[:, seen.frequency_hz < 20.0].all()  # above, the roof is below its sensor's noise
    z = (seen.log_frf - np.log(np.abs(exact)))[used] / seen.noise_sd[used]
    turn = np.angle(np.exp(1j * (seen.phase - np.angle(exact))))[used] / seen.noise_sd[used]
    for errors in (z, turn):
        assert np.sqrt(np.mean(errors**2)) < 1.2  # one, were the stated noise perfect
        assert abs(np.mean(errors)) < 0.25


def test_noise_is_white_of_the_stated_size_on_every_channel_and_changes_nothing_else():
    building = chain(*THREE)
    exact, noisy = (
        simulate_observation(building, SimulationSettings(sensor_noise_m_s2=s, seed=9)).histories
        for s in (0.0, 0.02)
    )
    noise = noisy.acceleration - exact.acceleration
    count = noise.shape[1]
    # Standard deviations of 16000 samples scatter by 0.6 %, correlations by 0.8 %.
    np.testing.assert_allclose(noise.std(axis=1), 0.02, rtol=0.03)
    np.testing.assert_allclose(np.corrcoef(noise), np.eye(4), atol=0.04)
    following = (noise[:, 1:] * noise[:, :-1]).mean(axis=1) / 0.02**2
    np.testing.assert_allclose(following, 0.0, atol=5.0 / np.sqrt(count))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"theta": (1.0,)}, StructureError, "needs 3 numbers"),
        ({"theta": (1.0, -1.0, 1.0)}, StructureError, "above zero"),
        ({"zeta": 1.5}, StructureError, "between 0 and 1"),
        ({"band_hz": (0.5, 95.0)}, MeasurementError, "below 90 Hz"),
        ({"band_hz": (5.0, 1.0)}, MeasurementError, "the lower first"),
        ({"duration_s": 2.0}, MeasurementError, "too short"),
        ({"duration_s": float("nan")}, MeasurementError, "duration_s"),
        ({"sampling_hz": 2e8}, MeasurementError, "1.6e\\+10 samples a channel are too many"),
        ({"duration_s": 1e9}, MeasurementError, "are too many to simulate; ask for at most 500,0"),
        ({"rms_m_s2": 1e300}, MeasurementError, "no shaking table reaches more"),
        ({"sensor_noise_m_s2": -1.0}, MeasurementError, "zero or more"),
        ({"quantisation_m_s2": 0.0}, MeasurementError, "above zero"),
        ({"mesh_size": 0.5}, BuildingError, "leave both out"),
        ({"sensors": ("P-B",)}, BuildingError, "leave both out"),
    ],
)
def test_what_cannot_be_simulated_is_refused(changes, error, words):
    with pytest.raises(error, match=words):
        simulate_observation(chain(*THREE), SimulationSettings(**changes))


def test_what_is_written_says_what_it_is_and_reads_back(tmp_path):
    building = frame()
    asked = SimulationSettings(theta=(0.8, 1.3), zeta=0.04, duration_s=10.0, seed=12)
    found = simulate_observation(building, asked)
    files = write_simulation(found, tmp_path / "run.csv", ["an added line"])
    written, truth = files.observation, files.truth_file
    assert truth == truth_path(written) == tmp_path / "run.truth.json"

    head = [line for line in written.read_text().splitlines() if line.startswith("#")]
    assert head[0].startswith("# synthetic: made by femupdate ")
    for words in ("building small", "seed 12", "not a measurement"):
        assert words in head[0]
    assert head[1:] == ["# all settings are in run.truth.json", "# an added line"]

    back = read_observation_file(written)
    assert isinstance(back, Histories)
    assert back.channels == found.histories.channels
    assert back.time_step == found.histories.time_step
    # Six significant digits.
    np.testing.assert_allclose(back.acceleration, found.histories.acceleration, rtol=5.1e-6)

    told = json.loads(truth.read_text())
    assert told["theta"] == [0.8, 1.3]
    assert told["parameters"] == ["theta_1", "theta_2"]
    assert (told["zeta"], told["mesh_size_m"], told["seed"]) == (0.04, 0.8, 12)
    assert told["motion"] == {
        "title": "white noise",
        "direction": "x",
        "duration_s": 10.0,
        "sampling_hz": 200.0,
        "rms_m_s2": 0.3,
        "band_hz": [0.5, 50.0],
        "rotation_rms_rad_s2": None,
        "across_rms_m_s2": None,
        "vertical_sensors_m": [],
    }
    assert told["noise"] == {"sensor_rms_m_s2": 0.003, "quantisation_m_s2": None}
    assert told["sensors"]["2F:1"] == "P-B"
    # Corners would see the floor turn otherwise than these points, which are aside.
    assert [told["sensors"][f"RF:{n}"] for n in (1, 2)] == ["P-B", "Q-B"]
    assert told["building_hash"] == mechanics_hash(building)
    assert told["observation_sha256"] == file_hash(written)


@pytest.fixture(scope="module")
def shipped():
    return read_observation_file(SHIPPED), json.loads(truth_path(SHIPPED).read_text())


def test_the_shipped_truth_is_of_the_shipped_building(shipped):
    _, truth = shipped
    building = load_building("six_story_wall_frame")
    assert truth["building_hash"] == mechanics_hash(building), (
        "the building has changed: run examples/make_observation.py again"
    )
    assert (
        truth["mesh_size_m"] < building.mesh.size
    )  # the truth is never the model that explains it
    prior = building.prior.theta
    assert all(prior.lower < value < prior.upper for value in truth["theta"])
    assert len(set(truth["theta"])) == 6
    assert truth["zeta"] == 0.02


@pytest.mark.slow
def test_the_example_makes_the_shipped_observation_again(tmp_path, shipped):
    spec = importlib.util.spec_from_file_location(
        "make_observation", EXAMPLES / "make_observation.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    written, truth = module.make(tmp_path)
    again = read_observation_file(written)
    # The shipped one was followed mode by mode, with straight lines between 32 points a sample.
    noise = module.SETTINGS.sensor_noise_m_s2
    assert np.abs(again.acceleration - shipped[0].acceleration).max() < 0.25 * noise
    assert (again.acceleration - shipped[0].acceleration).std() < 0.05 * noise
    made, kept = (
        {k: v for k, v in told.items() if k not in ("observation_sha256", "femupdate")}
        for told in (json.loads(truth.read_text()), shipped[1])
    )
    assert made == kept
