"""Our training beside the published layout: its layers, the race, and what is written."""

import math
import time
from importlib.metadata import version

import numpy as np
import pytest
import torch
from femupdate.benchmarks.result import Job
from femupdate.benchmarks.training.plot_race import race_figure
from femupdate.benchmarks.training.published_network import (
    LATENT,
    PUBLISHED_PARAMETERS,
    Gaussian,
    PublishedNetwork,
    parameter_counts,
)
from femupdate.benchmarks.training.published_training import (
    RECONSTRUCTION,
    published_loss,
    published_training,
    start_published,
)
from femupdate.benchmarks.training.race import (
    HeldOut,
    Point,
    Runner,
    first_to,
    race,
    score,
    turn_ends,
)
from femupdate.benchmarks.training.run import OURS, PUBLISHED, Reached, TrainingPlan, run_training
from scipy.stats import norm

from femupdate.errors import ReportError, SurrogateError
from femupdate.inference.parameters import Parameters

PARTS = ("parameter_encoder", "observation_encoder", "decoder")
NOISE = 0.2


@pytest.fixture
def small():
    torch.manual_seed(0)
    return PublishedNetwork(parameters=3, points=64)


def held_out(count=300, points=64, seed=0):
    generator = torch.Generator().manual_seed(seed)
    theta = torch.rand(count, 3, generator=generator)
    return HeldOut(theta, torch.sin(theta @ torch.ones(3, points)).half(), NOISE)


def test_the_layout_has_the_published_numbers_of_parameters():
    assert parameter_counts(PublishedNetwork(), PARTS) == PUBLISHED_PARAMETERS


def test_shapes(small):
    theta, x = torch.rand(5, 3), torch.randn(5, 64)
    for q in (small.encode_parameters(theta), small.encode_observation(x)):
        assert q.mean.shape == q.variance.shape == (5, LATENT)
        assert (q.variance > 0.0).all()
    decoded = small.decode(torch.randn(5, LATENT))
    assert decoded.mean.shape == decoded.variance.shape == (5, 64)
    assert (decoded.variance > 0.0).all()


def test_points_that_cannot_be_halved_five_times_are_refused():
    with pytest.raises(ValueError, match="100 points are no multiple of 32"):
        PublishedNetwork(points=100)


def test_encoders_drop_units_in_training_alone(small):
    theta, x = torch.rand(40, 3), torch.randn(40, 64)
    for encode, argument in ((small.encode_parameters, theta), (small.encode_observation, x)):
        assert not torch.equal(encode(argument).mean, encode(argument).mean)
        small.eval()
        assert torch.equal(encode(argument).mean, encode(argument).mean)
        small.train()


def test_convolutions_of_the_encoder_have_a_spectral_norm_of_one(small):
    with torch.no_grad():
        for _ in range(60):  # a power iteration each
            small.encode_observation(torch.randn(4, 64))
    for block in small.observation_encoder.blocks:
        for layer in (block.inner, block.outer, block.shortcut):
            found = torch.linalg.matrix_norm(layer.weight.detach().flatten(1), 2)
            assert float(found) == pytest.approx(1.0, abs=0.02)


def test_gaussians_have_scipys_density_and_the_closed_divergence():
    q = Gaussian(torch.tensor([[0.3, -1.0]]), torch.tensor([[0.5, 2.0]]))
    x = np.array([0.1, 0.4])
    expected = -norm.logpdf(x, [0.3, -1.0], np.sqrt([0.5, 2.0])).sum()
    assert float(q.negative_log_density(torch.from_numpy(x))) == pytest.approx(expected, rel=1e-6)
    # E_q[ln q - ln p] over many draws: .01 is three standard errors.
    draws = norm.rvs([0.3, -1.0], np.sqrt([0.5, 2.0]), size=(200_000, 2), random_state=1)
    excess = norm.logpdf(draws, [0.3, -1.0], np.sqrt([0.5, 2.0])) - norm.logpdf(draws)
    assert float(q.prior_divergence()) == pytest.approx(excess.sum(1).mean(), abs=0.01)


class Echo:
    """Encoders that say the prior, and a decoder that gives back what the encoder saw."""

    def encode_observation(self, x):
        self.seen = x
        return self.encode_parameters(x)

    def encode_parameters(self, theta):
        return Gaussian(torch.zeros(len(theta), 2), torch.full((len(theta), 2), self.width))

    def decode(self, z):
        seen = self.seen.repeat(2, 1)
        return Gaussian(seen, torch.full_like(seen, 2.0 * NOISE**2))


@pytest.mark.parametrize("width", [1.0, 0.25])
def test_the_noise_of_input_and_target_is_independent(width):
    """Residuals then have twice the noise's variance; with one noise they would be zero."""
    echo, x = Echo(), torch.randn(2000, 64)
    echo.width = width
    generator = torch.Generator().manual_seed(2)
    loss = float(published_loss(echo, torch.zeros(2000, 3), x, NOISE, generator))
    nats = 64 * norm.entropy(scale=math.sqrt(2.0) * NOISE)
    divergence = 2 * 0.5 * (width - 1.0 - math.log(width))
    # Both terms share their noise: 2 sqrt(64 / 2) / sqrt(2000) = .25 is the standard error.
    assert loss == pytest.approx(2.0 * (nats + divergence / RECONSTRUCTION), abs=0.8)


def test_the_published_training_learns():
    """Its own loss, with the same noise and without dropout, before and after a few steps."""
    data = held_out(512)
    box = Parameters.uniform(tuple("abc"), torch.zeros(3).double(), torch.ones(3).double())
    torch.manual_seed(0)  # of dropout
    network = start_published(box, data.log_frf[:500], NOISE, seed=0)
    training = published_training(network, data.theta, data.log_frf, NOISE, seed=0)

    def loss():
        network.eval()
        generator = torch.Generator().manual_seed(1)
        with torch.no_grad():
            found = published_loss(network, data.theta, data.log_frf.float(), NOISE, generator)
        network.train()
        return float(found)

    assert next(training) is network
    before = loss()
    for _ in range(12):
        next(training)
    # Of two encoders' 64 points each; the noise is the same, so every nat is the network's.
    assert loss() < before - 10.0


def test_the_limit_is_the_entropy_of_the_noise_and_a_perfect_emulator_has_it():
    data = held_out()
    assert data.limit == pytest.approx(64 * norm.entropy(scale=NOISE), rel=1e-12)

    def emulate(theta, shift=0.0, factor=1.0):
        mean = torch.sin(theta @ torch.ones(3, 64)).half().float() + shift
        return mean, torch.full_like(mean, factor * NOISE**2)

    assert score(emulate, data) == pytest.approx((data.limit, 0.0), rel=1e-5, abs=1e-6)
    loss, rms = score(lambda theta: emulate(theta, shift=0.1), data)
    assert loss == pytest.approx(data.limit + 64 * 0.5 * (0.1 / NOISE) ** 2, rel=1e-5)
    assert rms == pytest.approx(0.1, rel=1e-4)
    # Too wide by a factor of two: ln(2) / 2 dearer, but half of the noise's square is saved.
    loss, _ = score(lambda theta: emulate(theta, factor=2.0), data)
    assert loss == pytest.approx(data.limit + 64 * (0.5 * math.log(2.0) - 0.25), rel=1e-5)


def test_turns_grow_to_the_longest_and_end_with_the_budget():
    ends = np.array(turn_ends(300.0, 20.0))
    assert ends[0] == 1.0
    assert ends[-1] == 300.0
    assert np.diff(ends).max() == 20.0
    assert (np.diff(ends) > 0.0).all()
    assert turn_ends(0.5, 20.0) == [0.5]


def test_runners_take_turns_and_get_their_processor_time():
    order = []

    def training(name, steps):
        for _ in range(steps):
            order.append(name)
            started = time.process_time()
            while time.process_time() - started < 0.01:
                pass
            yield name

    def emulate(theta):
        return torch.zeros(len(theta), 64), torch.ones(len(theta), 64)

    runners = [Runner("a", training("a", 10**6), emulate), Runner("b", training("b", 3), emulate)]
    notes = []
    race(runners, held_out(), [0.05, 0.1], notes.append)
    assert len(notes) == 4
    a, b = (runner.points for runner in runners)
    # No step is cut short, and the looks between turns cost nothing.
    for point, end in zip(a[1:], (0.05, 0.1), strict=True):
        assert end <= point.cpu_seconds < end + 0.02
        assert point.clock_seconds >= point.cpu_seconds - 1e-3
        assert 0.01 * point.steps <= point.cpu_seconds + 1e-3
    assert [point.steps for point in b] == [0, 3, 3]
    first = "".join(order).index("b")
    assert first == a[1].steps
    assert order[first + 3 :] == ["a"] * (a[2].steps - a[1].steps)


def point(cpu, loss, steps=1):
    return Point(cpu, 2.0 * cpu, steps, loss, 0.1)


def test_times_are_compared_where_a_loss_is_first_had():
    points = [point(0.0, 1.0, steps=0), point(1.0, 9.0), point(2.0, 5.0), point(3.0, 1.0)]
    assert first_to(points, 5.0) is points[2]
    assert first_to(points, 0.5) is None
    reached = Reached(5.0, point(12.0, 5.0), points[2])
    assert (reached.cpu_ratio, reached.clock_ratio) == (6.0, 6.0)
    assert Reached(5.0, point(12.0, 5.0), None).cpu_ratio is None


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Some second of training each, on the benchmark's own building."""
    folder = tmp_path_factory.mktemp("training")
    return run_training(Job(folder, 3), TrainingPlan(700, 0.015, 1.0))


def test_the_files_hold_what_was_measured(written):
    found = written.content()
    assert found["seed"] == 3
    assert found["machine"]["packages"]["torch"] == version("torch")
    assert found["plan"] == {"samples": 700, "minutes": 0.015, "turn": 1.0}
    assert found["threads"] == torch.get_num_threads()
    assert found["parameters"][PUBLISHED] == PUBLISHED_PARAMETERS
    assert found["limit"] == pytest.approx(1024 * norm.entropy(scale=NOISE))
    published, ours = found["curves"][PUBLISHED], found["curves"][OURS]
    for curve in (published, ours):
        assert curve[0]["steps"] == 0
        assert curve[-1]["cpu_seconds"] >= 0.9
        assert all(entry["loss"] > found["limit"] for entry in curve)
    best = min(published, key=lambda entry: entry["loss"])
    assert found["reached"]["loss"] == best["loss"]
    first = next((entry for entry in ours[1:] if entry["loss"] <= best["loss"]), None)
    ratio = None if first is None else best["cpu_seconds"] / first["cpu_seconds"]
    assert found["cpu_ratio"] == (ratio if ratio is None else pytest.approx(ratio))
    text = written.markdown.read_text(encoding="utf-8")
    assert text.startswith(found["machine"]["date"][:10])
    assert "708,070" in text
    assert f"{best['loss']:.1f}" in text
    assert written.pictures[0].read_bytes().startswith(b"\x89PNG")


def test_both_are_judged_on_the_same_responses(written):
    """Neither has learned yet: errors are those of a mean, about the spread of ln|H|."""
    for curve in written.content()["curves"].values():
        assert 0.5 < curve[0]["rms"] < 3.0


def test_too_few_samples_are_refused(tmp_path):
    with pytest.raises(SurrogateError, match="500 samples are too few for batches of 512"):
        run_training(Job(tmp_path), TrainingPlan(samples=500))
    assert not list(tmp_path.iterdir())


def test_a_race_without_runners_cannot_be_drawn():
    with pytest.raises(ReportError, match="there is no training to draw"):
        race_figure({}, 0.0, 1.0)


def test_an_interrupt_ends_the_race_with_what_there_is():
    def training():
        yield 1
        raise KeyboardInterrupt

    def emulate(theta):
        return torch.zeros(len(theta), 64), torch.ones(len(theta), 64)

    runner = Runner("a", training(), emulate)
    race([runner], held_out(), [1.0], lambda note: None)
    assert len(runner.points) == 1
