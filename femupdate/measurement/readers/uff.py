"""Universal files (UFF), by pyuff: histories and functions (58), modes (55, 2414)."""

import contextlib
import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.measurement.clock import even_step, interpolated
from femupdate.measurement.names import force_unit, is_acceleration, parse_channel
from femupdate.measurement.recording import (
    RecordedChannel,
    RecordedFunction,
    RecordedMode,
    Recording,
    told_apart,
)
from femupdate.measurement.text import TextFile, reading_package

READS = "universal files (UFF sets 15, 55, 58, 151, 164, 2411, 2414)"

_FIRST = re.compile(r"\s*-1[ \t\r]*\n\s*\d{2,5}b?\b")
_READ = (15, 55, 58, 151, 164, 2411, 2412, 2414)
_KINDS = {
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response",
    5: "transmissibility",
    6: "coherence",
    9: "power spectral density",
    10: "energy spectral density",
}
_QUANTITIES = {8: "displacement", 11: "velocity", 12: "acceleration", 13: "force", 15: "pressure"}
_QUANTITIES |= {9: "force", 21: "pressure"}
_SI_UNITS = {8: "m", 9: "N", 11: "m/s", 12: "m/s2", 13: "N"}
_DIRECTIONS = {
    1: "+X",
    -1: "-X",
    2: "+Y",
    -2: "-Y",
    3: "+Z",
    -3: "-Z",
    4: "+RX",
    5: "+RY",
    6: "+RZ",
}
_COMPONENTS = (1, 2, 3, 4, 5, 6)  # directions of the components of a shape
_TIME, _HISTORY = 17, 1
_MODES, _COMPLEX_MODES = 2, (3, 7)  # analysis types of sets 55 and 2414
# Of set 2414: vectors of 3 or 6 components, motions or of unknown kind, and complex data types.
_VECTORS, _MOTIONS, _COMPLEX_DATA = (2, 3), (8, 11, 12, 95, 96), (5, 6)


def recognises(head: str, suffix: str) -> bool:
    return _FIRST.match(head) is not None


def read(path: Path) -> Recording:
    """Histories, functions of frequency, modes and points of a universal file."""
    file = TextFile(path)
    pyuff = reading_package(file, "pyuff", "pyuff", "universal files")
    lines = path.read_bytes().decode(errors="replace").replace("\r\n", "\n").split("\n")
    at = [k for k, line in enumerate(lines) if line.strip() == "-1"]
    if len(at) % 2 and not any(re.match(r" *58b", line) for line in lines):  # of bytes none is sure
        raise file.error("the last set has no end: the file is cut off; export it again")
    texts = [tuple(lines[a + 1 : b]) for a, b in zip(at[::2], at[1::2], strict=False)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        content = pyuff.UFF(str(path))
        types = [int(kind) for kind in content.get_set_types()]
        texts = texts if len(texts) == len(types) else [()] * len(types)
        sets = [_set(content, k, texts[k]) for k, kind in enumerate(types) if kind in _READ]
    return _recording(file, types, sets)


def _set(content: Any, number: int, lines: Sequence[str]) -> dict[str, Any]:
    """A set; an empty one of a result (2414) that pyuff cannot follow, such as stresses."""
    kind = int(content.get_set_types()[number])
    if kind == 58 and len(lines) > 12 and lines[0].strip() == "58":
        return _text_58(lines)
    if kind != 2414:
        return dict(content.read_sets(number))
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # where pyuff says what it leaves out
            return dict(content.read_sets(number))
    except Exception:
        return {"type": 2414}


_RECORD_6 = (
    *("func_type", "func_id", "ver_num", "load_case_id"),
    *("rsp_ent_name", "rsp_node", "rsp_dir", "ref_ent_name", "ref_node", "ref_dir"),
)
_AXES = ("abscissa", "ordinate", "orddenom")


def _text_58(lines: Sequence[str]) -> dict[str, Any]:
    """A function in text, whatever widths its program gives names and numbers."""
    found: dict[str, Any] = {"type": 58}
    found |= {f"id{k}": lines[k].strip() for k in range(1, 6)}
    row = lines[6]
    ends = (0, 5, 15, 20, 30, 41, 51, 55, 66, 76, 80)
    fields = [row[a:b].strip() for a, b in pairwise(ends)]
    whole = all(re.fullmatch(r"-?\d*", fields[k]) for k in (0, 1, 2, 3, 5, 6, 8, 9))
    if not whole or len(row.rstrip()) > 80:  # a name that is too long moves what follows
        fields = row.split()
        fields = fields if len(fields) == len(_RECORD_6) else fields[:4] + _around_names(row)
    for name, text in zip(_RECORD_6, fields, strict=True):
        found[name] = text if name.endswith("ent_name") else int(text or 0)
    figures = re.findall(r"\S+", lines[7])
    kind, count, even = (int(text) for text in figures[:3])
    least, step = (float(text.upper().replace("D", "E")) for text in figures[3:5])
    found |= {"num_pts": count, "abscissa_spacing": even, "abscissa_inc": step}
    found["abscissa_min"] = least
    for name, line in zip(_AXES, lines[8:11], strict=True):
        found[f"{name}_spec_data_type"] = int(line[:10])
        found[f"{name}_axis_lab"] = line[25:46].strip()
        found[f"{name}_axis_units_lab"] = line[46:].strip()
    text = " ".join(lines[12:]).upper().replace("D", "E")
    numbers = re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?|NAN|[-+]?INF\w*", text)
    values = np.array([float(number) for number in numbers])
    parts = 2 if kind in (5, 6) else 1
    values = values[: values.size - values.size % (parts + (even == 0))]
    table = values.reshape(-1, parts + (even == 0))
    given = table[:, even == 0 :] if even == 0 else table
    found["data"] = given[:, 0] + 1j * given[:, 1] if parts == 2 else given[:, 0]
    found["x"] = table[:, 0] if even == 0 else least + step * np.arange(len(table))
    return found


def _around_names(row: str) -> list[str]:
    """Fields of names, nodes and directions behind the first thirty characters of record 6."""
    match = re.match(r"(.*?)\s+(\d+)\s+(-?\d+)\s+(.*?)\s+(\d+)\s+(-?\d+)\s*$", row[30:])
    if match is None:
        raise ValueError(f"record 6 is {row.strip()!r}")
    return [text.strip() for text in match.groups()]


def _recording(file: TextFile, types: list[int], sets: list[dict[str, Any]]) -> Recording:
    # Code 1 of set 164 stands for SI.
    si = all(dataset["units_code"] == 1 for dataset in sets if dataset["type"] == 164)
    histories: list[dict[str, Any]] = []
    functions: list[dict[str, Any]] = []
    points: dict[int, tuple[float, float, float]] = {}
    for dataset in sets:
        if dataset["type"] in (15, 2411):
            places = np.column_stack([dataset[axis] for axis in "xyz"]).astype(np.float64).tolist()
            points |= {
                int(number): (x, y, z)
                for number, (x, y, z) in zip(dataset["node_nums"], places, strict=True)
            }
        elif dataset["type"] == 58:
            timed = dataset["abscissa_spec_data_type"] == _TIME
            general = dataset["func_type"] not in _KINDS
            history = dataset["func_type"] == _HISTORY or (general and timed)
            (histories if history else functions).append(dataset)
    recording = Recording(
        file,
        told_apart([_channel(file, each, k, si) for k, each in enumerate(histories, start=1)]),
        functions=tuple(_function(file, dataset, si) for dataset in functions),
        modes=tuple(_modes(file, sets)),
        points=points,
        notes=_notes(types, sets),
    )
    if not (recording.channels or recording.functions or recording.modes or points):
        raise file.error(
            f"the file has the sets {', '.join(map(str, dict.fromkeys(types))) or 'none'}; read are"
            " 58 (histories, functions), 55 and 2414 (modes), 15 and 2411 (points)"
        )
    return recording


def _channel(file: TextFile, dataset: Mapping[str, Any], number: int, si: bool) -> RecordedChannel:
    values = np.real(np.asarray(dataset["data"])).astype(np.float64)
    if values.size != int(dataset["num_pts"]):
        raise file.error(
            f"set 58 number {number} announces {int(dataset['num_pts'])} values but {values.size}"
            " follow: the file is cut off; export it again"
        )
    if values.size < 2 or not np.isfinite(values).all():
        raise file.error(f"set 58 number {number} holds no history of finite numbers")
    x = np.asarray(dataset["x"], dtype=np.float64)
    even = dataset["abscissa_spacing"] == 1
    step = float(dataset["abscissa_inc"]) if even else float((x[-1] - x[0]) / (x.size - 1))
    if not (np.isfinite(step) and step > 0.0):
        raise file.error(f"set 58 number {number} has a time step of {step:g}; correct it")
    done: tuple[str, ...] = ()
    if not even:
        step, times, done = even_step(file, x, np.arange(x.size) + 1, f"set 58 number {number}")
        values = values if times is None else interpolated(values, x, times)
    label = _unit(dataset)
    axis, code = _text(dataset["ordinate_axis_lab"]), dataset["ordinate_spec_data_type"]
    # Codes 0 and 1 of the ordinate tell nothing.
    general = code in (0, 1) and axis.lower() not in _QUANTITIES.values()
    quantity = "" if general else _QUANTITIES.get(code, axis.lower())
    if not label and quantity == "acceleration" and si:
        label = "m/s2"  # the format's own unit, unless set 164 says otherwise
    name = _text(dataset["rsp_ent_name"]) or _place(dataset, "rsp") or (axis if general else "")
    return RecordedChannel(
        name=name or f"channel {number}",
        values=values,
        time_step=step,
        unit=label or None,
        quantity=quantity or ("acceleration" if is_acceleration(label) else "unknown"),
        location=_place(dataset, "rsp"),
        direction=_DIRECTIONS.get(dataset["rsp_dir"], ""),
        start=float(dataset["abscissa_min"]) if even else float(x[0]),
        done=done,
    )


def _function(file: TextFile, dataset: Mapping[str, Any], si: bool) -> RecordedFunction:
    frequency, values = np.asarray(dataset["x"], dtype=np.float64), np.asarray(dataset["data"])
    if not np.imag(values).any():  # the file writes zeros for all imaginary parts
        values = np.real(values)
    if frequency.shape != values.shape:
        raise file.error(
            f"a function has {values.size} values at {frequency.size} frequencies; export it again"
        )
    return RecordedFunction(
        kind=_KINDS.get(dataset["func_type"], "function"),
        name=_text(dataset["rsp_ent_name"]) or _text(dataset["id4"]) or _text(dataset["id1"]),
        frequency_hz=frequency,
        values=values,
        unit=_ratio(dataset, si) or None,
        response=_place(dataset, "rsp"),
        reference=_place(dataset, "ref"),
    )


def _place(dataset: Mapping[str, Any], end: str) -> str:
    """The name of a floor, else `point 3 +X`; empty where the file does not say."""
    name = _text(dataset[f"{end}_ent_name"])
    if parse_channel(name):
        return name
    node, direction = int(dataset[f"{end}_node"]), _DIRECTIONS.get(dataset[f"{end}_dir"], "")
    return f"point {node} {direction}".strip() if node else ""


def _modes(file: TextFile, sets: list[dict[str, Any]]) -> Iterator[RecordedMode]:
    """The modes of all sets."""
    for dataset in sets:
        if dataset.get("analysis_type") not in (_MODES, *_COMPLEX_MODES):
            continue
        if dataset["type"] == 55:
            given = [k for k in _COMPONENTS if f"r{k}" in dataset]
            rows = np.column_stack([dataset[f"r{k}"] for k in given])
            name = str(int(dataset["mode_n"])) if "mode_n" in dataset else ""
            if dataset["analysis_type"] == _MODES:
                frequency, damping = _of_real(dataset["freq"], dataset["modal_damp_vis"])
            else:
                frequency, damping = _of_root(complex(dataset["eig"]))
        elif (
            dataset["type"] == 2414
            and "data_at_node" in dataset
            and dataset["data_characteristic"] in _VECTORS
            and dataset["result_type"] in _MOTIONS
        ):
            rows = np.array(dataset["data_at_node"], dtype=np.float64)
            if dataset["data_type"] in _COMPLEX_DATA:
                rows = rows[:, ::2] + 1j * rows[:, 1::2]
            # Records 10 to 13 depend on the kind of analysis.
            number = int(dataset.get("record10_field6", 0))
            name = str(number or int(dataset["analysis_dataset_label"]))
            if dataset["analysis_type"] == _MODES:
                figures = (dataset.get(f"record12_field{k}", 0.0) for k in (2, 5))
                frequency, damping = _of_real(*figures)
            else:
                root = complex(dataset["record13_field1"], dataset["record13_field2"])
                frequency, damping = _of_root(root)
        else:
            continue
        sensors = [
            f"point {int(number)} {_DIRECTIONS[k]}"
            for number in dataset["node_nums"]
            for k in _COMPONENTS[: rows.shape[1]]
        ]
        if rows.size != len(sensors):
            raise file.error(
                f"mode {name} has {rows.size} components where its points have "
                f"{len(sensors)}; export it again"
            )
        yield RecordedMode(
            frequency_hz=frequency,
            damping=damping,
            sensors=tuple(sensors),
            shape=rows.reshape(-1),
            name=name,
        )


def _of_real(frequency: float, viscous: float) -> tuple[float, float | None]:
    """Frequency, Hz, and damping ratio of a real mode; none is written as zero."""
    return float(frequency), float(viscous) if viscous > 0.0 else None


def _of_root(root: complex) -> tuple[float, float | None]:
    """Likewise of an eigenvalue."""
    return abs(root) / (2.0 * np.pi), -root.real / abs(root) if abs(root) > 0.0 else None


def _notes(types: list[int], sets: list[dict[str, Any]]) -> tuple[str, ...]:
    notes = [
        f"Model {dataset['model_name']} of {dataset['program']}."
        for dataset in sets
        if dataset["type"] == 151
    ]
    notes += [
        f"Units: {units['units_description']}, 1 m is {units['length']:g} of the file's lengths."
        for units in sets
        if units["type"] == 164
    ]
    elements = sum(  # pyuff groups them by the number of their shape
        len(group)
        for dataset in sets
        if dataset["type"] == 2412
        for shape, group in dataset.items()
        if isinstance(shape, int)
    )
    if elements:
        notes.append(f"{elements} elements join the points.")
    unread = [str(kind) for kind in dict.fromkeys(types) if kind not in _READ]
    if unread:
        notes.append(f"Sets that are not used: {', '.join(unread)}.")
    return tuple(notes)


def _unit(dataset: Mapping[str, Any]) -> str:
    # Old programs write the superscript of m/s² in an encoding that is lost on reading.
    return _text(dataset["ordinate_axis_units_lab"]).replace("\ufffd", "²")


def _ratio(dataset: Mapping[str, Any], si: bool) -> str:
    """Unit of a function; of a response, that of its numerator over its denominator's."""
    above, below = _unit(dataset), _text(dataset["orddenom_axis_units_lab"])
    # Kinds 4 and 5 are responses.
    if dataset["func_type"] not in (4, 5) or force_unit(above) is not None:
        return above
    if not above and not below and si:
        above, below = (
            _SI_UNITS.get(dataset[f"{part}_spec_data_type"], "")
            for part in ("ordinate", "orddenom")
        )
    if above and above == below:
        return "1"
    return f"{above}/{below}" if above and below else above


def _text(value: Any) -> str:
    text = " ".join(str(value).split())
    return "" if text.upper() == "NONE" else text
