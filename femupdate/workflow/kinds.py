"""Observation files of any kind."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from femupdate.building.document import Building
from femupdate.dynamics.force_response import RestFlexibility, rest_flexibility
from femupdate.effects.registry import building_effects
from femupdate.effects.structure import structure_of
from femupdate.errors import MeasurementError
from femupdate.inference.frf_data import FrfData, base_logs, forced_data, log_responses
from femupdate.inference.mode_data import ModalErrors
from femupdate.measurement.checks import pair_findings, response_findings, shape_findings
from femupdate.measurement.frf import observation_for, with_halves
from femupdate.measurement.frf_table import in_band
from femupdate.measurement.modes import IdentifiedModes
from femupdate.measurement.names import BASE, QUANTITIES
from femupdate.measurement.observation import (
    Histories,
    Observation,
    require_floors_of_building,
    select_floors,
)
from femupdate.measurement.recording import RecordedChannel
from femupdate.progress import Progress
from femupdate.storage import check_shapes, read_arrays, write_arrays
from femupdate.study import Study, StudyPart
from femupdate.units import STANDARD_GRAVITY, percent
from femupdate.workflow.amplitude import (
    changes_with_level,
    floor_levels,
    level_above_first,
    levels_told,
)
from femupdate.workflow.model import FINER, REDUCED, StudyModel
from femupdate.workflow.observed import ObservationSource, as_one, direction_of, runs_of


@dataclass(frozen=True)
class Measured:
    """All that was measured of a building.

    Attributes:
        base: FRFs under base motion; without a valid point where there are none.
        modes: identified modes, one entry a file.
        forced: responses to forces, one entry a file and floor at which a force acts.
        rest: static displacement under forces that the reduced model lacks; None of a stick.
        runs: under base motion, an observation each at its level; `base` is all of them together.
        doubts: sentences on channels of a run that look wrong.
        notes_of_others: sentences on how all that is no FRF under base motion was read.
        left_out: sentences on identified modes that fit none of the model's.
    """

    base: Observation
    modes: tuple[IdentifiedModes, ...] = ()
    forced: tuple[Observation, ...] = ()
    rest: RestFlexibility | None = None
    errors: ModalErrors = field(default_factory=ModalErrors)
    runs: tuple[Observation, ...] = ()
    doubts: tuple[str, ...] = ()
    notes_of_others: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def assumes_noise(self) -> bool:
        """Whether the noise of something is assumed, as its file states none."""
        told = [note for seen in (self.base, *self.forced) for note in seen.notes]
        without = any(np.isnan(modes.frequency_sd_hz).any() for modes in self.modes)
        return without or any("taken as" in note for note in told)

    @property
    def has_base(self) -> bool:
        """Whether there are FRFs under base motion."""
        return bool(self.base.valid.any())

    @property
    def others(self) -> bool:
        """Whether there is anything beside FRFs under base motion."""
        return bool(self.modes or self.forced)

    @property
    def beyond_surrogates(self) -> bool:
        """Whether there is anything that no surrogate knows."""
        return self.others or self.base.beside is not None

    @property
    def levels(self) -> tuple[float, ...]:
        """Of the runs, in doublings above the first."""
        return tuple(run.level for run in self.runs)

    @property
    def reference(self) -> Observation:
        """FRFs under base motion at the level of the first run, where that has all floors."""
        apart = any(self.levels) and self.runs[0].floors == self.base.floors
        return self.runs[0] if apart else self.base

    @property
    def run(self) -> Observation | None:
        """The run under base motion, where there is but one."""
        return self.runs[0] if len(self.runs) == 1 else None

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how everything was read, and what was assumed."""
        return (*self.base.notes, *self.notes_of_others)

    @property
    def as_observation(self) -> Observation:
        """The FRFs under base motion, called by all sources and floors."""
        if not self.others:
            return replace(self.reference, source=self.base.source)
        sources = [self.base.source] if self.has_base else []
        sources += [response.source for response in self.forced]
        sources += [table.source for table in self.modes]
        return replace(self.reference, source=" and ".join(dict.fromkeys(sources)))


def _notes(
    building: Building,
    forced: Sequence[Observation],
    modes: Sequence[IdentifiedModes],
    errors: ModalErrors,
) -> Iterator[str]:
    """Sentences on how responses to forces and modes were read, and what was assumed."""
    for seen in forced:
        yield (
            f"{seen.source}: {seen.quantity} of {', '.join(seen.floors)} under a"
            f" {seen.excitation.name}, taken to act through the middle of its sensors."
        )
        yield from (f"{seen.source}: {note}" for note in seen.notes)
    if forced and building.forces_are_relative:
        yield (
            "The building's masses are nominal (masses_known = false), but the level of a force"
            " test goes by them: the factors are of stiffness over those masses."
        )
    for table in modes:
        yield from (f"{table.source}: {note}" for note in table.notes)
    if errors.model_frequency:
        yield (
            f"The model's natural frequencies are taken to err by {errors.model_frequency:.2g}"
            " (standard deviation, --mode-error)."
        )
    for table in modes:
        ratios, shapes = ~np.isnan(table.damping), ~np.isnan(table.shape)
        lacking = {
            f"{percent(errors.frequency, 1)} of a frequency": np.isnan(table.frequency_sd_hz),
            f"{percent(errors.damping)} of a damping ratio": ratios & np.isnan(table.damping_sd),
            f"{percent(errors.shape)} of the largest component of a shape": (
                shapes & np.isnan(table.shape_sd)
            ),
        }
        assumed = [words for words, without in lacking.items() if without.any()]
        if assumed:
            yield f"{table.source} gives no standard deviation; taken are {', '.join(assumed)}."
    if building.moving_base:
        yield f"The base {building.moving_base}, as the building file says."


def read_measured_of(
    study: Study,
    model: StudyModel,
    source: ObservationSource,
    progress: Progress,
    apart: bool = False,
) -> Measured:
    """Read the files of a source, of any kind.

    Raises:
        MeasurementError: a file cannot be used, belongs to another building, or is in another
            unit or quantity than it says.
    """
    measured = measured_of(model.building, source, apart, model.reduced.across is not None)
    check_base_level(model, measured.base)
    return with_rest(study, model, measured, progress)


def with_rest(study: Study, model: StudyModel, measured: Measured, progress: Progress) -> Measured:
    """What was measured, with what the reduced model lacks under forces.

    Raises:
        MeasurementError: a response to a force is in another unit or quantity than its file says.
    """
    if not measured.forced:
        return measured
    rest = open_rest(study, model, progress)
    for seen in measured.forced:
        check_level(model, forced_data(seen, model.system.floors, rest), seen)
    if rest is None:
        return measured
    lacks = (
        f"The reduced model lacks {percent(rest.lacked)} (rms) of the static displacement where a"
        f" force acts; {rest.error:.1g} is left of it after a correction by the full model."
    )
    return replace(measured, rest=rest, notes_of_others=(*measured.notes_of_others, lacks))


def _wrong_channels(
    read: Histories | Observation, direction: str, asked: Sequence[str], chain: bool
) -> Iterator[str]:
    """Yield sentences on what looks wrong in channels of a run that are used, and between them."""
    if isinstance(read, Observation):
        logs = read.log_frf if read.phase is None else read.log_frf + 1j * read.phase
        yield from response_findings(
            read.frequency_hz, np.exp(logs), read.floors, read.excitation.force
        )
        return
    asked = asked or read.floors
    rows = zip(read.channels, read.acceleration, strict=True)
    along = [(to, row) for to, row in rows if to.direction == direction]
    how: dict[str, Any] = {"time_step": read.time_step, "unit": "m/s2"}
    heard = [RecordedChannel(name=to.name, values=row, **how) for to, row in along]
    places = [to.floor if to.floor in (BASE, *asked) else None for to, _ in along]
    for channel, place in zip(heard, places, strict=True):
        yield from (f"{channel.name}: {words}" for words in shape_findings(channel) if place)
    yield from pair_findings(heard, places, beside=not chain)


def measured_of(
    building: Building, source: ObservationSource, apart: bool = False, crosses: bool = False
) -> Measured:
    """Like `read_measured_of`, for a building that has no model yet.

    Args:
        crosses: whether floors follow the base's motion across.
        apart: for the finder, FRFs under base motion have halves that err independently, and
            records their own levels, which else count where effects of the building ask for them.
    """
    base: list[tuple[Path, Histories | Observation]] = []
    strengths: dict[Path, dict[str, float]] = {}
    by_level = apart or changes_with_level(building_effects(building).placed)
    modes: list[IdentifiedModes] = []
    forced: list[Observation] = []
    doubts: list[str] = []
    direction, asked = direction_of(building), source.sensors
    grid = building.frequency_grid.frequencies_hz()
    low, high = source.band_hz or (0.0, np.inf)
    band = max(low, float(grid[0])), min(high, float(grid[-1]))
    for path in source.paths:
        read = source.read(path, direction, noise=building.observation.noise_sd)
        if isinstance(read, IdentifiedModes):
            require_floors_of_building(read.source, read.floors, building.floors)
            modes.append(source.asked_of(read, path))
            doubts += [f"{path.name}: {words}." for words in read.doubts]
            continue
        if by_level and isinstance(read, Histories):
            strengths[path] = floor_levels(read, direction)
        found = (replace(read, crosses=crosses),) if isinstance(read, Histories) else read
        if found[0].excitation.force:
            for given in found:
                # On the floors and in the band that are asked for.
                if isinstance(given, Histories):
                    inside = grid[(grid >= band[0]) & (grid <= band[1])]
                    seen = observation_for(building.floors, given, inside, direction, asked)
                    seen = with_halves(seen, direction)
                else:
                    seen = in_band(given, building.floors, band)
                said = _wrong_channels(seen, direction, asked, building.is_chain)
                doubts += [f"{path.name}: {words}" for words in said]
                wanted = [name for name in seen.floors if name in (asked or seen.floors)]
                level = level_above_first(strengths, path)
                forced += [replace(select_floors(seen, wanted), level=level)] if wanted else []
        else:
            base.append((path, found[0]))
            said = _wrong_channels(found[0], direction, asked, building.is_chain)
            doubts += [f"{path.name}: {words}" for words in said]
    stated = source.mode_error
    errors = ModalErrors() if stated is None else ModalErrors(model_frequency=stated)
    others = Measured(
        no_base_motion(building, modes, forced),
        tuple(modes),
        tuple(forced),
        None,
        errors,
        notes_of_others=(
            *levels_told(strengths),
            *_notes(building, forced, modes, errors),
        ),
        doubts=tuple(doubts),
    )
    if not base:
        floors = others.base.floors
        missing = [name for name in source.sensors if name not in floors]
        if missing:
            raise MeasurementError(
                f"{source.path}: there is no {', '.join(missing)} to use; the files have"
                f" {', '.join(floors) or 'frequencies alone'} of what was asked for"
            )
        return others
    runs = tuple(
        replace(run, level=level_above_first(strengths, path))
        for run, (path, _) in zip(runs_of(building, source, base, apart), base, strict=True)
    )
    whole = as_one(building, runs)
    if any(run.level for run in runs) and len(runs) > 1:
        # Where the level may change them, whether they agree and what they differ by says nothing.
        whole = replace(whole, notes=whole.notes[1:], between=None)
    return replace(others, base=whole, runs=runs)


def no_base_motion(
    building: Building, modes: Sequence[IdentifiedModes], forced: Sequence[Observation]
) -> Observation:
    """An observation of the floors of other kinds that holds no FRFs under base motion."""
    seen = {name for table in modes for name in table.floors}
    seen |= {name for response in forced for name in response.floors}
    floors = tuple(name for name in building.floors if name in seen)
    frequency = building.frequency_grid.frequencies_hz()
    empty = np.full((len(floors), frequency.size), np.nan)
    return Observation(
        frequency_hz=frequency,
        floors=floors,
        log_frf=empty,
        noise_sd=empty,
        valid=np.zeros(empty.shape, dtype=bool),
        source="nothing",
    )


# Factors by which responses may miss all of them: to a force, where the masses tell the level; and
# floor over base acceleration, which is one at zero frequency whatever the building is.
_FORCE_LEVEL, _BASE_LEVEL = 2.0, 6.0

# What files are wrong by: factors, and powers of omega of another quantity.
_FACTORS = {
    "in m/s2, not in g": STANDARD_GRAVITY,
    "a thousand times too large (mm, or per kN)": 1e3,
    "a thousand times too small": 1e-3,
    "in g, not in m/s2": 1.0 / STANDARD_GRAVITY,
}


def open_rest(study: Study, model: StudyModel, progress: Progress) -> RestFlexibility | None:
    """What a study's reduced model lacks under forces, learned once; None for a stick."""
    if model.building.kind == "shear":
        return None

    def make() -> RestFlexibility:
        building, finer = model.building, model.finer
        if finer is None:
            structure, reduced = structure_of(building), model.reduced
        else:  # without what corrects its mesh
            structure, reduced = structure_of(building, halved=True), finer.model
        lower, upper = model.prior.lower.numpy(), model.prior.upper.numpy()
        return rest_flexibility(structure, reduced, lower, upper, progress)

    kept = study.artefacts()
    by = {name: kept[name].sha256 for name in (REDUCED.name, FINER) if name in kept}
    return study.cached(REST, {**model.made_from(), **by}, make)


def _read_rest(path: Path) -> RestFlexibility:
    data = read_arrays(path)
    check_shapes(data, {"terms": "pff", "numbers": "n"})
    return RestFlexibility(data["terms"], *data["numbers"].tolist())


REST = StudyPart(
    "flexibility under forces",
    "force_flexibility.npz",
    "calibrate",
    lambda rest, path: write_arrays(
        path, terms=rest.terms, numbers=np.array([rest.error, rest.lacked])
    ),
    _read_rest,
    lambda rest: {"error": rest.error, "lacked": rest.lacked},
)


def check_level(model: StudyModel, data: FrfData, seen: Observation) -> None:
    """Refuse responses in another unit or quantity than their file says.

    The masses of the building are known, so that no stiffness of the prior moves the level of the
    accelerance by much: it is the mass line that tells the unit.

    Raises:
        MeasurementError: no parameters of the prior come near the level; another unit or quantity
            would, and is named.
    """
    away = _away(model, data)
    omega = (2.0 * torch.pi * data.frequency_hz).log()
    level, spread = _level(away, omega, 0)
    if level <= math.log(_FORCE_LEVEL):
        return
    # What would be right, if anything.
    best, guess, power = math.inf, "", QUANTITIES.index(seen.quantity)
    for shift in range(-power, 3 - power):
        for words, factor in {"": 1.0, **_FACTORS}.items():
            if shift or factor != 1.0:
                other, scatter = _level(away - math.log(factor), omega, shift)
                told = f"{QUANTITIES[power + shift]} " if shift else ""
                if other + scatter < best:
                    best, guess = other + scatter, f"{told}{words}".strip()
    hint = f"; it fits if it is {guess}" if best < math.log(_FORCE_LEVEL) + spread else ""
    raise MeasurementError(
        f"{seen.source}: the {seen.quantity} of {', '.join(seen.floors)} under a "
        f"{seen.excitation.name} is {math.exp(level):.3g} times away from all that the building's "
        f"masses allow{hint}; correct its unit, or the masses of the building"
    )


def check_base_level(model: StudyModel, base: Observation) -> None:
    """Refuse a table of FRFs that cannot be floor over base acceleration.

    Responses to a hammer without units look like it, and are smaller by the masses of the building.

    Raises:
        MeasurementError: no parameters of the prior come near |H|.
    """
    if base.coherence is not None or not base.valid.any():
        return  # estimated here, from histories of the base and the floors
    away = _away(model, base_logs(base, model.system))
    level, scatter = _level(away, torch.zeros(()), 0)
    if level + scatter <= math.log(_BASE_LEVEL):
        return
    raise MeasurementError(
        f"{base.source}: |H| of {', '.join(base.floors)} is {math.exp(level + scatter):.3g} times"
        " away from all that floor over base acceleration can be in this building; if a hammer or"
        " a shaker excited it, say so by --force FLOOR and --unit m/s2/N"
    )


def _away(model: StudyModel, data: FrfData) -> Tensor:
    """(n, f, k) measured less predicted ln|H| at draws of the prior; NaN where not valid."""
    generator = torch.Generator().manual_seed(0)
    draws = model.parameters.split(model.parameters.sample(256, generator))
    predicted = log_responses(data, model.system, draws.of_structure, draws.zeta)
    return torch.where(data.valid, data.log_frf - predicted, torch.nan)


def _level(away: Tensor, omega: Tensor, power: int) -> tuple[float, float]:
    """How far the nearest draw misses the level, and how much it scatters about it, in ln."""
    left = (away - power * omega).flatten(1)
    middle = left.nanmedian(dim=1).values
    scatter = (left - middle[:, None]).abs().nanmedian(dim=1).values
    nearest = int((middle.abs() + scatter).argmin())
    return float(middle[nearest].abs()), float(scatter[nearest])
