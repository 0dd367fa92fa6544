"""compare: two posteriors, as before and after an event, or two tests.

Of posteriors it tells which stories changed; of tests how alike two sets of modes are, or FRFs of
two tests or of a model.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment

from femupdate.arrays import Complexes, Floats
from femupdate.building.document import factor_titles
from femupdate.building.files import load_building
from femupdate.errors import InferenceError, MeasurementError, StudyError
from femupdate.inference.change import NAMED, Changes, changes
from femupdate.inference.posterior import Posterior, load_posterior
from femupdate.measurement.frf import estimate_frf, on_grid
from femupdate.measurement.modes import identified_modes, mac
from femupdate.measurement.observation import Histories, Observation
from femupdate.measurement.reader import read_measured, read_observation_file
from femupdate.progress import SILENT
from femupdate.report.scale import plus_minus, with_unit
from femupdate.result import Item, Note, Notes, Picture, Result, Told, wrapped
from femupdate.study import BUILDING_FILE, Study
from femupdate.tables import Column, Table
from femupdate.units import percent
from femupdate.workflow.calibration_report import kept_posterior
from femupdate.workflow.model import open_calibrated
from femupdate.workflow.observed import direction_of


@dataclass(frozen=True, kw_only=True)
class State:
    """A posterior of a building in one state.

    Attributes:
        titles: what its factors are of, by name; empty where no building file is beside it.
        hashes: of what it was made from, where its study says so.
        summary: that the calibration kept; empty where no study is known.
    """

    name: str
    posterior: Posterior
    titles: Mapping[str, str]
    hashes: Mapping[str, str]
    summary: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CompareReport(Result):
    """What changed from one state to the other, of the p stiffness factors of both."""

    before: State
    after: State
    names: tuple[str, ...]
    changes: Changes
    notes: tuple[str, ...]

    @cached_property
    def draws(self) -> tuple[Floats, Floats]:
        """(n, p) and (m, p) factors of both states."""
        before, after = (state.posterior.of("stiffness") for state in (self.before, self.after))
        return before.samples, after.samples

    @property
    def titles(self) -> tuple[str, ...]:
        """What the factors are of."""
        return tuple(self.before.titles.get(name, name) for name in self.names)

    @property
    def verdict(self) -> str:
        """ "changed", "unchanged" or "unclear"."""
        if (self.changes.probability >= NAMED).any():
            return "changed"
        return "unchanged" if self.changes.none >= 0.8 else "unclear"

    @property
    def named(self) -> tuple[str, ...]:
        """Names of the factors that changed, by the verdict; none where all changed alike."""
        if self.verdict != "changed" or self.changes.alike > 0.5:
            return ()
        pairs = zip(self.names, self.changes.probability, strict=True)
        return tuple(name for name, probability in pairs if probability >= NAMED)

    def sentence(self) -> str:
        """The verdict for an engineer."""
        found = self.changes
        # From the smallest to the largest visible change.
        low, high = (
            100.0 * np.expm1(value) for value in (found.visible.min(), found.visible.max())
        )
        size = f"{low:.2g} %" if high < 1.2 * low else f"{low:.2g} to {high:.2g} % (by story)"
        seen = f"One story changing by {size} or more would"
        if self.verdict == "unchanged":
            return (
                f"Nothing has changed, with a probability of {_share(found.none)}. {seen} have "
                "been seen."
            )
        if self.verdict == "unclear":
            likeliest = int(found.probability.argmax())
            return (
                "The data do not tell whether anything changed: the probability that nothing did "
                f"is {_share(found.none)}. Most likely to have changed is {self.titles[likeliest]} "
                f"({_share(found.probability[likeliest])}). {seen} be seen."
            )
        if found.alike > 0.5:
            return (
                f"All stiffnesses changed alike, by {_change(found.size[0], found.size_sd[0])}, "
                f"with a probability of {_share(found.alike)}. Look for a common reason first: "
                "temperature, level of motion, or masses."
            )
        named = [self.names.index(name) for name in self.named]
        parts = [
            f"{self.titles[k]}{' changed' if k == named[0] else ''} by "
            f"{_change(found.size[k], found.size_sd[k])} "
            f"(probability {_share(found.probability[k])})"
            for k in named
        ]
        return f"The stiffness of {', that of '.join(parts)}."

    def items(self) -> Iterator[Item]:
        """The verdict, every factor, and notes."""
        found, (before, after) = self.changes, self.draws
        yield Note(
            wrapped(self.sentence()),
            {
                "before": self.before.name,
                "after": self.after.name,
                "verdict": self.verdict,
                "sentence": self.sentence(),
                "probability_of_no_change": found.none,
                "probability_of_all_alike": found.alike,
            },
        )
        sizes = zip(found.size, found.size_sd, strict=True)
        columns = (
            Column(self.names, key="parameter"),
            Column(self.titles, "factor of", key="of"),
            *(
                Column(
                    draws.mean(axis=0),
                    name,
                    [plus_minus(values.mean(), values.std()) for values in draws.T],
                    key=name,
                )
                for name, draws in (("before", before), ("after", after))
            ),
            Column(
                np.expm1(found.size),
                "change, if any",
                [_change(size, sd) for size, sd in sizes],
                key="change",
            ),
            Column(np.exp(found.size) * found.size_sd, key="change_sd"),
            Column(
                found.probability,
                "probability",
                [_share(value) for value in found.probability],
                key="probability",
            ),
            Column(np.expm1(found.visible), key="visible_from"),
        )
        yield Table(name="changes", key="changes", columns=columns)
        yield Notes(self.notes, key="notes")

    def figures(self) -> Iterator[Picture]:
        """The intervals of all factors before and after."""
        from femupdate.report.plot_posterior import theta_intervals

        both = dict(zip(("Before", "After"), self.draws, strict=True))
        bounds, title = (
            self.before.posterior.of("stiffness").bounds,
            "Stiffness factors before and after",
        )
        yield Picture("changes", lambda: theta_intervals(self.titles, both, bounds, title=title))


def find_state(text: str, study: Study) -> State:
    """The posterior that a user names.

    Args:
        text: a study folder, a posterior file, or the name of a posterior of the study.
        study: that is asked for the name.

    Raises:
        StudyError: there is none, or it is damaged.
    """
    path, names = Path(text), study.posteriors()
    if text in names:
        return open_state(Study(study.folder, text), text)
    if path.is_dir():
        return open_state(Study(path), text)
    if path.is_file():
        return State(name=text, posterior=load_posterior(path), titles={}, hashes={})
    known = f", or choose of {study.folder} {', '.join(names)}" if names else ""
    raise StudyError(
        f"there is no study folder, posterior file or posterior called {text}; make it by "
        f"`femupdate calibrate FILE --name {text}`{known}"
    )


def open_state(study: Study, name: str = "") -> State:
    """The chosen posterior of a study.

    Args:
        name: what to call it; default the folder.

    Raises:
        StudyError: there is none, or it is damaged.
    """
    file = study.require("posterior", "calibrate")
    building, recorded = study.path(BUILDING_FILE), study.artefact("posterior")
    assert recorded is not None
    return State(
        name=name or str(study.folder),
        posterior=load_posterior(file),
        titles=factor_titles(load_building(building)) if building.exists() else {},
        hashes=recorded.made_from,
        summary=study.summary(),
    )


def compare_states(before: State, after: State) -> CompareReport:
    """Find the factors that changed.

    Raises:
        InferenceError: the posteriors are of different factors, or from the same data.
    """
    states = before, after
    first, second = (state.posterior.of("stiffness") for state in states)
    if first.names != second.names or not first.names:
        raise InferenceError(
            f"{before.name} and {after.name} have other stiffness factors "
            f"({', '.join(first.names)}; {', '.join(second.names)}); compare posteriors of one "
            "building"
        )
    files = [
        {value for key, value in state.hashes.items() if key.startswith("observation")}
        for state in states
    ]
    seen, other = (state.posterior.observation for state in states)
    same = seen.floors == other.floors and bool(seen.valid.any())
    if files[0] & files[1] or (
        same and np.array_equal(seen.log_frf, other.log_frf, equal_nan=True)
    ):
        raise InferenceError(
            f"{before.name} and {after.name} come from the same measurement; compare posteriors of "
            "two measurements"
        )
    notes = []
    ways = [state.posterior.drawn.likelihood for state in states]
    if ways[0] != ways[1]:
        notes.append(
            f"One posterior is {ways[0]}, the other {ways[1]}: errors of the model that cancel "
            "between two of one kind do not cancel here."
        )
    hashes = [state.hashes.get("building") for state in states]
    if None not in hashes and hashes[0] != hashes[1]:
        notes.append(
            "The two building files differ: each factor is relative to its own file, so a "
            "difference between the files shows as a change."
        )
    if set(seen.floors) != set(other.floors):
        notes.append("The floors measured differ, which can move factors where the model errs.")
    worst = max(state.summary.get("misfit") or 0.0 for state in states)
    if worst > 1.5:
        notes.append(
            f"The model misses the data by {worst**0.5:.2g} times their noise: the probabilities "
            "are surer than they should be. `femupdate diagnose` looks for what is missing."
        )
    return CompareReport(
        before=before,
        after=after,
        names=first.names,
        changes=changes(np.log(first.samples), np.log(second.samples)),
        notes=tuple(notes),
    )


def _share(value: float) -> str:
    """A probability, never rounded to certainty."""
    if value > 0.999:
        return "over 99.9 %"
    return "under 0.1 %" if value < 0.001 else f"{100.0 * value:.3g} %"


def _change(log: float, sd: float) -> str:
    """A change of ln theta as a percentage with its standard deviation."""
    percent, spread = 100.0 * float(np.expm1(log)), 100.0 * float(np.exp(log)) * sd
    return f"{'+' if percent > 0.0 else ''}{with_unit(percent, spread, '%')}"


def compare_modes(before: Path, after: Path, points: Mapping[str, str] | None = None) -> Told:
    """Compare two files of modes.

    Args:
        points: our floors to the measuring points of universal files.

    Raises:
        MeasurementError: one holds none, a shape is not whole, or they share no two floors.
    """
    read = [read_measured(path) for path in (before, after)]
    found = [identified_modes(r, None if r.mode_table else points) for r in read]
    floors = [floor for floor in found[0].floors if floor in found[1].floors]
    if len(floors) < 2:
        raise MeasurementError(
            f"{before} and {after} have {len(floors)} floors in common; shapes need two to compare"
        )
    earlier, later = (
        each.some(np.flatnonzero(np.isfinite(each.of_floors(floors).shape).all(axis=1)).tolist())
        for each in found
    )
    if not earlier.names or not later.names:
        raise MeasurementError(
            f"no mode of {before if not earlier.names else after} has a value at all of "
            f"{', '.join(floors)}; complete one"
        )
    first, second = earlier.of_floors(floors), later.of_floors(floors)
    # The modal assurance criterion of every two shapes (Allemang 2003, equation 4).
    alike = np.array([[mac(shape, other) for other in second.shape] for shape in first.shape])
    # Pairs such that their MAC adds up to most; above .5 two are more alike than not.
    rows, columns = linear_sum_assignment(-alike)
    sure = alike[rows, columns] >= 0.5
    rows, columns = rows[sure], columns[sure]
    hertz = first.frequency_hz[rows], second.frequency_hz[columns]
    change, value = hertz[1] / hertz[0] - 1.0, alike[rows, columns]
    items: list[Item] = [
        Note(
            f"{len(rows)} modes of {first.source} and {second.source} belong together, by their "
            f"shapes at {', '.join(floors)}.",
            {"before": first.source, "after": second.source, "floors": first.floors},
        ),
        Table(
            name="pairs",
            key="pairs",
            columns=(
                Column([first.names[k] for k in rows], "mode", csv="mode", key="mode"),
                Column([second.names[m] for m in columns], "is mode", csv="is_mode", key="is_mode"),
                *(
                    Column(values, f"Hz {when}", [f"{v:.4g}" for v in values], f"hz_{when}", when)
                    for when, values in zip(("before", "after"), hertz, strict=True)
                ),
                Column(change, "change", [percent(v, 2) for v in change], "change", "change"),
                Column(value, "MAC", [f"{v:.3f}" for v in value], "mac", "mac"),
            ),
        ),
        Table.of(
            ("MAC", *second.names),
            [(n, *(f"{v:.3f}" for v in row)) for n, row in zip(first.names, alike, strict=True)],
            name="mac",
            caption="MAC of all modes",
        ),
        Note(content={"mac": alike}),
    ]
    if len(rows):
        items.append(_by_floor("comac", floors, comac(first.shape[rows], second.shape[columns])))
    alone = [
        f"mode {modes.names[k]} of {modes.source} has no partner."
        for modes, paired in ((first, rows), (second, columns))
        for k in range(len(modes.names))
        if k not in paired
    ]
    return Told((*items, Notes(tuple(alone), key="alone")))


def comac(first: Complexes, second: Complexes) -> Floats:
    """How alike shapes (n, f) of n pairs are at every floor (f,), all of unit length.

    sum |a b|^2 / (sum a^2 sum b^2), the sums over the pairs (Lieven and Ewins 1988).
    """
    a, b = (shape / np.linalg.norm(shape, axis=1, keepdims=True) for shape in (first, second))
    both = np.abs(a * b).sum(axis=0) ** 2
    return np.asarray(both / ((a**2).sum(axis=0) * (b**2).sum(axis=0)))


def _by_floor(name: str, floors: Sequence[str], values: Floats, *more: Column) -> Table:
    """A criterion of every floor."""
    cells = [f"{value:.3f}" for value in values]
    columns = (
        Column(floors, "floor", csv="floor", key="floor"),
        Column(values, name.upper(), cells, name, name),
        *more,
    )
    return Table(name=name, key=name, columns=columns)


def compare_frfs(
    before: str, after: str, study: Study, columns: Mapping[str, str] | None = None
) -> Told:
    """Compare FRFs under base motion of files, or of a file and the mean of a posterior.

    Args:
        before, after: files, or one name of a posterior of the study, or a study folder.
        columns: our column name to the files'; by default as a study has read them before.

    Raises:
        MeasurementError: a file holds none, or they share no floor or too few frequencies.
        StudyError: there is no such posterior.
    """
    if before == after:
        raise MeasurementError(f"{before} is named twice; name another test or model beside it")
    files: dict[str, Histories | Observation] = {}
    models = {}
    for name in (name for name in (before, after) if Path(name).is_file()):
        opened = next((Study(each) for each in (before, after) if Path(each).is_dir()), study)
        read = opened.reading_of(Path(name)) | ({"columns": columns} if columns else {})
        files[name] = read_observation_file(Path(name), **read)
    grids = [data.frequency_hz for data in files.values() if isinstance(data, Observation)]
    for name in {before, after} - set(files):
        opened = Study(name) if Path(name).is_dir() else Study(study.folder, name)
        model = open_calibrated(opened, SILENT)
        models[name] = model, kept_posterior(opened, model.building)
        grids.append(model.frequency_hz.numpy())
    grid = max(grids, key=len) if grids else np.arange(0.3, 20.0, 0.1)
    low, high = max([g[0] for g in grids] or [0.0]), min([g[-1] for g in grids] or [np.inf])
    grid = grid[(grid >= low) & (grid <= high)]
    if grid.size < 10:
        raise MeasurementError(f"{before} and {after} share {grid.size} frequencies; ten are least")
    direction = next((direction_of(model.building) for model, _ in models.values()), "x")
    seen: dict[str, tuple[tuple[str, ...], Complexes]] = {}
    used, estimator = np.ones(grid.size, dtype=bool), None
    for name, data in files.items():
        if isinstance(data, Histories):
            seen_at = estimate_frf(data, grid, direction)
        else:
            seen_at = on_grid(data, grid)
        estimator = seen_at.estimator or estimator
        used &= np.isfinite(seen_at.log_frf).all(axis=0)
        turned = 0.0 if seen_at.phase is None else 1j * seen_at.phase
        seen[name] = seen_at.floors, np.exp(seen_at.log_frf + turned)
    for name, (model, posterior) in models.items():
        mean = posterior.parameters.split(torch.from_numpy(posterior.values.mean((0, 1))[None]))
        at = torch.from_numpy(grid if estimator is None else estimator.frequency_hz)
        known = mean.theta, mean.zeta, mean.sizes, at
        # Through the estimate of the record, which smooths its peaks.
        seen[name] = model.system.floors, model.system.seen_frf(*known, estimator)[0].numpy()
    floors = tuple(floor for floor in seen[before][0] if floor in seen[after][0])
    if not floors or used.sum() < 10:
        raise MeasurementError(f"{before} and {after} share no floor, or under ten frequencies")
    rows = [seen[name][1][[seen[name][0].index(f) for f in floors]][:, used] for name in seen]
    first, second = rows if next(iter(seen)) == before else rows[::-1]
    if not (np.iscomplexobj(first) and np.iscomplexobj(second)):
        first, second = np.abs(first), np.abs(second)
    a, b = (np.sqrt((np.abs(h) ** 2).mean(axis=1)) for h in (first, second))
    of = "complex" if np.iscomplexobj(first) else "sizes of"
    band = [float(grid[used][k]) for k in (0, -1)]
    ratio = Column(b / a, "ratio (rms)", [f"{v:.3f}" for v in b / a], "ratio", "ratio")
    # The frequency response assurance criterion is the MAC of rows (Heylen and Lammens 1996).
    frac = np.array([mac(*pair) for pair in zip(first, second, strict=True)])
    return Told(
        (
            Note(
                f"{before} and {after}: {of} FRFs from {band[0]:.3g} to {band[1]:.3g} Hz; a FRAC "
                "of 1 is the same curve, but for a factor; noise and short records lower it.",
                {"before": before, "after": after, "band_hz": band},
            ),
            _by_floor("frac", floors, frac, ratio),
        )
    )
