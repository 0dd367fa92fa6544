"""The calibration benchmark: what it simulates, and a small run."""

import copy

import numpy as np
import pytest
from femupdate.benchmarks.calibration.cases import Judged, simulate
from femupdate.benchmarks.calibration.run import CalibrationPlan, run_calibration
from femupdate.benchmarks.calibration.tables import scores
from femupdate.benchmarks.result import Job
from femupdate.benchmarks.shear4dof.case import roof_log_frf
from femupdate.benchmarks.shipped import benchmark_model, shipped_surrogate, surrogate_mark


@pytest.fixture(scope="module")
def model():
    return benchmark_model()


def test_simulations_are_the_response_with_noise(model):
    rng = np.random.default_rng(0)
    made = [simulate(model, ("3F", "RF"), 0.2, rng) for _ in range(4)]
    theta = np.array([one.theta for one in made])
    clean = roof_log_frf(model, theta)[:, [1, 3]]
    noise = np.array([one.observation.log_frf for one in made]) - clean
    # 8,192 draws: an sd to .8 %.
    assert noise.std() == pytest.approx(0.2, rel=0.04)
    assert abs(np.corrcoef(noise[:, 0].ravel(), noise[:, 1].ravel())[0, 1]) < 0.06
    assert ((theta > 0.33) & (theta < 3.0)).all()


def test_cases_of_other_weights_are_told_apart(model):
    surrogate = shipped_surrogate(model.building)
    weights = copy.deepcopy(surrogate)
    weights.mvae.lower[0] += 0.01
    again = shipped_surrogate(model.building)
    assert surrogate_mark(again) == surrogate_mark(surrogate) != surrogate_mark(weights)


def test_scores_of_uniform_and_of_narrow_levels():
    rng = np.random.default_rng(1)

    def judged(power):
        return [Judged(u**power, rng.random(3), rng.random()) for u in rng.random(400)]

    right, narrow = scores(judged(1.0)), scores(judged(0.3))
    np.testing.assert_allclose(right.density.found, [0.5, 0.68, 0.9, 0.95], atol=0.06)
    # P(u^.3 < .9) = .9^(1/.3)
    assert narrow.density.found[2] == pytest.approx(0.9 ** (1 / 0.3), abs=0.06)
    assert min(right.rank_p) > 1e-3
    assert right.tarp_p > 1e-3
    assert right.central.cases == 400


def test_unknown_damping_is_integrated_over_and_a_run_goes_on(tmp_path):
    floors = ("2F", "RF")
    plan = CalibrationPlan(building="shear_3dof", floors=floors, cases=3, particles=300, beside=1)
    job = Job(tmp_path, 2)
    report = run_calibration(job, plan)
    content = report.content()
    assert len(content["density_levels"]) == 3
    (widths,) = content["widths"]
    assert len(widths["ratio"]) == 3
    assert all(0.3 < ratio < 10.0 for ratio in widths["ratio"])
    assert "| theta_3 | 1 |" in report.text
    log = tmp_path / "calibration_shear_3dof_2F_RF_cases.jsonl"
    lines = log.read_text().splitlines()
    # Cut off in the middle of the last case: that one alone is made again, and is the same.
    log.write_text("\n".join([*lines[:-1], lines[-1][:100]]))
    assert run_calibration(job, plan).text == report.text
    assert log.read_text().splitlines()[:-1] == lines[:-1]
