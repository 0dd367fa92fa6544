"""Frames whose truth another mesh or another program made, calibrated, and their intervals."""

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from femupdate.arrays import Flags, Floats
from femupdate.building import FrameBuilding, load_building
from femupdate.building.entry import ALL
from femupdate.dynamics import ReducedModel, System, damping_law, floor_histories
from femupdate.measurement import FloorChannel, GroundMotion, Histories, write_observation_histories
from femupdate.measurement.names import BASE
from femupdate.simulation import fine_model, truth_of
from femupdate.simulation.truth import FineModel
from femupdate.study import Study
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    calibrate_study,
    open_study,
    with_finer_mesh,
)

from ..log import ResumableLog
from ..result import Job, Report, markdown_table
from .motions import RATE_HZ, RECORDED, SIMULATED, WHITE, base_motion
from .opensees import SHELLS, opensees_model

_NAME = "frame_coverage"
_FINER = (0.4, 0.6)  # of the building's own mesh size
_LIKE_OURS = 0.5  # mesh of OpenSees' models
_THETA, _ZETA = (0.65, 1.5), (0.005, 0.03)
_NOISE = (0.002, 0.01)  # of a sensor, over the rms of the base
_MOTIONS = (WHITE, RECORDED, WHITE, SIMULATED)

RANDOM = "random"  # in place of a building: another frame in every case

Make = Callable[[FrameBuilding, Floats], ReducedModel]


@dataclass(frozen=True)
class CoveragePlan:
    """What is tried."""

    building: str  # shipped name or file of a frame
    cases: int  # simulated buildings
    particles: int  # posterior draws for each


@dataclass(frozen=True, kw_only=True)
class Case:
    """One building and its posterior."""

    truth: str  # what made the data
    motion: str  # of the base
    theta: Floats  # (p,) true factors; zeta: true damping ratio
    zeta: float
    # mean, sd, low, high: (p,) of the posterior, the ends those of the 90 % interval
    mean: Floats
    sd: Floats
    low: Floats
    high: Floats
    # zeta_low, zeta_high: 90 % interval of the damping ratio
    zeta_low: float
    zeta_high: float
    misfit: float  # of the best draw
    seconds: float  # of processor time

    @property
    def held(self) -> Flags:
        """Which true factors (p,) lie within their intervals."""
        return (self.low <= self.theta) & (self.theta <= self.high)

    @property
    def away(self) -> Floats:
        """Errors (p,) over their standard deviations."""
        return (self.mean - self.theta) / self.sd

    @property
    def zeta_held(self) -> bool:
        """Whether the true damping ratio lies within its interval."""
        return self.zeta_low <= self.zeta <= self.zeta_high


def run_coverage(job: Job, plan: CoveragePlan) -> Report:
    """Simulate and calibrate every case, and count."""
    several = plan.building == RANDOM
    title = RANDOM if several else load_building(plan.building).name
    name = f"{_NAME}_{title}_exact"
    makers = list(_truths().items())
    job.progress.start("Calibrating", plan.cases)
    log = ResumableLog(job.folder / f"{name}_cases.jsonl", [replace(plan, cases=0), job.seed])
    cases = []
    for number, rng in enumerate(np.random.default_rng(job.seed).spawn(plan.cases)):
        kind = makers[(number // len(_MOTIONS)) % len(makers)]
        motion = _MOTIONS[number % len(_MOTIONS)]
        file, folder = plan.building, job.folder / f"{_NAME}_{title}"
        if several:
            folder = folder / str(number)
            folder.mkdir(parents=True, exist_ok=True)
            file = str(folder / "frame.toml")
            Path(file).write_text(random_frame(rng), encoding="utf-8")
        make = partial(_case, plan, Study(folder / "study"), file, kind, motion, rng)
        cases.append(log.get_or_make(str(number), Case, make))
        job.progress.advance()
    content = {"building": title, "cases": cases}
    return job.write(name, content, _text(cases), packages=("openseespy",), answer=counted(cases))


def random_frame(rng: np.random.Generator) -> str:
    """A file of a frame of two or three stories, one bay wide and one or two long."""
    across = np.cumsum([0.0, *rng.uniform(3.5, 7.5, rng.integers(1, 3))]).round(1)
    width, ends, thick = rng.uniform(3.5, 7.0), "ABC"[len(across) - 1], rng.integers(10, 26, 3)
    lines = ", ".join(f'{name} = "{x} m"' for name, x in zip("ABC", across, strict=False))
    heights = rng.uniform(2.8, 4.2, rng.integers(2, 4)).round(1)
    stories = ", ".join(f'{{name = "S{k}", height = "{h} m"}}' for k, h in enumerate(heights, 1))
    column, beam = rng.integers(25, 61, 2), rng.integers((20, 40), (36, 71))
    walls = [("P", "A", "B"), ("Q", "A", "B"), (ends, "P", "Q")]
    stand = rng.uniform(size=3) < 0.4
    return f"""name = "random"
kind = "frame"
grid = {{x = {{{lines}}}, y = {{P = "0 m", Q = "{width:.1f} m"}}}}
stories = [{stories}]
mesh.size = "{rng.choice([0.7, 0.85, 1.0])} m"
reduction.tolerance = 0.01
tolerances.mass = "0 %"
frequency_grid = {{start = "0.1 Hz", step = "0.1 Hz", count = 250}}
prior = {{theta = {{lower = "1/3", upper = 3}}, zeta = {{lower = 0.003, upper = 0.06}}}}
damping = {{law = "constant", ratio = 0.02}}
sensors = {{direction = "x", points = ["A-P", "{ends}-Q"]}}
materials.concrete = {{youngs_modulus = "27 GPa", poisson_ratio = 0.2, density = "2400 kg/m3"}}
sections.column = {{shape = "rectangle", width = "{column[0]} cm", depth = "{column[1]} cm"}}
sections.beam = {{shape = "rectangle", width = "{beam[0]} cm", depth = "{beam[1]} cm"}}
columns = [{{section = "column"}}]
beams = [{{section = "beam"}}]
slabs = [{{x = ["A", "{ends}"], y = ["P", "Q"], thickness = "{rng.integers(12, 23)} cm"}}]
""" + "".join(
        f'[[walls]]\nalong = "{line}"\nfrom = "{start}"\nto = "{end}"\nthickness = "{t} cm"\n'
        for (line, start, end), t, there in zip(walls, thick, stand, strict=True)
        if there
    )


def _truths() -> dict[str, Make]:
    """What may make the data, by its name."""
    meshes: dict[str, Make] = {f"mesh of {ratio:g}": partial(meshed, ratio) for ratio in _FINER}
    shells = {f"OpenSees, {shell}": partial(_by_opensees, shell) for shell in SHELLS}
    # In turn, so that a run that was stopped early has some of both.
    return dict(pair for both in zip(meshes.items(), shells.items(), strict=True) for pair in both)


def _by_opensees(shell: str, building: FrameBuilding, theta: Floats) -> ReducedModel:
    return opensees_model(building, theta, _LIKE_OURS * building.mesh.size, shell)


def meshed(ratio: float, building: FrameBuilding, theta: Floats) -> ReducedModel:
    """All modes below the sampling rate's half, and floors that are the means of their sensors."""
    fine = fine_model(building, ratio * building.mesh.size)
    model = truth_of(fine, theta, damping_law(building), 0.5 * RATE_HZ).system.model
    own = sensor_rows(building, fine)
    rows = np.array([model.floor_shapes[own[floor]].mean(axis=0) for floor in own])
    return replace(model, floor_shapes=rows, floors=building.floors, rotation=None)


def sensor_rows(building: FrameBuilding, seen: FineModel) -> dict[str, list[int]]:
    """Rows of the building's own sensors on every floor, whose mean it is observed by."""
    found: dict[str, list[int]] = {floor: [] for floor in building.floors}
    for row, (channel, place) in enumerate(zip(seen.channels, seen.places, strict=True)):
        asked = building.sensors.of(channel.floor)[1]
        if asked == ALL or frozenset(place.split("-")) in [frozenset(p.split("-")) for p in asked]:
            found[channel.floor].append(row)
    return found


def _case(
    plan: CoveragePlan,
    model: Study,
    file: str,
    kind: tuple[str, Make],
    motion: str,
    rng: np.random.Generator,
) -> Case:
    building = load_building(file)
    assert isinstance(building, FrameBuilding)
    with_finer_mesh(model, open_study(model, file))
    started = time.process_time()
    theta = np.exp(rng.uniform(np.log(_THETA[0]), np.log(_THETA[1]), len(building.stories)))
    zeta = float(np.exp(rng.uniform(np.log(_ZETA[0]), np.log(_ZETA[1]))))
    base = base_motion(motion, rng)
    truth = kind[1](building, theta)
    with TemporaryDirectory() as name:
        study = Study(shutil.copytree(model.folder, Path(name) / "study"))
        path = written(Path(name), truth, zeta, base, rng)
        settings = CalibrationSettings(particles=plan.particles, exact=True, anyway=True)
        source = ObservationSource(path)
        report = calibrate_study(study, open_study(study), source, settings)
    draws, ratio = report.posterior.samples, report.posterior.zeta_samples
    assert ratio is not None
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    return Case(
        truth=kind[0],
        motion=motion,
        theta=theta,
        zeta=zeta,
        mean=draws.mean(axis=0),
        sd=draws.std(axis=0),
        low=low,
        high=high,
        zeta_low=float(np.quantile(ratio, 0.05)),
        zeta_high=float(np.quantile(ratio, 0.95)),
        misfit=report.misfit,
        seconds=time.process_time() - started,
    )


def written(
    folder: Path, truth: ReducedModel, zeta: float, base: GroundMotion, rng: np.random.Generator
) -> Path:
    """What noisy sensors at the base and on all floors record."""
    moved = floor_histories(
        System(truth),
        np.zeros((1, 0)),
        zeta,
        base.acceleration,
        base.time_step,
        oversampling=16,
        tolerance=0.0,
    ).floor_acceleration[0]
    exact = np.vstack([base.acceleration, moved])
    noise = rng.uniform(*_NOISE) * base.acceleration.std()
    channels = tuple(FloorChannel(floor, floor) for floor in (BASE, *truth.floors))
    seen = exact + noise * rng.standard_normal(exact.shape)
    histories = Histories(base.time_step, channels, seen, "simulated frame")
    return write_observation_histories(folder / "observation.csv", histories)


def counted(cases: list[Case]) -> dict[str, float]:
    held = np.concatenate([case.held for case in cases])
    away = np.concatenate([case.away for case in cases])
    relative = np.concatenate([case.sd / case.theta for case in cases])
    return {
        "cases": len(cases),
        "within_90": float(held.mean()),
        "rms_z": float(np.sqrt((away**2).mean())),
        "median_sd": float(np.median(relative)),
        "zeta_within_90": float(np.mean([case.zeta_held for case in cases])),
    }


def _text(cases: list[Case]) -> str:
    groups = {"all": cases}
    for kind in ("truth", "motion"):
        names = dict.fromkeys(getattr(case, kind) for case in cases)
        groups |= {name: [c for c in cases if getattr(c, kind) == name] for name in names}
    rows = []
    for name, some in groups.items():
        found = counted(some)
        rows.append(
            [
                name,
                str(len(some)),
                f"{found['within_90']:.0%}",
                f"{found['rms_z']:.2f}",
                f"{found['median_sd']:.2%}",
                f"{found['zeta_within_90']:.0%}",
            ]
        )
    head = [
        "truth or motion",
        "cases",
        "factors within 90 %",
        "error over sd, rms",
        "median sd",
        "damping within 90 %",
    ]
    return markdown_table(head, rows)
