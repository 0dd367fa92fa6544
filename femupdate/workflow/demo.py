"""demo: the whole chain on the shipped example."""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

from femupdate.building.parameters import factor_titles
from femupdate.progress import SILENT, Progress
from femupdate.report.prediction import Prediction
from femupdate.report.quantities import quantity_tables
from femupdate.report.scale import plus_minus
from femupdate.result import Item, Note, Result
from femupdate.study import Study
from femupdate.tables import Column, Table
from femupdate.workflow.build import BuildReport, build_study
from femupdate.workflow.calibrate import CalibrationReport, calibrate_study
from femupdate.workflow.likelihoods import CalibrationSettings
from femupdate.workflow.model import DEFAULT_BUILDING
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.predict import RecordSource, predict_study
from femupdate.workflow.render import RenderReport, draw_model, render_study
from femupdate.workflow.summary import short_name

_OBSERVATION = "six_story_white_noise.csv"
_TRUTH = "six_story_white_noise.truth.json"
_RECORD = "records/ridgecrest_2019_clc_90.csv"
_ROOF = "roof"
"""Name of the posterior from the roof alone."""


@dataclass(frozen=True, kw_only=True)
class DemoReport(Result):
    """All that the demo made.

    Attributes:
        all_floors: posterior from all six floors (Case 1).
        roof_alone: posterior from the roof alone (Case 2), kept under a name of its own.
        truth: the stiffness factors with which the observation was made.
        seconds: in all, without the pictures.
    """

    folder: Path
    built: BuildReport
    all_floors: CalibrationReport
    roof_alone: CalibrationReport
    truth: tuple[float, ...]
    predicted: Prediction
    rendered: RenderReport
    seconds: float

    def items(self) -> Iterator[Item]:
        """Both posteriors beside the truth, the prediction, and tables of all."""
        posterior, roof = self.all_floors.posterior, self.roof_alone.posterior
        yield Note(
            "\nStiffness factors, mean ± sd (the observation is synthetic, so truth is known)",
            {
                "study": self.folder,
                "posterior": self.all_floors.path,
                "prediction": self.predicted.path,
            },
        )
        names = factor_titles(self.built.model.building).values()
        count = len(names)
        columns = [
            Column(list(names), ""),
            Column(posterior.names, key="parameters"),
            Column(self.truth, "truth", [f"{true:.2f}" for true in self.truth], key="truth"),
        ]
        for head, key, draws in (
            ("all six floors", "", posterior.samples),
            ("roof alone", "roof_alone_", roof.samples),
        ):
            mean, sd = draws.mean(axis=0), draws.std(axis=0)
            cells = [plus_minus(*pair) for pair in zip(mean, sd, strict=True)]
            columns += [
                Column(mean, head, cells[:count], key=f"{key}mean"),
                Column(sd, key=f"{key}sd"),
            ]
        yield Table(name="factors", columns=tuple(columns))
        yield Note(
            "\nFloors under a tenth of the Ridgecrest record, mean and 5 to 95 % in brackets"
        )
        yield from quantity_tables([self.predicted.quantities["acceleration"]])
        yield Note(
            f"\nDone in {self.seconds:.0f} s. Everything is in {self.folder}; pictures and tables:",
            {"seconds": self.seconds},
        )

    def tables(self) -> tuple[Table, ...]:
        """Those of the posterior from all floors, of the prediction and of the modes."""
        made = (self.all_floors, self.predicted, self.rendered)
        return tuple(table for result in made for table in result.tables())


def run_demo(study: Study, seed: int = 0, progress: Progress = SILENT) -> DemoReport:
    """Build, calibrate with all floors and with the roof alone, predict, render."""
    started = time.monotonic()
    examples = files("femupdate.examples")
    progress.say("1/5 The six-story building: mesh, modes, reduced model")
    built = build_study(study, DEFAULT_BUILDING, progress)
    with as_file(examples / _OBSERVATION) as observation, as_file(examples / _RECORD) as record:
        progress.say("2/5 Posterior from the roof alone (Case 2)")
        settings = CalibrationSettings(seed=seed)
        source = ObservationSource(observation, sensors=("RF",))
        roof = calibrate_study(Study(study.folder, _ROOF), built.model, source, settings, progress)
        progress.say("3/5 Posterior from all six floors (Case 1)")
        source = ObservationSource(observation)
        everything = calibrate_study(study, built.model, source, settings, progress)
        progress.say("4/5 Response to a tenth of the 2019 Ridgecrest record")
        # The specimen is a 3/10 model shaken gently: a tenth of the record keeps it linear.
        predicted = predict_study(
            study, built.model, RecordSource(record, scale=0.1), progress=progress
        )
    progress.say("5/5 Mode shapes of the posterior")
    rendered = render_study(study, built.model, progress=progress)
    truth = tuple(json.loads((examples / _TRUTH).read_text(encoding="utf-8"))["theta"])
    return DemoReport(
        folder=study.folder,
        built=built,
        all_floors=everything,
        roof_alone=roof,
        truth=truth,
        predicted=predicted,
        rendered=rendered,
        seconds=time.monotonic() - started,
    )


def draw_demo(study: Study, report: DemoReport, progress: Progress = SILENT) -> tuple[Path, ...]:
    """Draw model, posteriors and prediction; the modes are drawn already."""
    from femupdate.report.figure import draw, save_figure
    from femupdate.report.plot_posterior import SampleSet, posterior_pairs

    cases = {"roof alone": report.roof_alone, "all six floors": report.all_floors}
    first = report.roof_alone.posterior
    pairs = posterior_pairs(
        [SampleSet(name, case.posterior.samples) for name, case in cases.items()],
        [short_name(name) for name in first.names],
        first.bounds,
        report.truth,
    )
    folder = study.path("pictures")
    return (
        *draw_model(study, report.built.model, report.built.modes, progress),
        save_figure(pairs, folder / "posterior_cases.png"),
        *draw(report.all_floors, folder, progress),
        *draw(report.predicted, folder, progress),
        *report.rendered.pictures,
    )
