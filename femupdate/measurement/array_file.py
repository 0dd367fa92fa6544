"""Named arrays, as MATLAB and numpy save them, as the table that they make."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.measurement.columns import FREQUENCY, FREQUENCY_NAME, TIME, TIME_NAME
from femupdate.measurement.mode_arrays import modes_in_arrays
from femupdate.measurement.quantity import is_unit
from femupdate.measurement.recording import Recording
from femupdate.measurement.table import Table
from femupdate.measurement.testlab_arrays import testlab_recording
from femupdate.measurement.text import TextFile

_RATE = re.compile(r"^(fs|f_s|fsamp\w*|rate|sampl(e|ing)_?(rate|freq(uency)?))(_?hz)?$", re.I)
_STEP = re.compile(r"^(dt|delta_?t|ts|time_?step)(_?s)?$", re.IGNORECASE)
_UNIT = re.compile(r"^units?$", re.IGNORECASE)
_LABELS = re.compile(r"^(channel|sensor|column)?s?_?(names?|labels?)$|^(channel|sensor)s$", re.I)


def table_of_arrays(file: TextFile, arrays: Mapping[str, Any]) -> Recording:
    """Return equally long arrays as a table; its times are an array or follow from a rate.

    Arrays of modes (`modes_in_arrays`) are modes instead, and `testlab_recording` knows the
    structures of its program.

    A complex array becomes two columns, `name_re` and `name_im`; of an array with two axes the
    shorter one counts the columns, `name_1` and so on.

    Args:
        arrays: by their names; a text called `unit` is that of all columns.

    Raises:
        MeasurementError: there is no numeric array, or neither times, frequencies nor a rate.
    """
    modes = modes_in_arrays(file, arrays)
    if modes:
        return Recording(file, modes=modes)
    exported = testlab_recording(file, arrays)
    if exported is not None:
        return exported
    numbers = {name: np.squeeze(a) for name, a in arrays.items() if _is_numeric(a)}
    scalars = {name: float(a.real) for name, a in numbers.items() if a.ndim == 0}
    labels = _texts(arrays, _LABELS)
    columns: dict[str, Floats] = {}
    for name, array in numbers.items():
        columns |= _columns(name, array, labels)
    if not columns:
        raise file.error("the file holds no array of numbers; save one for each channel")
    axis = _axis(file, columns, scalars)
    count = columns[axis].size
    used = {axis: columns.pop(axis)} | {k: v for k, v in columns.items() if v.size == count}
    left_out = [name for name in columns if name not in used]
    _require_finite(file, used)
    names = tuple(used)
    stated = [one if is_unit(one) else None for one in _texts(arrays, _UNIT)]
    each = dict(zip(labels, stated, strict=False)) if len(stated) == len(labels) else {}
    common = stated[0] if len(set(stated)) == 1 else None
    units = tuple(None if name == axis else each.get(name, common) for name in names)
    table = Table(
        file,
        _without_structure(names),
        units,
        np.column_stack(list(used.values())),
        np.arange(count) + 1,
    )
    notes = (f"Arrays of another length are left out: {', '.join(left_out)}.",)
    return Recording(file, table=table, notes=notes if left_out else ())


def _is_numeric(array: Any) -> bool:
    return isinstance(array, np.ndarray | np.number | float | int) and (
        np.asarray(array).dtype.kind in "fiuc" and np.asarray(array).size > 0
    )


def _texts(arrays: Mapping[str, Any], called: re.Pattern[str]) -> list[str]:
    """The texts of the first array of a name, one of a single text."""
    found = (a for name, a in arrays.items() if called.match(name.rpartition(".")[2]))
    return [str(one).strip() for a in found for one in np.ravel(np.asarray(a, dtype=object))]


def _without_structure(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of columns without that of the one structure that all of them are fields of."""
    plain = tuple(name.rpartition(".")[2] for name in names)
    one = len({name.rpartition(".")[0] for name in names if "." in name}) == 1
    return plain if one and len(set(plain)) == len(plain) else names


def _columns(name: str, array: NDArray[Any], labels: Sequence[str] = ()) -> dict[str, Floats]:
    if array.ndim == 2:
        rows = array if array.shape[0] <= array.shape[1] else array.T
        own = labels if len(set(labels)) == len(rows) else ()
        own = own or [f"{name}_{k}" for k in range(1, len(rows) + 1)]
        found = [_columns(title, row) for title, row in zip(own, rows, strict=True)]
        return {key: column for each in found for key, column in each.items()}
    if array.ndim != 1 or array.size < 2:
        return {}
    if np.iscomplexobj(array):
        return {f"{name}_re": array.real.astype(float), f"{name}_im": array.imag.astype(float)}
    return {name: array.astype(np.float64)}


def _axis(file: TextFile, columns: dict[str, Floats], scalars: Mapping[str, float]) -> str:
    """Name of the column of times or frequencies; one is added where a rate gives it."""
    for kind, name in ((TIME_NAME, TIME), (FREQUENCY_NAME, FREQUENCY)):
        found = next((key for key in columns if kind.match(key.rpartition(".")[2])), None)
        if found is not None:
            columns[name] = columns.pop(found)
            return name
    step = _step(scalars)
    if step is None:
        raise file.error(
            f"neither times nor a sampling rate is among {', '.join([*columns, *scalars])}; add"
            " the array time_s (s), frequency_hz, or the number fs (Hz)"
        )
    longest = max(column.size for column in columns.values())
    columns[TIME] = np.arange(longest, dtype=np.float64) * step
    return TIME


def _step(scalars: Mapping[str, float]) -> float | None:
    for name, value in scalars.items():
        plain = name.rpartition(".")[2]
        if np.isfinite(value) and value > 0.0 and (_RATE.match(plain) or _STEP.match(plain)):
            return 1.0 / value if _RATE.match(plain) else value
    return None


def _require_finite(file: TextFile, columns: Mapping[str, Floats]) -> None:
    for name, column in columns.items():
        wrong = np.flatnonzero(~np.isfinite(column))
        if wrong.size:
            raise file.error(
                f"the value is {column[wrong[0]]}; fill in the measured value or remove the array",
                int(wrong[0]) + 1,
                repr(name),
            )
