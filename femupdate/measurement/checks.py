"""What looks wrong in one recorded history, and between the channels of one building.

In its first mode a building's floors move together, the more the higher they are; well below that
mode they move with the base. Both hold for nearly every building, whatever its stiffness. So a
channel that runs against the others, late, or with the amplitude of another floor is told from its
response to the base, or without one to the highest floor. A clock that drifts turns the phase of
that response in time, in proportion to frequency, which no change of the building does.
"""

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.fft import next_fast_len

from femupdate.arrays import Complexes, Flags, Floats
from femupdate.measurement.names import (
    BASE,
    RAW,
    acceleration_factor,
    floor_height,
    is_acceleration,
    parse_channel,
)
from femupdate.measurement.observation import LARGEST_PEAK, SMALLEST_PEAK
from femupdate.measurement.recording import RecordedChannel
from femupdate.units import STANDARD_GRAVITY

# Figures by which files are judged.
_LATE = 0.03  # of the first period, a delay; damping alone makes a fifth of it
_LEAST_BINS = 3  # frequencies, that are compared at least
_COHERENCE = 0.8  # of frequencies that are compared


def channel_findings(channel: RecordedChannel, si: float | None) -> tuple[str, ...]:
    """Return sentences on what looks wrong in a channel.

    Args:
        si: SI factor of its unit, or None where the unit is not known.
    """
    if np.ptp(channel.values) == 0.0:
        return (f"it is dead: every value is {channel.values[0] + 0.0:g}.",)
    # Over the peak, so that no square overflows.
    peak = float(np.abs(channel.values).max())
    values = channel.values / peak
    mean = float(values.mean())
    swing = peak * float(np.abs(values - mean).max())
    findings = []
    raw = channel.unit if channel.unit and RAW.fullmatch(channel.unit) else ""
    if si is None and (channel.quantity == "acceleration" or raw):
        given, mend = (
            f"its unit {channel.unit!r} is not one of acceleration",
            "export accelerations",
        )
        if not channel.unit:
            given, mend = "the file does not say its unit", "give it with --unit"
        findings.append(f"{given}; {mend} (identify needs none).")
        # Below some hundred, whole numbers may be of any unit.
        if not raw and peak > 500.0 and np.array_equal(channel.values, np.rint(channel.values)):
            raw, given = "count", f"{given}, and whole numbers look like counts of a digitiser"
        if raw:
            findings[-1] = (
                f"{given}; give what a {raw} is with --unit, such as"
                ' --unit "4.7e-6 m/s2", or for each channel as'
                " --columns RF=RF*4.7e-6 --unit m/s2."
            )
    if channel.quantity == "acceleration" and si is not None:
        if peak * si > LARGEST_PEAK:
            findings.append(
                f"it peaks at {peak * si / STANDARD_GRAVITY:.3g} g, more than any earthquake (5 g):"
                " is the unit wrong?"
            )
        elif swing * si < SMALLEST_PEAK:
            findings.append(
                f"it peaks at {swing * si:.2g} m/s2, below what an accelerometer resolves: is the"
                " unit wrong, or the channel dead?"
            )
    stated = channel.stated_peak
    # Some headers state the peak about the mean. Headers round to three digits.
    if stated and min(abs(peak - stated), abs(swing - stated)) > 0.01 * stated + 5e-4:
        findings.append(f"it peaks at {peak:.4g} {channel.unit}, but its header says {stated:.4g}.")
    # A mean of 5 % of the largest swing is worth a word.
    if abs(mean) > 0.05 * float(np.abs(values - mean).max()):
        unit = f" {channel.unit}" if channel.unit else ""
        findings.append(f"its mean is {mean * peak:.3g}{unit}, an offset, which is taken off.")
    rate, slowest, fastest = 1.0 / channel.time_step, 5.0, 100_000.0
    if not slowest <= rate <= fastest:
        findings.append(
            f"its sampling rate is {rate:.3g} Hz; buildings are measured at {slowest:g} to"
            f" {fastest:g} Hz: is the time's unit wrong? Times in ms are called time_s (ms)."
        )
    if channel.quantity != "force":
        return (*findings, *shape_findings(channel))
    # A hammer hits in some samples and rests between them: its force may only be clipped.
    run = _longest_run(np.abs(values) == np.abs(values).max())
    if run >= 4:  # equal samples; smooth signals have two
        findings.append(f"it is clipped: {run} samples in a row stand at its largest value.")
    return tuple(findings)


def shape_findings(channel: RecordedChannel) -> Iterator[str]:
    """Yield sentences on what a building does not do: clip, jump for a sample, or stand still."""
    from scipy.ndimage import median_filter, uniform_filter1d

    if np.ptp(channel.values) == 0.0:
        return
    values, time_step = channel.values / np.abs(channel.values).max(), channel.time_step
    moving = values - values.mean()
    # The smallest difference between two values is the step of their digits.
    steps = np.diff(np.unique(values))
    peak, step = float(np.abs(moving).max()), float(steps.min()) if steps.size else 0.0
    # Below 50 steps of its digits nothing can be called clipped, a spike or stuck.
    if peak < 50.0 * step:
        yield (
            f"it moves by {2.0 * peak / step:.0f} steps of its digits only: too weak to show more."
        )
        return
    ends = [_longest_run(values == extreme) for extreme in (values.max(), values.min())]
    if max(ends) >= 4:
        yield f"it is clipped: {max(ends)} samples in a row stand at its largest value."
    away = np.abs(moving - median_filter(moving, 5, mode="nearest"))
    width = 2 * 10 + 1  # ten samples to either side
    # The mean square around a sample, without itself and the one to either side.
    wide, close = (uniform_filter1d(moving**2, n, mode="nearest") * n for n in (width, 3))
    around = np.sqrt(np.maximum(wide - close, 0.0) / (width - 3))
    # Gaussian noise is ten times its rms away from the median of five once in 1e8 samples.
    # A spike also stands out by a tenth of the peak.
    spikes = np.flatnonzero((away > 10.0 * around) & (away > 0.1 * peak))
    if spikes.size:
        at = ", ".join(f"{k * time_step:.4g} s" for k in spikes[:3])
        more = " ..." if spikes.size > 3 else ""
        plural = "s" if spikes.size > 1 else ""
        yield f"it has {spikes.size} spike{plural} of one sample: {at}{more}."
    # The longest stretch without change between parts that move.
    still = np.concatenate([[False], np.diff(values) == 0.0, [False]])
    edges = np.flatnonzero(np.diff(still.astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    lengths = np.where((starts > 0) & (stops < values.size - 1), stops - starts, 0)
    longest = int(lengths.max(initial=0)) * time_step
    if longest >= 1.0:
        first = int(starts[lengths.argmax()]) * time_step
        yield f"it stands still from {first:.4g} to {first + longest:.4g} s: was a gap filled?"


def _longest_run(flags: Flags) -> int:
    """Length of the longest run of true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


@dataclass(frozen=True, eq=False)
class _Sensor:
    """A horizontal channel on a known floor; the number is that of the file, from 1.

    Attributes:
        values: (n,) in one unit with those of the others, where units are known.
        stack: what sensors above each other have in common: place in plan, or number on the floor.
        behind_s, fast: delay and rate of its clock over the reference's, less one, taken out.
    """

    number: int
    floor: str
    channel: RecordedChannel
    values: Floats
    stack: str = ""
    behind_s: float = 0.0
    fast: float = 0.0

    @property
    def title(self) -> str:
        """What sentences call it."""
        return f"channel {self.number} ({self.channel.name})"


@dataclass(frozen=True, eq=False)
class _Response:
    """Response to the reference, its coherence, the reference's power, independent averages."""

    frequency_hz: Floats
    values: Complexes
    power: Floats
    coherence: Floats
    averages: float

    def phase_sd(self) -> Floats:
        """Standard deviation of the phase (Bendat and Piersol 2010, section 9.2), rad."""
        seen = np.clip(self.coherence, 1e-6, 1.0 - 1e-6)
        return np.sqrt((1.0 - seen) / (2.0 * seen * self.averages))


def response_findings(
    frequency_hz: Floats, responses: Complexes | Floats, floors: Sequence[str], force: str
) -> Iterator[str]:
    """Yield sentences on responses that are not of what they are said to be.

    Args:
        responses: (f, m) accelerations over that of the base or a force, where the sign of all or
            a factor of frequency does not matter; amplitudes do for a base.
        force: floor at which the force acts; empty for the base.
    """
    sizes = np.nan_to_num(np.abs(responses))
    least = frequency_hz[frequency_hz > 0.0].min(initial=np.inf)
    low = (frequency_hz >= least) & (frequency_hz < 2.01 * least)
    begin = sizes[:, low]
    if not force and low.sum() >= _LEAST_BINS and begin.min() > 0.0 and begin.max() < 0.5:
        # Of motions relative to the base they are, at the roof, 1.1 to 1.6 times the square of
        # frequency over that of the first mode.
        slopes, levels = np.polyfit(np.log(frequency_hz[low] / least), np.log(begin).T, 1)
        roof, peak = np.unravel_index(sizes.argmax(), sizes.shape)
        near = 0.6 < least * np.exp(-0.5 * levels[roof]) / frequency_hz[peak] < 1.1
        if near and (np.abs(slopes - 2.0) < 0.4).all():
            yield (
                "at low frequency the floors' response to the base falls to 0, where that of"
                " absolute accelerations is 1: are they relative to the base? Give floor plus base"
                " instead."
            )
    if force not in floors or not np.iscomplexobj(responses):
        return
    # A force does work where it acts in every mode: the imaginary part there has one sign. Squares
    # count little of the noise between peaks: on a real frame .0002 at the floor, .16 elsewhere;
    # both limits tell every floor of 300 random chains.
    part = np.nan_to_num(responses.imag * np.abs(responses.imag))
    whole = np.maximum(np.abs(part).sum(axis=1), 1e-300)
    against = 0.5 - 0.5 * np.abs(part.sum(axis=1)) / whole
    others = [floor for floor, share in zip(floors, against, strict=True) if share < 0.002]
    if against[list(floors).index(force)] > 0.01 and len(others) == 1:
        yield (
            f"{force} moves against the force in some modes, which the floor where it acts never"
            f" does, and {others[0]} in none: was it at {others[0]}? Then name that as its floor."
        )


_PLACES = re.compile(
    r"\b(?:\d+(?:st|nd|rd|th)?|roof|floor|flr?|level|stor(?:e?y|ies)|ground|base(?:ment)?|RF|\d+F)\b"
)


def pair_findings(
    channels: Sequence[RecordedChannel],
    floors: Sequence[str | None],
    placed: Collection[int] = (),
    *,
    beside: bool = False,
) -> tuple[str, ...]:
    """Return sentences on channels that are vertical, repeat another, or do not fit the others.

    Args:
        placed: those that measure how the base turns.
        beside: some floors are beside others, not above them, as those of two towers.
    """
    findings: list[str] = []
    vertical = [
        str(k + 1) for k, channel in enumerate(channels) if channel.vertical and k not in placed
    ]
    if vertical:
        are = "s " + ", ".join(vertical) + " are" if len(vertical) > 1 else f" {vertical[0]} is"
        findings.append(f"channel{are} vertical: no response to the base's horizontal motion.")
    for (earlier, first), (later, second) in combinations(enumerate(channels, start=1), 2):
        if np.array_equal(first.values, second.values) and np.ptp(first.values):
            findings.append(f"channels {earlier} and {later} hold the same numbers.")
    rates: dict[float, list[str]] = defaultdict(list)
    for channel in channels:
        rates[round(1.0 / channel.time_step, 6)].append(channel.name)
    if len(rates) > 1:
        told = ", ".join(f"{rate:g} Hz ({', '.join(names)})" for rate, names in rates.items())
        findings.append(
            f"the channels have unlike rates, {told}: all are taken at {min(rates):g} Hz."
        )
    # Channels that share their direction and times, on floors that are known.
    groups: dict[object, list[_Sensor]] = defaultdict(list)
    for number, (channel, floor) in enumerate(zip(channels, floors, strict=True), start=1):
        if floor is not None and not channel.vertical and np.ptp(channel.values):
            parsed = parse_channel(channel.name)
            along = parsed.direction if parsed else channel.direction.lower() or "x"
            key = along, channel.values.size, channel.time_step
            stack = parsed.sensor if parsed else _PLACES.sub("", channel.location.lower())
            stack = floor if beside else stack
            values = channel.values * acceleration_factor(channel.unit)
            groups[key].append(_Sensor(number, floor, channel, values, " ".join(stack.split())))
    for group in groups.values():
        findings += _of_group(sorted(group, key=lambda sensor: floor_height(sensor.floor)))
    return tuple(findings)


def _of_group(group: Sequence[_Sensor]) -> Iterator[str]:
    # Shorter records show too little.
    if len(group) < 2 or group[0].values.size < 1024:
        return
    based = group[0].floor == BASE
    mode = None
    if based:
        # The first mode, whichever sensor is the base.
        frequency, power = _powers(group)
        quiet = power.min(axis=0)
        shown = quiet > 1e-4 * quiet.max()
        size = np.where(shown, np.sqrt(power.max(axis=0) / np.maximum(quiet, 1e-300)), 0.0)
        mode = _first_peak(frequency, size, 2.0, True)
    if mode is not None:
        levels = {s.number: _level(group[0], s, mode) for s in group[1:]}
        order = list(_out_of_order(group[0], group[1:], levels, mode))
        if order and "the base" in order[0]:
            yield from order
            return
    seconds = group[0].values.size * group[0].channel.time_step
    # Without a base it takes two minutes to show the first mode.
    if not based and seconds < 120.0:
        return
    reference = group[0] if based else group[-1]
    others = [sensor for sensor in group if sensor is not reference]
    if mode is not None:
        others = _set_by_clock(reference, others, mode)
    responses = {sensor.number: _response(reference, sensor, 0, 1) for sensor in others}
    # That of a single floor is another where its gain is.
    first = mode or _first_mode(responses[others[-1].number], based)
    if first is None:
        return
    against = []
    for sensor in others:
        low = _low(responses[sensor.number], first, based)
        reversed_at = responses[sensor.number].values[low].real < 0.0
        if low.sum() >= _LEAST_BINS and np.mean(reversed_at) > 0.9:
            against.append(sensor)
    # Of floors alone, one that runs against all others is reversed; several are another mode.
    if based or (len(against) == 1 < len(others)):
        where = "the base where both should move together, at low frequency"
        where = where if based else "all other floors in the lowest mode"
        for sensor in against:
            yield f"{sensor.title} moves against {where}: is its direction reversed?"
    units = {sensor.channel.unit for sensor in group}
    levels = {}
    if len(units) == 1 or all(unit and is_acceleration(unit) for unit in units):
        levels = {s.number: _level(reference, s, first) for s in others if based}
        if based:
            yield from _of_levels(reference, others, levels)
        yield from _out_of_order(reference, others, levels, first)
    yield from _of_clocks(reference, [s for s in others if s not in against], responses, first)


def _of_clocks(
    reference: _Sensor, sensors: Sequence[_Sensor], responses: dict[int, _Response], first: float
) -> Iterator[str]:
    """Sentences on channels that are late or whose clock does not run as the reference's."""
    based = reference.floor == BASE
    half = 0.5 * reference.values.size * reference.channel.time_step
    for sensor in sensors:
        response = responses[sensor.number]
        used = _low(response, first, based)
        frequency, angle = response.frequency_hz[used], np.angle(response.values[used])
        delay = _shift(frequency, angle, response.phase_sd()[used], first)
        # How far it falls behind from half to half. Windows of fewer than three periods turn phases
        # by themselves: false alarms in 2 of 25 cases.
        drift = None
        if half / 12.0 * first >= 3.0:
            early, late = (_response(reference, sensor, part, 2) for part in (0, 1))
            coherence = np.minimum(early.coherence, late.coherence)
            used = (early.frequency_hz > 0.0) & (coherence > _COHERENCE)
            turn = np.angle(late.values[used] / early.values[used])
            sd = np.hypot(early.phase_sd(), late.phase_sd())[used]
            drift = _shift(early.frequency_hz[used], turn, sd, first)
        whole = None if drift is None and not sensor.fast else (drift or 0.0) + sensor.fast * half
        # Beside a floor, neighbouring modes turn the phase at the first one's frequency too.
        least = (1.0 if based else 2.0) * _LATE / first
        behind = (delay or 0.0) + sensor.behind_s
        if abs(behind) > least and whole is None:
            side = "behind" if behind > 0.0 else "ahead of"
            size = f"{abs(behind):.3g} s" if abs(behind) >= 1.0 else f"{1e3 * abs(behind):.3g} ms"
            yield (
                f"{sensor.title} runs {size} {side} {reference.title}: are their clocks the same?"
            )
        if whole is not None:
            yield (
                f"{sensor.title} drifts against {reference.title} by {1e3 * abs(whole):.3g} ms from"
                " the first half of the record to the second: 1000 s of its clock are"
                f" {1000.0 / (1.0 + whole / half):.5g} s of the other's."
            )


def _set_by_clock(reference: _Sensor, others: Sequence[_Sensor], mode: float) -> list[_Sensor]:
    """The sensors, with delays and drifts of more than a part of the first period taken out."""
    step, count = reference.channel.time_step, reference.values.size
    top = 0.7 * mode
    found = []
    for sensor in others:
        # Two hundred periods tell a pace to a few hundred ppm, the whole record the rest.
        part = min(count, int(140.0 / top / step))
        energy = np.cumsum(np.append(0.0, reference.values**2))
        begin = int(np.argmax(energy[part:] - energy[:-part]))
        x, y = (each.values[begin : begin + part] for each in (reference, sensor))
        wide = 0.25 / (part * step * top)
        paces = wide * np.arange(-np.ceil(0.012 / wide), np.ceil(0.012 / wide) + 1)
        tried = [_agreement(x, y, step, top, pace) for pace in paces]
        still = tried[len(tried) // 2]
        best = max(range(len(tried)), key=lambda k: tried[k][0])
        score, delay, pace = *tried[best], float(paces[best])
        # What is left of the phases must fall to two fifths for a word.
        if 1.0 - still[0] < 2.5 * (1.0 - score) + 0.01:
            score, delay, pace = *still, 0.0
        at_start = _agreement(x, y, step, top, 0.0, at=0.0)[0]
        alike = 1.0 - at_start < 2.5 * (1.0 - score) + 0.01
        if score < 0.5 or alike or (pace == 0.0 and abs(delay) < 0.25 / top):
            found.append(sensor)
            continue
        # What lags by `delay` in the middle of the part where it was looked at.
        time = step * np.arange(count)
        middle = step * (begin + 0.5 * part)
        read_at = time + delay + pace * (time - middle)
        values = np.interp(read_at, time, sensor.values, left=0.0, right=0.0)
        found.append(replace(sensor, values=values, behind_s=delay, fast=pace))
    return found


def _agreement(
    x: Floats, y: Floats, step: float, top: float, pace: float, at: float | None = None
) -> tuple[float, float]:
    """How well phases of two histories agree up to a frequency, at most 1, and the delay, s."""
    time = step * (np.arange(y.size) - 0.5 * y.size)
    y = np.interp(time * (1.0 + pace), time, y) if pace else y
    padded = next_fast_len(2 * x.size)
    window = np.hanning(x.size)
    band = int(top * padded * step)
    # Without an offset under the window, whose sign would count as a phase.
    levelled = (window * (v - np.average(v, weights=window)) for v in (x, y))
    first, second = (np.fft.rfft(v, padded)[: band + 1] for v in levelled)
    size = np.abs(first) * np.abs(second)
    seen = (np.abs(first) > 0.03 * np.abs(first).max()) & (size > 0.0)
    phase = np.where(seen, first.conj() * second / np.where(size > 0.0, size, 1.0), 0.0)
    total = float(seen.sum())
    if total < 2 * _LEAST_BINS:
        return 0.0, 0.0
    if at is not None:
        turn = np.exp(2j * np.pi * np.arange(band + 1) / (padded * step) * at)
        return float(abs((phase * turn).sum().real)) / total, at
    length = 16 * (band + 1)
    sums = np.abs(np.fft.ifft(phase, length).real) * length
    best = int(sums.argmax())
    delay = (best if best < length // 2 else best - length) * padded * step / length
    return float(sums[best]) / total, delay


def _level(reference: _Sensor, sensor: _Sensor, first: float) -> float | None:
    """Amplitude towards zero frequency, where floors move with the base; None where none shows."""
    count = reference.values.size
    frequency = np.fft.rfftfreq(count, reference.channel.time_step)
    used = (frequency > 0.0) & (frequency < 0.6 * first)
    window = np.hanning(count)
    x, y = (np.fft.rfft(window * (s.values - s.values.mean()))[used] for s in (reference, sensor))
    share = (frequency[used] / first) ** 2
    columns = np.stack([x, share / (1.0 - share) * x], axis=1)
    normal = (columns.conj().T @ columns).real
    if used.sum() < 8 or np.linalg.cond(normal) > 1e10:
        return None
    fitted = np.linalg.solve(normal, (columns.conj().T @ y).real)
    left = float((np.abs(y - columns @ fitted) ** 2).mean())
    # A Hann window makes neighbours repeat each other.
    spread = float(np.sqrt(3.0 * left * np.linalg.inv(normal)[0, 0]))
    level = abs(float(fitted[0]))
    return level if spread < 0.05 * level else None


def _of_levels(
    reference: _Sensor, others: Sequence[_Sensor], levels: dict[int, float | None]
) -> Iterator[str]:
    """Sentences on channels that have another gain or unit than the reference."""
    as_between = {9.80665: "g and m/s2", 980.665: "g and gal", 100.0: "m/s2 and gal"}
    as_between |= {1000.0: "g and mg", 101.97: "m/s2 and mg"}
    # Buildings stay within some percent at low frequency; a base that turns adds a third.
    odd = {
        sensor: level
        for sensor in others
        if (level := levels[sensor.number]) is not None and abs(np.log(level)) > np.log(1.4)
    }
    several = list(odd.values())
    if len(odd) == len(others) > 1 and max(several) < 1.2 * min(several):
        odd = {reference: 1.0 / float(np.mean(several))}
    for sensor, level in odd.items():
        beside = "all floors" if sensor is reference else reference.title
        ratio = max(level, 1.0 / level)
        units = next((u for r, u in as_between.items() if abs(np.log(ratio / r)) < 0.1), "")
        units = f" (as between {units})" if units else ""
        yield (
            f"{sensor.title} moves {level:.3g} times as much as {beside} at low frequency, where"
            f" both should move together{units}: is its gain or unit right? If not,"
            f" --columns {sensor.floor}=NAME*{1.0 / level:.3g} corrects it."
        )


def _response(reference: _Sensor, sensor: _Sensor, part: int, parts: int) -> _Response:
    """Response of one part of several of the record."""
    from scipy.signal import csd, welch

    size = reference.values.size // parts
    x, y = (
        each.values[part * size : (part + 1) * size] / max(float(np.abs(each.values).max()), 1e-300)
        for each in (reference, sensor)
    )
    scale = float(np.abs(sensor.values).max() / np.abs(reference.values).max())
    # Twelve segments of Welch's method, half overlapping.
    segment = reference.values.size // 12 // parts
    options = {"fs": 1.0 / reference.channel.time_step, "nperseg": segment}
    frequency, power = welch(x, **options)
    other, cross = welch(y, **options)[1], csd(x, y, **options)[1]
    power = np.maximum(power, 1e-300)
    seen = np.abs(cross) ** 2 / np.maximum(power * other, 1e-300)
    averages = 0.9 * size / segment  # half-overlapping Hann segments: 1.9 per two lengths
    return _Response(frequency, cross / power * scale, power, seen, averages)


def _first_mode(top: _Response, based: bool) -> float | None:
    """Frequency of the first mode, Hz, from the response of a high floor; or None."""
    if not based:
        # Coherent noise lies high, drifts low: the velocity is largest in the first mode.
        seen = (top.coherence > _COHERENCE) & (top.frequency_hz > 0.0)
        velocity = np.where(seen, top.power / np.maximum(top.frequency_hz, 1e-12) ** 2, 0.0)
        return float(top.frequency_hz[velocity.argmax()]) if seen.any() else None
    size = np.where(top.coherence > 0.7, np.abs(top.values), 0.0)
    # A peak of 1.25 times the base is a mode. Less than the base anywhere is another gain.
    return _first_peak(top.frequency_hz, size, 1.25, bool(size.max() < 1.25))


def _first_peak(frequency: Floats, size: Floats, least: float, anew: bool) -> float | None:
    """The lowest frequency at which a size peaks.

    Args:
        least: of a peak.
        anew: take it relative to the size at the lowest frequencies.
    """
    lowest = size[size > 0.0][:_LEAST_BINS]
    if anew and lowest.size:
        size = size / float(np.median(lowest))
    for k in range(1, size.size - 1):
        if size[k] > least and size[k] >= size[k - 1 : k + 2].max():
            return float(frequency[k])
    return None


def _low(response: _Response, first: float, based: bool) -> Flags:
    """Frequencies at which the floors should move together."""
    low, high = (0.0, 0.5 * first) if based else (0.7 * first, 1.2 * first)
    frequency = response.frequency_hz
    return np.asarray((frequency > low) & (frequency < high) & (response.coherence > _COHERENCE))


def _powers(group: Sequence[_Sensor]) -> tuple[Floats, Floats]:
    """Frequencies (f,) and power spectra (s, f) of sensors, in twelve windows."""
    from scipy.signal import welch

    step, count = group[0].channel.time_step, group[0].values.size
    spectra = [welch(sensor.values, fs=1.0 / step, nperseg=count // 12) for sensor in group]
    return spectra[0][0], np.array([power for _, power in spectra])


def _out_of_order(
    reference: _Sensor, others: Sequence[_Sensor], levels: dict[int, float | None], first: float
) -> Iterator[str]:
    """A sentence where sensors do not move the more the higher they are, in the first mode."""
    from scipy.signal import csd

    group = (reference, *others)
    frequency, power = _powers(group)
    near = np.abs(frequency - first) <= max(0.1 * first, 1.01 * frequency[1])
    gains = np.array([levels.get(sensor.number) or 1.0 for sensor in group])
    found = np.sqrt(power[:, near].sum(axis=1)) / gains
    sizes = {sensor.number: float(size) for sensor, size in zip(group, found, strict=True)}
    at = f"in the first mode, at {first:.3g} Hz"
    quiet = min(group, key=lambda sensor: sizes[sensor.number])
    based = reference.floor == BASE
    # In a higher mode floors move against each other.
    loud = max(group, key=lambda sensor: sizes[sensor.number])
    options = {"fs": 1.0 / loud.channel.time_step, "nperseg": loud.values.size // 12}
    for sensor in group:
        cross = csd(loud.values, sensor.values, **options)[1][near].sum()
        if sensor not in (loud, quiet if based else loud) and abs(np.angle(cross)) > 1.0:
            return
    if based and sizes[quiet.number] < 0.8 * sizes[reference.number]:
        ratio = sizes[quiet.number] / sizes[reference.number]
        yield (
            f"{quiet.title} moves {ratio:.2g} times as much as {reference.title} {at}: is it the"
            " base, or is it relative to the base?"
        )
        return
    for sensor in others:
        if sensor.floor == BASE and sizes[sensor.number] > 2.0 * sizes[reference.number]:
            ratio = sizes[sensor.number] / sizes[reference.number]
            yield (
                f"{sensor.title} moves {ratio:.2g} times as much as {reference.title} {at}: do both"
                " stand on the base?"
            )
            return
    # Floors must be in order where the mode amplifies twofold.
    if based and max(sizes.values()) < 2.0 * sizes[reference.number]:
        return
    ordered = sorted(group, key=lambda sensor: floor_height(sensor.floor))
    wrong = [
        (low, high)
        for low, high in combinations(ordered, 2)
        if low.floor != high.floor
        and low.stack == high.stack
        and sizes[low.number] > 1.25 * sizes[high.number]
    ]
    if wrong:
        low, high = max(wrong, key=lambda pair: sizes[pair[0].number] / sizes[pair[1].number])
        ratio = sizes[low.number] / sizes[high.number]
        yield (
            f"{low.title} moves {ratio:.2g} times as much as {high.title} above it {at}: are they"
            " swapped? (Beside each other, as in two towers, they need not be.)"
        )


def _shift(frequency: Floats, angle: Floats, sd: Floats, first: float) -> float | None:
    """Delay, s, that explains phases in proportion to frequency; None where none is sure."""
    if frequency.size < _LEAST_BINS:
        return None
    weight = 1.0 / sd**2
    # Few frequencies would fit one long delay or other by chance.
    longest = min(0.25 / first, 0.1 * (frequency.size - 1) / np.ptp(frequency))
    tried = np.linspace(-longest, longest, 2 * int(40.0 * frequency.max() * longest) + 1)
    fits = np.cos(angle + 2.0 * np.pi * frequency * tried[:, None]) @ weight
    delay = float(tried[fits.argmax()])
    left = np.angle(np.exp(1j * (angle + 2.0 * np.pi * frequency * delay)))
    power = float((weight * frequency**2).sum())
    delay -= float((weight * frequency * left).sum()) / (2.0 * np.pi * power)
    left = np.angle(np.exp(1j * (angle + 2.0 * np.pi * frequency * delay)))
    scatter = float(np.sqrt((weight * left**2).sum() / weight.sum()))
    # Half-overlapping Hann windows: two bins of three are independent.
    spread = np.sqrt(1.5 / power) / (2.0 * np.pi) * max(1.0, scatter / float(np.median(sd)))
    # A delay is sure from five standard deviations on,
    # and where no more than 0.15 rad of the phase is left beside it.
    sure = abs(delay) > 5.0 * spread and scatter < 0.15
    return delay if sure and abs(delay) > _LATE / first else None
