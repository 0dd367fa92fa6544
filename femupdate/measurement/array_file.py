"""Named arrays, as MATLAB and numpy save them, as the table that they make.

Simcenter Testlab exports structures to MATLAB files: evenly spaced x, and values of y.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.measurement.clock import even_step, is_moment, seconds_of
from femupdate.measurement.modes import DAMPING, DAMPING_SD, FREQUENCY_SD, TELLING, figure_of
from femupdate.measurement.names import (
    FREQUENCY,
    FREQUENCY_NAME,
    TIME,
    TIME_NAME,
    is_unit,
    parse_channel,
)
from femupdate.measurement.recording import RecordedChannel, Recording
from femupdate.measurement.table import ColumnTable
from femupdate.measurement.text import TextFile

_Column = NDArray[np.number]
_RATE = re.compile(
    r"^(fs|f_s|sr|srate|f_?samp\w*|rate|sampl(e|ing)_?(rate|freq(uency)?))(_?hz)?$", re.I
)
_STEP = re.compile(r"^(dt|delta_?t|ts|time_?step)(_?s)?$", re.IGNORECASE)
_UNIT = re.compile(r"^units?$", re.IGNORECASE)
_LABELS = re.compile(r"^(channel|sensor|column)?s?_?(names?|labels?)$|^(channel|sensor)s$", re.I)

# Fields of Testlab's structures.
_START, _STEP_OF, _COUNT = "x_values.start_value", "x_values.increment", "x_values.number_of_values"
_X, _Y, _VALUES = "x_values.quantity.label", "y_values.quantity.label", "y_values.values"
_NAMES = "function_record.name"
_AXES = {"s": TIME, "": TIME, "hz": FREQUENCY}


def table_of_arrays(file: TextFile, arrays: Mapping[str, Any]) -> Recording:
    """Return equally long arrays as a table; its times are an array or follow from a rate.

    Arrays of modes (`_modes_in_arrays`) are modes instead.

    A complex array becomes two columns, `name_re` and `name_im`; of an array with two axes the
    shorter one counts the columns, `name_1` and so on.

    Args:
        arrays: by their names; a text called `unit` is that of all columns.
    """
    modes = _modes_in_arrays(file, arrays)
    if modes is not None:
        return Recording(file, mode_table=modes)
    exported = _testlab_recording(file, arrays)
    if exported is not None:
        return exported
    kinds = np.ndarray | np.number | float | int
    given = {name: np.asarray(a) for name, a in arrays.items() if isinstance(a, kinds)}
    numbers = {
        name: np.squeeze(a) for name, a in given.items() if a.dtype.kind in "fiuc" and a.size
    }
    scalars = {name: float(a.real) for name, a in numbers.items() if a.ndim == 0}
    labels = _texts(arrays, _LABELS)
    columns: dict[str, _Column] = {}
    for name, array in numbers.items():
        if array.ndim > 2 and parse_channel(name):
            raise file.error(f"{name} has axes of {array.shape}; save a row of values a channel")
        columns |= _columns(name, array, labels)
    if not columns:
        raise file.error("the file holds no array of numbers; save one for each channel")
    if timed := _channels_with_clocks(file, columns, scalars, arrays):
        return Recording(file, timed)
    axis = _axis(file, columns, scalars)
    count = columns[axis].size if axis else max(column.size for column in columns.values())
    used = {k: v for k, v in columns.items() if v.size == count}
    used = {axis: used.pop(axis)} | used if axis else used
    if axis != FREQUENCY and any(map(np.iscomplexobj, used.values())):
        raise file.error("complex arrays need their frequencies, frequency_hz; histories are real")
    left_out = [name for name in columns if name not in used]
    alike = [k for k in left_out if 2 * columns[k].size > count > 500 or parse_channel(k)]
    if alike:
        raise file.error(
            f"{', '.join(alike)} and {next(k for k in used if k != axis)} have unlike lengths, and "
            "nothing says when each starts; save times with each, such as time_RF, or cut them"
        )
    for name, column in used.items():
        wrong = np.flatnonzero(np.isinf(column))
        if wrong.size:
            raise file.error(
                f"the value is {column[wrong[0]]}; fill in the measured value or remove the array",
                int(wrong[0]) + 1,
                repr(name),
            )
    stated = [unit if is_unit(unit) else None for unit in _texts(arrays, _UNIT)]
    each = dict(zip(labels, stated, strict=False)) if len(stated) == len(labels) else {}
    common = stated[0] if len(set(stated)) == 1 else None
    # Names of columns go without that of the one structure that all of them are fields of.
    short = [name.rpartition(".")[2] for name in used]
    single = len({name.rpartition(".")[0] for name in used if "." in name}) == 1
    plain = dict(
        zip(short if single and len(set(short)) == len(short) else used, used, strict=True)
    )
    units = {name: each.get(key, common) for name, key in plain.items() if key != axis}
    table = ColumnTable.of_arrays(file, {name: used[key] for name, key in plain.items()}, units)
    notes = (f"Arrays of another length are left out: {', '.join(left_out)}.",)
    of_modes = any(figure_of(name) in TELLING for name in plain)
    kept = None if of_modes else table
    modal = table if of_modes else None
    return Recording(file, table=kept, mode_table=modal, notes=notes if left_out else ())


_CLOCK = re.compile(
    r"(?P<word>time|t_?0|t_?start|t|start_?time|start|begin|fs|rate|dt)"
    r"(?P<unit>_ms|_us)?(?:_?(?P<of>[A-Za-z0-9]*))$",
    re.IGNORECASE,
)


def _channels_with_clocks(
    file: TextFile,
    columns: Mapping[str, _Column],
    scalars: Mapping[str, float],
    arrays: Mapping[str, Any],
) -> tuple[RecordedChannel, ...]:
    """Arrays each of which has times, a start or a rate for itself; none of other files.

    They are told by names: `time_RF`, `t2` of `a2`, `fs_RF`, `start_RF`, or fields of a structure.
    """
    texts = {k: str(v) for k, v in arrays.items() if isinstance(v, str) and is_moment(v)}
    moments = seconds_of(list(texts.values())) if texts else 0
    starts = {} if isinstance(moments, int) else dict(zip(texts, moments, strict=True))
    known: dict[str, Any] = {**scalars, **starts, **columns}
    clocks = {key: found for key in known if (found := _CLOCK.match(key.rpartition(".")[2]))}
    data = [key for key in columns if key not in clocks]
    if len(clocks) < 2 or len(data) > 200:
        return ()
    (unit,) = {*_texts(arrays, _UNIT)} if len({*_texts(arrays, _UNIT)}) == 1 else (None,)

    def of(name: str, *words: str) -> Any:
        """What is said of an array by one of the words, else of all by the same."""
        for alone in (True, False):
            for key, found in clocks.items():
                owner, place = key.rpartition(".")[0], found["of"]
                ends = re.search(rf"(^|_|[a-z](?=\d)){re.escape(place)}$", name) if place else None
                mine = bool(ends) or bool(owner and name.startswith(f"{owner}."))
                common = not alone and not owner and not place
                if found["word"].lower().replace("_", "") in words and (mine if alone else common):
                    return known[key]
        return None

    made = []
    for name in data:
        time, begin = of(name, "time", "t"), of(name, "t0", "tstart", "start", "starttime", "begin")
        rate, step = of(name, "fs", "rate"), of(name, "dt")
        if np.ndim(time) and np.size(time) == columns[name].size:
            step, even, _ = even_step(file, time, np.arange(time.size) + 1, name)
            begin = float(time[0])
            if even is not None:
                return ()
        elif rate or step:
            step = step or 1.0 / rate
        else:
            return ()
        owner, _, last = name.rpartition(".")
        title = owner.rpartition(".")[2] or re.sub("^(acc|a)_", "", last)
        values = np.asarray(np.real(columns[name]), dtype=np.float64)
        channel = RecordedChannel(name=title, values=values, time_step=step, unit=unit, start=begin)
        made.append(channel)
    rates, begins = {each.time_step for each in made}, {each.start for each in made}
    if len(made) < 2 or (None in begins and len(begins) > 1):
        return ()
    return tuple(made) if len(begins) > 1 or len(rates) > 1 else ()


def _texts(arrays: Mapping[str, Any], called: re.Pattern[str]) -> list[str]:
    """The texts of the first array of a name, one of a single text."""
    named = (a for name, a in arrays.items() if called.match(name.rpartition(".")[2]))
    return [str(text).strip() for a in named for text in np.ravel(np.asarray(a, dtype=object))]


def _columns(name: str, array: NDArray[Any], labels: Sequence[str] = ()) -> dict[str, _Column]:
    if array.ndim == 2:
        rows = array if array.shape[0] <= array.shape[1] else array.T
        titles = labels if len(set(labels)) == len(rows) else ()
        titles = titles or [f"{name}_{k}" for k in range(1, len(rows) + 1)]
        parts = [_columns(title, row) for title, row in zip(titles, rows, strict=True)]
        return {key: column for each in parts for key, column in each.items()}
    return {name: array} if array.ndim == 1 and array.size > 1 else {}


def _axis(file: TextFile, columns: dict[str, _Column], scalars: Mapping[str, float]) -> str | None:
    """Name of the column of times or frequencies; one is added where a rate gives it, else None."""
    for kind, name in ((TIME_NAME, TIME), (FREQUENCY_NAME, FREQUENCY)):
        real = (key for key, column in columns.items() if not np.iscomplexobj(column))
        key_of_axis = next((key for key in real if kind.match(key.rpartition(".")[2])), None)
        if key_of_axis is not None:
            counted = {"_ms": 1e-3, "_us": 1e-6}.get(key_of_axis.lower()[-3:], 1.0)
            columns[name] = counted * columns.pop(key_of_axis)
            return name
    steps = {
        name: 1.0 / value if _RATE.match(plain) else value
        for name, value in scalars.items()
        for plain in (name.rpartition(".")[2],)
        if np.isfinite(value) and value and (_RATE.match(plain) or _STEP.match(plain))
    }
    if not steps:
        return None
    step = max(steps.values())
    if not 0.0 < step < 1.001 * min(steps.values()):
        told = " and ".join(f"{name} says {value:g} s" for name, value in steps.items())
        raise file.error(f"steps must agree and be above 0: {told}; remove what is wrong")
    longest = max(column.size for column in columns.values())
    columns[TIME] = np.arange(longest, dtype=np.float64) * step
    return TIME


def _testlab_recording(file: TextFile, arrays: Mapping[str, Any]) -> Recording | None:
    """The structures of a file as one table; None of a file that holds none."""
    stepped = {
        name.removesuffix(f".{_STEP_OF}") for name in arrays if name.endswith(f".{_STEP_OF}")
    }
    owners = sorted(name for name in stepped if f"{name}.{_VALUES}" in arrays)
    if not owners:
        return None
    # Of each its axis (our name, start, step, count), its columns and unit.
    signals = dict[str, tuple[tuple[str, float, float, int], dict[str, _Column], str]]()
    for owner in owners:
        values = np.asarray(arrays[f"{owner}.{_VALUES}"])
        count = int(arrays.get(f"{owner}.{_COUNT}", values.shape[0] if values.ndim else 0))
        values = values[:, None] if values.ndim == 1 else values
        label = str(arrays.get(f"{owner}.{_X}", "")).strip().lower()
        step = float(arrays[f"{owner}.{_STEP_OF}"])
        whole = values.ndim == 2 and values.shape[0] == count and values.dtype.kind in "fiuc"
        if not whole or label not in _AXES or not step > 0.0 or not np.isfinite(values).all():
            raise file.error(
                f"{owner} holds no {count} rows of finite numbers over time or frequency; export it"
                " again as time data or response functions"
            )
        names = [str(name).strip() for name in np.ravel(arrays.get(f"{owner}.{_NAMES}", []))]
        if len(set(names)) != values.shape[1] or not all(names):
            numbered = [f"{owner}_{k}" for k in range(1, values.shape[1] + 1)]
            names = [owner] if values.shape[1] == 1 else numbered
        axis = _AXES[label], float(arrays.get(f"{owner}.{_START}", 0.0)), step, count
        unit = str(arrays.get(f"{owner}.{_Y}", "")).strip()
        signals[owner] = axis, dict(zip(names, values.T, strict=True)), unit
    axes = {axis for axis, _, _ in signals.values()}
    if len(axes) > 1:
        raise file.error(
            f"{', '.join(owners)} are not sampled alike; export them to files of their own"
        )
    ((kind, start, step, count),) = axes
    columns: dict[str, _Column] = {kind: start + step * np.arange(count, dtype=np.float64)}
    units: dict[str, str | None] = {}
    for owner, (_, own_columns, unit) in signals.items():
        for name, column in own_columns.items():
            alone = sum(name in others for _, others, _ in signals.values()) == 1
            title = name if alone else f"{owner} {name}"
            columns[title], units[title] = column, unit
    return Recording(file, table=ColumnTable.of_arrays(file, columns, units))


_SHAPE, _SHAPE_SD, _SENSORS = "shape", "shape_sd", "sensors"
_SHAPES = {
    _SHAPE: r"phi|psi|(mode_?)?shapes?|modes",
    _SHAPE_SD: r"(phi|psi|(mode_?)?shapes?|modes)_(std|sd)",
    _SENSORS: r"(sensor|channel|floor)s?(_?(names?|labels?))?|names|labels",
}


def _modes_in_arrays(file: TextFile, arrays: Mapping[str, Any]) -> ColumnTable | None:
    """Modes in named arrays as a table; None without frequencies (m,) and shapes (c, m).

    Args:
        arrays: by their names; `sensors` holds names (c,), else they count from 1.
    """
    given: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        plain = name.rpartition(".")[2]
        called = (of for of, names in _SHAPES.items() if re.fullmatch(names, plain, re.IGNORECASE))
        ours = next(called, None) or figure_of(plain)
        if ours and np.size(array):
            given[ours] = np.squeeze(np.asarray(array))
    if not {FREQUENCY, _SHAPE} <= set(given):
        return None
    count = np.size(given[FREQUENCY])

    def by_modes(array: NDArray[Any]) -> NDArray[Any] | None:
        # One mode is a column, and columns are modes where both could be.
        array = array if array.ndim != 1 else array[:, None] if count == 1 else array[None]
        if array.ndim != 2:
            return None
        return array if array.shape[1] == count else array.T if array.shape[0] == count else None

    shape = by_modes(given[_SHAPE])
    if given[FREQUENCY].ndim > 1 or shape is None:
        return None
    columns = {}
    for name in (FREQUENCY, FREQUENCY_SD, DAMPING, DAMPING_SD):
        if name in given and np.size(given[name]) != count:
            raise file.error(
                f"there are {count} frequencies but {np.size(given[name])} values of"
                f" {name}; give one for each mode"
            )
        if name in given:
            columns[name] = np.atleast_1d(given[name]).astype(np.float64)
    names = [str(sensor) for sensor in np.atleast_1d(given.get(_SENSORS, np.array([])))]
    names = names if len(names) == len(shape) else [str(k + 1) for k in range(len(shape))]
    spread = by_modes(given[_SHAPE_SD]) if _SHAPE_SD in given else None
    columns |= dict(zip(names, shape, strict=True))
    if spread is not None:
        columns |= {f"{name}_sd": row for name, row in zip(names, spread, strict=True)}
    return ColumnTable.of_arrays(file, columns, {})
