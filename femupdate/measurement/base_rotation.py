"""The base's own rotation, by vertical sensors that stand at places along the motion.

A base that turns by a small angle, so that what stands on it leans forward, goes down in front: at
the place s along the motion its vertical acceleration is that of its middle less s times the
angular acceleration. Of more than two sensors the slope is the least-squares one.
"""

from collections.abc import Sequence

import numpy as np

from femupdate.arrays import Floats
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.columns import BASE, Channel, parse_channel
from femupdate.measurement.floor_names import base_rank
from femupdate.measurement.thresholds import ROTATION
from femupdate.units import percent


def rotation_of(channels: Sequence[Channel], acceleration: Floats) -> Floats | None:
    """Angular acceleration (n,) of the base, rad/s2, forward positive, without its mean.

    Args:
        channels: c of them, all that were recorded.
        acceleration: (c, n) m/s2.

    Returns:
        None where fewer than two vertical sensors stand at known places of the base.
    """
    rows, places = _vertical(channels)
    if len(rows) < 2:
        return None
    arm = places - places.mean()
    slope = arm @ acceleration[rows] / (arm @ arm)
    return np.asarray(slope.mean() - slope)


def fault_of(channels: Sequence[Channel]) -> str | None:
    """Why vertical sensors of the base cannot measure its rotation, or None where they can."""
    rows, places = _vertical(channels)
    if len(rows) < 2 or np.ptp(places) >= ROTATION.apart_m:
        return None
    names = " and ".join(channels[row].name for row in rows)
    return (
        f"{names} stand at one place, and a rotation needs two places along the motion; correct the"
        " places, which are in metres, or leave the columns out"
    )


def said_of_rotation(
    channels: Sequence[Channel], acceleration: Floats, base: Floats
) -> tuple[str, ...]:
    """Sentences on what vertical sensors of the base tell of its rotation.

    Args:
        channels, acceleration: see `rotation_of`.
        base: (n,) translation, m/s2.
    """
    _, places = _vertical(channels)
    rotation = rotation_of(channels, acceleration)
    if rotation is not None:
        at = ", ".join(f"{place:g}" for place in places)
        moved = float(np.sqrt((rotation**2).mean()))
        share = ROTATION.height_m * moved / float(base.std())
        doubt = (
            " Is their unit right, and are the places in metres?" if share > ROTATION.most else ""
        )
        return (
            f"The base's rotation is measured by vertical sensors at {at} m and is an input:"
            f" {moved:.3g} rad/s2 rms, which moves a point {ROTATION.height_m:g} m up by"
            f" {percent(share)} of what the translation does.{doubt}",
        )
    alone = [one.name for one in channels if one.floor == BASE and one.direction == "z"]
    if not alone:
        return ()
    few = f"{alone[0]} alone does" if len(alone) == 1 else f"{', '.join(alone)} do"
    return (
        f"{few} not tell the base's rotation, which is taken as zero: that takes two vertical"
        " sensors with their places along the motion, such as base@-2.5.z and base@2.5.z.",
    )


def vertical_pair(channels: Sequence[RecordedChannel], floors: Sequence[str | None]) -> str:
    """What vertical channels of the base inside a building could tell; empty where there are few.

    Args:
        floors: of each, or None.
    """
    inside = [
        str(k + 1)
        for k, (one, floor) in enumerate(zip(channels, floors, strict=True))
        if floor == BASE and is_vertical_channel(one) and base_rank(one.location or one.name) == 0
    ]
    if len(inside) < 2:
        return ""
    return (
        f"Channels {', '.join(inside)} are vertical at the base: with their places along the"
        " motion, in m, they measure how it turns. Map them under names such as base@-2.5.z."
    )


def is_vertical_channel(channel: RecordedChannel) -> bool:
    """Whether a channel is vertical, as its direction or its name says."""
    parsed = parse_channel(channel.name)
    return channel.vertical or (parsed is not None and parsed.direction == "z")


def _vertical(channels: Sequence[Channel]) -> tuple[list[int], Floats]:
    """Rows and places of the vertical sensors whose place is known."""
    known = [(row, one.place) for row, one in enumerate(channels) if one.place is not None]
    return [row for row, _ in known], np.array([place for _, place in known], dtype=np.float64)
