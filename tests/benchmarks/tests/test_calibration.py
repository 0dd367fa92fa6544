"""The calibration benchmark: what it simulates, and a small run."""

import copy

import numpy as np
import pytest
import torch
from femupdate.benchmarks.calibration.cases import level_of, simulate
from femupdate.benchmarks.calibration.run import CalibrationPlan, run_calibration
from femupdate.benchmarks.calibration.tables import coverage
from femupdate.benchmarks.result import Job
from femupdate.benchmarks.shear4dof.case import roof_log_frf
from femupdate.benchmarks.shipped import benchmark_model, shipped_surrogate, surrogate_mark
from scipy.stats import chi2

from femupdate.inference.importance import SamplerRun


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


@pytest.mark.parametrize("width", [0.6, 1.0, 1.7])
def test_coverage_of_gaussians(width):
    """A region of probability q in two dimensions holds chi2 at width^2 times its own quantile."""
    rng = np.random.default_rng(0)
    truth = rng.normal(size=(1500, 2))
    draws = width * rng.normal(size=(1500, 400, 2))  # of posteriors whose sd is off by the width

    def level(true, drawn):
        def log_likelihood(theta):
            return -0.5 * (theta / width).square().sum(1)

        own = torch.from_numpy(drawn)
        known = {"log_likelihood": log_likelihood(own), "log_evidence": 0.0, "evaluations": 400}
        return level_of(SamplerRun(theta=own, **known), log_likelihood, true)

    found = coverage([level(*pair) for pair in zip(truth, draws, strict=True)])
    expected = chi2.cdf(width**2 * chi2.ppf(found.nominal, 2), 2)
    sd = np.sqrt(expected * (1.0 - expected) / found.cases)
    # 400 draws blur each level by up to .025.
    np.testing.assert_allclose(found.found, expected, atol=3.5 * sd.max() + 0.005)
    if width == 1.0:
        np.testing.assert_allclose(found.error, sd, rtol=1e-9)


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
