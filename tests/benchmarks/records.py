"""Errors over stated standard deviations of a right model, from records of many kinds.

Three equal stories by exact modes, periodic over four times the record, of which the last quarter
is measured: white motion finds the tower moving. Sensors of the base and of floors have the noise.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    StudyModel,
    measured_of,
    open_study,
    settled_likelihood,
)

from .result import Job, Report, markdown_table

_STORY = 'height = "3 m"\nmass = "100 t"\nstiffness_per_mass = "3000 1/s2"\n'
_TOWER = "".join(
    [
        'name = "tower"\nkind = "shear"\nmasses_known = false\n',
        *(f'[[stories]]\nname = "S{k}"\n{_STORY}' for k in (1, 2, 3)),
        '[frequency_grid]\nstart = "0.3 Hz"\nstep = "0.05 Hz"\ncount = 480\n',
        '[prior.theta]\nlower = "1/3"\nupper = 3.0\n[prior.zeta]\nlower = 0.001\nupper = 0.12\n',
        '[damping]\nlaw = "constant"\nratio = 0.02\n',
    ]
)
_STEP, _FACTORS, _FLOORS = 0.01, np.array([0.9, 1.2, 0.8]), ("2F", "3F", "RF")
# Motion, seconds, noise over the base's rms, damping, floors seen.
_KINDS = [
    ("white", 600.0, 0.01, 0.02, _FLOORS),
    ("white", 120.0, 0.01, 0.02, _FLOORS),
    ("white", 120.0, 0.1, 0.02, _FLOORS),
    ("white", 60.0, 0.2, 0.02, _FLOORS),
    ("white", 60.0, 0.02, 0.04, ("RF",)),
    ("white", 30.0, 0.03, 0.02, _FLOORS),
    ("white", 20.0, 0.02, 0.01, _FLOORS),
    ("quake", 120.0, 0.01, 0.04, _FLOORS),
    ("quake", 60.0, 0.01, 0.02, _FLOORS),
    ("quake", 60.0, 0.02, 0.02, ("2F", "RF")),
    ("quake", 40.0, 0.05, 0.005, _FLOORS),
]


def _record(
    motion: str, seconds: float, noise: float, zeta: float, seed: tuple[int, ...]
) -> Floats:
    """Times and noisy accelerations (5, n) of base and floors."""
    rng, count = np.random.default_rng(seed), round(seconds / _STEP)
    springs = 3000.0 * _FACTORS
    chain = np.diag(springs + np.append(springs[1:], 0.0))
    chain -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    squares, shapes = np.linalg.eigh(chain)
    fine = np.fft.rfftfreq(4 * count, _STEP)
    omega, time = 2.0 * np.pi * fine, _STEP * np.arange(4 * count) - 3.0 * seconds
    spectrum = np.fft.rfft(rng.standard_normal(4 * count))
    spectrum[(fine < 0.3) | (fine > 40.0)] = 0.0
    if motion == "quake":
        rise = np.clip((time / seconds - 0.1) / 0.05, 0.0, 1.0)
        envelope = rise * np.exp(-np.clip((time / seconds - 0.2) / 0.12, 0.0, None))
        soil = 225.0 / (225.0 - omega**2 + 15.0j * omega)
        spectrum = np.fft.rfft(np.fft.irfft(soil * spectrum, 4 * count) * envelope)
    below = squares[:, None] - omega**2 + 2j * zeta * np.sqrt(squares)[:, None] * omega
    frf = 1.0 + (shapes * shapes.sum(axis=0)) @ (omega**2 / below)
    rows = np.fft.irfft(np.vstack([spectrum, frf * spectrum]), 4 * count)[:, -count:]
    rows *= 0.3 / rows[0].std()
    rows += noise * 0.3 * rng.standard_normal(rows.shape)
    return np.vstack([_STEP * np.arange(count), rows])


def _away(
    model: StudyModel, path: Path, record: Floats, zeta: float, seen: tuple[str, ...]
) -> Floats:
    """Errors (4,) of factors and damping over their standard deviations about the maximum."""
    rows = [0, 1, *(2 + _FLOORS.index(floor) for floor in seen)]
    head = ",".join(["time_s", *(f"{name} (m/s2)" for name in ("base", *seen))])
    np.savetxt(path, record[rows].T, "%.9g", ",", header=head, comments="")
    measured = measured_of(model.building, ObservationSource(path))
    found = settled_likelihood(model, measured, CalibrationSettings())
    prior, truth = found.likelihood.prior, np.append(_FACTORS, zeta)
    # Of several solutions that next to the truth.
    maxima = prior.from_normal(found.found.z)
    nearest = int((maxima - torch.from_numpy(truth)).square().sum(1).argmin())
    z = found.found.z[nearest]
    slopes = torch.autograd.functional.jacobian(lambda z: prior.from_normal(z[None])[0], z)
    covariance = slopes @ torch.linalg.inv(found.found.precision[nearest]) @ slopes.T
    return np.asarray((maxima[nearest].numpy() - truth) / covariance.diagonal().sqrt().numpy())


def run_records(job: Job, records: int) -> Report:
    """So many records of every kind."""
    content, rows = [], []
    with TemporaryDirectory() as folder:
        file = Path(folder) / "tower.toml"
        file.write_text(_TOWER, encoding="utf-8")
        model = open_study(Study(Path(folder) / "study"), str(file))
        for number, (motion, seconds, noise, zeta, seen) in enumerate(_KINDS):
            away = np.array(
                [
                    _away(
                        model,
                        Path(folder) / "record.csv",
                        _record(motion, seconds, noise, zeta, (job.seed, number, run)),
                        zeta,
                        seen,
                    )
                    for run in range(records)
                ]
            )
            rms, held = np.sqrt((away**2).mean(axis=0)), (np.abs(away) < 1.645).mean()
            kind = {"motion": motion, "seconds": seconds, "noise": noise, "damping": zeta}
            content.append({**kind, "floors": seen, "error_over_sd": rms, "in_90": held})
            words = f"{motion}, {seconds:g} s, noise {noise:.0%}, damping {zeta:.1%}"
            few = "" if seen == _FLOORS else f", {' and '.join(seen)}"
            each = [f"{value:.2f}" for value in rms]
            rows.append((words + few, *each[:3], each[3], f"{held:.0%}"))
    head = ("record", *(f"theta_{k}" for k in (1, 2, 3)), "damping", "in 90 %")
    return job.write("records", {"records": records, "kinds": content}, markdown_table(head, rows))
