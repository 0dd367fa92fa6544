"""When samples were taken: times as people and loggers write them, to one even time step."""

import re
from collections.abc import Sequence
from datetime import date
from fractions import Fraction

import numpy as np

from femupdate.arrays import Floats, Integers
from femupdate.measurement.text import TextFile

_DECIMALS = 9  # of times that are looked at, at most
BRIDGED = 3  # samples without a value, that are interpolated
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_DATE = r"(?P<first>\d{1,4})[-/.](?P<second>\d{1,2}|[^\W\d_]{3,10})[-/.](?P<third>\d{1,4})"
_TIME = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<sec>\d{2}))?(?:[.,:](?P<part>\d{1,9}))?"
    r"\s*(?P<half>[AaPp])?(?(half)\.?[Mm]\.?)\s*(?P<zone>Z|UTC|GMT|[-+]\d{2}:?\d{2})?"
)
_MOMENT = re.compile(rf"(?:{_DATE})?[T ,_]*{_TIME}")


def is_moment(text: str) -> bool:
    """Whether a text is a time of day, with or without a date."""
    return _MOMENT.fullmatch(text) is not None


def seconds_of(texts: Sequence[str]) -> Floats | int:
    """Seconds since the first of some moments; the position of the first that there cannot be.

    A day may end within times without dates, and of days and months that could be either, the
    order is taken in which time runs evenly.
    """
    found: list[dict[str, str | None]] = []
    for text in texts:
        if (match := _MOMENT.fullmatch(text)) is None:
            return len(found)
        found.append(match.groupdict())
    orders = [_in_order(found, day_first) for day_first in (False, True)]
    readings = [each for each in orders if not isinstance(each, int)]
    if not readings:
        return max(each for each in orders if isinstance(each, int))
    return min(readings, key=lambda each: float(np.ptp(np.diff(each, prepend=each[0]))))


def _in_order(found: Sequence[dict[str, str | None]], day_first: bool) -> Floats | int:
    """Seconds since the first moment, the day before the month or behind it; or as above."""
    days: dict[tuple[str | None, ...], int] = {}
    seconds = np.empty(len(found))
    for k, of in enumerate(found):
        written = of["first"], of["second"], of["third"]
        if written not in days:
            days[written] = 0
            a, b, c = (part or "" for part in written)
            if b.isalpha():
                b = str((*_MONTHS, b[:3].lower()).index(b[:3].lower()) + 1)
                year, month, day = (a, b, c) if len(a) == 4 else (c, b, a)
            elif len(a) == 4:
                year, month, day = a, b, c
            else:
                year, month, day = (c, b, a) if day_first else (c, a, b)
            if a:
                century = 2000 if len(year) < 3 else 0
                try:
                    days[written] = date(int(year) + century, int(month), int(day)).toordinal()
                except ValueError:  # there is no such day
                    return k
        hour, minute, part = int(of["hour"] or 0), int(of["minute"] or 0), of["part"] or "0"
        sec = int(of["sec"] or 0)
        if of["sec"] is None and of["part"] is not None:  # 12:03.5 has minutes and seconds
            hour, minute, sec = hour // 60, hour % 60, minute
        zone = (of["zone"] or "Z").replace(":", "")
        away = int(zone[:3]) * 3600 + int(zone[0] + zone[3:]) * 60 if zone[0] in "-+" else 0
        midnight = hour == 24 and minute == sec == 0  # at the end of a day
        most = 12 if of["half"] else 24 if midnight else 23
        if hour > most or max(minute, sec) > 59 or abs(away) > 15 * 3600:
            return k
        if of["half"]:
            hour = hour % 12 + (12 if of["half"] in "Pp" else 0)
        whole = (days[written] - next(iter(days.values()))) * 86400 + hour * 3600 + minute * 60
        seconds[k] = whole + sec - away + int(part) / 10 ** len(part)
    # Without dates a clock goes back by a day at midnight, one of twelve hours by half a day,
    # one of minutes and seconds by an hour.
    if found[0]["first"] is None:
        back = -np.diff(seconds, prepend=seconds[0])
        turn = 3600.0 if all(of["sec"] is None for of in found) else 86400.0
        turns = np.where(back > 0.5 * turn, turn, 0.0)
        turns[(back > 40000.0) & (back < 50000.0)] = 43200.0
        seconds += np.cumsum(turns)
    return np.asarray(seconds - seconds[0])


def counted_unit(name: str, unit: str | None, values: Floats) -> tuple[str, tuple[str, ...]]:
    """Unit of a column of times, and a sentence where nothing but the numbers tells it."""
    named = re.search(r"[_ ](ms|msec|us|ns)$", name, re.IGNORECASE)
    if unit or named:
        return unit or (named[1].lower().replace("msec", "ms") if named else "s"), ()
    # Seconds since 1970 reach 1e11 in the year 5138. Days of spreadsheets pass 20000 in 1954, and
    # no clock with such large seconds has steps of a microsecond.
    largest = float(np.abs(values).max())
    if 2e4 < largest < 1e6 and 0.0 < float(np.median(np.diff(values))) < 2e-6:
        return "d", ("The times are read as days, as spreadsheets count them.",)
    for least, since in ((1e17, "ns"), (1e14, "us"), (1e11, "ms")):
        if largest > least:
            return since, (f"The times are read as {since} since 1970.",)
    return "s", ()


def check_step(file: TextFile, step: float, title: str | None = None) -> None:
    """Refuse a time step, s, with which no building is measured."""
    # An impact on a model has steps of 1e-6 s, the slowest monitoring of a tower 10 s.
    shortest, longest = 1e-6, 10.0
    if not shortest <= step <= longest:
        raise file.error(
            f"the time step is {step:.3g} s, and buildings are measured every {shortest:g} to"
            f" {longest:g} s; is the time's unit wrong? Times in ms have the name time_s (ms)",
            column=title,
        )


def even_step(
    file: TextFile, time: Floats, lines: Integers, title: str
) -> tuple[float, Floats | None, tuple[str, ...]]:
    """Time step of printed times (n,), s, and what had to be done to have one.

    A time may differ from the straight line through all of them by three quarters of its last
    printed digit, or by a hundredth of a step. Times with fewer digits than their step takes give
    the rate by the first and the last. A clock that is uneven throughout, or rows that are missing,
    give even times (k,), s, to which the values are to be interpolated.
    """
    if (blank := np.flatnonzero(~np.isfinite(time))).size:
        text = "the time is blank or nan; fill it in, or remove the row"
        raise file.error(text, int(lines[blank[0]]), title)
    steps = np.diff(time)
    if (steps <= 0).mean() > 0.5 and (time[-1] <= time[0] or (steps < 0).any()):
        raise file.error("the times do not increase; sort them (periods: give 1/T)", None, title)
    # As many decimals as all times are printed with.
    scale = np.abs(time).max() * 1e-14
    printed = (d for d in range(_DECIMALS) if np.abs(np.round(time, d) - time).max() <= scale)
    digit = 10.0 ** -next(printed, _DECIMALS)
    since = time - time[0]
    step, start = np.polyfit(np.arange(time.size), since, 1)
    # A hundredth of a step turns the phase at half the Nyquist frequency by less than a degree;
    # a lost sample shifts all times by half a step.
    tolerance = min(max(0.75 * digit, 0.01 * step), 0.3 * step)
    deviation = np.abs(since - (start + step * np.arange(time.size)))
    # The nearest whole sampling rate or round step that the first and last time's digits allow.
    allowed = digit / (time.size - 1)
    rate, rounded = round(1.0 / step), round(step, _DECIMALS)
    if rate > 0 and abs(step - 1.0 / rate) <= allowed:
        step = 1.0 / rate
    elif abs(step - rounded) <= allowed:
        step = rounded
    if (steps > 0).all() and deviation.max() <= tolerance:
        check_step(file, float(step), title)
        return float(step), None, ()
    enough = time.size >= 64  # of fewer rows nothing is told
    usual = float(np.median(steps))
    passed = np.rint(steps / usual) if usual > 0.0 else np.zeros_like(steps)
    lost = np.flatnonzero(passed > 1.0)
    near = np.abs(steps - passed * usual).max() <= max(1.5 * digit, 0.02 * usual)
    few = 0 < lost.size < 0.01 * time.size and passed.sum() < 3 * time.size
    if enough and near and passed.min() == 1.0 and few:
        step = float(np.polyfit(np.r_[0.0, np.cumsum(passed)], since, 1)[0])
        step = 1.0 / round(1.0 / step) if abs(1.0 / step - round(1.0 / step)) < 0.01 else step
        check_step(file, step, title)
        many, after = int(passed.sum()) - steps.size, time[lost[0]]
        words = f"{many} row{'s are' if many > 1 else ' is'} missing after {after:.6g} s: " + (
            "interpolated." if passed.max() <= BRIDGED + 1 else "the longer part is used."
        )
        return step, time[0] + step * np.arange(passed.sum() + 1.0), (words,)
    if enough and (steps >= 0).all() and deviation.max() <= 0.75 * digit:
        check_step(file, float(step), title)
        words = (
            f"The times are rounded to {digit:g} s: {1.0 / step:.6g} Hz is taken, which is the"
            " number of steps over the time from the first row to the last."
        )
        return float(step), None, (words,)
    worst = int(np.argmax(np.abs(steps - usual)))
    uneven = np.abs(steps - usual) > max(1.5 * digit, 0.002 * usual)
    throughout = uneven.mean() > 0.1 or (near and not lost.size)
    if not (enough and (steps > 0).all() and steps.max() < 3.5 * usual and throughout):
        raise file.error(
            f"the sampling is not uniform: {steps[worst]:.6g} s after the row before, elsewhere"
            f" {usual:.6g} s; fill the gap or resample to one time step",
            int(lines[worst + 1]),
            title,
        )
    whole = round(1.0 / usual)
    step = 1.0 / whole if whole and abs(usual * whole - 1.0) < 0.02 else usual
    check_step(file, step, title)
    even = np.arange(int(since[-1] / step * (1.0 + 1e-9)) + 1) * step
    words = (
        f"The times are uneven, by {1e3 * float(steps.std()):.2g} ms (rms) from row to row and"
        f" {1e3 * float(steps.max()):.3g} ms at most: all columns are interpolated to"
        f" {1.0 / step:.6g} Hz."
    )
    return step, time[0] + even, (words,)


def interpolated(values: Floats, time: Floats, even: Floats) -> Floats:
    """Values (n, c) at even times (k,), by cubic splines; NaN in a gap of many steps."""
    from scipy.interpolate import CubicSpline

    step = even[1] - even[0]
    behind = np.clip(np.searchsorted(time, even - 0.1 * step), 1, time.size - 1)
    near = np.minimum(np.abs(even - time[behind]), np.abs(even - time[behind - 1])) < 0.1 * step
    bridged = time[behind] - time[behind - 1] < (BRIDGED + 1.5) * step
    found = CubicSpline(time, values, axis=0)(even)
    return np.where((near | bridged)[:, None], found, np.nan)


def rate_ratio(step: float, other: float, samples: int) -> Fraction | None:
    """One time step over another in whole numbers up to 1000, within a thousandth of a step."""
    if not (np.isfinite(other) and other > 0):
        return None
    ratio = Fraction(step / other).limit_denominator(1000)
    drift = abs(float(ratio) * other / step - 1.0) * samples
    return ratio if 0 < ratio.numerator <= 1000 and drift < 1e-3 else None


def resampled(values: Floats, ratio: Fraction) -> Floats:
    """Values (n,) at a rate that is higher by a ratio, zero before their start and after their end.

    Polyphase filtering with a linear-phase Kaiser window: flat within 0.1 % up to 0.9 of the lower
    Nyquist frequency, no delay.
    """
    from scipy.signal import firwin, resample_poly

    up, down = ratio.numerator, ratio.denominator
    # 32 periods of the lower rate to either side, and a Kaiser window 80 dB down.
    window = firwin(64 * max(up, down) + 1, 1.0 / max(up, down), window=("kaiser", 8.0))
    return np.asarray(resample_poly(values, up, down, window=window))
