"""The command to run next on a measured file, with a proposal which floors its channels are."""

import shlex
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.columns import BASE, TIME, channel_name, floor_height, parse_channel
from femupdate.measurement.floor_names import base_rank, floors_of

_COMPONENTS = 3  # a record of one place has so many channels at most
_LONG_S = 120.0  # records of earthquakes end sooner, ambient ones later
_NO_BASE = "There is no base: the modes can be found if this is ambient vibration."
_CHECK = "The floors are told from the sensors' places or names; check them against the building."


@dataclass(frozen=True)
class NextStep:
    """A command, or an empty text, and a sentence on it."""

    command: str
    advice: str = ""


def next_step(
    path: Path,
    histories: Sequence[RecordedChannel],
    names: Sequence[str] | None,
    unit: str | None,
) -> NextStep:
    """Return what to run next on a file of histories.

    Args:
        path: the file.
        histories: of it.
        names: of a table's columns, the one of times included; None of any other file.
        unit: that the user gave.
    """
    usable = [k for k, each in enumerate(histories) if _is_usable(each)]
    unknown = unit is None and any(histories[k].unit is None for k in usable)
    options = f" --unit {unit or 'UNIT'}" if unit or unknown else ""
    if not usable:
        return NextStep("", "None of the channels is a horizontal acceleration.")
    mapping = _mapping(histories, usable, names)
    base = [ours for ours in mapping if ours.startswith(BASE)]
    floors = [ours for ours in mapping if not ours.startswith(BASE)]
    calibrate = f"femupdate calibrate {shlex.quote(str(path))}{options}"
    if base and floors:
        if names is not None and _speaks_our_names(names):
            return NextStep(calibrate)
        return NextStep(calibrate + _columns(mapping, histories, names), _CHECK)
    if len(histories) <= _COMPONENTS and not floors:
        return NextStep(_predict(path, histories, usable, options), "")
    if floors and not base and _lasts(histories[usable[0]]) >= _LONG_S:
        columns = "" if names is not None and _speaks_our_names(names) else None
        columns = _columns(mapping, histories, names) if columns is None else columns
        name = shlex.quote(str(path))
        return NextStep(f"femupdate identify {name} -o modes.csv{columns}", _NO_BASE)
    if not base and len(histories) <= _COMPONENTS:
        return NextStep(
            "",
            f"The channel sits at {', '.join(floors)}: a response needs the base's record too, with"
            " the same times in one file.",
        )
    known = mapping or {BASE: -1}
    missing = ([] if base else [BASE]) + ([] if floors else ["RF"])
    columns = _columns({k: v for k, v in known.items() if v >= 0}, histories, names, missing)
    return NextStep(
        calibrate + columns,
        f"Put in which channels are {' and '.join(missing)}: their places do not tell it.",
    )


def proposed_floors(channels: Sequence[RecordedChannel]) -> tuple[str | None, ...]:
    """Floors that the channels' locations or names tell, None where they do not."""
    return floors_of([each.location or each.name for each in channels])


def _lasts(channel: RecordedChannel) -> float:
    """Length, s."""
    return channel.values.size * channel.time_step


def _is_usable(channel: RecordedChannel) -> bool:
    parsed = parse_channel(channel.name)
    vertical = channel.vertical or (parsed is not None and parsed.direction == "z")
    return channel.quantity in ("acceleration", "unknown") and not vertical


def _direction(channel: RecordedChannel) -> str:
    """What channels of one direction have in common."""
    parsed = parse_channel(channel.name)
    if parsed is not None:
        return parsed.direction
    if channel.azimuth_deg is not None:
        return f"{round(channel.azimuth_deg / 5.0) * 5 % 180}"
    return channel.direction.upper()


def _mapping(
    histories: Sequence[RecordedChannel], usable: Sequence[int], names: Sequence[str] | None
) -> dict[str, int]:
    """Our column name to the channel's index, in the direction with most floors above a base."""
    directions: dict[str, dict[str, list[int]]] = defaultdict(lambda: defaultdict(list))
    floors_told = proposed_floors(histories)
    for k in usable:
        floor = floors_told[k]
        if floor is not None:
            directions[_direction(histories[k])][floor].append(k)
    if not directions:
        return {}
    found = max(directions.values(), key=lambda floors: (BASE in floors, len(floors)))
    if BASE in found:
        ranks = {k: base_rank(histories[k].location or histories[k].name) for k in found[BASE]}
        found[BASE] = [k for k in found[BASE] if ranks[k] == min(ranks.values())]
    mapping: dict[str, int] = {}
    for floor in sorted(found, key=floor_height):
        several = len(found[floor]) > 1
        for number, k in enumerate(found[floor], start=1):
            mapping[channel_name(floor, str(number) if several else "")] = k
    return mapping


def _speaks_our_names(names: Sequence[str]) -> bool:
    others = [name for name in names if name.lower() != TIME]
    return len(others) == len(names) - 1 and all(parse_channel(name) for name in others)


def _columns(
    mapping: dict[str, int],
    histories: Sequence[RecordedChannel],
    names: Sequence[str] | None,
    missing: Sequence[str] = (),
) -> str:
    """The option that maps channels, or columns of a table, to floors."""
    table = names is not None
    pairs = [f"{ours}={histories[k].name if table else k + 1}" for ours, k in mapping.items()]
    pairs += [f"{ours}=NUMBER" for ours in missing]
    time = next((n for n in names or () if n not in {each.name for each in histories}), TIME)
    if table and time.lower() != TIME:
        pairs.insert(0, f"{TIME}={time}")
    return f" --columns {shlex.quote(','.join(pairs))}"


def _predict(
    path: Path, histories: Sequence[RecordedChannel], usable: Sequence[int], options: str
) -> str:
    largest = max(usable, key=lambda k: float(abs(histories[k].values).max()))
    channel = f" --channel {largest + 1}" if len(histories) > 1 else ""
    return f"femupdate predict --record {shlex.quote(str(path))}{channel}{options}"
