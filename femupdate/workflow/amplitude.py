"""Stiffness that falls with amplitude, at the level that the predicted motion itself reaches.

The stiffness factors of a posterior hold at the level of the record that they were found from. A
stronger motion finds a softer building, and how strong the motion of the floors is depends on the
stiffness in turn: each draw is put at the level at which its own response has that level.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from femupdate.arrays import Floats, Integers
from femupdate.dynamics.history import BATCH, floor_histories
from femupdate.dynamics.level import motion_level
from femupdate.dynamics.system import System
from femupdate.effects.effect import Placed
from femupdate.errors import MeasurementError
from femupdate.inference.parameters import Values
from femupdate.measurement.names import BASE
from femupdate.measurement.observation import Histories
from femupdate.measurement.record import GroundMotion
from femupdate.progress import SILENT, Progress
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource, direction_of


def level_between(model: StudyModel, first: ObservationSource, second: ObservationSource) -> float:
    """Doublings from the first to the second record's level, over the floors of both.

    Raises:
        MeasurementError: the files of one hold no histories, or the two have no floor in common.
    """
    both = [record_levels(model, source) for source in (first, second)]
    if not set(both[0]) & set(both[1]):
        raise MeasurementError(
            f"{second.path}: it has no floor in common with {first.path}, so that their levels "
            "cannot be compared"
        )
    return doublings(both[0], both[1])


def doublings(first: Mapping[str, float], second: Mapping[str, float]) -> float:
    """Doublings from the first to the second level (m/s2 by floor), the median over the floors."""
    common = sorted(set(first) & set(second))
    levels = np.array([[of[floor] for floor in common] for of in (first, second)])
    before, after = np.maximum(levels, 1e-300)  # a floor may be silent
    return float(np.log2(np.median(after / before)))


def level_above_first(strengths: Mapping[Path, Mapping[str, float]], path: Path) -> float:
    """Doublings of a file's levels by floor above the first file's; zero where they are alike."""
    first, this = next(iter(strengths.values()), {}), strengths.get(path, {})
    level = doublings(first, this) if set(first) & set(this) else 0.0
    return level if abs(level) >= 0.25 else 0.0


def levels_told(strengths: Mapping[Path, Mapping[str, float]]) -> tuple[str, ...]:
    """A sentence on the levels of files, where they are unlike."""
    levels = {path: level_above_first(strengths, path) for path in strengths}
    each = [f"{path.name} at {2.0**level:.2g} times" for path, level in levels.items() if level]
    if not each:
        return ()
    return (
        f"{len(levels)} runs are explained together, each at its own level: {', '.join(each)} that "
        f"of {next(iter(levels)).name}, at which all others are taken to be.",
    )


def record_levels(model: StudyModel, source: ObservationSource) -> dict[str, float]:
    """Level (m/s2) of every floor's acceleration along the motion (see `motion_level`).

    Of several files the first one with histories counts.

    Raises:
        MeasurementError: no file holds histories.
    """
    direction = direction_of(model.building)
    return floor_levels(_histories(source, direction), direction)


def floor_levels(data: Histories, direction: str) -> dict[str, float]:
    """Level (m/s2) of every floor's acceleration along a direction (see `motion_level`)."""
    return {
        channel.floor: float(motion_level(row))
        for channel, row in zip(data.channels, data.acceleration, strict=True)
        if channel.floor != BASE and channel.direction == direction
    }


def _histories(source: ObservationSource, direction: str) -> Histories:
    for path in source.paths:
        read = source.read(path, direction)
        if isinstance(read, Histories):
            return read
    raise MeasurementError(
        f"{source.path}: response functions and modes do not say at which level they"
        " were measured; give the histories of both records"
    )


# In the settings of a posterior.
_LEVELS, _SPAN, _PEAK = "level_m_s2", "level_span", "base_peak_m_s2"


def level_settings(
    model: StudyModel,
    placed: tuple[Placed, ...],
    source: ObservationSource,
    span: tuple[float, ...] = (),
) -> dict[str, Any]:
    """What a posterior keeps of the level that its stiffness factors hold at.

    Args:
        placed: its effects; nothing is kept where none of them depends on a level.
        span: levels of the records from which the effect was found, doublings above the first.
    """
    kept = {_PEAK: base_peak(model, source)}
    if not changes_with_level(placed):
        return kept
    try:
        levels = record_levels(model, source)
    except MeasurementError:  # a table of FRFs has none
        return kept
    return {**kept, _LEVELS: levels, _SPAN: [min(span, default=0.0), max(span, default=0.0)]}


def base_peak(model: StudyModel, source: ObservationSource) -> float:
    """Largest acceleration of the base in a source's first histories, m/s2; zero without any."""
    try:
        data = _histories(source, direction_of(model.building))
        return (
            0.0 if data.force else float(np.abs(data.means(direction_of(model.building))[0]).max())
        )
    except MeasurementError:
        return 0.0


def far_stronger(settings: Mapping[str, Any], peak: float) -> tuple[str, ...]:
    """A warning where the base (peak, m/s2) moves far more than in a posterior's record."""
    known = float(settings.get(_PEAK, 0.0))
    # Two doublings: a hotel lost 3 % of its frequency and an overpass 9 % of its stiffness in each.
    if known <= 0.0 or peak < 4.0 * known:
        return ()
    return (
        f"The base peaks at {peak:.3g} m/s², {peak / known:.2g} times what it did in the record "
        f"behind the kept posterior ({known:.3g} m/s²). Buildings are softer and damp more when "
        "shaken so much harder, and may be damaged: its factors and intervals hold none of that.",
    )


def changes_with_level(placed: tuple[Placed, ...]) -> bool:
    """Whether one of some effects makes stiffness or damping depend on the level."""
    return any(place.effect.needs_levels for place in placed)


def at_own_level(
    system: System,
    draws: Values,
    motion: GroundMotion,
    settings: Mapping[str, Any],
    *,
    keep_damping: bool = False,
    progress: Progress = SILENT,
) -> tuple[Values, Floats, str]:
    """Posterior draws at the level that their own response to a motion has.

    Args:
        draws: as they hold at the record that they were found from.
        settings: of the posterior, with the level that theta holds at; without it all stays.
        keep_damping: leave the damping ratios as they are.

    Returns:
        The draws there, their levels (S,) in doublings above the record, a sentence for the user.
    """
    count, reference = len(draws.zeta), settings.get(_LEVELS)
    if not reference:
        return (
            draws,
            np.zeros(count),
            "The stiffness falls with amplitude, but at which level its factors were found is not "
            "known: they are used as they are.",
        )

    def at(rows: Integers, level: Floats) -> Values:
        theta, zeta, sizes = draws.theta[rows], draws.zeta[rows], draws.sizes[rows]
        softer, damped = system.at_level(theta, zeta, sizes, torch.from_numpy(level))
        return Values(softer, zeta if keep_damping else damped, sizes)

    def reached(rows: Integers, some: Integers, level: Floats) -> Floats:
        """Levels (n,) of the responses of some draws, with the stiffness of levels (n,)."""
        there = at(rows[some], level)
        theta, zeta = there.of_structure.numpy(), there.zeta.numpy()
        response = floor_histories(system, theta, zeta, motion.inputs, motion.time_step)
        levels = motion_level(response.floor_acceleration).tolist()
        each = (dict(zip(response.floors, run, strict=True)) for run in levels)
        return np.array([doublings(reference, run) for run in each])

    found, start, batch = list[Floats](), 0.0, BATCH
    for rows in np.split(np.arange(count), range(batch, count, batch)):
        found.append(own_level(partial(reached, rows), len(rows), start))
        # Draws of one posterior have about the same level.
        start = float(np.median(found[-1]))
        progress.advance(len(rows))
    level = np.concatenate(found)
    there = at(np.arange(count), level)
    mean, share = float(level.mean()), (there.theta / draws.theta).mean(0).numpy()
    most = float(share[np.abs(np.log(share)).argmax()])
    damped = float((there.zeta / draws.zeta).mean())
    note = (
        f"The motion is {2.0**mean:.2g} times as strong as the record behind the stiffness "
        f"factors: stiffness is multiplied by {most:.3g}, damping by {damped:.3g}."
    )
    span = settings.get(_SPAN)
    # Half a doubling outside of the records is worth a word.
    if span and span[1] > span[0] and not span[0] - 0.5 < mean < span[1] + 0.5:
        note += (
            f" That is beyond the records ({2.0 ** span[0]:.2g} to {2.0 ** span[1]:.2g} times) "
            "that show this change."
        )
    return there, level, note


def own_level(reached: Callable[[Integers, Floats], Floats], count: int, start: float) -> Floats:
    """The level (doublings) at which the response of each draw (count,) has that level.

    Args:
        reached: levels of the responses of some draws with the stiffness of levels.

    Stiffness changes the level of the response little, so that taking each answer for the next
    question leads there. Once two questions err to opposite sides, the next lies between them:
    where the straight line has it, by the Illinois rule (Dowell and Jarratt, BIT 11, 1971, 168).
    """
    level, answer = np.full(count, start), np.full(count, start)
    ends, gaps = np.full((2, count), np.nan), np.full((2, count), np.nan)
    before, open_ = np.full(count, -1), np.arange(count)
    for _ in range(30):
        answer[open_] = reached(open_, level[open_])
        gap = answer[open_] - level[open_]
        side = (gap < 0.0).astype(np.intp)
        # An end that stays for the second time counts half, or steps would creep.
        stays = before[open_] == side
        gaps[1 - side[stays], open_[stays]] *= 0.5
        ends[side, open_], gaps[side, open_], before[open_] = level[open_], gap, side
        open_ = open_[np.abs(gap) >= 0.005]
        if not open_.size:
            break
        low, high = ends[:, open_]
        share = gaps[0, open_] / (gaps[0, open_] - gaps[1, open_])
        between = low + share * (high - low)
        level[open_] = np.where(np.isnan(between), answer[open_], between)
    return answer
