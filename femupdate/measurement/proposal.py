"""Which floors the channels of a file are, as their places, names and azimuths propose it."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.columns import BASE, TIME, channel_name, floor_height, parse_channel
from femupdate.measurement.floor_names import base_rank, floors_of
from femupdate.measurement.thresholds import PROPOSAL


@dataclass(frozen=True)
class Proposed:
    """A channel by its index, and whether it points against the others of its direction."""

    channel: int
    turned: bool = False


def proposed_floors(channels: Sequence[RecordedChannel]) -> tuple[str | None, ...]:
    """Floors that the channels' locations or names tell, None where they do not."""
    return floors_of([each.location or each.name for each in channels])


def is_usable(channel: RecordedChannel) -> bool:
    """Whether a channel is, as far as is told, a horizontal acceleration."""
    acceleration = channel.quantity in ("acceleration", "unknown")
    return acceleration and not channel.vertical


def proposal(channels: Sequence[RecordedChannel]) -> dict[str, Proposed]:
    """Our column name to the channel: x is the direction with most floors above a base.

    The other direction, at a right angle where azimuths are known, is y.
    """
    floors = proposed_floors(channels)
    directions: dict[str, list[int]] = defaultdict(list)
    for k, channel in enumerate(channels):
        if is_usable(channel) and floors[k] is not None:
            directions[_key(channel, directions, channels)].append(k)
    rank = {key: _reach(own, floors) for key, own in directions.items()}
    ordered = sorted(directions, key=lambda key: rank[key], reverse=True)
    found: dict[str, Proposed] = {}
    for axis, key in zip("xy", _right_angled(ordered, directions, channels), strict=False):
        found |= _along(axis, directions[key], floors, channels)
    return found


def columns_of(
    proposed: Mapping[str, Proposed],
    channels: Sequence[RecordedChannel],
    names: Sequence[str] | None,
) -> dict[str, str]:
    """Our column name to the file's, or to the channel's number with a minus where it is turned.

    Args:
        proposed: see `proposal`.
        names: of a table's columns, the one of times included; None of any other file.
    """
    if names is None:
        return {
            ours: f"{'-' if one.turned else ''}{one.channel + 1}" for ours, one in proposed.items()
        }
    found = {ours: channels[one.channel].name for ours, one in proposed.items()}
    time = next((n for n in names if n not in {each.name for each in channels}), TIME)
    return found if time.lower() == TIME else {TIME: time, **found}


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
        return channel.direction.upper()
    for key, own in directions.items():
        other = channels[own[0]].azimuth_deg
        if other is not None and _angle(channel.azimuth_deg, other) <= PROPOSAL.along_deg:
            return key
    return f"{channel.azimuth_deg:.0f}"


def _angle(one: float, other: float) -> float:
    """Angle between two axes, 0 to 90 degrees, whichever way they point."""
    apart = abs(one - other) % 180.0
    return min(apart, 180.0 - apart)


def _reach(own: Sequence[int], floors: Sequence[str | None]) -> tuple[bool, int]:
    told = {floors[k] for k in own}
    return BASE in told, len(told)


def _right_angled(
    ordered: Sequence[str],
    directions: Mapping[str, Sequence[int]],
    channels: Sequence[RecordedChannel],
) -> list[str]:
    """The first direction, and the first one after it that may be at a right angle to it."""
    if not ordered:
        return []
    first = channels[directions[ordered[0]][0]].azimuth_deg
    for key in ordered[1:]:
        other = channels[directions[key][0]].azimuth_deg
        if first is None or other is None or _angle(first, other) >= 90.0 - PROPOSAL.along_deg:
            return [ordered[0], key]
    return [ordered[0]]


def _along(
    axis: str, own: Sequence[int], floors: Sequence[str | None], channels: Sequence[RecordedChannel]
) -> dict[str, Proposed]:
    """Channels of one direction; of several bases those inside the building."""
    by_floor: dict[str, list[int]] = defaultdict(list)
    for k in own:
        by_floor[floors[k] or ""].append(k)
    if BASE in by_floor:
        places = {k: channels[k].location or channels[k].name for k in by_floor[BASE]}
        best = min(base_rank(text) for text in places.values())
        by_floor[BASE] = [k for k, text in places.items() if base_rank(text) == best]
    ordered = sorted(by_floor, key=floor_height)
    forward = channels[by_floor[ordered[0]][0]].azimuth_deg
    found: dict[str, Proposed] = {}
    for floor in ordered:
        several = len(by_floor[floor]) > 1
        for number, k in enumerate(by_floor[floor], start=1):
            azimuth = channels[k].azimuth_deg
            known = forward is not None and azimuth is not None
            turned = known and 90.0 < abs((azimuth or 0.0) - (forward or 0.0)) % 360.0 < 270.0
            name = channel_name(floor, str(number) if several else "", axis)
            found[name] = Proposed(k, turned)
    return found
