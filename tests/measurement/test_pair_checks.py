"""Channels that are late, drift, are swapped or reversed, in records of a chain of three masses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, cont2discrete, lfilter, sosfilt, ss2tf

from femupdate.measurement import RecordedChannel, pair_findings, response_findings

STEP = 0.01
FLOORS = ("base", "2F", "3F", "RF")


def building(seed, seconds=120.0):
    """Channels of the base and three floors in a shock, first mode 0.8 to 4 Hz."""
    rng = np.random.default_rng(seed)
    count = int(seconds / STEP)
    noise = sosfilt(
        butter(3, [0.2, 20.0], "band", fs=1 / STEP, output="sos"), rng.normal(size=count)
    )
    base = noise * (np.exp(-(((STEP * np.arange(count) - 25.0) / 15.0) ** 2)) + 0.01)
    stiffness = rng.uniform(0.6, 1.6, 3)
    K = np.diag(stiffness) + np.diag([*stiffness[1:], 0.0])
    K -= np.diag(stiffness[1:], 1) + np.diag(stiffness[1:], -1)
    squared, shapes = np.linalg.eigh(K)
    omega = np.sqrt(squared / squared[0]) * 2 * np.pi * rng.uniform(0.8, 4.0)
    zeta = rng.uniform(0.01, 0.06)
    floors = np.zeros((3, count))
    for own, shape in zip(omega, shapes.T, strict=True):
        A = np.array([[0.0, 1.0], [-(own**2), -2 * zeta * own]])
        # What a mode adds to the absolute acceleration, q'' + a = -(2 zeta omega q' + omega^2 q).
        C = np.array([[-(own**2), -2 * zeta * own]])
        system = cont2discrete((A, np.array([[0.0], [-1.0]]), C, np.zeros((1, 1))), STEP)[:4]
        above, below = ss2tf(*system)
        floors += np.outer(shape * shape.sum(), lfilter(above[0], below, base))
    floors += 0.002 * floors.std() * rng.normal(size=floors.shape)
    return [
        RecordedChannel(name=name, values=values, time_step=STEP, unit="m/s2")
        for name, values in zip(FLOORS, [base, *floors], strict=True)
    ], omega[0] / (2 * np.pi)


def shifted(values, delay):
    """Values (n,) behind by a delay, s, that may vary, band-limited before it is read off."""
    from scipy.signal import resample

    time = STEP * np.arange(values.size)
    fine = resample(values, 8 * values.size)
    return np.interp(time - delay, STEP / 8 * np.arange(fine.size), fine)


def turned(channels, at):
    """The channels, one of them the other way round."""
    changed = list(channels)
    changed[at] = replace(changed[at], values=-changed[at].values)
    return changed


@pytest.mark.parametrize("seed", range(15))
def test_nothing_is_said_of_good_records(seed):
    channels, _ = building(seed)
    assert pair_findings(channels, FLOORS) == ()
    assert pair_findings(channels[1:], FLOORS[1:]) == ()


def test_a_floor_that_is_taken_for_the_base_as_well_is_told():
    """Its mean with the base would be no base."""
    channels, _ = building(0)
    (found,) = pair_findings(channels, ("base", "base", "3F", "RF"))
    assert found.startswith("channel 2 ")
    assert found.endswith("do both stand on the base?")


def test_a_step_at_the_end_is_no_drift():
    """It shifts the means, floors against the base: an offset in between, no phase."""
    last, sides = np.arange(5000) >= 4980, (0.1, -0.1, -0.1, -0.1)
    stepped = [
        replace(each, values=each.values[:5000] + side * np.ptp(each.values) * last)
        for each, side in zip(building(10)[0], sides, strict=True)
    ]
    assert pair_findings(stepped, FLOORS) == ()


def test_accelerations_relative_to_the_base_are_told():
    told = 0
    for seed in range(10):
        (base, *floors), _ = building(seed)
        lower = [replace(each, values=each.values - base.values) for each in floors]
        found = pair_findings([base, *lower], FLOORS)
        told += len(found) == 1 and found[0].endswith("or is it relative to the base?")
    assert told >= 9


@pytest.mark.parametrize("seed", range(20))
def test_responses_that_are_of_another_excitation_are_told(seed):
    """Of chains of three to six stories, from a tenth of the first mode to above the last."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 7))
    stiffness = rng.uniform(0.6, 1.6, count)
    K = np.diag(stiffness + np.append(stiffness[1:], 0.0))
    K -= np.diag(stiffness[1:], 1) + np.diag(stiffness[1:], -1)
    squared, shapes = np.linalg.eigh(K)
    frequency = np.linspace(0.1, 1.2 * np.sqrt(squared[-1] / squared[0]), 400)
    omega = frequency[:, None] * np.sqrt(squared[0])
    below = squared - omega**2 + 2j * rng.uniform(0.01, 0.05) * np.sqrt(squared) * omega
    floors = (*(f"{k}F" for k in range(2, count + 1)), "RF")

    def noisy(loads):
        """Accelerations of floors under loads (f,) of unit masses, with noise of 3 %."""
        H = shapes @ (omega**2 / below * (shapes.T @ loads)).T
        return H * (1.0 + 0.03 * rng.normal(size=H.shape) + 0.03j * rng.normal(size=H.shape))

    relative = noisy(np.ones(count))
    (said,) = response_findings(frequency, np.abs(relative), floors, "")
    assert "are they relative to the base?" in said
    assert list(response_findings(frequency, 1.0 + relative, floors, "")) == []
    for at, floor in enumerate(floors):
        under = -noisy(np.eye(count)[at])
        for named in floors:
            found = list(response_findings(frequency, under, floors, named))
            assert len(found) == (named != floor), (floor, named)
            assert all(f"and {floor} in none: was it at {floor}?" in text for text in found)


def test_swapped_reversed_late_and_drifting_channels_are_told():
    """In nine of ten records at least, and never another finding."""
    told = {"swapped": 0, "reversed": 0, "are their clocks the same": 0, "drifts": 0}
    for seed in range(10):
        channels, first = building(seed)
        late = shifted(channels[3].values, 0.08 / first)
        drift = shifted(channels[3].values, np.linspace(0.0, 0.3 / first, late.size))
        swapped = [channels[k] for k in (0, 3, 2, 1)]
        cases = {
            "swapped": [replace(one, name=name) for one, name in zip(swapped, FLOORS, strict=True)],
            "reversed": turned(channels, 2),
            "are their clocks the same": [*channels[:3], replace(channels[3], values=late)],
            "drifts": [*channels[:3], replace(channels[3], values=drift)],
        }
        for words, case in cases.items():
            found = pair_findings(case, FLOORS)
            told[words] += any(words in sentence for sentence in found)
            assert all(words in sentence for sentence in found), (seed, found)
    assert min(told.values()) >= 9, told


def test_a_reversed_floor_is_told_without_the_base():
    told = 0
    for seed in range(10):
        channels, _ = building(seed)
        found = pair_findings(turned(channels[1:], 0), FLOORS[1:])
        assert all("channel 1" in sentence for sentence in found)
        told += any("reversed" in sentence for sentence in found)
    assert told >= 8


@pytest.mark.parametrize(
    ("at", "gain"), [(0, 1 / 9.80665), (1, 0.7), (3, 2.0), (2, 0.25), (0, 4.0)]
)
def test_a_gain_is_told_whichever_channel_has_it(at, gain):
    told = 0
    for seed in range(2):
        channels, _ = building(seed)
        channels[at] = replace(channels[at], values=gain * channels[at].values)
        found = pair_findings(channels, FLOORS)
        told += any(f"channel {at + 1}" in text and "is its gain" in text for text in found)
        assert len(found) < 2, (seed, found)
    assert told == 2


def test_floors_beside_each_other_have_no_order():
    """As of two towers, of which the lower one may move more."""
    channels, _ = building(0)
    swapped = [channels[k] for k in (0, 3, 2, 1)]
    case = [replace(channel, name=name) for channel, name in zip(swapped, FLOORS, strict=True)]
    assert any("swapped" in text for text in pair_findings(case, FLOORS))
    assert pair_findings(case, FLOORS, beside=True) == ()
