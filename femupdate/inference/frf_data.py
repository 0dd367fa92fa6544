"""FRFs as a model is judged by them: residuals of ln|H| and of the phase."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import torch
from scipy.special import chdtrc
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.excitation import BASE_MOTION, Excitation
from femupdate.dynamics.force_response import RestFlexibility
from femupdate.dynamics.system import Responses, System
from femupdate.effects.effect import Effect, Placed, observed
from femupdate.inference.model_error import (
    MODEL_ERROR,
    NOISE_ALONE,
    Cell,
    ErrorTable,
    LearnedError,
    Remains,
)
from femupdate.measurement.estimated import Estimator
from femupdate.measurement.observation import (
    Observation,
    at_frequencies,
    band_edges,
    independent_share,
)
from femupdate.units import percent

# Six-story building, noise .01: 40 modes move the log likelihood by hundreds, 100 by .03.
MODES_KEPT = 100

_LEAST = 1e-30  # of |H|, and of |A| (1/kg), whose logarithm is taken


@dataclass(frozen=True)
class Block:
    """Some neighbouring points of the frequency axis, which one record gave.

    Attributes:
        independent: share of them that err independently.
        estimator: what the estimate makes of FRFs; None for those read from a table.
        level: doublings of the amplitude above that of the first record.
        beside: (c - 1, points) further columns of the base's motion that go with its unit
            translation, for pictures; None where none was measured.
    """

    points: int
    independent: float
    estimator: Estimator | None = None
    level: float = 0.0
    beside: Tensor | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class FrfData:
    """FRFs of one record or several under one excitation.

    Attributes:
        rows: which of them are observed.
        frequency_hz: (k,), one record after the other.
        log_frf: (f, k) observed; zero where not valid.
        phase: (f, k) observed, rad, or None.
        sd: (f, k) of ln|H| and phase; infinite where not valid.
        leaking: (f, k) the same with what leaks; None where it is not known.
        rest: static displacement under a force that the reduced model lacks; None of a stick.
        halves: the data in two parts that err independently; none where they cannot be parted.
        table: what the model may err by.
        logs: how ln|H| of one record is made, of the observed floors alone and far faster than
            complex FRFs; None where FRFs are compared.
    """

    floors: tuple[str, ...]
    rows: tuple[int, ...]
    frequency_hz: Tensor
    log_frf: Tensor
    phase: Tensor | None
    sd: Tensor
    blocks: tuple[Block, ...]
    excitation: Excitation = BASE_MOTION
    rest: RestFlexibility | None = None
    halves: "tuple[FrfData, ...]" = ()
    table: ErrorTable = MODEL_ERROR
    logs: Responses | None = None
    leaking: Tensor | None = None

    @property
    def at_once(self) -> int:
        """Points at a time: with complex FRFs of a thousand, and all their residuals, take a GB."""
        return 64 if self.logs is None else 1024

    @property
    def name(self) -> str:
        """The excitation; empty for base motion."""
        return self.excitation.name

    @property
    def valid(self) -> Tensor:
        """(f, k)."""
        return torch.isfinite(self.sd)

    @property
    def residuals(self) -> int:
        """Number of residuals, with those of points that are not valid."""
        return self._parts * self.sd.numel()

    @property
    def points(self) -> int:
        """Number of numbers compared."""
        return self._parts * int(self.valid.sum())

    @property
    def effective(self) -> float:
        """Number of them that err independently."""
        return self._parts * float((self.valid * self.independent).sum())

    @cached_property
    def independent(self) -> Tensor:
        """(k,) share by which a point counts."""
        parts = [torch.full((b.points,), b.independent, dtype=torch.float64) for b in self.blocks]
        return torch.cat(parts)

    @property
    def top_hz(self) -> float:
        """The highest frequency."""
        return float(self.frequency_hz.max())

    @property
    def levels(self) -> tuple[float, ...]:
        """Of motion, one a record."""
        return tuple(block.level for block in self.blocks)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the observed floors."""
        return tuple(self.floors[row] for row in self.rows)

    def checked(self, squares: Tensor, wild: Tensor) -> list[tuple[str, Tensor, Tensor]]:
        """Name, squares (n,), and independent numbers (n,), of every floor."""
        force = f"/{self.excitation.force}" if self.forced else ""
        counted = self.valid & ~wild.unflatten(1, (self._parts, *self.sd.shape))
        counts = (counted * self.independent).sum((1, 3))
        rows_of = zip(self.names, squares.unbind(1), counts.unbind(1), strict=True)
        return [(f"{name}{force}", square, count) for name, square, count in rows_of]

    @property
    def turns(self) -> bool:
        """Whether the rotation of the base was measured in every record."""
        return all(block.estimator is not None and block.estimator.turns for block in self.blocks)

    @property
    def _parts(self) -> int:
        return 1 if self.phase is None else 2

    def shows(self, effect: Effect) -> bool:
        """Whether an effect can show in it at all."""
        if effect.needs_phase and self.phase is None:
            return False
        if effect.turns_base and self.turns:
            return False
        # |H| under base motion is made of two accelerations; that under a force is not.
        ratio = not (self.forced or any(block.estimator for block in self.blocks))
        return ratio or not effect.tables_only

    def error(self, known: Tensor | None) -> LearnedError:
        """What the model may err by, beside errors (c, n) that are known beforehand."""
        # A load case has no neighbours that could err alike.
        several, leaking = len(self.frequency_hz) > len(self.blocks), None
        if self.leaking is not None:
            leaking = torch.where(self.valid, self.leaking / self.sd, 1.0).clamp_min(1.0)
        return LearnedError(
            self.weight,
            self.frequency_hz,
            self.effective,
            known,
            table=self.table if several or not self.table.sizes else NOISE_ALONE,
            parts=self._parts,
            cancelled=self._cancelled if self.forced or known is not None else None,
            leaking=leaking,
            shared=self._shared,
        )

    @property
    def _shared(self) -> Tensor | None:
        """(f, k) share of the noise (sd) that all floors have from that of the excitation.

        None where it is not known, and of one floor.
        """
        parts = [
            self.sd.new_zeros(block.points)
            if block.estimator is None or not block.estimator.shared.size
            else torch.from_numpy(block.estimator.shared)
            for block in self.blocks
        ]
        shared = torch.cat(parts) / self.sd
        return shared.clamp_max(0.99) if len(self.rows) > 1 and shared.any() else None

    @property
    def _cancelled(self) -> Tensor | None:
        """(f, k) response of all floors (rms) over that of one, where that is more than one.

        It is how much larger the parts of a floor's response are than their sum, for where one
        floor's cancel the others' do not. Base motion is a part itself. None of one floor's force.
        """
        if self.forced and len(self.rows) == 1:
            return None
        power = torch.where(self.valid, (2.0 * self.log_frf).exp(), 0.0)
        base = float(not self.forced)
        mean = (base + power.sum(0)) / (base + self.valid.sum(0)).clamp_min(1)
        return torch.where(self.valid, (mean / power.clamp_min(_LEAST**2)).sqrt(), 1.0).clamp_min(1)

    def predicted(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """Complex FRFs (N, f, k) of all floors, as each record shows them.

        With `logs`, ln|H| (N, g, k) of the observed ones.
        """
        if self.logs is not None:
            seen, both = self.blocks[0].estimator, torch.cat([theta, sizes], dim=1).double()
            asked = self.frequency_hz if seen is None else torch.from_numpy(seen.frequency_hz)
            return system.log_frf(both, zeta.double(), asked, self.logs)
        each = self.frequency_hz.split([block.points for block in self.blocks])
        grids = [
            some if block.estimator is None else torch.from_numpy(block.estimator.frequency_hz)
            for some, block in zip(each, self.blocks, strict=True)
        ]
        columns = max(1 if b.estimator is None else b.estimator.inputs for b in self.blocks)
        excitation, parts = replace(self.excitation, columns=columns), dict[int, Tensor]()
        # Parts of a run at levels that change nothing show one response.
        changing = any(listed.effect.needs_levels for listed in system.placed)
        for level in dict.fromkeys(self.levels if changing else (0.0,)):
            numbers = [k for k, its in enumerate(self.levels) if not changing or its == level]
            frequency, places = torch.cat([grids[k] for k in numbers]).unique(return_inverse=True)
            known = *system.at_level(theta, zeta, sizes, level), sizes, frequency
            frf = system.respond(excitation, *known, self.rest)
            for k, at in zip(numbers, places.split([len(grids[k]) for k in numbers]), strict=True):
                shown = (frf if len(frequency) == len(at) else frf[..., at]).unbind(dim=2)
                estimate = self.blocks[k].estimator
                parts[k] = shown[0] if estimate is None else estimate(*shown)
        return torch.cat([parts[k] for k in range(len(self.blocks))], dim=2)

    def as_logs(self, system: System, modes: int | None = MODES_KEPT) -> "FrfData":
        """The same of one record under base motion without phases, as fast as it can be had.

        Args:
            system: the model. Responses of one with effects are made of all its modes.
            modes: kept for a response; all where None, which makes responses smooth in theta:
                which modes are kept changes from place to place.
        """
        how = Responses(
            modes=None if system.placed else modes,
            floors=self.rows,
            seen=self.blocks[0].estimator,
        )
        return replace(self, logs=how)

    def drawn(self, system: System, theta: Tensor, zeta: Tensor, sizes: Tensor) -> Tensor:
        """Complex FRFs (f, k) of the observed floors at the first record's points, as they are."""
        block, sample = self.blocks[0], (theta, zeta, sizes)
        rows, frequency = list(self.rows), self.frequency_hz[: block.points]
        if self.forced:
            return system.respond(self.excitation, *sample, frequency, self.rest)[0, rows, 0]
        return system.frf_beside(sample, frequency, block.beside)[0, rows]

    def read_with(self, predicted: Tensor, placed: Placed) -> Tensor:
        """FRFs (N, f, k) with channels exchanged or reversed."""
        omega = 2.0 * torch.pi * self.frequency_hz
        none = omega.new_zeros(len(predicted), 0)
        return observed((placed,), self.floors, predicted, omega, none)

    def compared(self, predicted: Tensor) -> Tensor:
        """Residuals (N, n) of complex FRFs (N, f, k) of all floors, in the unit of their noise.

        With `logs`, of ln|H| of the observed ones. Zero where not valid.
        """
        if self.logs is not None:
            missed = self.log_frf.to(predicted) - predicted
            return (missed * self._root.to(predicted)).flatten(1)
        frf = predicted[:, list(self.rows)]
        size = self.logarithm(predicted)
        parts = [((self.log_frf - size) * self._root).flatten(1)]
        if self.phase is not None:
            # Half a turn off is half a turn ahead: were it at either end of the range, errors of a
            # reversed channel would change sign from point to point.
            least = 0.75 * torch.pi
            turn = torch.remainder(self.phase - frf.angle() + least, 2.0 * torch.pi) - least
            parts.append((turn * self._root).flatten(1))
        return torch.cat(parts, dim=1)

    def logarithm(self, predicted: Tensor) -> Tensor:
        """ln|H| (N, g, k) of the observed floors, of predictions."""
        if self.logs is not None:
            return predicted
        return predicted[:, list(self.rows)].abs().clamp_min(_LEAST).log()

    def explained(self, raw: Tensor) -> float:
        """Share of the measured variation over frequency that the best of residuals (n, m) has.

        Of the squares of ln|H| about the mean of every floor; below zero where that is better.
        """
        count = self.sd.numel()
        known = self.independent * (self.weight > 0.0)

        def about(weight: Tensor) -> Tensor:
            mean = (weight * self.log_frf).sum(1, True) / weight.sum(1, True).clamp_min(1e-300)
            return torch.as_tensor((self.log_frf - mean) ** 2)

        # Drift below the first frequency may seem to have no noise, so no point is known better
        # than to a tenth of the variation: seven records of right models, three of them of stories
        # that yield or pound, have .4 and more, nine of other buildings .23 at most.
        spread = (known * about(known)).sum(1, True) / known.sum(1, True).clamp_min(1.0)
        weight = known / (self.sd**2 + 0.01 * spread).clamp_min(1e-300)
        share = (weight / self.weight.clamp_min(1e-300)).flatten()
        whole = float((weight * about(weight)).sum())
        left = float((share * raw[:, :count].square()).sum(1).min())
        return 1.0 - left / max(whole, 1e-300)

    def moved(self, from_: Tensor, to: Tensor) -> Tensor:
        """Change (N, n) of predictions, (1, f, k) and (N, f, k), in the unit of the residuals."""
        if self.logs is not None:
            return ((to - from_) * self._root.to(to)).flatten(1)
        rows = list(self.rows)
        ratio = to[:, rows] / from_[:, rows]
        parts = [(ratio.abs().log() * self._root).flatten(1)]
        if self.phase is not None:
            parts.append((ratio.angle() * self._root).flatten(1))
        return torch.cat(parts, dim=1)

    def by_floor(self, moved: Tensor) -> Tensor:
        """A change (n,) of all floors, of each of them alone (f, n)."""
        count = len(self.rows)
        each = moved.reshape(-1, count, self.sd.shape[1])
        return (torch.eye(count).to(each)[:, None, :, None] * each).flatten(1)

    @property
    def weight(self) -> Tensor:
        """(f, k) inverse variance by which independent points count; zero where not valid."""
        return self.independent / self.sd**2

    @cached_property
    def _root(self) -> Tensor:
        return (1.0 / self.sd) * self.independent**0.5

    def coarse(self, noise: float) -> "FrfData":
        """The same with so much more noise in ln|H|."""
        return replace(self, sd=(self.sd**2 + noise**2).sqrt())

    def emptied(self, above_hz: float = 0.0) -> "FrfData":
        """The same as if nothing had been observed above a frequency."""
        kept = self.frequency_hz <= above_hz
        return replace(self, sd=torch.where(kept, self.sd, torch.inf), halves=())

    @property
    def forced(self) -> bool:
        """Whether a force acts."""
        return bool(self.excitation.force)

    def with_rest(self, rest: RestFlexibility) -> "FrfData":
        """The same with another static displacement that the reduced model lacks under a force."""
        if not self.forced:
            return self
        return replace(self, rest=rest, halves=tuple(half.with_rest(rest) for half in self.halves))

    def at_level(self, level: float) -> "FrfData":
        """The same with every record at a level, in doublings."""
        halves = tuple(half.at_level(level) for half in self.halves)
        blocks = tuple(replace(block, level=level) for block in self.blocks)
        return replace(self, blocks=blocks, halves=halves)

    def cells(self, left: Tensor) -> tuple[Cell, ...]:
        """Mean squared residual of every floor in bands of equal width in log frequency."""
        squared = (left.reshape(self._parts, *self.sd.shape) ** 2).sum(dim=0).numpy()
        valid, frequency = self.valid.numpy(), self.frequency_hz.numpy()
        weight = self.independent.numpy()
        cells: list[Cell] = []
        for row, seen, floor in zip(squared, valid, self.names, strict=True):
            for low, high in pairwise(band_edges(frequency)):
                inside = seen & (frequency >= low) & (frequency < high)
                freedom = self._parts * float(weight[inside].sum())
                # The last points before coherence is lost were chosen by chance: too few say
                # nothing.
                enough = freedom >= 3.0
                total = float(row[inside].sum())
                tail = float(chdtrc(freedom, total)) if enough else 1.0
                mean = total / freedom if enough else 1.0
                cells.append(Cell(floor, (float(low), float(high)), mean - 1.0, tail, self.name))
        return tuple(cells)

    def remains(self, error: LearnedError, row: int, raw: Tensor) -> Remains:
        """What residuals (n,) hold beside noise, by a row of the table of errors."""
        level = error.levels[row]
        wider = f"The noise is {level.noise:.1f} times the stated one."
        noise = wider if level.noise > 1.0 else ""
        if level.common == level.own == 0.0:
            return Remains(noise=level.noise, sentence=noise)
        found = error.likeliest(error.tame(raw[None], row), row)[0]  # (p f, j)
        values = found @ error.harmonics.at(self.frequency_hz).T
        parts = values.unflatten(0, (-1, len(self.rows))).numpy()  # (p, f, k)
        valid = self.valid.numpy()
        there, floor, (low, high) = self._worst(parts[0], valid)
        turn = _rms(parts[1, valid]) if len(parts) > 1 else 0.0
        size = _rms(parts[0, valid])
        turned = f" and {np.degrees(turn):.1f} degrees in phase" if turn else ""
        under = f" under the {self.name}" if self.name else ""
        text = (
            f"The model is still off by {percent(np.expm1(size))} in amplitude{turned} (rms)"
            f"{under}, most at {floor} between {low:.3g} and {high:.3g} Hz "
            f"({percent(np.expm1(there))})."
        )
        return Remains(
            size, turn, floor, (low, high), there, level.noise, f"{text} {noise}".rstrip()
        )

    def _worst(self, values: Floats, valid: np.ndarray) -> tuple[float, str, tuple[float, float]]:
        """Floor and band in which an error (f, k) of ln|H| is largest (rms)."""
        frequency = self.frequency_hz.numpy()
        worst = (0.0, 0, (float(frequency.min()), float(frequency.max())))
        for low, high in pairwise(band_edges(frequency)):
            inside = (frequency >= low) & (frequency < high)
            for row, residuals in enumerate(values):
                some = residuals[inside & valid[row]]
                if some.size:
                    worst = max(worst, (_rms(some), row, (float(low), float(high))))
        return worst[0], self.names[worst[1]], worst[2]

    def changed(self, from_: Tensor, to: Tensor, instrument: bool) -> float:
        """Largest change of |H| of a floor (rms over the band, as a share of |H|).

        Of an instrument, what it adds to the readings.
        """
        before, after = (side[0, list(self.rows)] for side in (from_, to))
        if instrument:
            change = torch.where(self.valid, (after / before - 1.0).abs() ** 2, 0.0)
            return float((change.sum(1) / self.valid.sum(1).clamp_min(1)).sqrt().max())
        plain = before.abs()
        change = torch.where(self.valid, (after.abs() - plain) ** 2, 0.0).sum(1)
        whole = torch.where(self.valid, plain**2, 0.0).sum(1).clamp_min(1e-300)
        return float((change / whole).sqrt().max())


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def frf_data(
    observation: Observation,
    floors: tuple[str, ...],
    *,
    rest: RestFlexibility | None = None,
    use_phase: bool = True,
    halves: Sequence[FrfData] = (),
    table: ErrorTable = MODEL_ERROR,
) -> FrfData:
    """An observation that a model is judged by.

    Args:
        rest: static displacement under a force that the reduced model lacks.
        use_phase: compare phases where they were measured.
        halves: of the observation, where it can be parted.
        table: what the model may err by.
    """
    valid = torch.from_numpy(observation.valid)
    noise = torch.from_numpy(np.nan_to_num(observation.noise_sd, nan=1.0))
    beside, phase = observation.beside, observation.phase if use_phase else None
    leaking = observation.leaking_sd
    block = Block(
        observation.frequency_hz.size,
        independent_share(observation),
        observation.estimator,
        observation.level,
        beside=None if beside is None else torch.from_numpy(np.nan_to_num(beside)),
    )
    return FrfData(
        floors=floors,
        rows=tuple(floors.index(name) for name in observation.floors),
        frequency_hz=torch.from_numpy(observation.frequency_hz),
        log_frf=torch.where(valid, torch.from_numpy(np.nan_to_num(observation.log_frf)), 0.0),
        phase=None if phase is None else torch.from_numpy(np.nan_to_num(phase)),
        sd=torch.where(valid, noise, torch.inf),
        blocks=(block,),
        excitation=observation.excitation,
        rest=rest,
        halves=tuple(halves),
        table=table,
        leaking=None if leaking is None else torch.from_numpy(np.nan_to_num(leaking)),
    )


def that_says(observation: Observation) -> Observation:
    """The observation from the first to the last frequency at which any floor is valid.

    Of a table coarser than its grid its own points alone: straight lines between are no data.
    """
    frequency, seen = observation.frequency_hz, np.flatnonzero(observation.valid.any(axis=0))
    if not seen.size:
        return observation
    used = np.zeros(frequency.size, dtype=bool)
    used[seen[0] : seen[-1] + 1] = True
    spacing = float(np.median(np.diff(frequency)))
    coarse = observation.resolution_hz or spacing
    if observation.coherence is None and coarse >= 1.5 * spacing:
        # There lines meet; elsewhere second differences are rounding.
        read = np.nan_to_num(observation.log_frf[:, used])
        bent = np.abs(np.diff(read, 2, axis=1)) > 1e-9 * np.abs(read).max()
        used[seen[0] + 1 : seen[-1]] = bent.any(axis=0)
    return at_frequencies(observation, used)


def base_logs(
    observation: Observation,
    system: System,
    *,
    table: ErrorTable = MODEL_ERROR,
    modes: int | None = MODES_KEPT,
) -> FrfData:
    """ln|H| under base motion, at all frequencies of an observation (see `FrfData.as_logs`)."""
    data = frf_data(observation, system.floors, use_phase=False, table=table)
    return data.as_logs(system, modes)


def forced_data(
    forced: Observation,
    floors: tuple[str, ...],
    rest: RestFlexibility | None = None,
    *,
    use_phase: bool = False,
    table: ErrorTable = MODEL_ERROR,
) -> FrfData:
    """Responses to a force at the frequencies that say something; arguments of `frf_data`."""

    def read(source: Observation, parts: Sequence[Observation]) -> FrfData:
        seen = at_frequencies(source, np.asarray(source.valid.any(axis=0)))
        return frf_data(
            seen,
            floors,
            rest=rest,
            use_phase=use_phase,
            halves=tuple(read(part, ()) for part in parts),
            table=table,
        )

    whole = read(forced, forced.halves)
    if forced.coherence is not None or whole.points < 20:
        return whole
    # Points of a table err independently: of twenty and more every other one is a half.
    even = torch.arange(len(whole.frequency_hz)) % 2 == 0
    sds = (torch.where(kept, whole.sd, torch.inf) for kept in (even, ~even))
    return replace(whole, halves=tuple(replace(whole, sd=sd, halves=()) for sd in sds))


def log_responses(data: FrfData, system: System, parameters: Tensor, zeta: Tensor) -> Tensor:
    """ln|H| (n, g, k) of the observed floors at parameters (n, p + q) and ratios (n,)."""
    parts = []
    for some, ratio in zip(parameters.split(data.at_once), zeta.split(data.at_once), strict=True):
        theta, sizes = system.split(some)
        parts.append(data.logarithm(data.predicted(system, theta, ratio, sizes)))
    return torch.cat(parts)


def together(first: FrfData, second: FrfData) -> FrfData:
    """Two records of the same structure as one, each at its level."""
    rows = tuple(sorted({*first.rows, *second.rows}))

    def joined(name: str, missing: float) -> Tensor:
        parts = []
        for record in (first, second):
            values = getattr(record, name)
            wide = values.new_full((len(rows), values.shape[1]), missing)
            wide[[rows.index(row) for row in record.rows]] = values
            parts.append(wide)
        return torch.cat(parts, dim=1)

    phases = first.phase is not None and second.phase is not None
    leaks = [record.leaking is not None for record in (first, second)]
    return replace(
        first,
        frequency_hz=torch.cat([first.frequency_hz, second.frequency_hz]),
        rows=rows,
        log_frf=joined("log_frf", 0.0),
        phase=joined("phase", 0.0) if phases else None,
        sd=joined("sd", torch.inf),
        leaking=joined("leaking", torch.inf) if all(leaks) else None,
        blocks=(*first.blocks, *second.blocks),
        halves=tuple(together(*parts) for parts in zip(first.halves, second.halves, strict=False)),
    )
