"""The Python interface: what the commands do, as functions of a study and its measured files.

    import femupdate

    study = femupdate.Study("house")
    print(*femupdate.calibrate(study, "run.csv", building="shear_3dof").lines(), sep="\\n")

Every result has its figures as attributes, `as_dict()` for programs and `lines()` for people. Of a
study its folder will do. All raise `FemupdateError`, whose text says what to do.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack, get_type_hints

from annotated_types import Ge, Interval

from femupdate.errors import FemupdateError, close
from femupdate.lazy import lazily
from femupdate.progress import SILENT, Progress
from femupdate.study import MAIN_POSTERIOR, Study, study_of, timed

if TYPE_CHECKING:
    from femupdate.measurement.observation import Observation
    from femupdate.measurement.record import GroundMotion
    from femupdate.report.prediction import Prediction
    from femupdate.result import Told
    from femupdate.simulation.simulate import WrittenSimulation
    from femupdate.workflow.calibration_report import CalibrationReport
    from femupdate.workflow.compare import CompareReport
    from femupdate.workflow.diagnose import DiagnosisReport
    from femupdate.workflow.model import StudyModel
    from femupdate.workflow.repair import RepairReport
    from femupdate.workflow.status import StatusReport
    from femupdate.workflow.train import Trained

Folder = Study | Path | str
File = Path | str


class Reading(TypedDict, total=False):
    """How measured files are read."""

    unit: str | None  # of accelerations, where a file gives none
    columns: Mapping[str, str] | None  # our column names to the file's names or numbers
    rate: float | None  # samples a second, of a table without times
    sensors: str | Sequence[str]  # floors to use
    band_hz: tuple[float, float] | None
    force: str | None  # floor at which a force acts
    mode_error: float | None  # of the model's own ln f


class Sampling(Reading, total=False):
    """How `calibrate` reads and samples, see `CalibrationSettings`."""

    exact: bool
    particles: Annotated[int, Ge(200)]
    chains: Annotated[int, Ge(1)]
    seed: int
    anyway: bool


class Judging(Reading, total=False):
    """How `diagnose` and `repair` read and judge, see `DiagnosisSettings`."""

    seed: int
    least_frequency: Annotated[float, Interval(ge=0.0, le=1.0)]
    least_response: Annotated[float, Interval(ge=0.0, le=1.0)]


class Predicting(TypedDict, total=False):
    """How `predict` works, see `PredictionSettings`."""

    samples: Annotated[int, Ge(2)]
    damping: Annotated[float, Interval(ge=0.0, le=1.0)] | None
    seed: int
    spectrum_damping: Annotated[float, Interval(ge=0.0, lt=1.0)] | None
    members: tuple[Any, ...]
    member_draws: Annotated[int, Ge(2)]
    scatter: float | None
    damping_scatter: float | None


class Training(TypedDict, total=False):
    """How `train` works, see `TrainingSettings`."""

    epochs: int
    batch: int
    seed: int


class Simulating(TypedDict, total=False):
    """What `simulate` makes, see `SimulationSettings`."""

    theta: tuple[float, ...] | None
    zeta: float | None
    mesh_size: float | None
    sensors: Any
    base_motion: Any  # a GroundMotion
    duration_s: float
    sampling_hz: float
    rms_m_s2: float
    band_hz: tuple[float, float]
    rotation_rms: float | None
    vertical_at: tuple[float, ...]
    sensor_noise_m_s2: float
    quantisation_m_s2: float | None
    effects: tuple[tuple[str, tuple[float, ...]], ...]
    seed: int


def reduce(
    study: Folder, building: File | None = None, *, progress: Progress = SILENT
) -> "StudyModel":
    """The building of a study with its reduced model, made where the study has none.

    Args:
        building: its file or its shipped name; by default that of the study.

    Raises:
        BuildingError, StructureError: the building cannot be read or cannot stand.
        StudyError: the study holds another building.
    """
    from femupdate.workflow.model import open_study

    return open_study(study_of(study), _name(building), progress)


def train(
    study: Folder,
    building: File | None = None,
    *,
    samples: int = 50_000,
    fresh: bool = False,
    device: str = "cpu",
    progress: Progress = SILENT,
    **settings: Unpack[Training],
) -> "Trained":
    """Train the surrogate of a study's building, unless a fitting one is there.

    Args:
        samples: simulated responses to learn from.
        fresh: train even where a fitting surrogate exists.
        device: of torch, for the training.

    Raises:
        SurrogateError: too few samples, or no surrogate serves the building.
        StudyError: the study has no building and none is named.
    """
    from femupdate.workflow.train import (
        check_device,
        check_training,
        default_settings,
        train_study,
    )

    opened, name, (_, rest) = study_of(study), _name(building), _parted(settings, Training)
    check_device(device)
    check_training(opened, samples, rest.get("batch", 512), name)
    model = reduce(opened, name, progress=progress)
    chosen = default_settings(model, **rest)
    how: dict[str, Any] = {"fresh": fresh, "progress": progress, "device": device}
    return train_study(opened, model, samples, chosen, **how)


def calibrate(
    study: Folder,
    *files: "File | Observation",
    building: File | None = None,
    name: str = MAIN_POSTERIOR,
    progress: Progress = SILENT,
    **settings: Unpack[Sampling],
) -> "CalibrationReport":
    """Draw the posterior of the stiffness factors from measured files.

    Args:
        files: of one building, of any kind that the command takes; or arrays (`Observation`).
        name: of the posterior in the study.
        settings: how files are read (`Reading`) and the posterior is drawn (`Sampling`).

    Raises:
        MeasurementError: a file cannot be used, or belongs to another building.
        InferenceError: the sampler cannot go on.
    """
    from femupdate.workflow.calibrate import calibrate_study, check_calibration
    from femupdate.workflow.likelihoods import CalibrationSettings
    from femupdate.workflow.observed import readable

    opened, (reading, rest) = Study(study_of(study).folder, name), _parted(settings, Sampling)
    chosen = CalibrationSettings(**rest)
    source = readable(opened, reading, *_files(opened, files))
    check_calibration(opened, source, chosen, _name(building))
    with opened.whole():
        model = reduce(opened, building, progress=progress)
        return calibrate_study(opened, model, source, chosen, progress)


def predict(
    study: Folder,
    record: "File | GroundMotion",
    *,
    unit: str | None = None,
    channel: str | int | None = None,
    scale: float = 1.0,
    measured: File | None = None,
    columns: Mapping[str, str] | None = None,
    rate: float | None = None,
    progress: Progress = SILENT,
    **settings: Unpack[Predicting],
) -> "Prediction":
    """Predict the response of a calibrated building to a ground motion.

    Args:
        study: with a posterior; `Study(folder, "roof")` is that with the posterior "roof".
        record: file of the motion, or the motion.
        unit: of its accelerations, where the file gives none.
        channel: of the record, by name or number.
        scale: factor on the acceleration.
        measured: file with the floors measured in the same motion, to compare.
        columns: its column names, ours to the file's.
        rate: samples a second, of a table without times.

    Raises:
        MeasurementError: the record or what was measured cannot be used.
        StudyError: there is no posterior, or it is of another building.
    """
    from femupdate.workflow.model import open_calibrated
    from femupdate.workflow.predict import PredictionSettings, RecordSource, predict_study

    opened, (_, rest) = study_of(study), _parted(settings, Predicting)
    (path,) = _files(opened, [record])
    before = opened.reading_of(path)
    unit, columns = unit or before.get("unit"), timed(columns, rate) or before.get("columns")
    return predict_study(
        opened,
        open_calibrated(opened, progress),
        RecordSource(path, unit, channel, scale),
        PredictionSettings(**rest),
        measured=None if measured is None else Path(measured),
        columns=columns,
        progress=progress,
    )


def diagnose(
    study: Folder,
    *files: "File | Observation",
    building: File | None = None,
    progress: Progress = SILENT,
    **settings: Unpack[Judging],
) -> "DiagnosisReport":
    """Find where model and measurement disagree, and what is missing in the model.

    Args:
        files: of one building, of any kind that `calibrate` takes.
        settings: how files are read (`Reading`) and judged (`Judging`).

    Raises:
        MeasurementError: a file cannot be used.
        BuildingError: an effect of the building's file cannot be.
    """
    from femupdate.discrepancy.thresholds import DiagnosisSettings
    from femupdate.workflow.diagnose import diagnose_study
    from femupdate.workflow.observed import readable

    opened, (how, rest) = study_of(study), _parted(settings, Judging)
    source = readable(opened, how, *_files(opened, files))
    chosen = DiagnosisSettings(**rest)
    with opened.whole():
        model = reduce(opened, building, progress=progress)
        return diagnose_study(opened, model, source, chosen, progress)


def repair(
    study: Folder,
    *files: "File | Observation",
    building: File | None = None,
    holdout: File | None = None,
    progress: Progress = SILENT,
    **settings: Unpack[Judging],
) -> "RepairReport":
    """Add to the model what the data show to be missing, as a study inside the study.

    Args:
        holdout: data that are only predicted, before and after.
        settings: and all other arguments, see `diagnose`.

    Raises:
        MeasurementError: a file cannot be used.
        BuildingError: an effect of the building's file cannot be.
    """
    from femupdate.discrepancy.thresholds import DiagnosisSettings
    from femupdate.workflow.observed import readable
    from femupdate.workflow.repair import repair_study

    opened, (how, rest) = study_of(study), _parted(settings, Judging)
    source = readable(opened, how, *_files(opened, files))
    kept_out = None if holdout is None else readable(opened, how, Path(holdout))
    chosen = DiagnosisSettings(**rest)
    with opened.whole():
        model = reduce(opened, building, progress=progress)
        return repair_study(opened, model, source, kept_out, chosen, progress)


def compare(
    study: Folder, before: str, after: str, *, columns: Mapping[str, str] | None = None
) -> "CompareReport | Told":
    """Which stories changed between two posteriors, or how alike two sets of modes or FRFs are.

    Args:
        before, after: names of posteriors of the study, study folders or posterior files; or two
            files of modes; or files of FRFs or records, one of which may be a posterior instead.
        columns: our column name to that of the files, or to points of universal files of modes.

    Raises:
        StudyError: there is no such posterior.
        InferenceError: they come from the same measurement.
        MeasurementError: files are of no modes, or share no two floors.
    """
    from femupdate.workflow.compare import (
        compare_frfs,
        compare_modes,
        compare_states,
        find_state,
    )

    opened, files = study_of(study), [Path(name) for name in (before, after)]
    measured = [file for file in files if file.is_file() and file.suffix != ".nc"]
    if measured:
        from femupdate.measurement.reader import read_measured

        for name in {before, after} - set(map(str, measured)):
            find_state(name, opened)
        read = [read_measured(file) for file in measured]
        if len(read) == 2 and any(one.modes or one.mode_table is not None for one in read):
            return compare_modes(files[0], files[1], columns)
        return compare_frfs(before, after, opened, columns)
    return compare_states(find_state(before, opened), find_state(after, opened))


def simulate(
    building: File, path: File, *, progress: Progress = SILENT, **settings: Unpack[Simulating]
) -> "WrittenSimulation":
    """Make a synthetic observation of a building with known stiffness factors, as a CSV file.

    Args:
        building: its file or its shipped name.
        path: of the file; the truth goes beside it.

    Raises:
        BuildingError: the building cannot be read.
        MeasurementError: the file cannot be written.
    """
    from femupdate.building.files import load_building
    from femupdate.simulation.simulate import (
        SimulationSettings,
        simulate_observation,
        write_simulation,
    )

    chosen = SimulationSettings(**_parted(settings, Simulating)[1])
    made = simulate_observation(load_building(building), chosen, progress)
    return write_simulation(made, Path(path))


def status(study: Folder) -> "StatusReport":
    """What a study holds, what is stale, and what to do next."""
    from femupdate.workflow.status import study_status

    return study_status(study_of(study))


def _parted(settings: Mapping[str, Any], known: type[Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Keywords that say how files are read, where a function reads some, and the others.

    Raises:
        FemupdateError: one is not known, or has a value that it cannot have.
    """
    from pydantic import ConfigDict, ValidationError, create_model

    names = get_type_hints(known, include_extras=True)
    for name in settings:
        if name not in names:
            raise FemupdateError(f"there is no keyword {name!r}{close(name, names)}")
    coerced = ConfigDict(coerce_numbers_to_str=True)
    fields: dict[str, Any] = {name: (names[name], ...) for name in settings}
    plain = {k: v.tolist() if hasattr(v, "tolist") else v for k, v in settings.items()}
    try:
        model = create_model("Settings", __config__=coerced, **fields).model_validate(plain)
    except ValidationError as error:
        wrong = error.errors()[0]
        raise FemupdateError(
            f"{wrong['loc'][0]}={settings[str(wrong['loc'][0])]!r}: "
            + wrong["msg"].replace("Input", "it")
        ) from None
    chosen = {name: getattr(model, name) for name in settings}
    if (band := chosen.get("band_hz")) and not band[0] < band[1]:
        raise FemupdateError(f"band_hz={band}: write the lowest frequency first")
    if "sensors" in chosen and known is not Simulating:
        floors = chosen["sensors"]
        chosen["sensors"] = tuple(floors.split(",") if isinstance(floors, str) else floors)
    if rate := chosen.pop("rate", None):
        chosen["columns"] = timed(chosen.get("columns"), rate)
    reads = set(Reading.__annotations__) if set(Reading.__annotations__) <= set(names) else set()
    how = {name: value for name, value in chosen.items() if name in reads}
    return how, {name: value for name, value in chosen.items() if name not in reads}


def _files(study: Study, given: "Sequence[File | Observation | GroundMotion]") -> list[Path]:
    """Paths; arrays become files of the study, so that what is made from them can be made again."""
    from femupdate.measurement.observation import Observation
    from femupdate.measurement.record import GroundMotion
    from femupdate.measurement.write import write_frfs, write_observation_histories

    paths = []
    for data in given:
        if isinstance(data, str | Path):
            paths.append(Path(data))
            continue
        if isinstance(data, GroundMotion):
            base = {"base": data.acceleration}
            data = Observation.from_accelerations(data.time_step, base, source=data.name)
        if not isinstance(data, Observation):
            raise FemupdateError(
                f"a {type(data).__name__} is no measurement; give names of files, or arrays by "
                "Observation.from_accelerations or Observation.from_arrays"
            )
        path, histories = path_of(study, data), data.histories
        if histories is not None and not data.frequency_hz.size:
            paths.append(write_observation_histories(path, histories))
        else:
            paths.append(write_frfs(path, data))
    if not paths:
        raise FemupdateError("no measured file is named; give one or more after the study")
    return paths


def path_of(study: Folder, data: "File | Observation | GroundMotion") -> Path:
    """Of a measured file, or where a study keeps arrays."""
    if isinstance(data, str | Path):
        return Path(data)
    name = str(getattr(data, "source", None) or getattr(data, "name", ""))
    return study_of(study).path("measured", f"{Path(name).stem}.csv")


def _name(building: File | None) -> str | None:
    return None if building is None else str(building)


# Functions that take a study or files already, by their modules.
_OF_WORKFLOW = {
    "build_model": "build",
    "catalogue": "shipped:list_all",
    "copy_examples": "shipped",
    "demo": "demo:run_demo",
    "identify": "inspect_files",
    "inspect": "inspect_files",
    "render": "render:render_study",
    "write_report": "page",
}
__getattr__ = lazily("femupdate.workflow", _OF_WORKFLOW)
