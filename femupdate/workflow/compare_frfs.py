"""compare, of FRFs: how alike two tests, or a test and a model, are at every floor."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from femupdate.arrays import Complexes, Floats
from femupdate.errors import MeasurementError
from femupdate.measurement.frf import estimate_frf, on_grid
from femupdate.measurement.histories import Histories
from femupdate.measurement.modes import IdentifiedModes
from femupdate.measurement.observation import Observation
from femupdate.measurement.reader import kind_in, read_measured
from femupdate.progress import SILENT
from femupdate.result import Item, Note, Result
from femupdate.study import Study
from femupdate.tables import Column, Table
from femupdate.workflow.model import open_calibrated
from femupdate.workflow.observed import direction_of
from femupdate.workflow.summary import kept_posterior

_STEP, _BAND = 0.1, (0.3, 20.0)  # Hz, of two records without a grid of their own


@dataclass(frozen=True, kw_only=True)
class FrfComparison(Result):
    """FRFs (f, m) of two tests or models, complex or their sizes, at floors that both have."""

    names: tuple[str, str]
    floors: tuple[str, ...]
    frequency_hz: Floats
    responses: tuple[Complexes, Complexes]

    @property
    def frac(self) -> Floats:
        """(f,) frequency response assurance criterion: |sum a b*|^2 / (sum |a|^2 sum |b|^2).

        1 where the two differ by a factor alone (Heylen and Lammens 1996).
        """
        a, b = self.responses
        both = np.abs((a * b.conj()).sum(axis=1)) ** 2
        return np.asarray(both / ((np.abs(a) ** 2).sum(axis=1) * (np.abs(b) ** 2).sum(axis=1)))

    def items(self) -> Iterator[Item]:
        """FRAC and the ratio of the sizes of every floor."""
        a, b = (np.sqrt((np.abs(h) ** 2).mean(axis=1)) for h in self.responses)
        of = "complex" if all(map(np.iscomplexobj, self.responses)) else "sizes of"
        band = [float(self.frequency_hz[k]) for k in (0, -1)]
        yield Note(
            f"{self.names[0]} and {self.names[1]}: {of} FRFs from {band[0]:.3g} to {band[1]:.3g} "
            "Hz; a FRAC of 1 is the same curve, but for a factor.",
            {"before": self.names[0], "after": self.names[1], "band_hz": band},
        )
        cells = [f"{value:.3f}" for value in self.frac]
        columns = (
            Column(self.floors, "floor", csv="floor", key="floor"),
            Column(self.frac, "FRAC", cells, "frac", "frac"),
            Column(b / a, "ratio (rms)", [f"{v:.3f}" for v in b / a], "ratio", "ratio"),
        )
        yield Table(name="frac", key="frac", columns=columns)


def compare_frfs(before: str, after: str, study: Study) -> FrfComparison:
    """Compare FRFs under base motion of files, or of a file and the mean of a posterior.

    Args:
        before, after: files, or one name of a posterior of the study, or a study folder.

    Raises:
        MeasurementError: a file holds none, or they share no floor or too few frequencies.
        StudyError: there is no such posterior.
    """
    files = {name: _measured(Path(name)) for name in (before, after) if Path(name).is_file()}
    models = {}
    grids = [data.frequency_hz for data in files.values() if isinstance(data, Observation)]
    for name in {before, after} - set(files):
        opened = Study(name) if Path(name).is_dir() else Study(study.folder, name)
        model = open_calibrated(opened, SILENT)
        models[name] = model, kept_posterior(opened, model.building)
        grids.append(model.frequency_hz.numpy())
    grid = max(grids, key=len) if grids else np.arange(*_BAND, _STEP)
    low, high = max([own[0] for own in grids] or [0.0]), min([own[-1] for own in grids] or [np.inf])
    grid = grid[(grid >= low) & (grid <= high)]
    if grid.size < 10:
        raise MeasurementError(f"{before} and {after} share {grid.size} frequencies; ten are least")
    direction = next((direction_of(model.building) for model, _ in models.values()), "x")
    seen: dict[str, tuple[tuple[str, ...], Complexes]] = {}
    used, estimator = np.ones(grid.size, dtype=bool), None
    for name, data in files.items():
        own = estimate_frf(data, grid, direction) if isinstance(data, Histories) else None
        own = on_grid(data, grid) if isinstance(data, Observation) else own
        assert own is not None
        estimator = own.estimator or estimator
        used &= np.isfinite(own.log_frf).all(axis=0)
        h = np.exp(own.log_frf) if own.phase is None else np.exp(own.log_frf + 1j * own.phase)
        seen[name] = own.floors, h
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
    return FrfComparison(
        names=(before, after), floors=floors, frequency_hz=grid[used], responses=(first, second)
    )


def _measured(path: Path) -> Histories | Observation:
    """What moves with the base in a file."""
    data = kind_in(read_measured(path))
    if isinstance(data, IdentifiedModes):
        raise MeasurementError(f"{path} holds modes; compare it with another file of modes")
    first = data if isinstance(data, Histories) else data[0]
    if first.excitation.force:
        raise MeasurementError(
            f"{path} holds responses to a force; FRAC compares those under base motion"
        )
    return first
