"""A base that moves along and across an unsymmetric frame: from a simulated file to a forecast."""

import copy

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import from_document, save_building
from femupdate.dynamics import ConstantDamping, Excitation, driven_system
from femupdate.effects import structure_of
from femupdate.measurement import read_record, write_observation_histories
from femupdate.simulation import SimulationSettings, simulate_observation
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    PredictionSettings,
    RecordSource,
    calibrate_study,
    open_study,
    predict_study,
)
from tests import documents

THETA, ZETA = (0.8, 1.2), 0.02


def document():
    """A frame of two stories that moves along y, with a wall across that at one side."""
    made = documents.frame(
        {"A": 0.0, "B": 6.0},
        {"1": 0.0, "2": 5.0},
        {"S1": 3.6, "S2": 3.2},
        size=2.5,
        grid=(0.1, 150),
        direction="y",
        slabs=[{"x": ["A", "B"], "y": ["1", "2"], "thickness": 0.2}],
    )
    made["walls"] = [{"along": "1", "from": "A", "to": "B", "thickness": 0.2}]
    made["sensors"]["points"] = ["B-2"]
    return made


def with_equal_sides():
    made = copy.deepcopy(document())
    made["walls"].append(made["walls"][0] | {"along": "2"})
    made["sensors"]["points"] = ["A-1", "B-2"]
    return made


def test_floors_follow_as_a_direct_solution_says():
    """Against one complex solution a frequency of M u'' + C u' + K u = -M i_x x''."""
    structure, ratio = structure_of(from_document(document())), 0.03
    frequency = np.array([0.7, 3.0, 5.2, 9.0])
    full = driven_system(
        structure, [], np.array(THETA), np.zeros(0), 20.0, ConstantDamping(), columns=3
    )
    none = torch.zeros(1, 0, dtype=torch.float64)
    zeta = torch.tensor([ratio], dtype=torch.float64)
    asked = none, zeta, none, torch.from_numpy(frequency)
    found = full.system.respond(Excitation(columns=3), *asked)[0, :, 2].numpy()
    K, M = structure.stiffness(THETA).toarray(), structure.mass.toarray()
    inverse, shapes = eigh(M, K)  # of unit stiffness, so that what has no mass has zeros
    moving = inverse > 1e-12
    of_mass = M @ shapes[:, moving] / np.sqrt(inverse[moving])
    C = of_mass * (2.0 * ratio / np.sqrt(inverse[moving])) @ of_mass.T
    # The mass that foundations share with what stands on them moves, too.
    along_x = structure.meshed[1].inertia(0)
    for number, omega in enumerate(2.0 * np.pi * frequency):
        u = np.linalg.solve(K + 1j * omega * C - omega**2 * M, -along_x)
        exact = -(omega**2) * structure.floor_rows @ u
        np.testing.assert_allclose(found[:, number], exact, atol=2e-3 * np.abs(exact).max())


def simulated(seed):
    asked = {"duration_s": 60.0, "sampling_hz": 60.0, "band_hz": (0.3, 20.0), "mesh_size": 2.5}
    asked |= {"theta": THETA, "zeta": ZETA, "across_rms": 0.3, "sensors": ("B-2",), "seed": seed}
    return simulate_observation(from_document(document()), SimulationSettings(**asked)).histories


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("across")
    save_building(from_document(document()), folder / "side.toml")
    for seed, name in enumerate(("first", "second")):
        both = simulated(seed)
        write_observation_histories(folder / f"{name}.csv", both)
        kept = [k for k, to in enumerate(both.channels) if to.name != "base"]
        alone = type(both)(
            both.time_step, tuple(both.channels[k] for k in kept), both.acceleration[kept]
        )
        write_observation_histories(folder / f"{name}_alone.csv", alone)
    return folder


def calibrated(home, name):
    study = Study(home / f"study_{name}")
    model = open_study(study, str(home / "side.toml"))
    settings = CalibrationSettings(exact=True, particles=400, chains=1)
    source = ObservationSource(home / f"{name}.csv")
    return study, model, calibrate_study(study, model, source, settings)


def test_what_comes_across_is_an_input_and_not_noise(home):
    study, model, both = calibrated(home, "first")
    _, _, alone = calibrated(home, "first_alone")
    assert any("base is an input" in note for note in both.notes)
    assert any("without a column base it counts as noise" in note for note in alone.notes)
    theta, seen = both.posterior.samples, both.posterior.observation
    assert np.abs((theta.mean(axis=0) - THETA) / theta.std(axis=0)).max() < 2.5
    used = seen.valid & alone.posterior.observation.valid
    ratio = alone.posterior.observation.noise_sd[used] / seen.noise_sd[used]
    assert np.median(ratio) > 1.5
    errors = {}
    for name in ("second", "second_alone"):
        done = predict_study(
            study,
            model,
            RecordSource(home / f"{name}.csv"),
            PredictionSettings(samples=20),
            measured=home / f"{name}.csv",
        )
        errors[name] = max(of["relative_error"] for of in done.comparison.values())
        assert any("which the record lacks" in note for note in done.notes) == ("_" in name)
    # What is left is of the mesh, on which the truth is made: it is coarser than the model's.
    assert errors["second"] < 0.15
    assert errors["second_alone"] > 3.0 * errors["second"]


def test_a_symmetric_building_has_no_such_input(home, tmp_path):
    save_building(from_document(with_equal_sides()), tmp_path / "even.toml")
    model = open_study(Study(tmp_path / "study"), str(tmp_path / "even.toml"))
    assert model.reduced.across is None


def test_a_record_has_its_motion_across_in_every_form(home):
    motion = read_record(home / "first.csv", direction="y")
    assert motion.channel == "base.y"
    assert motion.inputs.shape == (3, len(motion.acceleration))
    assert not motion.inputs[1].any()
    assert motion.scaled(2.0).across == pytest.approx(2.0 * motion.across)
    assert read_record(home / "first_alone.csv").across is None
