"""Structures of MATLAB files as Simcenter Testlab exports them: evenly spaced x, values of y."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.columns import FREQUENCY, TIME
from femupdate.measurement.recording import Recording
from femupdate.measurement.table import Table
from femupdate.measurement.text import TextFile

_START, _STEP, _COUNT = "x_values.start_value", "x_values.increment", "x_values.number_of_values"
_X, _Y, _VALUES = "x_values.quantity.label", "y_values.quantity.label", "y_values.values"
_NAMES = "function_record.name"
_AXES = {"s": TIME, "": TIME, "hz": FREQUENCY}


@dataclass(frozen=True)
class _Signal:
    """One structure.

    Attributes:
        axis: name of our column, first value, increment and number of values.
        values: (n, c) of its columns, real or complex.
        names: (c,)
        unit: of all values, or None.
    """

    axis: tuple[str, float, float, int]
    values: Any
    names: Sequence[str]
    unit: str | None


def testlab_recording(file: TextFile, arrays: Mapping[str, Any]) -> Recording | None:
    """Return the structures of a file as one table; None of a file that holds none.

    Args:
        file: where they were read.
        arrays: by their names, fields of a structure as `Signal.x_values.increment`.

    Raises:
        MeasurementError: two structures differ in their sampling, or one holds other than rows of
            a time or a frequency.
    """
    found = {name.removesuffix(f".{_STEP}") for name in arrays if name.endswith(f".{_STEP}")}
    owners = sorted(name for name in found if f"{name}.{_VALUES}" in arrays)
    if not owners:
        return None
    signals = [_signal(file, name, arrays) for name in owners]
    axis = signals[0].axis
    if any(one.axis != axis for one in signals):
        raise file.error(
            f"{', '.join(owners)} are not sampled alike; export them to files of their own"
        )
    names, start, step, count = axis
    columns: list[tuple[str, str | None, Floats]] = [
        (names, None, start + step * np.arange(count, dtype=np.float64))
    ]
    for owner, one in zip(owners, signals, strict=True):
        for name, column in zip(one.names, np.asarray(one.values).T, strict=True):
            plain = (
                name if sum(name in other.names for other in signals) == 1 else f"{owner} {name}"
            )
            columns += [(title, one.unit, part) for title, part in _parts(plain, column)]
    table = Table(
        file,
        tuple(name for name, _, _ in columns),
        tuple(unit for _, unit, _ in columns),
        np.column_stack([values for *_, values in columns]),
        np.arange(count) + 1,
    )
    return Recording(file, table=table)


def _signal(file: TextFile, owner: str, arrays: Mapping[str, Any]) -> _Signal:
    values = np.asarray(arrays[f"{owner}.{_VALUES}"])
    count = int(arrays.get(f"{owner}.{_COUNT}", values.shape[0] if values.ndim else 0))
    values = values[:, None] if values.ndim == 1 else values
    label = str(arrays.get(f"{owner}.{_X}", "")).strip().lower()
    step = float(arrays[f"{owner}.{_STEP}"])
    whole = values.ndim == 2 and values.shape[0] == count and values.dtype.kind in "fiuc"
    if not whole or label not in _AXES or not step > 0.0 or not np.isfinite(values).all():
        raise file.error(
            f"{owner} holds no {count} rows of finite numbers over time or frequency; export it"
            " again as time data or response functions"
        )
    stated = [str(one).strip() for one in np.ravel(arrays.get(f"{owner}.{_NAMES}", []))]
    alone = [owner] if values.shape[1] == 1 else []
    numbered = alone or [f"{owner}_{k}" for k in range(1, values.shape[1] + 1)]
    unique = len(set(stated)) == values.shape[1] and all(stated)
    unit = str(arrays.get(f"{owner}.{_Y}", "")).strip() or None
    start = float(arrays.get(f"{owner}.{_START}", 0.0))
    return _Signal((_AXES[label], start, step, count), values, stated if unique else numbered, unit)


def _parts(name: str, column: Any) -> list[tuple[str, Floats]]:
    """A column, or the two of complex numbers."""
    if np.iscomplexobj(column):
        return [
            (f"{name}_re", column.real.astype(float)),
            (f"{name}_im", column.imag.astype(float)),
        ]
    return [(name, column.astype(np.float64))]
