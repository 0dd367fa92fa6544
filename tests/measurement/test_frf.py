"""FRFs estimated from histories, against systems whose response is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy import signal

from femupdate.errors import MeasurementError
from femupdate.measurement import (
    LEAST_NOISE,
    FloorChannel,
    Histories,
    Observation,
    Segments,
    effective_averages,
    estimate_frf,
    mean_estimator,
    noise_of_lines,
    observation_for,
    on_grid,
    parse_channel,
    read_observation_file,
    resolved_share,
)
from femupdate.measurement.observation import HANN_BANDWIDTH

RATE = 200.0
GRID = np.arange(1, 1025) * 0.05  # the wall-frame's: to 51.2 Hz
BAND = (GRID > 1) & (GRID < 45)


def histories(rate=RATE, source="test", **rows: np.ndarray) -> Histories:
    """Histories of columns whose names are written with _ for : and __ for the dot."""
    channels = []
    for name in rows:
        channel = parse_channel(name.replace("__", ".").replace("_", ":").removeprefix("f"))
        assert isinstance(channel, FloorChannel)
        channels.append(channel)
    return Histories(1 / rate, tuple(channels), np.array(list(rows.values())), source)


def noise(seconds: float, seed: int, rate=RATE) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=round(seconds * rate))


def coloured(seconds: float, seed: int) -> np.ndarray:
    """Noise in 0.5 to 50 Hz, as a shake table is driven."""
    sos = signal.butter(4, [0.5, 50], "bandpass", fs=RATE, output="sos")
    return signal.sosfilt(sos, noise(seconds, seed))


def sdof_filter(f0: float, zeta: float) -> tuple[np.ndarray, np.ndarray]:
    """Absolute over base acceleration of a mass on a spring and a damper, bilinear at RATE."""
    omega = 2 * np.pi * f0
    return signal.bilinear([2 * zeta * omega, omega**2], [1, 2 * zeta * omega, omega**2], RATE)


def closed_form(system: tuple[np.ndarray, np.ndarray], frequency_hz=GRID) -> np.ndarray:
    return signal.freqz(*system, worN=frequency_hz, fs=RATE)[1]


TWO = (sdof_filter(5.8, 0.02), sdof_filter(16.0, 0.02))


def two_floors(seed: int, sensor_noise: float, seconds: float = 80.0) -> Histories:
    """A shake-table run: 80 s, a floor tuned to 5.8 Hz and one to 16 Hz, noise on all sensors."""
    base = coloured(seconds, seed)
    floors = [signal.lfilter(*system, base) for system in TWO]
    rng = np.random.default_rng(1000 + seed)
    rows = [x + sensor_noise * base.std() * rng.normal(size=x.size) for x in floors]
    return histories(base=base, f2F=rows[0], RF=rows[1])


@pytest.mark.parametrize("sensor_noise", [0.01, 0.05, 0.2])
def test_stated_noise_covers_the_error(sensor_noise):
    truth = np.log(np.abs(np.array([closed_form(system, GRID) for system in TWO])))
    audible = BAND & (truth > np.log(3 * sensor_noise))
    ratios, usable = [], []
    for seed in range(6):
        observation = estimate_frf(two_floors(seed, sensor_noise), GRID)
        seen = observation.estimator
        asked = np.array([closed_form(system, seen.frequency_hz) for system in TWO])
        truth = np.log(np.abs(seen(torch.from_numpy(asked)[None])[0].numpy()))
        above_floor = observation.noise_sd > 1.5 * LEAST_NOISE
        error = (observation.log_frf - truth) / observation.noise_sd
        ratios.append(error[observation.valid & above_floor & BAND])
        usable.append(observation.valid[audible].mean())
    ratio = np.concatenate(ratios)
    # Six records of some 2 x 300 independent points: sd of the share .0035. Seven segments give a
    # noise that is itself uncertain by a fifth, which may move the share from .954 by .03.
    assert 0.93 < np.mean(np.abs(ratio) < 2) < 0.985
    assert np.mean(ratio**2) == pytest.approx(1, abs=0.25)
    assert np.mean(usable) > 0.95


@pytest.mark.parametrize("samples", [-3, 3, 10])
@pytest.mark.parametrize("sign", [1, -1])
def test_delay_and_sign_stay_in_the_phase(samples, sign):
    base = noise(100, 4)
    floor = sign * 1.7 * np.roll(base, samples)
    observation = estimate_frf(histories(base=base, RF=floor), GRID)
    expected = sign * np.exp(-2j * np.pi * GRID * samples / RATE)
    turned = np.angle(np.exp(1j * observation.phase[0]) / expected)
    use = observation.valid[0]
    assert use[BAND].all()
    # A delay takes samples out of the segment, and what it takes is noise of this size.
    assert np.abs(turned[use]).max() < 0.05
    np.testing.assert_allclose(observation.log_frf[0][use], np.log(1.7), atol=0.05)


def test_coherence_is_scipys():
    base = noise(80, 2)
    floor = signal.lfilter(*TWO[0], base) + 0.5 * noise(80, 3)
    observation = estimate_frf(histories(base=base, RF=floor), GRID)
    frequency, expected = signal.coherence(base, floor, RATE, nperseg=4000, noverlap=2000)
    at = np.searchsorted(frequency, GRID - 1e-6)
    np.testing.assert_allclose(observation.coherence[0], expected[at], rtol=1e-9)
    assert observation.resolution_hz == pytest.approx(1.5 / 20)


def test_the_mean_over_a_band_errs_as_that_of_the_independent_points():
    """H1 of white noise, by Hann segments of length T and a grid of 1 / T; two thousand bands."""
    rng, length, width = np.random.default_rng(3), 256, 24
    window = signal.windows.hann(length, sym=False)

    def spectra():
        return np.fft.rfft(window * rng.standard_normal((400, 32, length)))[..., 4:124]

    base, other = spectra(), spectra()
    error = ((base.conj() * other).sum(1) / (np.abs(base) ** 2).sum(1)).real
    bands = error.reshape(-1, width)
    found = (bands**2).mean() / (width * (bands.mean(axis=1) ** 2).mean())
    grid = np.arange(1, 121) / length
    share = resolved_share(grid, HANN_BANDWIDTH / length, estimated=True)
    assert share == pytest.approx(1.0 / (1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)))
    # Points beyond the ends of a band would repeat some of its own: 1.6 % of it. The scatter of two
    # thousand means knows a variance to 3 %; by the noise bandwidth the share would be .67.
    assert found == pytest.approx(share, rel=0.08)


@pytest.mark.parametrize("count", [2, 5, 9, 40])
def test_effective_averages_against_chance(count):
    """Unrelated signals have a mean coherence of one over the number of independent segments."""
    rng = np.random.default_rng(count)
    length = 64
    samples = (count + 1) * length // 2
    _, values = signal.coherence(*rng.normal(size=(2, 400, samples)), nperseg=length)
    # 400 means over some 12 independent bins: 1 to 2 %; the formula is Welch's for one spectrum.
    assert 1 / values[:, 4:-4].mean() == pytest.approx(effective_averages(length, count), rel=0.04)


def test_sensors_of_a_floor_are_averaged_in_time():
    base, twist = noise(60, 5), noise(60, 6)
    floor = signal.lfilter(*TWO[0], base)
    apart = histories(base=base, f2F_1=floor + 3 * twist, f2F_2=floor - 3 * twist, RF=base + floor)
    observation = estimate_frf(apart, GRID)
    together = estimate_frf(histories(base=base, f2F=floor, RF=base + floor), GRID)
    np.testing.assert_allclose(observation.log_frf, together.log_frf, atol=1e-9)
    assert observation.floors == ("2F", "RF")
    assert "Sensors averaged in time: 2F (2)." in observation.notes
    of_roof = estimate_frf(apart, np.r_[GRID, 60.0], sensors=("RF",)).notes
    assert any("lie outside" in note for note in of_roof)
    assert not any("2F" in note for note in of_roof)


def test_points_that_were_not_measured_are_flagged():
    # 80 Hz sampling: Nyquist 40 Hz; segments of 20 s resolve 0.05 Hz.
    base = noise(100, 9, rate=80)
    grid = np.r_[0.01, 0.02, GRID]
    observation = estimate_frf(histories(80.0, base=base, RF=3 * base), grid)
    valid = observation.valid[0]
    assert not valid[:2].any()
    assert not valid[grid >= 39.999].any()
    assert valid[(grid > 0.2) & (grid < 39.9)].all()
    assert np.isnan(observation.log_frf[0][grid > 40]).all()
    assert any("lie outside what was measured" in note for note in observation.notes)


@pytest.mark.parametrize("count", [6, 7])
def test_halves_share_out_the_segments(count):
    whole = Segments(length=100, count=count, effective=5.0, seconds=1.0, wanted=1.0)
    starts = [whole.half(number).starts.tolist() for number in (0, 1)]
    assert starts == [whole.starts[number::2].tolist() for number in (0, 1)]


def test_short_record_gets_shorter_segments_and_says_so():
    base = noise(30, 13)
    observation = estimate_frf(histories(base=base, RF=1.5 * base), GRID)
    assert "8.57 s" in observation.notes[0]  # six half-overlapping segments fill 3.5 lengths
    assert "asks for 20 s" in observation.notes[0]
    first = GRID[observation.valid[0]][0]
    assert first == pytest.approx(0.15)  # the first grid point above 1 / 8.57 s
    # Between its bins H is interpolated as a complex number: a constant stays one.
    np.testing.assert_allclose(observation.log_frf[0][observation.valid[0]], np.log(1.5), atol=1e-9)


def test_building_of_other_floors_is_refused():
    base = noise(60, 17)
    data = histories(source="tower.csv", base=base, f7F=base, RF=base)
    with pytest.raises(MeasurementError) as caught:
        observation_for(("2F", "3F", "RF"), data, GRID)
    for part in ("tower.csv", "another building", "7F, RF", "2F, 3F, RF"):
        assert part in str(caught.value)


def table(noise=0.2, **others) -> Observation:
    size, valid = np.array([[0.0, 1.0, -1.0], [2.0, 2.0, 4.0]]), np.ones((2, 3), dtype=bool)
    sd = np.broadcast_to(noise, (2, 3)).copy()
    own, floors = np.array([1.0, 2.0, 4.0]), ("2F", "RF")
    return Observation(own, floors, size, sd, valid, source="t.csv", **others)


def test_table_is_interpolated_in_the_logarithm_and_not_beyond():
    observation = on_grid(table(), np.array([0.5, 1.0, 1.5, 3.0, 4.0, 4.5]))
    np.testing.assert_allclose(
        observation.log_frf[:, 1:5], [[0, 0.5, 0, -1], [2, 2, 3, 4]], atol=1e-15
    )
    np.testing.assert_array_equal(observation.valid, [[0, 1, 1, 1, 1, 0]] * 2)
    assert (observation.noise_sd[observation.valid] == 0.2).all()
    assert observation.phase is None


def test_table_brings_its_own_noise_and_phase():
    angle = np.array([[0.0, -1.0, -2.0], [0.5, 1.0, 3.0]])
    data = table([[0.1, 0.3, 0.3], [0.07] * 3], phase=angle)
    observation = on_grid(data, np.array([1.0, 1.5, 2.0]))
    np.testing.assert_allclose(observation.noise_sd, [[0.1, 0.2, 0.3], [0.07] * 3])
    np.testing.assert_allclose(observation.phase[:, [0, 2]], angle[:, :2], atol=1e-15)
    through = observation_for(["2F", "3F", "RF"], data, np.array([1.0, 1.5]))
    np.testing.assert_array_equal(through.noise_sd, observation.noise_sd[:, :2])


def test_observation_refuses_what_does_not_fit():
    zero = np.zeros((1, 2))
    good = {"log_frf": zero, "noise_sd": zero + 1.0, "valid": zero == 0.0}
    grid = np.array([1.0, 2.0])
    Observation(grid, ("RF",), **good)
    with pytest.raises(MeasurementError, match="floors by frequencies"):
        Observation(grid, ("2F", "RF"), **good)
    with pytest.raises(MeasurementError, match="noise above zero"):
        Observation(grid, ("RF",), **good | {"noise_sd": np.zeros((1, 2))})


@pytest.mark.parametrize(
    ("run", "peaks"),
    # Where the frame's published description puts them (to about two resolution bandwidths).
    [("northridge", (3.7, 11.2, 16.6)), ("sine1p0", (None, 11.2, 16.6))],
)
def test_real_bench_top_frame_peaks(shared_file, run, peaks):
    columns = {"time_s": "t_s", "base": "a_base", "2F": "a_1F", "3F": "a_2F", "RF": "a_3F"}
    data = read_observation_file(shared_file(f"data/mini_flexible_{run}.csv"), "m/s2", columns)
    observation = observation_for(("2F", "3F", "RF"), data, GRID)
    roof = np.where(observation.valid[2], observation.log_frf[2], -np.inf)
    for peak, low, high in zip(peaks, (2, 9, 15), (6, 13, 18), strict=True):
        near = (low < GRID) & (high > GRID)
        found = GRID[near][np.argmax(roof[near])]
        if peak is not None:
            assert found == pytest.approx(peak, abs=0.16)
    in_band = (GRID > 0.5) & (GRID < 15)
    assert np.median(observation.coherence[:, in_band]) > 0.93
    assert observation.valid[:, in_band].mean() > 0.75


STEP, FINE = 0.02, np.arange(1, 201) * 0.05


def frf(frequency_hz, zeta, own_hz=3.0):
    """Absolute acceleration of an oscillator over that of its base."""
    ratio = np.asarray(frequency_hz) / own_hz
    return (1.0 + 2j * zeta * ratio) / (1.0 - ratio**2 + 2j * zeta * ratio)


def bell(time):
    return np.exp(-(((time - 15.0) / 4.0) ** 2))


def dying_away(time):
    """Strong for ten seconds, then for longer than a segment weaker and weaker."""
    return np.minimum(np.minimum((time / 3.0) ** 2, 1.0), np.exp(-(time - 13.0) / 12.0))


def shaken(zeta, seed=0, samples=4000, envelope=bell, own_hz=3.0):
    """Histories of a shock of some seconds in a record of eighty, with the exact response."""
    base = envelope(STEP * np.arange(samples)) * np.random.default_rng(seed).standard_normal(
        samples
    )
    padded = 4 * samples
    exact = frf(np.fft.rfftfreq(padded, STEP), zeta, own_hz)
    motion = np.fft.irfft(exact * np.fft.rfft(base, padded))
    channels = tuple(parse_channel(name) for name in ("base", "RF"))
    return Histories(STEP, channels, np.stack([base, motion[:samples]]), "shock")


def missed(observation, values):
    """rms over valid points of ln|H| and of the phase, rad."""
    valid = observation.valid[0]
    away = np.log(np.abs(values[valid])) - observation.log_frf[0, valid]
    turn = np.angle(values * np.exp(-1j * observation.phase[0]))[valid]
    return np.sqrt(np.mean(away**2)), np.sqrt(np.mean(turn**2))


@pytest.mark.parametrize("zeta", [0.01, 0.03])
def test_a_shock_is_estimated_of_the_model_as_of_its_response(zeta):
    """The FRF itself is off by percents; through the base motion's own means it is not."""
    observation = estimate_frf(shaken(zeta), FINE)
    seen = observation.estimator
    asked = torch.from_numpy(frf(seen.frequency_hz, zeta))[None, None]
    through = missed(observation, seen(asked)[0, 0].numpy())
    itself = missed(observation, frf(FINE, zeta))
    assert max(through) < 0.004
    assert min(itself) > 4.0 * max(through)


@pytest.mark.parametrize("zeta", [0.01, 0.03])
@pytest.mark.parametrize("seed", range(3))
def test_a_motion_that_dies_away_over_segments_is_estimated_as_well(zeta, seed):
    """Its means turn in phase so fast that they are a small part of their absolute values."""
    grid = np.arange(1, 501) * 0.02
    observation = estimate_frf(shaken(zeta, seed, 6000, dying_away), grid)
    seen = observation.estimator
    asked = torch.from_numpy(frf(seen.frequency_hz, zeta))[None, None]
    values = seen(asked)[0, 0].numpy()
    used = observation.valid[0]
    used[grid < 0.1] = False  # where the record's mean counts
    assert max(missed(replace(observation, valid=used[None]), values)) < 0.0015


@pytest.mark.parametrize("seed", [31, 34, 38])
def test_peaks_narrower_than_the_window_are_resolved(seed):
    """Segments of ten seconds have a bandwidth of .15 Hz, the peak one of .026 Hz."""
    zeta, own_hz, grid = 0.006, 2.145, np.arange(2, 81) * 0.1
    observation = estimate_frf(shaken(zeta, seed, 2000, np.ones_like, own_hz), grid)
    seen, used = observation.estimator, observation.valid[0]
    asked = torch.from_numpy(frf(seen.frequency_hz, zeta, own_hz))[None, None]
    away = observation.log_frf[0] - np.log(np.abs(seen(asked)[0, 0].numpy()))
    # By cubics over thirds of a bandwidth .09 to .16. What is left leaks from further away.
    assert np.abs(away[used]).max() < 0.05


def test_an_frf_that_is_one_everywhere_stays_one():
    seen = estimate_frf(shaken(0.02), FINE).estimator
    one = torch.ones(1, 1, len(seen.frequency_hz), dtype=torch.complex128)
    np.testing.assert_allclose(seen(one)[0, 0].numpy(), 1.0, rtol=1e-9)


# A tower in motion when the record begins, and a quake that strikes it at rest: s, noise over the
# base's rms, damping.
NOISY = [(120.0, 0.1, 0.02, False), (20.0, 0.02, 0.01, False), (40.0, 0.05, 0.005, True)]


def measured_tower(seconds, noise, zeta, quake, seed):
    """Noisy histories of three equal stories by exact responses, FRF, density of the noise.

    The motion is periodic over four times the record, of which the last quarter is measured.
    """
    rng, count, step = np.random.default_rng(seed), int(seconds / 0.01), 0.01
    chain = 3000.0 * (np.diag([2.0, 2.0, 1.0]) - np.eye(3, k=1) - np.eye(3, k=-1))
    squares, shapes = np.linalg.eigh(chain)
    part = shapes * shapes.sum(axis=0)

    def frf(frequency_hz):
        omega = 2.0 * np.pi * np.asarray(frequency_hz)
        below = squares[:, None] - omega**2 + 2j * zeta * np.sqrt(squares)[:, None] * omega
        return 1.0 + part @ (omega**2 / below)

    base = rng.standard_normal(4 * count)
    if quake:
        time = step * np.arange(4 * count) - 3.0 * seconds
        rise = np.clip((time - 0.1 * seconds) / (0.05 * seconds), 0.0, 1.0)
        base *= rise * np.exp(-np.clip((time - 0.2 * seconds) / (0.12 * seconds), 0.0, None))
    spectrum = np.fft.rfft(base)
    fine = np.fft.rfftfreq(4 * count, step)
    spectrum[(fine < 0.3) | (fine > 40.0)] = 0.0
    motion = np.fft.irfft(np.vstack([spectrum, frf(fine) * spectrum]), 4 * count)[:, -count:]
    sd = noise * motion[0].std()
    channels = tuple(parse_channel(name) for name in ("base", "2F", "3F", "RF"))
    rows = motion + sd * rng.standard_normal(motion.shape)
    return Histories(step, channels, rows, "tower"), frf, 2.0 * step * sd**2


@pytest.mark.parametrize("case", NOISY)
def test_noise_is_told_from_what_leaks_without_a_model(case):
    """Of each floor that of its sensor, and that of the base which it does not follow."""
    histories, frf, density = measured_tower(*case, seed=1)
    base, floors, _ = histories.means("x")
    frequency, across = noise_of_lines(base[None], floors, histories.time_step, 20.0)
    left = np.einsum("iil->il", across).real
    ratio = left / (density * (1.0 + np.abs(frf(frequency)) ** 2))
    # Some 90 to 800 windows of eight degrees of freedom, half of them apart; coherence has 2 to 400
    # times as much beside the peaks. At a few lines a peak ends within a window.
    assert ratio.mean() == pytest.approx(1.0, abs=0.15)
    assert np.median(ratio) == pytest.approx(0.95, abs=0.12)


@pytest.mark.parametrize("case", NOISY)
def test_errors_of_estimates_are_those_stated_and_floors_share_what_the_base_has(case):
    grid, squares, common = np.arange(6, 481) * 0.05, [], []
    for seed in range(6):
        histories, frf, _ = measured_tower(*case, seed=seed)
        observation = estimate_frf(histories, grid)
        seen = observation.estimator
        expected = seen(torch.from_numpy(frf(seen.frequency_hz))[None])[0].numpy()
        used = observation.valid.all(axis=0)
        away = (observation.log_frf - np.log(np.abs(expected)))[:, used]
        noise, shared = observation.noise_sd[:, used], seen.shared[used]
        for miss, sd, of_all in zip(away.T, noise.T, shared, strict=True):
            cover = np.diag(sd**2 - of_all**2) + of_all**2
            values, vectors = np.linalg.eigh(cover)
            white = (vectors.T @ miss) ** 2 / values
            squares.append(white[:-1].mean())
            common.append(white[-1])
    # Of some 600 independent points; the least noise that is believed is more than there is at a
    # few. Counted as independent, errors of floors would come out at .3 and at 2.
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)
    assert np.mean(common) == pytest.approx(1.0, abs=0.25)


def test_runs_together_are_the_means_of_their_estimates():
    parts = [estimate_frf(shaken(0.02, seed), FINE).estimator for seed in (0, 1)]
    shares = np.stack([np.linspace(0.2, 0.8, FINE.size), np.linspace(0.8, 0.2, FINE.size)])

    def estimate(part):
        return part(torch.from_numpy(frf(part.frequency_hz, 0.02))[None, None])[0, 0].numpy()

    together = estimate(mean_estimator(parts, shares, FINE))
    expected = sum(share * estimate(part) for share, part in zip(shares, parts, strict=True))
    np.testing.assert_allclose(together, expected, rtol=1e-9)
    assert mean_estimator([None, None], shares, FINE) is None
