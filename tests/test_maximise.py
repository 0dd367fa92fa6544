"""Searches against bounded linear least squares and curved ones by scipy, from several starts."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares, lsq_linear
from torch import Tensor

from femupdate.maximise import Search, maximise

SIZES = 4


@dataclass(frozen=True, eq=False)
class Curve:
    """Predictions of unknowns, straight or bent, with a normal prior of the last unknown."""

    design: Tensor
    data: Tensor
    lower: Tensor
    upper: Tensor
    bend: float = 0.0

    @property
    def mean(self):
        return torch.zeros_like(self.lower)

    @property
    def precision(self):
        return torch.diag(torch.tensor([0.0] * (SIZES - 1) + [1.0], dtype=torch.float64))

    def predicted(self, z):
        straight = z @ self.design.T
        return straight + self.bend * straight.square()

    def raw(self, z):
        return self.data - self.predicted(z)

    def whitened(self, raw):
        return raw

    def with_derivative(self, z, first):
        raw = self.raw(z)
        return raw, raw, self.derivative(z, raw, first)

    def derivative(self, z, residual, first):
        slope = 1.0 + 2.0 * self.bend * (z @ self.design.T)
        return slope[:, :, None] * self.design[:, first:]


def curve(seed, truth, bend=0.0, lower=-0.7, upper=0.7, last=(-np.inf, np.inf)):
    rng = np.random.default_rng(seed)
    design = rng.normal(size=(40, SIZES)) * ([1.0] * SIZES if bend else [8.0, 5.0, 7.0, 2.0])
    design[:, 1] += 0.5 * design[:, 0]  # not orthogonal
    ends = [
        torch.tensor([end] * (SIZES - 1) + [own], dtype=torch.float64)
        for end, own in zip((lower, upper), last, strict=True)
    ]
    made = Curve(torch.from_numpy(design), torch.zeros(40).double(), *ends, bend)
    clean = made.predicted(torch.tensor([truth], dtype=torch.float64))[0]
    noise = torch.from_numpy(rng.normal(size=40)) * (0.05 if bend else 1.0)
    return Curve(made.design, clean + noise, *ends, bend)


MENDED = Search(iterations=30, small=1e-4, longest=1.0, mended=True)
EXACT = Search(iterations=30, small_nats=1e-6)


@pytest.mark.parametrize("how", [MENDED, EXACT], ids=["mended", "exact"])
@pytest.mark.parametrize(
    ("truth", "last"),
    [
        ((0.2, -0.3, 0.1, 0.5), (-np.inf, np.inf)),
        ((0.2, -0.3, 1.5, 0.5), (-np.inf, np.inf)),  # an unknown beyond its limit
        ((0.2, -1.0, 0.1, -1.5), (0.0, np.inf)),  # and one of the impossible sign
    ],
    ids=["inside", "one held", "two held"],
)
def test_a_linear_model_is_solved_like_bounded_least_squares(truth, last, how):
    """Sum of squares and normal prior together, within the limits, from two starts."""
    target = curve(2, truth, last=last)
    starts = torch.tensor([[0.0] * SIZES, [0.5, 0.5, -2.0, 1.0]], dtype=torch.float64)
    found = maximise(target, starts, how)
    rows = np.vstack([target.design, [0.0, 0.0, 0.0, 1.0]])
    limits = target.lower.numpy(), target.upper.numpy()
    reference = lsq_linear(rows, np.append(target.data, 0.0), limits, tol=1e-14)
    assert (reference.active_mask != 0).any() == (truth != (0.2, -0.3, 0.1, 0.5))
    sd = np.sqrt(np.linalg.inv(rows.T @ rows).diagonal())
    for z, objective in zip(found.z, found.objective, strict=True):
        # The search ends at a relative decrease of 1e-4 of about 40.
        assert (np.abs(z.numpy() - reference.x) < 0.1 * sd).all()
        assert float(objective) == pytest.approx(2.0 * reference.cost, rel=1e-3)
        held = reference.active_mask != 0
        np.testing.assert_allclose(z[held], reference.x[held], rtol=1e-14, atol=1e-14)


def test_a_jacobian_of_which_one_part_is_made_anew_leads_to_the_fit():
    """The others are known from near by."""
    target = curve(5, (0.2, -0.3, 0.1, 0.3))
    start = torch.tensor([[0.2, -0.3, 0.1, 0.1]], dtype=torch.float64)
    how = Search(iterations=30, small=1e-4, longest=1.0, mended=True, renewed=False, fresh=3)
    seen = maximise(target, start, how, target.design[:, :3])
    whole = maximise(target, start, MENDED)
    assert float(seen.objective) == pytest.approx(float(whole.objective), rel=1e-6)
    torch.testing.assert_close(seen.z, whole.z, rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("known", [False, True], ids=["from nothing", "from a Jacobian near by"])
def test_the_jacobian_is_that_where_a_search_ends(known):
    """However it was mended on the way; where it ends is where scipy's search does."""
    target = curve(8, (0.3, -0.4, 0.2, 0.5), bend=0.1, lower=-np.inf, upper=np.inf)
    near = target.design[:, :3] if known else None
    found = maximise(target, torch.zeros(1, SIZES).double(), MENDED, near)

    def missed(z):
        own = target.raw(torch.from_numpy(z)[None])[0]
        return np.append(own.numpy(), z[-1])

    reference = least_squares(missed, np.zeros(SIZES), xtol=1e-12, ftol=1e-12)
    # The search ends where a step gains less than 1e-4 of the objective.
    assert float(found.objective) == pytest.approx(2.0 * reference.cost, rel=1e-3)
    torch.testing.assert_close(found.z[0], torch.from_numpy(reference.x), rtol=0.0, atol=0.01)
    expected = target.derivative(found.z, found.residual, 0)
    torch.testing.assert_close(found.jacobian, expected, rtol=0.0, atol=0.05)


def test_a_start_without_a_number_stays():
    target = curve(3, (0.2, -0.3, 0.1, 0.5))
    broken = Curve(target.design * torch.nan, target.data, target.lower, target.upper)
    found = maximise(broken, torch.zeros(1, SIZES).double(), EXACT)
    assert (found.z == 0.0).all()
    assert found.objective.isnan().all()
