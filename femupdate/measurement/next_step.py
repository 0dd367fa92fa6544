"""The command to run next on a measured file, with a proposal which floors its channels are."""

import shlex
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from femupdate.measurement.names import (
    BASE,
    TIME,
    ForceChannel,
    base_rank,
    channel_name,
    floor_height,
    floors_of,
    parse_channel,
    parse_history,
)
from femupdate.measurement.recording import RecordedChannel

# Figures by which files are judged.
_COMPONENTS = 3  # channels of a record of one place, at most
_ALONG_DEG = 10.0  # degrees, by which azimuths of one direction may differ


def proposed_floors(channels: Sequence[RecordedChannel]) -> tuple[str | None, ...]:
    """Floors that the channels' locations or names tell, None where they do not."""
    return floors_of([each.location or each.name for each in channels])


def _proposal(channels: Sequence[RecordedChannel], usable: Sequence[int]) -> dict[str, str]:
    """Our column name to the channel's number from 1, with a minus where it is turned.

    The direction x is that with most floors above a base; y is the next that may be at a right
    angle to it.
    """
    floors = proposed_floors(channels)
    directions: dict[str, list[int]] = defaultdict(list)
    for k in usable:
        if floors[k] is not None:
            directions[_key(channels[k], directions, channels)].append(k)
    reached = {key: {floors[k] for k in indices} for key, indices in directions.items()}
    ordered = sorted(
        directions, key=lambda key: (BASE in reached[key], len(reached[key])), reverse=True
    )
    azimuths = {key: channels[directions[key][0]].azimuth_deg for key in ordered}
    right = [
        key
        for key in ordered[1:]
        if azimuths[key] is None
        or azimuths[ordered[0]] is None
        or _angle(azimuths[key], azimuths[ordered[0]]) >= 90.0 - _ALONG_DEG
    ]
    proposed: dict[str, str] = {}
    for axis, key in zip("xy", [*ordered[:1], *right[:1]], strict=False):
        by_floor: dict[str, list[int]] = defaultdict(list)
        for k in directions[key]:
            by_floor[floors[k] or ""].append(k)
        # Of several bases those inside the building are taken.
        ranks = {k: base_rank(channels[k].location or channels[k].name) for k in by_floor[BASE]}
        by_floor[BASE] = [k for k, rank in ranks.items() if rank == min(ranks.values())]
        rising = sorted((floor for floor in by_floor if by_floor[floor]), key=floor_height)
        forward = channels[by_floor[rising[0]][0]].azimuth_deg
        for floor in rising:
            several = len(by_floor[floor]) > 1
            for number, k in enumerate(by_floor[floor], start=1):
                azimuth = channels[k].azimuth_deg
                known = forward is not None and azimuth is not None
                turned = known and 90.0 < abs((azimuth or 0.0) - (forward or 0.0)) % 360.0 < 270.0
                name = channel_name(floor, str(number) if several else "", axis)
                proposed[name] = f"{'-' if turned else ''}{k + 1}"
    return proposed


def _key(
    channel: RecordedChannel,
    directions: Mapping[str, Sequence[int]],
    channels: Sequence[RecordedChannel],
) -> str:
    """What channels of one direction have in common."""
    parsed = parse_channel(channel.name)
    if parsed is not None:
        return parsed.direction
    if channel.azimuth_deg is None:
        return channel.direction.lower() or "x"
    for key, indices in directions.items():
        other = channels[indices[0]].azimuth_deg
        if other is not None and _angle(channel.azimuth_deg, other) <= _ALONG_DEG:
            return key
    return f"{channel.azimuth_deg:.0f}"


def _angle(first: float | None, second: float | None) -> float:
    """Angle between two axes, 0 to 90 degrees, whichever way they point."""
    apart = abs((first or 0.0) - (second or 0.0)) % 180.0
    return min(apart, 180.0 - apart)


_NO_BASE = "There is no base: the modes can be found if this is ambient vibration."
_FORCED = "Put in at which floor the force acts, and which channels are the floors."
_CHECK = (
    "The floors are told from the sensors' places or names; check them against the building, or"
    " write them to a file that you can correct, by --write-mapping."
)


@dataclass(frozen=True)
class NextStep:
    """What to run next.

    Attributes:
        command: or an empty text.
        columns: our column name to the channel or column that the file proposes, both directions.
    """

    command: str
    advice: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)


def next_step(
    path: Path,
    histories: Sequence[RecordedChannel],
    names: Sequence[str] | None,
    unit: str | None,
    columns: Mapping[str, str] | None = None,
) -> NextStep:
    """Return what to run next on a file of histories.

    Args:
        names: of a table's columns, the one of times included; None of any other file.
    """
    # As far as is told, horizontal accelerations.
    kinds = ("acceleration", "unknown")
    usable = [k for k, e in enumerate(histories) if e.quantity in kinds and not e.vertical]
    unknown = unit is None and any(histories[k].unit is None for k in usable)
    options = f" --unit {unit or 'UNIT'}" if unit or unknown else ""
    if not usable:
        return NextStep("", "None of the channels is a horizontal acceleration.")
    name = shlex.quote(str(path))
    if columns:
        based = any(ours.startswith((BASE, "force/")) for ours in columns)
        command = f"calibrate {name}{options}" if based else f"identify {name} -o modes.csv"
        return NextStep(f"femupdate {command}{columns_option(columns)}", "", columns)
    proposed = _proposal(histories, usable)
    columns = dict(proposed)
    if names is not None:  # columns of a table go by their names
        columns = {ours: histories[int(k.lstrip("-")) - 1].name for ours, k in proposed.items()}
        time = next((n for n in names if n not in {each.name for each in histories}), TIME)
        columns = columns if time.lower() == TIME else {TIME: time, **columns}
    along = {ours: theirs for ours, theirs in columns.items() if ".y" not in ours}
    told = proposed_floors(histories)
    left_over = [histories[k].name for k in usable if told[k] is None]
    if proposed and left_over and (names is not None or not any(h.location for h in histories)):
        return NextStep(
            "",
            f"The names do not say which floor {', '.join(left_over)} is; say it for all channels"
            f" by --columns, such as base={histories[usable[0]].name},RF={left_over[0]}.",
        )
    base = [ours for ours in proposed if ours.startswith(BASE)]
    floors = [ours for ours in proposed if not ours.startswith(BASE)]
    others = [title for title in names or () if title.lower() != TIME]
    ours = len(others) == len(names or ()) - 1 and all(parse_history(title) for title in others)
    mapped = "" if ours else columns_option(along)
    calibrate = f"femupdate calibrate {name}{options}"
    forced = any(isinstance(parse_history(each.name), ForceChannel) for each in histories)
    if (base or forced) and floors:
        return NextStep(calibrate + mapped, "" if ours else _CHECK, columns)
    what = "NUMBER" if names is None else "NAME"
    pushed = next((k for k, each in enumerate(histories) if each.quantity == "force"), None)
    if pushed is not None and not forced:
        force = str(pushed + 1) if names is None else histories[pushed].name
        option = columns_option({"force/RF": force, **along}, [] if floors else ["RF"], what)
        return NextStep(calibrate + option, _FORCED, columns)
    if len(histories) <= _COMPONENTS and not floors:
        largest = max(usable, key=lambda k: float(abs(histories[k].values).max()))
        channel = f" --channel {largest + 1}" if len(histories) > 1 else ""
        return NextStep(f"femupdate predict --record {name}{channel}{options}", "")
    seconds = histories[usable[0]].values.size * histories[usable[0]].time_step
    # Records of earthquakes end before two minutes.
    if floors and not base and seconds >= 120.0:
        identify = f"femupdate identify {name} -o modes.csv{mapped}"
        return NextStep(identify, _NO_BASE, columns)
    if not base and len(histories) <= _COMPONENTS:
        return NextStep(
            "",
            f"The channel sits at {', '.join(floors)}: a response needs the base's record too, with"
            " the same times in one file.",
        )
    missing = ([] if base else [BASE]) + ([] if floors else ["RF"])
    return NextStep(
        calibrate + columns_option(along, missing, what),
        f"Put in which channels are {' and '.join(missing)}: their places do not tell it.",
        columns,
    )


def columns_option(
    columns: Mapping[str, str] | None, missing: Sequence[str] = (), what: str = "NUMBER"
) -> str:
    """Return the option that maps channels, or columns of a table, to floors; empty of none."""
    pairs = [f"{ours}={theirs}" for ours, theirs in (columns or {}).items()]
    pairs += [f"{ours}={what}" for ours in missing]
    return f" --columns {shlex.quote(','.join(pairs))}" if pairs else ""
