"""The benchmark of measured events: what counts as held by the intervals of another event."""

from pathlib import Path

import femupdate.benchmarks.measured as benchmark
import numpy as np
import pytest
from femupdate.benchmarks.measured.run import Event, pair_of

from femupdate.inference import DrawnBy, Parameter, Parameters, Posterior
from femupdate.measurement import Observation
from femupdate.study import Study
from femupdate.workflow import open_study

FACTORS = Parameters.uniform(("theta_1", "theta_2", "theta_3"), [1.0 / 3.0] * 3, [3.0] * 3)
SIZE = Parameter(name="joint_flexibility", kind="effect", lower=0.0, upper=2.0)
ZETA = Parameter(name="zeta", kind="damping", lower=0.005, upper=0.05)
BUILDING = Path(benchmark.__file__).with_name("bench_stick_joints.toml")


@pytest.fixture
def event(tmp_path):
    """Events of a stick whose joints rotate: three known factors and the size of the joints."""
    study = Study(tmp_path / "study")
    model = open_study(study, str(BUILDING))

    def made(name, factor, joints):
        middle = np.array([factor, factor, factor, joints])
        draws = middle * np.exp(1e-3 * np.random.default_rng(0).standard_normal((1, 500, 4)))
        seen = np.ones((1, 4))
        posterior = Posterior(
            parameters=FACTORS + Parameters((SIZE, ZETA)),
            values=np.concatenate([draws, np.full((1, 500, 1), 0.01)], axis=2),
            log_likelihood=np.zeros((1, 500)),
            drawn=DrawnBy(likelihood="exact", way="drawing", chains=1, evaluations=500),
            observation=Observation(
                frequency_hz=np.arange(1.0, 5.0),
                floors=("RF",),
                log_frf=seen,
                noise_sd=0.1 * seen,
                valid=seen > 0.0,
            ),
            settings={},
        )
        return Event(name, BUILDING, 1.0, study, model, posterior, None, None)

    return made


# Another event has 5 % of stiffness more or less: 90 % intervals reach 8 % to either side.
@pytest.mark.parametrize(("factor", "share"), [(1.0, 1.0), (1.05, 1.0), (1.12, 0.0)])
def test_factors_are_held_within_the_scatter_between_events(event, factor, share):
    pair = pair_of(event("one", 1.0, 0.02), event("other", factor, 0.02), 0)
    assert pair.factors == share
    assert pair.frequency == bool(share)


def test_effects_move_the_frequency_and_are_no_factors(event):
    # Joints a third as stiff as the members lower the first frequency by far more than 4 %.
    pair = pair_of(event("one", 1.0, 0.02), event("other", 1.0, 3.0), 0)
    assert pair.factors == 1.0
    assert not pair.frequency
