"""Mapping files: which channel or column of a measured file is which floor, as TOML to edit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from femupdate.errors import MeasurementError
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.text import closest, read_text
from femupdate.storage import atomic_path, toml_content

_KEYS = ("columns", "unit")
_HEAD = """\
# Which channel of {file} is which floor. Correct it, and hand it back by --mapping.
# Floors are base, 2F, ..., RF; "RF:1" and "RF:2" are two sensors of a floor, and "RF.y" is one in
# the other direction. A channel goes by its number or name; a minus turns it round: RF = "-3".
# "base@-2.5.z" = 4 is a vertical sensor of the base, 2.5 m behind its middle along the motion; two
# at different places measure how the base turns.
"""


@dataclass(frozen=True)
class ColumnMapping:
    """What a mapping file says.

    Attributes:
        columns: our column name to the file's name or number.
        unit: of the accelerations, or None where the measured file says it.
    """

    columns: Mapping[str, str]
    unit: str | None = None


def read_mapping(path: str | Path) -> ColumnMapping:
    """Read a mapping file.

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
    return ColumnMapping(found, unit)


def write_mapping(
    path: Path,
    file: Path,
    columns: Mapping[str, str],
    channels: Sequence[RecordedChannel],
    unit: str | None,
) -> Path:
    """Write a mapping file, with all channels that are not used as comments, and return its path.

    Args:
        path: of the mapping file.
        file: that is mapped.
        columns: our column name to the channel's number or the column's name.
        channels: all of the file.
        unit: of the accelerations, where the file does not say it.

    Raises:
        MeasurementError: it cannot be written.
    """
    lines = [_HEAD.format(file=file.name)]
    if unit is not None:
        lines.append(f"unit = {_quoted(unit)}\n")
    lines.append("[columns]")
    used = set()
    for ours, theirs in columns.items():
        number = _number(theirs, channels)
        used.add(number)
        value = theirs if theirs.isdecimal() else _quoted(theirs)
        told = "" if number is None else f"  # {_told(channels[number])}"
        lines.append(f"{ours if ours.isalnum() else _quoted(ours)} = {value}{told}")
    rest = [k for k in range(len(channels)) if k not in used]
    if rest:
        lines.append("\n# Not used:")
        lines += [f"# {k + 1}: {_told(channels[k])}" for k in rest]
    with atomic_path(path, MeasurementError) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    return path


def _number(theirs: str, channels: Sequence[RecordedChannel]) -> int | None:
    plain = theirs.removeprefix("-")
    if plain.isdecimal() and int(plain) <= len(channels):
        return int(plain) - 1
    return next((k for k, one in enumerate(channels) if one.name == plain), None)


def _told(channel: RecordedChannel) -> str:
    azimuth = channel.azimuth_deg
    words = [channel.location or channel.name, channel.direction]
    words.append("" if azimuth is None else f"azimuth {azimuth:.0f}")
    return ", ".join(" ".join(word.split()) for word in words if word)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
