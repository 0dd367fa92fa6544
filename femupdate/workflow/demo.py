"""demo: the whole chain on the shipped example."""

import json
import time
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from femupdate.progress import Progress, Silent
from femupdate.report.figure import save_figure
from femupdate.report.plot_posterior import SampleSet, posterior_pairs
from femupdate.study import Study
from femupdate.workflow.build import BuildReport, build_study
from femupdate.workflow.calibrate import CalibrationReport, calibrate_study
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.model import DEFAULT_BUILDING
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.predict import PredictionReport, predict_study
from femupdate.workflow.predict_settings import RecordSource
from femupdate.workflow.render import RenderedMode, render_study

_OBSERVATION = "six_story_white_noise.csv"
_TRUTH = "six_story_white_noise.truth.json"
_RECORD = "records/ridgecrest_2019_clc_90.csv"
# The specimen is a 3/10 model shaken gently: a tenth of the record keeps it linear.
_SCALE = 0.1


@dataclass(frozen=True)
class DemoReport:
    """All that the demo made.

    Attributes:
        built: the model.
        all_floors: posterior from all six floors (Case 1); it stays in the study.
        roof_alone: mean and sd of each factor from the roof alone (Case 2).
        truth: the stiffness factors with which the observation was made.
        predicted: response to the Ridgecrest record.
        rendered: mode shapes.
        pictures: all pictures drawn.
        seconds: in all.
    """

    built: BuildReport
    all_floors: CalibrationReport
    roof_alone: CalibrationReport
    truth: tuple[float, ...]
    predicted: PredictionReport
    rendered: tuple[RenderedMode, ...]
    pictures: tuple[Path, ...]
    seconds: float


def run_demo(study: Study, seed: int = 0, progress: Progress | None = None) -> DemoReport:
    """Build, calibrate with all floors and with the roof alone, predict, render."""
    show = progress or Silent()
    started = time.monotonic()
    examples = files("femupdate.examples")
    show.say("1/5 The six-story building: mesh, modes, reduced model")
    built = build_study(study, DEFAULT_BUILDING, show)
    with (
        as_file(examples / _OBSERVATION) as observation,
        as_file(examples / _RECORD) as record,
    ):
        show.say("2/5 Posterior from the roof alone (Case 2)")
        settings = CalibrationSettings(seed=seed)
        source = ObservationSource(observation, sensors=("RF",))
        roof = calibrate_study(study, built.model, source, settings, show)
        show.say("3/5 Posterior from all six floors (Case 1)")
        source = ObservationSource(observation)
        everything = calibrate_study(study, built.model, source, settings, show)
        show.say("4/5 Response to a tenth of the 2019 Ridgecrest record")
        predicted = predict_study(
            study, built.model, RecordSource(record, scale=_SCALE), progress=show
        )
    show.say("5/5 Mode shapes of the posterior")
    rendered = render_study(study, built.model, progress=show)
    truth = tuple(json.loads((examples / _TRUTH).read_text(encoding="utf-8"))["theta"])
    both = _draw_cases(study, everything, roof, truth)
    pictures = (
        *built.pictures,
        both,
        *everything.pictures,
        *predicted.pictures,
        *(mode.picture for mode in rendered),
    )
    return DemoReport(
        built,
        everything,
        roof,
        truth,
        predicted,
        rendered,
        pictures,
        time.monotonic() - started,
    )


def _draw_cases(
    study: Study, everything: CalibrationReport, roof: CalibrationReport, truth: tuple[float, ...]
) -> Path:
    posterior = everything.posterior
    figure = posterior_pairs(
        [
            SampleSet("roof alone", roof.posterior.samples),
            SampleSet("all six floors", posterior.samples),
        ],
        [name.replace("theta_", "θ") for name in posterior.names],
        np.column_stack([posterior.lower, posterior.upper]),
        truth,
    )
    return save_figure(figure, study.path("pictures", "posterior_cases.png"))
