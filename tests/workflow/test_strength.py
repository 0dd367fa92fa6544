"""A chain that yields in one story is told to change while it shakes; a linear one is not."""

import re

import numpy as np
import pytest
import torch
from scipy.linalg import eigh
from scipy.signal import lsim

from femupdate.building import from_document
from femupdate.discrepancy import Diagnosis, DiagnosisSettings
from femupdate.discrepancy.findings import NONE
from femupdate.discrepancy.fit import fit, fit_baseline
from femupdate.discrepancy.search import problem_of
from femupdate.discrepancy.strength import (
    beyond_linear,
    judged_by_strength,
    missed_in_run,
    peaks_with,
    secant_when_strong,
    what_yields,
)
from femupdate.dynamics import lumped, reduced_on
from femupdate.effects import structure_of
from femupdate.inference import COARSE_ERROR
from femupdate.inference.frf_data import frf_data
from femupdate.measurement import FloorChannel, Histories, observation_for
from tests.documents import stick, towers

MASS, SPRING, STEP, FINE = np.array([3e5, 3e5, 2e5]), np.array([2e8, 2e8, 1.5e8]), 0.01, 8
FLOORS, ZETA, SHARE = ("2F", "3F", "RF"), 0.02, 0.2
PRIOR = {"theta": {"lower": 0.5, "upper": 2.0}, "zeta": {"lower": 0.005, "upper": 0.1}}


def motion(seed, seconds=60.0):
    """An earthquake that rises in ten seconds and dies down, m/s2, with steps of STEP / FINE."""
    rng, count = np.random.default_rng(seed), round(seconds / STEP)
    frequency = np.fft.rfftfreq(count, STEP)
    white = np.fft.rfft(rng.standard_normal(count))
    white[(frequency < 0.3) | (frequency > 16.0)] = 0.0
    time = np.arange(count) * STEP
    base = np.fft.irfft(white, count) * np.minimum((time / 10.0) ** 2, np.exp(-(time - 20.0) / 15))
    base *= 2.0 / np.abs(base).max()
    fine = np.concatenate([np.fft.rfft(base), np.zeros(count * (FINE - 1) // 2)])
    return np.fft.irfft(fine, count * FINE) * FINE


def shaken(base, yields, gap=np.inf, spring=SPRING):
    """Accelerations, drifts and shears (3, c, floors, n) of chains.

    Their stories follow Bouc and Wen (exponent one), and yield at displacements (c, stories), m,
    from which a share of their stiffness stays; infinite: never. The top strikes a spring beyond a
    gap, m. Semi-implicit Euler steps.
    """
    drift = np.eye(3) - np.eye(3, k=-1)
    chain = drift.T @ np.diag(SPRING) @ drift
    squared, shapes = np.linalg.eigh(chain / np.sqrt(np.outer(MASS, MASS)))
    root = np.sqrt(MASS)[:, None] * shapes
    damping = root @ np.diag(2.0 * ZETA * np.sqrt(squared)) @ root.T
    share, step = np.where(np.isfinite(yields), SHARE, 1.0), STEP / FINE
    moved, speed, lag = np.zeros((3, *yields.shape))
    seen = np.zeros((3, *yields.shape, base.size))
    for n, pushed in enumerate(base):
        shear = spring * (share * (moved @ drift.T) + (1.0 - share) * lag)
        own = -(shear @ drift + speed @ damping) / MASS
        own[:, -1] -= SPRING[-1] * np.maximum(moved[:, -1] - gap, 0.0) / MASS[-1]
        seen[..., n] = own, moved @ drift.T, shear
        speed = speed + step * (own - pushed)
        moved = moved + step * speed
        rate = speed @ drift.T
        lag = lag + step * (rate - 0.5 * (abs(rate) * lag + rate * abs(lag)) / yields)
    return seen


@pytest.fixture(scope="module")
def runs():
    """A motion, and what a linear chain answers, as it is and 10 and 1.5 % softer."""
    base, kept = motion(1), 1.0 - np.array([[0.0], [0.1], [0.015]])
    return base, *shaken(base, np.full((3, 3), np.inf), spring=kept * SPRING)[0]


def fitted_to(base, seen, seed, reduced, direction="x"):
    """The model that a run with 2 % of noise leads to, and the run."""
    rng, building = np.random.default_rng(seed), reduced.structure.building
    rows = np.vstack([base, seen])[:, ::FINE]
    rows = rows + 0.02 * rows.std(axis=1, keepdims=True) * rng.standard_normal(rows.shape)
    channels = (FloorChannel(name, name, "", direction) for name in ("base", *building.floors))
    grid = building.frequency_grid.frequencies_hz()
    histories = Histories(STEP, tuple(channels), rows)
    whole = observation_for(building.floors, histories, grid, direction)
    data = frf_data(whole, building.floors, table=COARSE_ERROR)
    return fit_baseline(problem_of(reduced, building, (data,)))[0], whole


def found_in(base, seen, seed):
    """The diagnosis of a run with 2 % of noise, what the model misses of it, and the run."""
    building = from_document(stick(MASS, SPRING, grid=(0.1, 120), ratio=ZETA, prior=PRIOR))
    fitted, whole = fitted_to(base, seen, seed, lumped(structure_of(building)))
    found = Diagnosis(fitted, NONE, (), (), (), (), fitted.remains(), (), "")
    missed = missed_in_run(fitted, whole, "x")
    return judged_by_strength(found, whole, "x", DiagnosisSettings()), missed, whole


def stiff_towers(direction="x", seen=None, top=3.5):
    """Two towers of stiff beams on a podium, reduced to its lowest modes, and their rad/s."""
    made = towers(slabs=True, top=top) | {"prior": PRIOR}
    made["materials"]["stiff"] = made["materials"]["concrete"] | {"youngs_modulus": 28e11}
    for part in (made["sections"]["column"], *made["slabs"]):
        part["material"] = "concrete"
    made["sections"]["beam"]["material"] = "stiff"
    made["sensors"] |= {"direction": direction} | ({} if seen is None else {"floors": seen})
    structure = structure_of(from_document(made))
    stiffness, mass = structure.stiffness(np.ones(6)).toarray(), structure.mass.toarray()
    squared, shapes = eigh(stiffness, mass, subset_by_index=[0, 23])
    return reduced_on(structure, shapes), np.sqrt(squared)


def softened(reduced, omega, base, story, half):
    """Accelerations (f, n) where a story keeps half of its stiffness at a drift, and its loop."""
    model, step = reduced.model, STEP / FINE
    term, drift = model.stiffness_terms[story], model.story_drift[story]
    moved, speed = np.zeros((2, omega.size))
    seen, loop = np.zeros((len(model.floors), base.size)), np.zeros((2, base.size))
    for n, pushed in enumerate(base):
        apart = drift @ moved
        kept = 1.0 / (1.0 + (apart / half) ** 2)
        own = (1.0 - kept) * (term @ moved) - omega * (2.0 * ZETA * speed + omega * moved)
        own -= model.excitation * pushed
        seen[:, n], loop[:, n] = model.floor_shapes @ own + pushed, (kept * apart, apart)
        speed = speed + step * own
        moved = moved + step * speed
    return seen, loop[:, ::FINE]


def secant(shear, drift):
    """Stiffness of a loop (n,) in its strongest cycle over that in its third that drifts least."""
    cycle = round(1.0 / (2.3 * STEP))  # of the first mode, Hz
    drift = drift - np.convolve(drift, np.ones(3 * cycle) / (3 * cycle), "same")
    square, work, size = (
        np.convolve(values, np.ones(cycle), "same")
        for values in (shear**2, shear * drift, drift**2)
    )
    weak = size <= np.quantile(size, 1 / 3)
    return square[size.argmax()] / work[size.argmax()] * work[weak].sum() / square[weak].sum()


def test_a_story_that_yields_is_told_with_its_place(runs):
    base, linear, *_ = runs
    found, missed, _ = found_in(base, linear, 2)
    assert found.verdict == NONE
    assert missed < 0.05  # of noise, and of the error of Euler's steps
    # Yielding at two fifths of what it would reach.
    forces = np.cumsum((MASS[:, None] * linear)[::-1], axis=0)[::-1]
    most = np.abs(forces).max(axis=1) / SPRING
    stories = (0, 2)
    yielding = np.array([[1, 0, 0], [0, 0, 1], [1, 0, 1]], dtype=bool)
    *single, two = zip(*shaken(base, np.where(yielding, 0.4 * most, np.inf)), strict=True)
    for story, (seen, *loop) in zip(stories, single, strict=True):
        found, missed, _ = found_in(base, seen, 2)
        assert missed > 0.1
        assert found.verdict == "nonlinear"
        assert found.leading.placed.label == f"amplitude_softening@S{story + 1}"
        assert found.leading.size < -0.01
        assert f"S{story + 1} changes while it shakes" in found.sentence
        told = re.search(r"about (\d+) % softer", found.sentence)
        drift, shear = (values[story, ::FINE] for values in loop)
        # Points of a mean over a cycle; the measured drift lacks what stays behind.
        assert 0.01 * int(told[1]) == pytest.approx(1.0 - secant(shear, drift), abs=0.1)
    found, *_ = found_in(base, two[0], 2)
    assert found.verdict == "nonlinear"
    assert re.search("within (S1 and S3|S3 and S1) alone", found.sentence)


def test_a_change_that_moves_no_frequency_by_a_hundredth_is_no_verdict(runs):
    base, linear, *softer = runs
    strong = np.clip(28.0 - np.arange(base.size) * STEP / FINE, 0.0, 1.0)
    for soft, verdict in zip(softer, ("nonlinear", NONE), strict=True):
        found, *_ = found_in(base, strong * soft + (1.0 - strong) * linear, 2)
        assert found.verdict == verdict


def test_noise_that_grows_with_the_motion_is_no_story_that_yields(runs):
    base, linear, *_ = runs
    step = FINE * 50
    envelope = np.sqrt(np.convolve((linear**2).mean(axis=0), np.ones(step) / step, "same"))
    rng = np.random.default_rng(3)
    # Most of it on the lowest floor, so that the shear below that grows most.
    share_of = np.array([[0.05], [0.025], [0.015]])
    noisy = linear + share_of * envelope * rng.standard_normal(linear.shape)
    found, _, run = found_in(base, noisy, 2)
    base = found.base
    share, _ = beyond_linear(run.histories, "x", base.likelihood.building, base.system, 12.0)
    assert share > 0.01
    assert "changes while it shakes" not in found.sentence


def test_a_floor_that_strikes_a_neighbour_is_told_as_such():
    base, still = motion(1), np.full((1, 3), np.inf)
    struck = shaken(base, still, gap=0.006)[0, 0]
    found, _, _ = found_in(base, struck, 2)
    assert found.verdict == "nonlinear"
    assert found.sentence.startswith("Something acts on RF")
    assert found.leading is None


def test_a_story_under_two_towers_is_told_by_what_stands_on_it():
    reduced, omega = stiff_towers()
    seen, loop = softened(reduced, omega, motion(1), 1, 2e-3)
    fitted, run = fitted_to(motion(1), seen, 2, reduced)
    known = reduced.structure.building, fitted.system, fitted.split
    text, story, *_ = what_yields(run, "x", *known, 10.0)
    assert story == "P2"
    told = re.search(r"about (\d+) % softer", text)
    assert 0.01 * int(told[1]) == pytest.approx(1.0 - secant(*loop), abs=0.1)
    # Where the floor on which both towers stand has no sensor, they share a story.
    kept = [0, 1, 3, 4, 5, 6]
    channels, rows = np.array(run.histories.channels)[kept], run.histories.acceleration[kept]
    histories = Histories(STEP, tuple(channels), rows)
    assert np.isnan(beyond_linear(histories, "x", *known[:2], 10.0)[0])


def test_sensors_that_stand_apart_in_plan_tell_the_drift_at_one_place():
    """Towers of unlike height turn the podium, which changes by a sixteenth."""
    reduced, omega = stiff_towers("y", {name: ["D-1"] for name in ("3F", "6F", "RF")}, 5.0)
    seen, loop = softened(reduced, omega, motion(1), 1, 1e-2)
    fitted, run = fitted_to(motion(1), seen, 2, reduced, "y")
    known = reduced.structure.building, fitted.system, fitted.split
    kept, *_ = secant_when_strong(run.histories, "y", *known, 1, np.array([1.0, 10.0]))
    # Noise, and the noise in what the model tells; .72 without the model, .91 in truth.
    assert kept == pytest.approx(secant(*loop), abs=0.07)


def test_peaks_and_drifts_on_towers_change_as_those_at_one_place_in_plan():
    reduced, omega = stiff_towers()
    model, structure, base = reduced.model, reduced.structure, motion(1, 30.0)
    linear, _ = softened(reduced, omega, base, 1, np.inf)
    before, run = fitted_to(base, linear, 2, reduced)
    softer = torch.eye(len(before.z), dtype=before.z.dtype)[4]  # of tower B's first story
    after = fit(before.likelihood, (), before.z - 0.3 * softer, 0)
    mesh, drift = structure.meshed[0], []
    nodes = mesh.model.nodes
    for seen, foot in zip(mesh.floor_nodes.values(), (0.0, 4.5, 8.5, 11.7, 8.5, 11.7), strict=True):
        under = [np.abs(nodes - [x, y, foot]).max(axis=1).argmin() for x, y, _ in nodes[seen]]
        drift.append((model.node_shapes[seen, 0] - model.node_shapes[under, 0]).mean(axis=0))
    ground, peaks, time = run.histories.acceleration[0], [], STEP * np.arange(3000)
    for fitted in (before, after):
        squared, shapes = np.linalg.eigh(model.stiffness(fitted.theta()[0]))
        share = shapes * (shapes.T @ model.excitation)
        ways = [[1.0, 2.0 * float(fitted.split[1]) * w, w**2] for w in np.sqrt(squared)]
        moved, faster = (
            share @ [lsim((above, below), ground, time)[1] for below in ways]
            for above in ([-1.0], [-1.0, 0.0, 0.0])
        )
        seen = np.abs(model.floor_shapes @ faster + ground).max(axis=1)
        peaks.append((seen, np.abs(drift @ moved).max(axis=1)))
    told = peaks_with(before, after, run, "x")
    names = model.floors, structure.building.story_names
    for what, known, old, new in zip(("peaks", "drifts"), names, *peaks, strict=True):
        change = np.abs(new / old - 1.0)
        said = re.search(rf"{what} by up to ([\d.]+) % \((\w+)\)", told)
        # The band leaves out what noise of the base moves above it.
        assert 0.01 * float(said[1]) == pytest.approx(change.max(), abs=0.02)
        assert change[known.index(said[2])] == pytest.approx(change.max(), abs=0.03)
