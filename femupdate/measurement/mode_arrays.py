"""Identified modes as named arrays, as pyOMA2's results hold them: Fn, Xi and Phi."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.measurement.recording import RecordedMode
from femupdate.measurement.text import TextFile

_FREQUENCY = r"(f_?n|f_?id|(natural_?)?freq(uency|uencies|s)?)"
_DAMPING = r"(xi|zeta|(modal_?)?damp(ing)?_?(ratios?)?)"
_SHAPE = r"(phi|psi|(mode_?)?shapes?|modes)"
_NAMES = {
    "frequency": rf"{_FREQUENCY}(_hz)?",
    "frequency_sd": rf"{_FREQUENCY}_(std|sd)(_hz)?",
    "damping": _DAMPING,
    "damping_sd": rf"{_DAMPING}_(std|sd)",
    "shape": _SHAPE,
    "shape_sd": rf"{_SHAPE}_(std|sd)",
    "sensors": r"(sensor|channel|floor)s?(_?(names?|labels?))?|names|labels",
}


def modes_in_arrays(file: TextFile, arrays: Mapping[str, Any]) -> tuple[RecordedMode, ...]:
    """The modes in named arrays; none where there are no frequencies (m,) with shapes (c, m).

    Args:
        arrays: by their names; `sensors` holds names (c,), else they count from 1.

    Raises:
        MeasurementError: an array has another number of modes.
    """
    found = {
        ours: np.squeeze(np.asarray(array))
        for name, array in arrays.items()
        for ours, pattern in _NAMES.items()
        if re.fullmatch(pattern, name.rpartition(".")[2], re.IGNORECASE) and np.size(array)
    }
    if not {"frequency", "shape"} <= set(found):
        return ()
    frequency = np.atleast_1d(found["frequency"])
    count = frequency.size
    shape = _by_modes(found["shape"], count)
    if frequency.ndim != 1 or shape is None:
        return ()
    spread = _by_modes(found["shape_sd"], count) if "shape_sd" in found else None
    for name in ("frequency_sd", "damping", "damping_sd"):
        if name in found and np.size(found[name]) != count:
            raise file.error(
                f"there are {count} frequencies but {np.size(found[name])} values of"
                f" {name.replace('_sd', ' (standard deviation)')}; give one for each mode"
            )
    names = [str(one) for one in np.atleast_1d(found.get("sensors", np.array([])))]
    if len(names) != len(shape):
        names = [str(k + 1) for k in range(len(shape))]
    return tuple(
        RecordedMode(
            frequency_hz=float(frequency[k]),
            frequency_sd_hz=_value(found.get("frequency_sd"), k),
            damping=_value(found.get("damping"), k),
            damping_sd=_value(found.get("damping_sd"), k),
            sensors=tuple(names),
            shape=shape[:, k],
            shape_sd=None if spread is None else spread[:, k].astype(np.float64),
            name=str(k + 1),
        )
        for k in range(count)
    )


def _by_modes(array: NDArray[Any], count: int) -> NDArray[Any] | None:
    """Shapes (c, m): one mode is a column, and columns are modes where both could be."""
    if array.ndim == 1:
        return array[:, None] if count == 1 else array[None] if array.size == count else None
    if array.ndim != 2:
        return None
    return array if array.shape[1] == count else array.T if array.shape[0] == count else None


def _value(array: NDArray[Any] | None, k: int) -> float | None:
    if array is None:
        return None
    value = float(np.atleast_1d(array)[k])
    return value if np.isfinite(value) else None
