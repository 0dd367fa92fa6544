"""The four-story benchmark as a whole: its truth, its tables and its small run."""

import numpy as np
import pytest
from femupdate.benchmarks.result import Job
from femupdate.benchmarks.shear4dof.case import (
    PUBLISHED_SOLUTIONS,
    authors_case,
    case_modes,
    exact_posterior,
    random_case,
    roof_log_frf,
)
from femupdate.benchmarks.shear4dof.run import Shear4dofPlan, run_shear4dof
from femupdate.benchmarks.shipped import benchmark_model

# Long runs of another sampler over the exact likelihood (tests/inference/test_benchmark.py).
WEIGHT = [0.337, 0.132, 0.346, 0.185]
SD = [
    [0.0071, 0.0058, 0.0045, 0.0067],
    [0.0073, 0.0052, 0.0048, 0.0022],
    [0.0269, 0.0114, 0.0036, 0.0028],
    [0.0117, 0.0046, 0.0043, 0.0037],
]


@pytest.fixture(scope="module")
def model():
    return benchmark_model()


def test_exact_posterior(model):
    case = authors_case(model)
    np.testing.assert_allclose(case.solutions, PUBLISHED_SOLUTIONS, atol=5e-6)
    found = exact_posterior(model, case, draws=10_000, seed=4, particles=1000)
    assert found.weighted.log_evidence == pytest.approx(-580.90, abs=0.03)
    assert found.weighted.log_evidence_error < 0.005
    # 15,000 effective draws: .004 for a weight, and 1.5 % for the rarest mode's deviations.
    np.testing.assert_allclose(found.modes.weight, WEIGHT, atol=0.015)
    np.testing.assert_allclose(found.modes.sd, SD, rtol=0.08)


def test_random_cases_have_the_truth_among_their_solutions(model):
    case = random_case(model, np.random.default_rng(3))
    assert np.abs(case.solutions - case.theta).max(axis=1).min() < 1e-6
    roofs = roof_log_frf(model, case.solutions)[:, -1]
    np.testing.assert_allclose(roofs, roofs[[0]].repeat(len(roofs), 0), atol=1e-4)
    near = case.solutions + 0.5 * case.sd
    np.testing.assert_array_equal(case_modes(case, near).member, np.arange(len(near)))


def _refuse(*_):
    raise AssertionError("it was made already")


@pytest.mark.slow
def test_small_run(tmp_path, monkeypatch):
    pytest.importorskip("sklearn")
    made = []

    def exact_once(*args, **options):
        made.append(made[0] if made else exact_posterior(*args, **options))
        return made[-1]

    monkeypatch.setattr("femupdate.benchmarks.shear4dof.run.exact_posterior", exact_once)
    job, plan = Job(tmp_path), Shear4dofPlan((200,), 2, 1000, 1, particles=1000)
    report = run_shear4dof(job, plan)
    content = report.content()
    assert content["log_evidence"] == pytest.approx(-580.9, abs=0.1)
    (judged,) = content["observations"]
    assert judged["bridged"]["weight_distance"] < 0.05
    assert judged["bridged"]["c2st"] < 0.56
    assert abs(judged["evidence_error"]) < 0.1
    # The latent posterior takes no response, the bridge a few for each particle.
    assert judged["responses"] < 20 * 1000
    rows = {(row["likelihood"], row["sampler"]): row for row in content["samplers"]}
    assert len(rows) == 5
    walk, mixture = rows["data", "random walk (paper)"], rows["data", "mixture"]
    assert mixture["unique"] > walk["unique"]
    assert mixture["evaluations"] < 0.5 * walk["evaluations"]
    assert "| solution 4 | 2.63969 |" in report.text
    # All of it is kept: a second run makes neither rows nor observations again.
    for part in ("observation_result", "sampler_row"):
        monkeypatch.setattr(f"femupdate.benchmarks.shear4dof.run.{part}", _refuse)
    assert run_shear4dof(job, plan).text == report.text
