"""What the next event adds: scatter of its own, and what does not follow the base."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.integrate import simpson
from scipy.stats import norm

from femupdate.dynamics import ResponseHistories
from femupdate.inference import EventErrors, EventScatter, learned_scatter
from femupdate.inference.error_draws import ErrorDraws, SizeDraws
from femupdate.inference.event_scatter import sd_density
from femupdate.inference.next_event import between_runs, incoherent_share
from femupdate.measurement import Observation, pooled

GRID = np.linspace(1.0, 10.0, 10)


def test_factors_scatter_together_by_as_much_as_asked():
    theta, zeta = torch.ones(20_000, 3).double(), torch.full((20_000,), 0.02).double()
    box = torch.full((3,), 0.1).double(), torch.full((3,), 9.0).double()
    moved, damped = EventScatter(stiffness=0.05, damping=0.2).next_event(theta, zeta, box, 1)
    # A standard deviation of 20,000 draws errs by half a percent.
    assert float(moved[:, 0].log().std()) == pytest.approx(0.05, rel=0.02)
    assert float((damped / 0.02).log().std()) == pytest.approx(0.2, rel=0.02)
    assert torch.equal(moved[:, 0], moved[:, 2])
    same, kept = EventScatter(stiffness=0.0, damping=0.0).next_event(theta, zeta, box, 1)
    assert torch.equal(same, theta)
    assert torch.equal(kept, zeta)


def test_what_does_not_follow_the_base_has_the_power_that_the_coherence_leaves():
    measured = Observation(
        frequency_hz=GRID,
        floors=("RF",),
        log_frf=np.zeros((1, 10)),
        noise_sd=np.full((1, 10), 0.1),
        valid=np.ones((1, 10), dtype=bool),
        coherence=np.full((1, 10), 0.9),
        leaking_sd=np.full((1, 10), 0.25),
    )
    both = incoherent_share(measured, ("2F", "RF"), GRID)
    # Half of the power 1 / 9 in either part; two fifths of its root are no leakage. 2F
    # has the mean.
    np.testing.assert_allclose(both, 0.4 * np.sqrt(0.5 / 9.0), rtol=1e-12)


@pytest.mark.parametrize("noises", [(0.05,) * 5, (0.01, 0.05, 0.05, 0.1, 0.1)])
def test_differences_of_runs_beyond_their_noise_are_told_from_it(noises):
    """Five runs that err by .1 each of their own at RF beside their noise, and not at 2F."""
    rng, grid = np.random.default_rng(1), np.linspace(0.1, 100.0, 1000)
    own = np.array([[0.0], [0.1]])
    runs = [
        Observation(
            frequency_hz=grid,
            floors=("2F", "RF"),
            log_frf=own * rng.standard_normal((2, 1000)) + noise * rng.standard_normal((2, 1000)),
            noise_sd=np.full((2, 1000), noise),
            valid=np.ones((2, 1000), dtype=bool),
        )
        for noise in noises
    ]
    found = between_runs(pooled(runs, ("2F", "RF")), ("2F", "3F", "RF"), grid)
    # Variances of 4,000 degrees of freedom are known to 2 %; that of noise alone is cut at zero. Of
    # runs whose noise is unlike those with the least count most: some 1,500 degrees.
    assert np.sqrt((found[2] ** 2).mean()) == pytest.approx(0.1, rel=0.07)
    assert np.sqrt((found[0] ** 2).mean()) < 0.035
    np.testing.assert_allclose(found[1], 0.5 * (found[0] + found[2]))


def test_runs_that_differ_over_a_part_of_the_band_differ_there_alone():
    """Running means of what ends are rounded, and have a root all the same."""
    grid, size = np.linspace(0.1, 40.0, 400), 0.37 * np.linspace(1.0, 3.0, 150) ** 3
    values = np.concatenate([size, np.zeros(250)])
    runs = [
        Observation(
            frequency_hz=grid,
            floors=("RF",),
            log_frf=sign * values[None],
            noise_sd=np.full((1, 400), 1e-2),
            valid=np.ones((1, 400), dtype=bool),
        )
        for sign in (-1.0, 1.0)
    ]
    found = between_runs(pooled(runs, ("RF",)), ("RF",), grid)
    assert (found[0, :150] > 0.3).all()
    np.testing.assert_allclose(found[0, 160:], 0.0, atol=1e-6)


def learned(runs=0, between=None, floors=("RF",), draws=1, sign=1.0):
    """RF was measured and the model 20 % low there, half of it (in variance) at all floors."""
    measured = Observation(
        frequency_hz=GRID,
        floors=floors,
        log_frf=np.zeros((len(floors), 10)),
        noise_sd=np.full((len(floors), 10), 0.1),
        valid=np.array([[floor == "RF"] * 10 for floor in floors]),
        between=between,
    )
    mean = np.full((len(floors), 10), 0.2) * sign
    sizes = SizeDraws(np.full((1, 1, 4), 0.1) * [1.0, 1.0, 10.0, 10.0], mean)
    errors = ErrorDraws(sizes, None, 1.0, 9.0)
    scatter = SimpleNamespace(runs=runs) if runs else None
    posterior = SimpleNamespace(model_error=errors, scatter=scatter, observation=measured)
    return EventErrors(posterior, np.zeros(draws, dtype=int), 0.01, 0)


def gain(errors, hertz):
    """Of steady motion at 2F and RF by what stays of the error."""
    time = np.arange(0.0, 60.0, 0.01)
    wave = np.sin(2.0 * np.pi * hertz * time)
    moved = errors.corrected(("2F", "RF"), np.array([wave, wave]), 0.01)
    middle = slice(2000, 4000)  # far from both ends
    return np.log(moved[:, middle].std(axis=1) / wave[middle].std())


def test_a_share_of_the_error_of_one_event_stays_in_the_next():
    np.testing.assert_allclose(gain(learned(), 5.0), [0.09, 0.18], rtol=0.01)
    # A floor whose points are all left out is no measured one.
    np.testing.assert_allclose(gain(learned(floors=("2F", "RF")), 5.0), [0.09, 0.18], rtol=0.01)
    # Outside of the band it was learned in it fades over its length of 1 Hz.
    assert gain(learned(), 14.0)[1] == pytest.approx(0.18 * np.exp(-4.0), rel=0.1)
    # What changes from point to point stays less, by its neighbours within .04 of the band: these
    # weigh exp(-1 / .36), whose sums are geometric.
    weight = np.exp(-1.0 / 0.36)
    narrow = gain(learned(sign=(-1.0) ** np.arange(10)), 5.0)
    expected = 0.18 * ((1.0 - weight) / (1.0 + weight)) ** 2
    np.testing.assert_allclose(narrow[1], expected, rtol=0.05)


def test_the_mean_of_several_runs_stays_and_is_known_to_their_scatter():
    errors = learned(4, np.full((1, 10), 0.01), draws=400)
    # Of one run .9 would stay, and the parts of four events are a quarter of one's in variance.
    assert gain(errors, 5.0)[1] == pytest.approx(0.2 * 0.9 / (0.9 + 0.1 / 4.0), rel=0.01)
    time = np.arange(0.0, 20.0, 0.01)
    wave = np.broadcast_to(np.sin(2.0 * np.pi * 5.0 * time), (400, 2, 2000))
    moved = ResponseHistories(0.01, ("2F", "RF"), wave, wave, wave)
    (*batches,) = errors.applied([moved])
    middle = np.concatenate([batch.floor_acceleration for batch in batches])[:, 1, 800:1200]
    # In phase: .1 of an event's own, and .1 / 2 of the mean; 400 draws know it to 4 %.
    turning = middle @ np.exp(-2j * np.pi * 5.0 * time[800:1200]) / 200.0
    assert np.log(np.abs(turning)).std() == pytest.approx(0.1 * np.sqrt(1.25), rel=0.08)


ESTIMATES, ERRORS = np.array([0.03, -0.05, 0.08, 0.0]), np.array([0.01, 0.02, 0.03, 0.015])


def test_the_density_of_the_scatter_is_that_of_the_random_effects_model():
    """Mean, over the prior of tau and a flat one of the mean over events, by quadrature."""

    mean, log_tau = np.linspace(-0.8, 0.8, 801)[:, None], np.linspace(-5.9, 0.0, 601)
    joint = norm.pdf(log_tau, np.log(0.05), 1.0)
    for estimate, error in zip(ESTIMATES, ERRORS, strict=True):
        joint = joint * norm.pdf(estimate, mean, np.hypot(error, np.exp(log_tau)))
    whole, first = (
        simpson(simpson(np.exp(power * log_tau) * joint, x=log_tau), x=mean[:, 0])
        for power in (0, 1)
    )
    tau, weight = sd_density(ESTIMATES, ERRORS, 0.05)
    assert tau @ weight == pytest.approx(first / whole, rel=0.005)


@pytest.mark.parametrize("true", [0.02, 0.05, 0.1])
def test_intervals_of_the_next_event_hold_it(true):
    """Over 400 buildings of five events each, at a scatter that the prior holds."""
    rng, held = np.random.default_rng(2), []
    for seed in range(400):
        errors = rng.uniform(0.005, 0.02, 5)
        seen = true * rng.standard_normal(5) + errors * rng.standard_normal(5)
        found = learned_scatter(
            seen[:, None].repeat(2, 1), errors[:, None].repeat(2, 1), (1, 400), seed
        )
        pooled = (seen / errors**2).sum() / (errors**-2).sum()
        draws = pooled + (errors**-2).sum() ** -0.5 * rng.standard_normal(400)
        of = found.of(np.arange(400))
        following = draws + of.stiffer + of.stiffness * rng.standard_normal(400)
        low, high = np.quantile(following, [0.05, 0.95])
        held.append(low <= true * rng.standard_normal() <= high)
    # The prior is about .05: below it intervals are wide, above a little narrow (.8 at .15).
    assert 0.84 <= np.mean(held) <= 1.0
