"""Errors over stated standard deviations by kinds of data: histories, FRFs, modes, hammer, ambient.

Every case is a tower of three stories, by exact modes: factors, damping, sensors and noise are
drawn, and the prior is what they are drawn from. Of wrong models the building is another one.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from femupdate.arrays import Complexes, Floats
from femupdate.study import Study
from femupdate.workflow import CalibrationSettings, ObservationSource, calibrate_study, open_study
from femupdate.workflow.inspect_files import identify

from .result import Job, Report, markdown_table

_STORY = 'height = "3 m"\nmass = "100 t"\nstiffness_per_mass = "3000 1/s2"\n'
_TOWER = "".join(
    [
        'name = "tower"\nkind = "shear"\n',
        *(f'[[stories]]\nname = "S{k}"\n{_STORY}' for k in (1, 2, 3)),
        '[frequency_grid]\nstart = "0.3 Hz"\nstep = "0.05 Hz"\ncount = 480\n',
        "[prior.theta]\nlower = 0.5\nupper = 2.0\n[prior.zeta]\nlower = 0.005\nupper = 0.05\n",
        '[damping]\nlaw = "constant"\nratio = 0.02\n',
    ]
)
_FLOORS, _STEP, _MASS = np.array(["2F", "3F", "RF"]), 0.01, 1e5
_KINDS = ("histories", "FRFs", "modes", "hammer test", "ambient vibration")
_ALL = "all together"
# Modes of buildings that the model is not: a floor heavier by a tenth, all masses off by 5 %,
# floors that turn.
_WRONG = ("modes, a floor's mass off", "modes, masses off", "modes, bending")


class _Tower:
    """What is drawn, its modes, and the files that hold it; masses over 100 t."""

    def __init__(self, rng: np.random.Generator, wrong: str = "") -> None:
        self.theta = rng.uniform(*((0.7, 1.4) if wrong else (0.5, 2.0)), 3)
        self.zeta, self.rng = rng.uniform(0.005, 0.05), rng
        springs, self.mass = 3000.0 * self.theta, np.ones(3)
        stiffness = np.diag(springs + np.append(springs[1:], 0.0))
        stiffness -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
        if wrong == _WRONG[0]:
            self.mass[rng.integers(3)] = 1.1
        elif wrong == _WRONG[1]:
            self.mass *= np.exp(0.05 * rng.standard_normal(3))
        elif wrong == _WRONG[2]:
            bent = np.diff(np.eye(4), 2, axis=0)
            stiffness += 180.0 * (bent.T @ bent)[1:, 1:]
        root = np.sqrt(self.mass)
        squares, shapes = np.linalg.eigh(stiffness / np.outer(root, root))
        self.omega, self.shapes = np.sqrt(squares), shapes / root[:, None]
        self.seen = np.sort(rng.choice(3, size=rng.integers(2, 4), replace=False))

    def _over(self, load: Floats, motion: Any, hertz: Floats) -> Complexes:
        """Accelerations (3, k) under loads (3,) of floors that follow a motion (k,)."""
        w = 2.0 * np.pi * hertz
        below = self.omega[:, None] ** 2 - w**2 + 2j * self.zeta * self.omega[:, None] * w
        return np.asarray(-(w**2) * motion * ((self.shapes * (load @ self.shapes)) @ (1.0 / below)))

    def _written(self, path: Path, heads: Sequence[str], columns: Sequence[Any]) -> Path:
        rows = np.column_stack(columns)
        np.savetxt(path, rows, "%.9g", ",", header=",".join(heads), comments="")
        return path

    def _moved(self, seconds: float, loads: Floats) -> Floats:
        """Histories (1 + 3, n) of the first white motion, and of floors under loads (m, 3)."""
        count = round(seconds / _STEP)
        hertz = np.asarray(np.fft.rfftfreq(2 * count, _STEP), dtype=np.float64)
        white = np.fft.rfft(self.rng.standard_normal((len(loads), 2 * count)))
        white[:, (hertz < 0.3) | (hertz > 45.0)] = 0.0
        floors = sum(self._over(*both, hertz) for both in zip(loads, white, strict=True))
        return np.fft.irfft(np.vstack([white[:1], floors]), 2 * count)[:, count:]

    def modes(self, path: Path) -> Path:
        """Errors of .05 to 1 % of frequencies, .3 to 3 % of shapes and 10 % of damping."""
        rng, names = self.rng, _FLOORS[self.seen]
        off, bent = rng.choice([0.0005, 0.002, 0.005, 0.01]), rng.choice([0.003, 0.01, 0.03])
        hertz = self.omega / (2.0 * np.pi) * np.exp(off * rng.standard_normal(3))
        ratio = self.zeta * np.exp(0.1 * rng.standard_normal(3))
        shapes = self.shapes[self.seen] / np.abs(self.shapes[self.seen]).max(axis=0)
        shapes = shapes + bent * rng.standard_normal(shapes.shape)
        heads = ["frequency_hz", "frequency_sd_hz", "damping", "damping_sd", *names]
        sds = [np.full(3, bent)] * len(names)
        columns = [hertz, off * hertz, ratio, 0.1 * ratio, *shapes, *sds]
        return self._written(path, [*heads, *(f"{name}_sd" for name in names)], columns)

    def responses(self, path: Path, force: bool) -> Path:
        """|H| every .2 Hz with errors of 3 to 20 %, over the base or a force at a floor."""
        hertz, noise = np.arange(0.5, 24.0, 0.2), self.rng.choice([0.03, 0.1, 0.2])
        at = int(self.rng.integers(3))
        under = self._over(np.eye(3)[at], 1.0 / _MASS, hertz)
        size = np.abs(under if force else 1.0 + self._over(-self.mass, 1.0, hertz))[self.seen]
        size = size * np.exp(noise * self.rng.standard_normal(size.shape))
        names = [f"{name}/{_FLOORS[at]}" if force else name for name in _FLOORS[self.seen]]
        heads = [f"{name} (m/s2/N)" if force else name for name in names]
        heads = ["frequency_hz", *heads, *(f"{name}_sd" for name in names)]
        return self._written(path, heads, [hertz, *size, *np.full_like(size, noise)])

    def histories(self, path: Path) -> Path:
        """30 to 120 s of base and floors, with noise of 1 to 10 % of the base's motion."""
        rows = self._moved(self.rng.choice([30.0, 60.0, 120.0]), -self.mass[None])
        rows[1:] += rows[0]
        noise = self.rng.choice([0.01, 0.03, 0.1])
        rows = rows / rows[0].std() + noise * self.rng.standard_normal(rows.shape)
        return self._histories(path, ["base", *_FLOORS[self.seen]], rows[[0, *(1 + self.seen)]])

    def ambient(self, path: Path) -> Path:
        """Modes by `identify` from 5 to 30 minutes of wind on all floors, noise of 1 to 10 %."""
        rows = self._moved(self.rng.choice([300.0, 600.0, 1800.0]), np.eye(3))[1:]
        rows += (
            self.rng.choice([0.01, 0.03, 0.1]) * rows.std() * self.rng.standard_normal(rows.shape)
        )
        rows = 0.01 * rows[self.seen] / rows.std()
        record = self._histories(path.with_suffix(".record.csv"), list(_FLOORS[self.seen]), rows)
        identify(record, path)
        return path

    def _histories(self, path: Path, names: Sequence[str], rows: Floats) -> Path:
        heads = ["time_s", *(f"{name} (m/s2)" for name in names)]
        return self._written(path, heads, [_STEP * np.arange(rows.shape[1]), *rows])


def _files(folder: Path, seed: Sequence[int]) -> Iterator[tuple[str, list[Path], _Tower]]:
    """Every kind, its files and what they are of."""
    tower = _Tower(np.random.default_rng(seed))
    files = [
        tower.histories(folder / "histories.csv"),
        tower.responses(folder / "frfs.csv", force=False),
        tower.modes(folder / "modes.csv"),
        tower.responses(folder / "hammer.csv", force=True),
        tower.ambient(folder / "ambient.csv"),
    ]
    yield from ((kind, [file], tower) for kind, file in zip(_KINDS, files, strict=True))
    yield _ALL, files, tower
    for number, kind in enumerate(_WRONG):
        other = _Tower(np.random.default_rng([*seed, number]), kind)
        yield kind, [other.modes(folder / f"wrong_{number}.csv")], other


def run_kinds(job: Job, cases: int) -> Report:
    """So many towers, each seen in every way."""
    settings = CalibrationSettings(particles=1000, exact=True, chains=1, anyway=True)
    kinds = (*_KINDS, _ALL, *_WRONG)
    job.progress.start("Calibrating", cases * len(kinds))
    found: dict[str, list[Floats]] = {kind: [] for kind in kinds}
    for number in range(cases):
        with TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "tower.toml").write_text(_TOWER, encoding="utf-8")
            for kind, files, tower in _files(folder, (job.seed, number)):
                study = Study(folder / kind)
                source = ObservationSource(files[0], further=tuple(files[1:]))
                model = open_study(study, str(folder / "tower.toml"))
                draws = calibrate_study(study, model, source, settings).posterior
                theta = draws.of("stiffness").samples
                rank = (theta < tower.theta).mean(axis=0)
                sd = theta.std(axis=0)
                held = np.abs(rank - 0.5) < 0.45
                found[kind].append(np.array([(theta.mean(axis=0) - tower.theta) / sd, sd, held]))
                job.progress.advance()
    content, rows = {}, []
    for kind, values in found.items():
        away, sd, held = np.array(values).transpose(1, 0, 2)
        content[kind] = {
            "median_sd": float(np.median(sd)),
            "error_over_sd": float(np.sqrt((away**2).mean())),
            "in_90": float(held.mean()),
        }
        figures = content[kind]["median_sd"], content[kind]["error_over_sd"]
        rows.append((kind, f"{figures[0]:.4f}", f"{figures[1]:.2f}", f"{held.mean():.0%}"))
    head = ("data", "median sd of a factor", "error over sd, rms", "in 90 %")
    return job.write("kinds", {"cases": cases, "kinds": content}, markdown_table(head, rows))
