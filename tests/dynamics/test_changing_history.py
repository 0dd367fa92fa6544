"""A building that softens while it shakes, against scipy's integration of its own equation."""

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp
from scipy.ndimage import uniform_filter1d

from femupdate.building import from_document
from femupdate.dynamics import OwnLevel, System, floor_histories, history_batches, lumped
from femupdate.effects import CATALOGUE, Placed, structure_of
from tests.documents import stick

MASS, SPRING, STEP = 2000.0, 8e5, 0.01
ZETA, MEAN = 0.03, 1.0
PERIOD = 2.0 * np.pi * np.sqrt(MASS / SPRING)


def document():
    return stick([MASS], [SPRING], grid=(0.2, 60), ratio=ZETA)


@pytest.fixture(scope="module")
def system():
    reduced = lumped(structure_of(from_document(document())))
    placed = (Placed(CATALOGUE["softening_in_run"], "all"),)
    return System(reduced.model, placed=placed, terms=(reduced.terms(placed[0]),))


def noise(seconds, seed=3):
    """Shaking about the building's frequency, 3.2 Hz."""
    time = np.arange(round(seconds / STEP)) * STEP
    rng = np.random.default_rng(seed)
    waves = zip(np.linspace(1.5, 6.0, 90), rng.uniform(0.0, 6.28, 90), strict=True)
    return time, sum(np.sin(2.0 * np.pi * f * time + phase) for f, phase in waves) / 9.0


def followed(system, sizes, base, level=None, **more):
    parameters = torch.tensor([[1.0, *sizes]], dtype=torch.float64)
    zeta = torch.tensor([ZETA], dtype=torch.float64)
    mean = None if level is None else np.array([level])
    own = OwnLevel(mean, **more)
    (found,) = history_batches(system, parameters, zeta, base, STEP, level=own)
    return found


def test_without_a_change_it_is_the_linear_response(system):
    _, base = noise(20.0)
    found = followed(system, (0.0, 0.0), base, MEAN)
    linear = floor_histories(system, [[1.0, 0.0, 0.0]], ZETA, base, STEP)
    np.testing.assert_allclose(found.floor_acceleration, linear.floor_acceleration, atol=1e-12)
    np.testing.assert_allclose(found.story_drift, linear.story_drift, atol=1e-15)


def test_far_from_the_mean_level_it_is_linear_at_the_end_of_the_span(system):
    _, base = noise(30.0)
    for strength, level in ((30.0, 1.0), (0.03, -1.0)):
        found = followed(system, (-0.1, 0.3), strength * base, MEAN)
        at = floor_histories(
            system, [[0.9**level, -0.1, 0.3]], ZETA * 1.3**level, strength * base, STEP
        )
        # The first second of all is rest.
        late = slice(300, None)
        np.testing.assert_allclose(
            found.floor_acceleration[..., late], at.floor_acceleration[..., late], rtol=1e-9
        )


def test_its_own_equation_is_followed(system):
    """Within a twelfth of the motion, where the linear response is off by a third and more."""
    time, base = noise(80.0)
    base = base * 2.0 ** np.linspace(-2.0, 1.0, len(time))
    softer, damped = -0.15, 0.3
    found = followed(system, (softer, damped), base, MEAN).floor_acceleration[0, 0]
    width = round(4.0 * PERIOD / STEP)
    level = 0.5 * np.log2(np.maximum(uniform_filter1d(found**2, width, mode="constant"), 1e-9))
    level = np.clip(level, -1.0, 1.0)

    squared = SPRING / MASS * (1.0 + softer) ** level
    loss = 2.0 * ZETA * (1.0 + damped) ** level * np.sqrt(squared)

    def equation(t, state):
        u, v = state
        of_base = np.interp(t, time, base)
        return [v, -of_base - np.interp(t, time, loss) * v - np.interp(t, time, squared) * u]

    exact = solve_ivp(equation, (0.0, time[-1]), [0.0, 0.0], t_eval=time, max_step=STEP, rtol=1e-7)
    acceleration = -loss * exact.y[1] - squared * exact.y[0]
    linear = floor_histories(system, [[1.0, 0.0, 0.0]], ZETA, base, STEP).floor_acceleration[0, 0]
    size = np.sqrt(np.mean(acceleration**2))
    off, off_linear = (
        np.sqrt(np.mean((one - acceleration) ** 2)) / size for one in (found, linear)
    )
    assert off < 1.0 / 12.0
    assert off_linear > 1.0 / 3.0


def test_without_a_known_level_the_mean_is_that_of_the_motion(system):
    _, base = noise(40.0)
    weak, strong = (followed(system, (-0.1, 0.3), k * base) for k in (0.1, 10.0))
    np.testing.assert_allclose(
        100.0 * weak.floor_acceleration, strong.floor_acceleration, rtol=1e-6, atol=1e-9
    )
