"""demo: the whole chain on the shipped example."""

import json
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import as_file, files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING

from femupdate.building.document import factor_titles
from femupdate.progress import SILENT, Progress
from femupdate.report.quantities import quantity_tables
from femupdate.report.scale import plus_minus
from femupdate.result import Item, Note, Picture, Result, Told
from femupdate.study import Study, study_of
from femupdate.tables import Column, Table
from femupdate.workflow.build import DEFAULT_BUILDING, build_model
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.calibration_report import short_name
from femupdate.workflow.likelihoods import CalibrationSettings
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.predict import RecordSource, predict_study
from femupdate.workflow.render import render_study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OBSERVATION = "six_story_white_noise.csv"
TRUTH = "six_story_white_noise.truth.json"
RECORD = "records/ridgecrest_2019_clc_90.csv"
_ROOF = "roof"
"""Name of the posterior from the roof alone."""


@dataclass(frozen=True)
class DemoReport(Result):
    """Both posteriors beside the truth and the prediction; tables and pictures of all its parts."""

    told: tuple[Item, ...]
    parts: tuple[Result, ...]

    def items(self) -> Iterable[Item]:
        """As they were put together."""
        return self.told

    def tables(self) -> tuple[Table, ...]:
        """Those of the parts."""
        return tuple(table for part in self.parts for table in part.tables())

    def figures(self) -> Iterator[Picture]:
        """Those of the parts; those of modes of the posterior are drawn already."""
        for part in self.parts:
            yield from part.figures()


def run_demo(
    study: Study | Path | str,
    *,
    seed: int = 0,
    progress: Progress = SILENT,
    building: str = DEFAULT_BUILDING,
    examples: Traversable | None = None,
    settings: CalibrationSettings | None = None,
) -> DemoReport:
    """Run the whole chain on a shipped synthetic observation and a real ground motion.

    It builds, calibrates with all floors and with the roof alone, predicts and renders.

    Args:
        examples: a folder with the observation, its truth and the record; default the shipped ones.
    """
    started, study = time.monotonic(), study_of(study)
    examples = examples or files("femupdate.examples")
    progress.say("1/5 The six-story building: mesh, modes, reduced model")
    built = build_model(study, building, progress=progress)
    with as_file(examples / OBSERVATION) as observation, as_file(examples / RECORD) as record:
        progress.say("2/5 Posterior from the roof alone (Case 2)")
        settings = settings or CalibrationSettings(seed=seed)
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
    rendered = render_study(study, model=built.model, progress=progress)
    truth = tuple(json.loads((examples / TRUTH).read_text(encoding="utf-8"))["theta"])
    posterior, seconds = everything.posterior, time.monotonic() - started
    columns = [
        Column(list(factor_titles(built.model.building).values()), ""),
        Column(posterior.names, key="parameters"),
        Column(truth, "truth", [f"{true:.2f}" for true in truth], key="truth"),
    ]
    for head, key, draws in (
        ("all six floors", "", posterior.samples),
        ("roof alone", "roof_alone_", roof.posterior.samples),
    ):
        mean, sd = draws.mean(axis=0), draws.std(axis=0)
        cells = [plus_minus(*pair) for pair in zip(mean, sd, strict=True)][: len(truth)]
        columns += [Column(mean, head, cells, key=f"{key}mean"), Column(sd, key=f"{key}sd")]
    where = {"study": study.folder, "posterior": everything.path, "prediction": predicted.path}
    first, last = (
        "\nStiffness factors, mean ± sd (the observation is synthetic, so truth is known)",
        f"\nDone in {seconds:.0f} s. Everything is in {study.folder}; pictures and tables:",
    )
    floors = "\nFloors under a tenth of the Ridgecrest record, mean and 5 to 95 % in brackets"
    told: tuple[Item, ...] = (
        Note(first, where),
        Table(name="factors", columns=tuple(columns)),
        Note(floors),
        *quantity_tables([predicted.quantities["acceleration"]]),
        Note(last, {"seconds": seconds}),
    )

    def cases() -> "Figure":
        from femupdate.report.plot_posterior import posterior_pairs

        sets = {"roof alone": roof.posterior.samples, "all six floors": posterior.samples}
        names = [short_name(name) for name in posterior.names]
        return posterior_pairs(sets, names, posterior.bounds, truth)

    pairs = Told((), [Picture("posterior_cases", cases)])
    return DemoReport(told, (built, pairs, everything, predicted, rendered))
