"""Errors over stated standard deviations of a right model, from records of many kinds.

Three equal stories by exact modes, periodic over four times the record, of which the last quarter
is measured: white motion finds the tower moving. Sensors of the base and of floors have the noise.
Where the building states tolerances its masses, gains and clocks are off by as much.
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
    calibrate_study,
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
_TOLERANCES = '[tolerances]\nmass = "3 %"\ngain = "1 %"\ndelay = "1 ms"\n'
_STEP, _FACTORS, _FLOORS = 0.01, np.array([0.9, 1.2, 0.8]), ("2F", "3F", "RF")
# Motion, seconds, noise over the base's rms, damping, floors seen, whether with tolerances.
_KINDS = [
    ("white", 600.0, 0.01, 0.02, _FLOORS, False),
    ("white", 120.0, 0.01, 0.02, _FLOORS, False),
    ("white", 120.0, 0.1, 0.02, _FLOORS, False),
    ("white", 60.0, 0.2, 0.02, _FLOORS, False),
    ("white", 60.0, 0.02, 0.04, ("RF",), False),
    ("white", 30.0, 0.03, 0.02, _FLOORS, False),
    ("white", 20.0, 0.02, 0.01, _FLOORS, False),
    ("quake", 120.0, 0.01, 0.04, _FLOORS, False),
    ("quake", 60.0, 0.01, 0.02, _FLOORS, False),
    ("quake", 60.0, 0.02, 0.02, ("2F", "RF"), False),
    ("quake", 40.0, 0.05, 0.005, _FLOORS, False),
    ("white", 120.0, 0.02, 0.02, _FLOORS, True),
    ("quake", 60.0, 0.02, 0.02, _FLOORS, True),
]


def _record(
    motion: str, seconds: float, noise: float, zeta: float, off: bool, seed: tuple[int, ...]
) -> Floats:
    """Times and noisy accelerations (5, n) of base and floors."""
    rng, count = np.random.default_rng(seed), round(seconds / _STEP)
    # By which masses, gains and clocks (s) are off what the file says.
    away = np.random.default_rng((*seed, 1)).standard_normal((3, 3))
    mass, gain, late = off * np.array([[0.03], [0.01], [0.001]]) * away
    springs, root = 3000.0 * _FACTORS, np.sqrt(1.0 + mass)
    chain = np.diag(springs + np.append(springs[1:], 0.0))
    chain -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    squares, shapes = np.linalg.eigh(chain / np.outer(root, root))
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
    frf = 1.0 + (shapes / root[:, None] * (root @ shapes)) @ (omega**2 / below)
    frf *= (1.0 + gain[:, None]) * np.exp(-1j * omega * late[:, None])
    rows = np.fft.irfft(np.vstack([spectrum, frf * spectrum]), 4 * count)[:, -count:]
    rows *= 0.3 / rows[0].std()
    rows += noise * 0.3 * rng.standard_normal(rows.shape)
    return np.vstack([_STEP * np.arange(count), rows])


def _away(
    study: Study, model: StudyModel, path: Path, record: Floats, zeta: float, seen: tuple[str, ...]
) -> Floats:
    """Errors (4,) of factors and damping over standard deviations, at the maximum or of draws."""
    rows = [0, 1, *(2 + _FLOORS.index(floor) for floor in seen)]
    head = ",".join(["time_s", *(f"{name} (m/s2)" for name in ("base", *seen))])
    np.savetxt(path, record[rows].T, "%.9g", ",", header=head, comments="")
    source, truth = ObservationSource(path), np.append(_FACTORS, zeta)
    if model.building.tolerances is not None:
        settings = CalibrationSettings(particles=400, exact=True, chains=1)
        draws = calibrate_study(study, model, source, settings).posterior
        assert draws.zeta_samples is not None
        known = np.column_stack([draws.of("stiffness").samples, draws.zeta_samples])
        return np.asarray((known.mean(axis=0) - truth) / known.std(axis=0))
    found = settled_likelihood(model, measured_of(model.building, source), CalibrationSettings())
    prior = found.likelihood.prior
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
        models = []
        for name, more in (("exact", ""), ("tolerances", _TOLERANCES)):
            file = Path(folder) / f"{name}.toml"
            file.write_text(_TOWER + more, encoding="utf-8")
            study = Study(Path(folder) / name)
            models.append((study, open_study(study, str(file))))
        for number, (motion, seconds, noise, zeta, seen, off) in enumerate(_KINDS):
            away = np.array(
                [
                    _away(
                        *models[off],
                        Path(folder) / "record.csv",
                        _record(motion, seconds, noise, zeta, off, (job.seed, number, run)),
                        zeta,
                        seen,
                    )
                    for run in range(records)
                ]
            )
            rms, held = np.sqrt((away**2).mean(axis=0)), (np.abs(away) < 1.645).mean()
            kind = {"motion": motion, "seconds": seconds, "noise": noise, "damping": zeta}
            kind |= {"floors": seen, "tolerances": off}
            content.append({**kind, "error_over_sd": rms, "in_90": held})
            words = f"{motion}, {seconds:g} s, noise {noise:.0%}, damping {zeta:.1%}"
            few = "" if seen == _FLOORS else f", {' and '.join(seen)}"
            few += ", with tolerances" if off else ""
            each = [f"{value:.2f}" for value in rms]
            rows.append((words + few, *each[:3], each[3], f"{held:.0%}"))
    head = ("record", *(f"theta_{k}" for k in (1, 2, 3)), "damping", "in 90 %")
    return job.write("records", {"records": records, "kinds": content}, markdown_table(head, rows))
