"""What programs differ by in all members alike, in the posterior of a frame."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.inference import Parameter, Parameters
from femupdate.workflow.conclusion import with_errors_of_models


@dataclass(frozen=True)
class Draws:
    """The part of a posterior that is moved: two factors and the size of an effect."""

    parameters: Parameters
    values: np.ndarray

    @staticmethod
    def of(middle, lower, upper, neutral=0.0):
        factors = Parameters.uniform(("theta_1", "theta_2"), lower[:2], upper[:2])
        size = Parameter(
            name="size", kind="effect", lower=lower[2], upper=upper[2], neutral=neutral
        )
        return Draws(factors + Parameters((size,)), np.broadcast_to(middle, (2, 4000, 3)))


POSTERIOR = Draws.of([0.8, 1.2, -0.1], (0.3, 0.3, -0.5), (3.0, 3.0, 0.5))


def model(shared=None, kind="frame", effects=()):
    placed = tuple(SimpleNamespace(effect=effect) for effect in effects)
    building, system = SimpleNamespace(kind=kind), SimpleNamespace(placed=placed)
    return SimpleNamespace(shared=shared, building=building, system=system)


def test_all_factors_of_a_frame_move_together_and_nothing_else_moves():
    moved = with_errors_of_models(POSTERIOR, model("of a mesh"), 1).values
    by = np.log(moved[..., :2] / POSTERIOR.values[..., :2])
    np.testing.assert_allclose(by[..., 0], by[..., 1], atol=1e-12)
    # Of 8000 draws a standard deviation is known to .8 %; four of these.
    assert by[..., 0].std() == pytest.approx(MESH_ERROR.of_all, rel=0.032)
    assert abs(by.mean()) < 4.0 * MESH_ERROR.of_all / np.sqrt(8000)
    assert (moved[..., 2] == -0.1).all()


@pytest.mark.parametrize(("kind", "errs"), [("frame", np.hypot(0.12, 0.03)), ("shear", 0.12)])
def test_sizes_err_by_what_the_models_of_effects_err_by_about_their_neutral_values(kind, errs):
    """A ratio of 1.5 whose neutral value is one: the half of it is what errs."""
    rough = SimpleNamespace(own_error=0.12, parameters=(None,))
    draws = Draws.of([0.8, 1.2, 1.5], (0.3, 0.3, 0.0), (3.0, 3.0, 9.0), neutral=1.0)
    moved = with_errors_of_models(draws, model(None, kind, (rough,)), 1).values
    assert (moved[..., :2] == draws.values[..., :2]).all()
    assert moved[..., 2].std() == pytest.approx(0.5 * errs, rel=0.032)
    assert moved[..., 2].mean() == pytest.approx(1.5, abs=4.0 * 0.5 * errs / np.sqrt(8000))
