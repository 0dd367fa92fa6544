"""compare, of tests: how alike two sets of modes are, or FRFs of two tests or of a model."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment

from femupdate.arrays import Complexes, Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.frf import estimate_frf, on_grid
from femupdate.measurement.modes import identified_modes, mac
from femupdate.measurement.observation import Histories, Observation
from femupdate.measurement.reader import read_measured, read_observation_file
from femupdate.progress import SILENT
from femupdate.result import Item, Note, Notes, Told
from femupdate.study import Study
from femupdate.tables import Column, Table
from femupdate.units import percent
from femupdate.workflow.calibration_report import kept_posterior
from femupdate.workflow.model import open_calibrated
from femupdate.workflow.observed import direction_of


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
    return Told(
        (
            Note(
                f"{before} and {after}: {of} FRFs from {band[0]:.3g} to {band[1]:.3g} Hz; a FRAC "
                "of 1 is the same curve, but for a factor; noise and short records lower it.",
                {"before": before, "after": after, "band_hz": band},
            ),
            _by_floor("frac", floors, frac(first, second), ratio),
        )
    )


def frac(first: Complexes, second: Complexes) -> Floats:
    """Frequency response assurance criterion (f,) of responses (f, m), 1 where a factor parts them.

    |sum a b*|^2 / (sum |a|^2 sum |b|^2) (Heylen and Lammens 1996).
    """
    both = np.abs((first * second.conj()).sum(axis=1)) ** 2
    sizes = [(np.abs(h) ** 2).sum(axis=1) for h in (first, second)]
    return np.asarray(both / (sizes[0] * sizes[1]))
