"""Identified modes: frequencies, damping ratios and shapes, with their standard deviations.

`mode_findings` says what looks wrong in them.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.measurement.names import (
    BASE,
    FREQUENCY,
    FREQUENCY_WORD,
    floor_height,
    parse_channel,
    si_factor,
)
from femupdate.measurement.recording import RecordedMode, Recording, mean_of_tests
from femupdate.measurement.resolve import positions, renamed_columns, whole_or_parts
from femupdate.measurement.table import ColumnTable
from femupdate.measurement.text import TextFile, closest

# Figures by which files are judged.
_IN_PHASE = 0.9  # collinearity of the parts of a shape, below which they do not move in phase

MODE, FREQUENCY_SD, DAMPING, DAMPING_SD = "mode", "frequency_sd_hz", "damping", "damping_sd"
PERIOD, PERIOD_SD, TEST = "period_s", "period_sd_s", "test"
MODE_COLUMNS = (
    f"{MODE}, {FREQUENCY}, {FREQUENCY_SD}, {DAMPING}, {DAMPING_SD}, and shapes 2F ... RF with"
    " 2F_sd ..., or 2F_re and 2F_im"
)
_NAMED = (MODE, FREQUENCY, FREQUENCY_SD, DAMPING, DAMPING_SD, PERIOD, PERIOD_SD, TEST)
TELLING = (MODE, FREQUENCY_SD, DAMPING, DAMPING_SD)
"""Columns that no table of histories or of response functions has."""
_DEVIATION = r"(std|sd|standarddeviation)"
_FREQUENCY = rf"(f|fn|fid|ω|omega|(natural|modal|eigen|circular)?({FREQUENCY_WORD}))"
_DAMPING = r"(xi|zeta|ξ|ζ|(modal)?damp(ing)?(ratios?)?|dämpfung\w*|amort\w+|smorz\w+|sönüm\w*)"
_PERIOD = r"(t|tn|(natural|modal)?p[eé]r[ií]od[eos]?|周期|固有周期)"
# Titles without blanks, points and underscores.
_TITLES = {
    MODE: r"mod[eo](no|nr|number|name)?",
    FREQUENCY: rf"{_FREQUENCY}(hz)?",
    FREQUENCY_SD: rf"{_DEVIATION}{_FREQUENCY}(hz)?|{_FREQUENCY}{_DEVIATION}(hz)?",
    DAMPING: _DAMPING,
    DAMPING_SD: rf"{_DEVIATION}{_DAMPING}|{_DAMPING}{_DEVIATION}",
    PERIOD: rf"{_PERIOD}s?",
    PERIOD_SD: rf"{_DEVIATION}{_PERIOD}s?|{_PERIOD}{_DEVIATION}s?",
    TEST: r"(test|run|record(ing)?|measurement|event|setup|session|date|day|file)(no|nr|id|name)?",
}
# What programs say of a mode besides.
_BESIDE = re.compile(r"(std\.?\s*)?complexity|mpc|mpd|mcf|comments?|remarks?|method", re.IGNORECASE)
_PART = re.compile(r"(?P<sensor>.+?)(?:_(?P<part>re|im|sd))?", re.IGNORECASE)


def modes_in_table(
    table: ColumnTable, columns: Mapping[str, str], named: bool = True
) -> tuple[RecordedMode, ...]:
    """The modes in the rows of a table, NaN and None where a cell is blank; of tests their means.

    Args:
        table: NaN where a cell is blank; of the column `mode` its numbers.
        named: whether every component must bear our name of a floor; else it keeps its own.
    """
    values = _columns(table, columns, named)
    if FREQUENCY not in values:
        raise table.file.error(
            f"there is no column {FREQUENCY}; columns of identified modes are {MODE_COLUMNS}"
        )
    frequency = values[FREQUENCY]
    wrong = np.flatnonzero(~((frequency > 0.0) & np.isfinite(frequency)))
    if wrong.size:
        raise table.file.error(
            "the mode has no frequency above 0; give it or remove the row",
            int(table.lines[wrong[0]]),
            FREQUENCY,
        )
    parts = [name for name in values if name not in _NAMED]
    sensors = tuple(dict.fromkeys(re.sub(r"_(re|im|sd)$", "", name) for name in parts))
    shape: NDArray[np.inexact] = np.zeros((len(frequency), len(sensors)), dtype=complex)
    sd = np.full(shape.shape, np.nan)
    for k, sensor in enumerate(sensors):
        what = f"the shape at {sensor}"
        real, imaginary = whole_or_parts(table.file, sensor, values, what)
        shape[:, k] = real if imaginary is None else real + 1j * imaginary
        sd[:, k] = values.get(f"{sensor}_sd", sd[:, k])
    if not any(f"{sensor}_im" in values for sensor in sensors):
        shape = shape.real
    numbers = values.get(MODE, np.arange(1.0, len(frequency) + 1.0))
    given = list(zip(values.get(TEST, np.zeros(len(numbers))), numbers, strict=True))
    for row, (_, number) in enumerate(given):
        if given[row] in given[:row]:
            raise table.file.error(
                f"mode {number:g} is given twice; give each mode once, number them apart, or say"
                f" by a column {TEST} which test each row is of",
                int(table.lines[row]),
                MODE,
            )

    _, at = np.unique(numbers, return_inverse=True)
    _, test = np.unique([named for named, _ in given], return_inverse=True)
    of_tests = np.full((test.max() + 1, at.max() + 1), np.nan)
    of_tests[test, at] = frequency
    # Modes that are near may change places from test to test; by 5 % they do not.
    ratio = of_tests[:, 1:] / of_tests[:, :-1]
    for row, mode in np.argwhere((ratio < 0.95) & (ratio > 1.05).any(axis=0)):
        raise table.file.error(
            f"the mode is at {of_tests[row, mode]:.4g} Hz and the next one at"
            f" {of_tests[row, mode + 1]:.4g} Hz, in other tests the other way round; exchange or"
            " correct them",
            int(table.lines[(test == row) & (at == mode)][0]),
            f"{MODE} {numbers[at == mode][0]:g}",
        )

    def cell(name: str, row: int) -> float | None:
        value = float(values[name][row]) if name in values else np.nan
        return None if np.isnan(value) else value

    modes = [
        RecordedMode(
            frequency_hz=float(frequency[row]),
            frequency_sd_hz=cell(FREQUENCY_SD, row),
            damping=cell(DAMPING, row),
            damping_sd=cell(DAMPING_SD, row),
            sensors=sensors,
            shape=shape[row],
            shape_sd=sd[row],
            name=f"{numbers[row]:g}",
        )
        for row in range(len(frequency))
    ]
    return tuple(
        mean_of_tests([mode for mode in modes if mode.name == name])
        for name in dict.fromkeys(mode.name for mode in modes)
    )


def _columns(table: ColumnTable, columns: Mapping[str, str], named: bool) -> dict[str, Floats]:
    """Values (r,) of every column that is used, by our name, in SI units."""
    renamed = renamed_columns(table, columns)
    values: dict[str, Floats] = {}
    for position, title in enumerate(table.names or ()):
        name = renamed.get(position, title)
        known = figure_of(name)
        part = _PART.fullmatch(name)
        channel = parse_channel(part["sensor"]) if part else None
        if known is None and part is not None and channel is not None:
            known = f"{channel.name}_{part['part'].lower()}" if part["part"] else channel.name
        beside = _BESIDE.fullmatch(title) is not None
        if known is None and position not in renamed and (columns or beside):
            continue
        if known is None and named:
            raise table.file.error(
                f"unknown column {title!r}{closest(title, _NAMED)}; columns of identified modes"
                f" are {MODE_COLUMNS}: rename it or map it by the columns option"
            )
        known = known or title
        unit, factor = table.units[position], 1.0
        if unit is None and known == FREQUENCY and re.match("ω|omega|circular", title.lower()):
            unit = "rad/s"
        if unit and known in (FREQUENCY, FREQUENCY_SD):
            factor = si_factor(table.file, unit, "frequency", title)
        elif unit and known in (PERIOD, PERIOD_SD):
            factor = si_factor(table.file, unit, "time", title)
        elif known in (DAMPING, DAMPING_SD) and unit == "%":
            factor = 0.01
        elif unit and known not in (MODE, TEST) and unit not in ("-", "1"):
            raise table.file.error(
                f"the column cannot be in {unit!r}; damping is a ratio or in %, a shape has no"
                " unit (write phases as complex numbers, 0.1+2j)",
                column=table.title(position),
            )
        values[known] = table.values[:, position] * factor
    if FREQUENCY not in values and PERIOD in values:
        with np.errstate(divide="ignore"):
            values[FREQUENCY] = 1.0 / values[PERIOD]
        if PERIOD_SD in values:
            values[FREQUENCY_SD] = values[PERIOD_SD] * values[FREQUENCY] ** 2
    elif PERIOD in values and (np.abs(values[FREQUENCY] * values[PERIOD] - 1.0) > 0.05).any():
        raise table.file.error("frequencies and periods do not fit each other; leave out one")
    return values


def figure_of(title: str) -> str | None:
    """Which figure of a mode a title names, as programs of identification write it.

    `Std. Frequency`, `Damping Ratio`, `Fn`; None of any other title.
    """
    plain = re.sub(r"[\s_.\-]+", "", title).lower()
    return next((name for name, pattern in _TITLES.items() if re.fullmatch(pattern, plain)), None)


_OF_MODES = ("frequency_hz", "frequency_sd_hz", "damping", "damping_sd", "shape", "shape_sd")


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedModes:
    """Modes of a building that somebody has identified, NaN where the file gives nothing.

    Attributes:
        names: (m,) what the file calls them.
        frequency_hz: (m,) undamped natural frequencies.
        frequency_sd_hz: (m,) standard deviations.
        damping: (m,) ratios of critical damping.
        damping_sd: (m,) standard deviations.
        floors: (f,) with a sensor, bottom to top.
        shape: (m, f) displacement of the floors against the fixed base, in any scale and sign.
        shape_sd: (m, f) standard deviations, in the scale of the shape.
    """

    names: tuple[str, ...]
    frequency_hz: Floats
    frequency_sd_hz: Floats
    damping: Floats
    damping_sd: Floats
    floors: tuple[str, ...]
    shape: Floats
    shape_sd: Floats
    source: str = "modes"
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def some(self, rows: Sequence[int]) -> "IdentifiedModes":
        """Some of the modes."""
        chosen = list(rows)
        arrays = {name: getattr(self, name)[chosen] for name in _OF_MODES}
        return replace(self, names=tuple(self.names[k] for k in chosen), **arrays)

    def of_floors(self, floors: Sequence[str]) -> "IdentifiedModes":
        """Shapes at some of the floors."""
        columns = [self.floors.index(name) for name in floors]
        return replace(
            self,
            floors=tuple(floors),
            shape=self.shape[:, columns],
            shape_sd=self.shape_sd[:, columns],
        )


def identified_modes(
    recording: Recording, columns: Mapping[str, str] | None = None, direction: str = "x"
) -> IdentifiedModes:
    """The modes in a file, on floors.

    Args:
        columns: our column name to the file's, or our floor to the file's measuring point, such
            as `{"2F": "3 +X"}`.
        direction: of the motion; components in other directions are left out.

    Raises:
        MeasurementError: there is no mode, a figure cannot be, or no component is on a floor.
    """
    file = recording.file
    table = recording.mode_table
    modes = recording.modes if table is None else modes_in_table(table, columns or {})
    if not modes:
        raise file.error("there is no mode in the file; give one row for each")
    for mode in modes:
        _check(file, mode)
    sensors = [parse_channel(sensor) for mode in modes for sensor in mode.sensors]
    notes = []
    if any(channel is not None and channel.floor == BASE for channel in sensors):
        notes.append("The shapes' component at the base is left out.")
    placed = _floors_of(file, modes, None if table is not None else columns, direction)
    floors = tuple(sorted(set(placed.values()), key=floor_height))
    # The sensors of a floor averaged.
    shape, spread = np.full((2, len(modes), len(floors)), np.nan)
    for row, mode in enumerate(modes):
        used = [k for k, name in enumerate(mode.sensors) if name in placed]
        values = in_phase(np.asarray(mode.shape)[used])
        sd = np.full(len(used), np.nan) if mode.shape_sd is None else mode.shape_sd[used]
        at = np.array([floors.index(placed[mode.sensors[k]]) for k in used], dtype=int)
        for column in set(at[~np.isnan(values)].tolist()):
            here = (at == column) & ~np.isnan(values)
            shape[row, column] = values[here].mean()
            spread[row, column] = np.sqrt((sd[here] ** 2).sum()) / here.sum()
    return IdentifiedModes(
        names=tuple(mode.name or str(k) for k, mode in enumerate(modes, start=1)),
        frequency_hz=np.array([mode.frequency_hz for mode in modes]),
        # None becomes NaN.
        frequency_sd_hz=np.array([mode.frequency_sd_hz for mode in modes], dtype=np.float64),
        damping=np.array([mode.damping for mode in modes], dtype=np.float64),
        damping_sd=np.array([mode.damping_sd for mode in modes], dtype=np.float64),
        floors=floors,
        shape=shape,
        shape_sd=spread,
        source=file.path.name,
        notes=tuple(notes),
        doubts=mode_findings(modes),
    )


def _check(file: TextFile, mode: RecordedMode) -> None:
    """Refuse figures that no mode has."""
    which = f"mode {mode.name}" if mode.name else "a mode"
    if not (np.isfinite(mode.frequency_hz) and mode.frequency_hz > 0.0):
        raise file.error(
            f"the frequency of {which} is {mode.frequency_hz:g} Hz; it must be above 0"
        )
    if mode.shape.size and (mode.shape == 0.0).all():
        raise file.error(f"the shape of {which} is zero at all floors; leave blank what is unknown")
    # No building loses more than half: such a figure is in percent.
    if mode.damping is not None and mode.damping <= 0.0:
        raise file.error(
            f"the damping ratio of {which} is {mode.damping:g}; it must be above 0: leave the cell"
            " blank where it is not known"
        )
    if mode.damping is not None and not mode.damping <= 0.5:
        raise file.error(
            f"the damping ratio of {which} is {mode.damping:g}, which no building has; give a"
            " ratio such as 0.02, or write the unit % behind the column's name: damping (%)"
        )
    stated = {"frequency": mode.frequency_sd_hz, "damping ratio": mode.damping_sd}
    for what, sd in stated.items():
        if sd is not None and not (np.isfinite(sd) and sd > 0.0):
            raise file.error(
                f"the standard deviation of the {what} of {which} is {sd:g}; it must be above 0,"
                " or left blank where it is not known"
            )
    spread = mode.shape_sd
    if spread is not None and (spread[~np.isnan(spread)] <= 0.0).any():
        raise file.error(
            f"a standard deviation of the shape of {which} is not above 0; correct it or leave"
            " it blank"
        )


def _floors_of(
    file: TextFile, modes: Sequence[RecordedMode], columns: Mapping[str, str] | None, direction: str
) -> dict[str, str]:
    """Floor of each sensor that is used, by the file's name of the sensor."""
    sensors = list(dict.fromkeys(name for mode in modes for name in mode.sensors))
    given = {name: name for name in sensors}
    if columns:
        chosen = positions(file, "component", sensors, columns)
        given = {sensors[k]: ours for ours, k in chosen.items()}
    placed: dict[str, str] = {}
    for sensor, ours in given.items():
        channel = parse_channel(ours)
        if channel is None and columns:
            raise file.error(f"unknown floor {ours!r}; floors are 2F, 3F, ..., RF")
        if channel is not None and channel.direction == direction and channel.floor != BASE:
            placed[sensor] = channel.floor
    if sensors and not placed:
        shown = ", ".join(sensors[:12]) + (", ..." if len(sensors) > 12 else "")
        raise file.error(
            f"none of the shapes' components is a floor's in direction {direction}; say which are,"
            f" by the columns option, such as 2F=NAME,RF=NAME, among {shown}"
        )
    return placed


def in_phase(shape: NDArray[np.inexact]) -> Floats:
    """Real part of a shape (s,), turned so that it holds as much of the shape as can be."""
    if not np.iscomplexobj(shape):
        return np.asarray(shape, dtype=np.float64)
    turn = 0.5 * np.angle(np.nansum(_scaled(shape) ** 2))
    return np.asarray((shape * np.exp(-1j * turn)).real, dtype=np.float64)


def phase_collinearity(shape: NDArray[np.inexact]) -> float:
    """Share of a shape (s,) that moves in one phase: 1 for a real shape (Pappa 1993)."""
    shape = _scaled(shape)
    whole = float(np.nansum(np.abs(shape) ** 2))
    return float(np.abs(np.nansum(shape**2)) / whole) if whole > 0.0 else 1.0


def _scaled(shape: NDArray[np.inexact]) -> NDArray[np.inexact]:
    """A shape (s,) whose largest component is one: squares of it neither overflow nor vanish."""
    largest = np.abs(shape[~np.isnan(shape)]).max(initial=0.0)
    return shape / largest if largest > 0.0 else shape


def mode_findings(modes: Sequence[RecordedMode]) -> tuple[str, ...]:
    """Sentences on modes that are doubtful by themselves, then on pairs."""
    findings = []
    called = [
        f"{f'mode {mode.name}' if mode.name else 'the mode'} at {mode.frequency_hz:.4g} Hz"
        for mode in modes
    ]
    for mode, name in zip(modes, called, strict=True):
        shape = np.asarray(mode.shape)
        if not mode.frequency_hz > 0.0:
            findings.append(f"{name}: the frequency must be above 0")
        # Buildings have damping ratios of .005 to .1, bare steel a few thousandths.
        if mode.damping is not None and not 0.001 <= mode.damping <= 0.1:
            percent = "" if mode.damping > 0.1 else ": is it a ratio, and not in percent?"
            findings.append(f"{name} has a damping ratio of {mode.damping:.3g}{percent}")
        # A standard deviation of a tenth of the frequency is worth a word.
        if mode.frequency_sd_hz is not None and mode.frequency_sd_hz > 0.1 * mode.frequency_hz:
            findings.append(f"{name} is hardly known: ±{mode.frequency_sd_hz:.3g} Hz")
        seen = shape[~np.isnan(shape)]
        if seen.size and phase_collinearity(seen) < _IN_PHASE:
            findings.append(f"{name}: the sensors do not move in phase")
        if seen.size > 1 and not np.abs(in_phase(seen)).any():
            findings.append(f"{name}: every component of the shape is zero")
    findings += [
        f"{called[k]} and {called[m]} have nearly one frequency and one shape: this"
        " looks like one mode found twice"
        for k, m in combinations(range(len(modes)), 2)
        if alike(modes[k], modes[m])
    ]
    if words := _without_signs(modes):
        findings.append(words)
    return tuple(findings)


def _without_signs(modes: Sequence[RecordedMode]) -> str:
    """A sentence where no component of any shape is negative, though not all shapes rise."""
    falling = []
    for mode in modes:
        along: dict[str, list[tuple[float, float]]] = {}
        for sensor, value in zip(mode.sensors, np.asarray(mode.shape), strict=True):
            if np.isnan(value):
                continue
            if np.iscomplex(value) or value.real < 0.0:
                return ""
            if (channel := parse_channel(sensor)) is not None:
                place = channel.direction + channel.sensor
                along.setdefault(place, []).append((floor_height(channel.floor), value.real))
        lines = [np.array(sorted(each))[:, 1] for each in along.values() if len(each) > 2]
        # In a mode that moves all floors one way none moves much less than one below it.
        if any((line < 0.75 * np.maximum.accumulate(line)).any() for line in lines):
            falling.append(mode.name or f"at {mode.frequency_hz:.4g} Hz")
    if not falling or len(modes) < 2:
        return ""
    return (
        f"no shape has a minus, though in mode {', '.join(falling)} floors move less than one"
        " below: were amplitudes written without signs? Give a minus to the components of floors"
        " that move against the others, or leave the shapes out"
    )


def mac(first: NDArray[np.inexact], second: NDArray[np.inexact]) -> float:
    """Modal assurance criterion of two shapes (s,)."""
    length = float(np.vdot(first, first).real * np.vdot(second, second).real)
    return float(np.abs(np.vdot(first, second)) ** 2 / length) if length > 0.0 else 0.0


def alike(first: RecordedMode, second: RecordedMode) -> bool:
    """Whether two modes look like one that was found twice."""
    if not (first.frequency_hz > 0.0 and second.frequency_hz > 0.0):
        return False
    # Within 2 % in frequency
    close = abs(np.log(first.frequency_hz / second.frequency_hz)) < 0.02
    shared = [name for name in first.sensors if name in second.sensors]
    both = np.array(
        [
            np.asarray(mode.shape)[[mode.sensors.index(name) for name in shared]]
            for mode in (first, second)
        ]
    )
    both = both[:, ~np.isnan(both).any(axis=0)]
    # and by a MAC of 0.95 two modes are one.
    return close and both.shape[1] > 1 and mac(*both) > 0.95
