"""Observation files, tables of modes and mapping files, written all at once or not at all."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from femupdate.errors import MeasurementError
from femupdate.measurement.modes import DAMPING, DAMPING_SD, FREQUENCY_SD, MODE
from femupdate.measurement.names import FREQUENCY, TIME
from femupdate.measurement.observation import Histories, Observation
from femupdate.measurement.recording import RecordedChannel, RecordedMode
from femupdate.measurement.text import closest, read_text
from femupdate.storage import atomic_path, toml_content

_TIME_FORMAT = "%.10g"


def write_observation_histories(
    path: str | Path, histories: Histories, comments: Sequence[str] = (), digits: int = 9
) -> Path:
    """Write histories as an observation file in s and m/s2, and return its path.

    Args:
        path: the CSV file; one that is there is replaced once the new one is whole.
        comments: lines that say where the numbers come from; each gets a # in front.
        digits: significant ones of the accelerations.
    """
    names, values = [channel.name for channel in histories.channels], histories.acceleration
    buffer = io.StringIO()
    buffer.writelines(f"# {line}\n" for comment in comments for line in comment.splitlines())
    buffer.write(",".join([TIME, *names]) + "\n")
    buffer.write(",".join(["s", *["m/s2"] * len(names)]) + "\n")
    time = np.arange(values.shape[1]) * histories.time_step
    formats = [_TIME_FORMAT, *[f"%.{digits}g"] * len(names)]
    np.savetxt(buffer, np.column_stack([time, values.T]), fmt=formats, delimiter=",")
    return _write_text(path, buffer.getvalue())


def write_frfs(path: str | Path, seen: Observation) -> Path:
    """Write FRFs under base motion as a table, at frequencies where all floors have one."""
    whole = seen.valid.all(axis=0)
    names, columns = [FREQUENCY], [seen.frequency_hz[whole]]
    h = np.exp(seen.log_frf + (0.0 if seen.phase is None else 1j * seen.phase))[:, whole]
    for floor, row, noise in zip(seen.floors, h, seen.noise_sd[:, whole], strict=True):
        names += [floor] if seen.phase is None else [f"{floor}_re", f"{floor}_im"]
        columns += [row.real] if seen.phase is None else [row.real, row.imag]
        names, columns = [*names, f"{floor}_sd"], [*columns, noise]
    buffer = io.StringIO()
    np.savetxt(buffer, np.column_stack(columns), "%.9g", ",", header=",".join(names), comments="")
    return _write_text(path, buffer.getvalue())


def write_modes(
    path: str | Path, modes: Sequence[RecordedMode], comments: Sequence[str] = ()
) -> Path:
    """Write identified modes of real shapes as a table, and return its path.

    Args:
        modes: with the same sensors.
    """
    sensors = modes[0].sensors
    spreads = [() if mode.shape_sd is None else tuple(mode.shape_sd) for mode in modes]
    names = [MODE, FREQUENCY, FREQUENCY_SD, DAMPING, DAMPING_SD, *sensors]
    names += [f"{name}_sd" for name in sensors] if all(spreads) else []
    rows = [
        [mode.frequency_hz, mode.frequency_sd_hz, mode.damping, mode.damping_sd, *mode.shape, *sd]
        for mode, sd in zip(modes, spreads, strict=True)
    ]
    lines = [f"# {line}" for comment in comments for line in comment.splitlines()]
    lines.append(",".join(names))
    for mode, row in zip(modes, rows, strict=True):
        cells = ["" if value is None else f"{value:.6g}" for value in row]
        lines.append(",".join([mode.name, *cells]))
    return _write_text(path, "\n".join(lines) + "\n")


def write_modes_uff(
    path: str | Path, modes: Sequence[RecordedMode], heights: Sequence[float], direction: str
) -> Path:
    """Write real shapes as a universal file: points (set 15) and a mode each (set 55).

    Args:
        modes: whose components are of points 1, 2, ..., in one direction.
        heights: of these points, m.
        direction: x or y.
    """
    axis, blocks = "xyz".index(direction), []
    points = [f"{k:10d}{1:10d}{1:10d}{11:10d}" for k in range(1, len(heights) + 1)]
    zero = f"{0:13.5E}" * 2
    blocks.append(
        ["    15", *(f"{p}{zero}{z:13.5E}" for p, z in zip(points, heights, strict=True))]
    )
    for number, mode in enumerate(modes, 1):
        figures = (mode.frequency_hz, 1.0, mode.damping or 0.0, 0.0)
        titles = [f"mode {mode.name}", *(f"point {k} {n}" for k, n in enumerate(mode.sensors, 1))]
        lines = ["    55", *[*(line[:80] for line in titles[:5]), *["NONE"] * 5][:5]]
        lines += [
            "".join(f"{k:10d}" for k in row) for row in ((1, 2, 2, 8, 2, 3), (2, 4, 1, number))
        ]
        lines.append("".join(f"{value:13.5E}" for value in figures))
        for point, value in enumerate(mode.shape.real, 1):
            row = [value if k == axis else 0.0 for k in range(3)]
            lines += [f"{point:10d}", "".join(f"{each:13.5E}" for each in row)]
        blocks.append(lines)
    parted = (line for block in blocks for line in ("    -1", *block, "    -1"))
    return _write_text(path, "\n".join(parted) + "\n")


def _write_text(path: str | Path, text: str) -> Path:
    target = Path(path)
    with atomic_path(target, MeasurementError) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target


_KEYS = ("columns", "unit")
_HEAD = """\
# Which channel of {file} is which floor. Correct it, and hand it back by --mapping.
# Floors are base, 2F, ..., RF; "RF:1" and "RF:2" are two sensors of a floor, and "RF.y" is one in
# the other direction. A channel goes by its place, name or number; a minus turns it: RF = "-3".
# "base@-2.5.z" = 4 is a vertical sensor of the base, 2.5 m behind its middle along the motion; two
# at different places measure how the base turns.
"""


def read_mapping(path: str | Path) -> tuple[dict[str, str], str | None]:
    """What a mapping file says: our column names to the file's, and the unit of accelerations.

    Raises:
        MeasurementError: it is no TOML, a key is not known, or a value is neither a name nor a
            number.
    """
    file = read_text(path)
    try:
        content = toml_content("\n".join(file.lines))
    except ValueError as error:
        raise file.error(f"{error}; a mapping file has RF = 3 under [columns]") from None
    unknown = next((key for key in content if key not in _KEYS), None)
    if unknown is not None:
        raise file.error(
            f"unknown key {unknown!r}{closest(unknown, _KEYS)}; a mapping file has [columns], and"
            " unit where the measured file has none"
        )
    columns, unit = content.get("columns"), content.get("unit")
    if not isinstance(columns, dict) or not columns:
        raise file.error("there is no [columns]; write base = 1 and RF = 3 below it")
    if unit is not None and not isinstance(unit, str):
        raise file.error(f'the unit {unit} is no text; write unit = "gal"')
    found: dict[str, str] = {}
    for ours, theirs in columns.items():
        if isinstance(theirs, dict):
            raise file.error(f'{ours} has a dot; write it in quotes, such as "{ours}.y" = 3')
        if isinstance(theirs, bool) or not isinstance(theirs, int | str):
            raise file.error(f"{ours} = {theirs} is neither a channel's number nor its name")
        found[ours] = str(theirs)
    return found, unit


def write_mapping(
    path: Path,
    file: Path,
    columns: Mapping[str, str],
    channels: Sequence[RecordedChannel],
    unit: str | None,
) -> Path:
    """Write a mapping file, with all channels that are not used as comments, and return its path.

    Args:
        columns: our column name to the channel's number or the column's name.
        unit: of the accelerations, where the file does not say it.
    """

    def quoted(text: str) -> str:
        escaped = text.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'

    def told(channel: RecordedChannel) -> str:
        azimuth = channel.azimuth_deg
        words = [channel.location or channel.name, channel.direction]
        words.append("" if azimuth is None else f"azimuth {azimuth:.0f}")
        return ", ".join(" ".join(word.split()) for word in words if word)

    lines = [_HEAD.format(file=file.name)]
    if unit is not None:
        lines.append(f"unit = {quoted(unit)}\n")
    lines.append("[columns]")
    by_name = {channel.name: k for k, channel in reversed([*enumerate(channels)])}
    used = set()
    for ours, theirs in columns.items():
        plain = theirs.removeprefix("-")
        number = by_name.get(plain)
        if plain.isdecimal() and int(plain) <= len(channels):
            number = int(plain) - 1
        used.add(number)
        value = theirs if theirs.isdecimal() else quoted(theirs)
        place = "" if number is None else channels[number].location
        if plain.isdecimal() and sum(channel.location == place for channel in channels) == 1:
            value = quoted(theirs.removesuffix(plain) + place)  # which other files have as well
        words = "" if number is None else f"  # {told(channels[number])}"
        lines.append(f"{ours if ours.isalnum() else quoted(ours)} = {value}{words}")
    rest = [k for k in range(len(channels)) if k not in used]
    if rest:
        lines.append("\n# Not used:")
        lines += [f"# {k + 1}: {told(channels[k])}" for k in rest]
    return _write_text(path, "\n".join(lines) + "\n")
