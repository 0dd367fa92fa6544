"""The main job without the command line: calibrate the six-story building, predict, draw.

Run it from anywhere: python examples/calibrate_and_predict.py [STUDY_FOLDER]
"""

import sys
from importlib.resources import as_file, files
from pathlib import Path

from femupdate.report.figure import draw
from femupdate.study import Study
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.likelihoods import CalibrationSettings
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource
from femupdate.workflow.predict import RecordSource, predict_study

EXAMPLES = files("femupdate.examples")


def main(folder: Path) -> None:
    """Calibrate on the shipped observation and predict a tenth of the Ridgecrest record."""
    study = Study(folder)
    model = open_study(study, "six_story_wall_frame")
    with as_file(EXAMPLES / "six_story_white_noise.csv") as observation:
        calibrated = calibrate_study(
            study, model, ObservationSource(observation), CalibrationSettings(particles=2000)
        )
    draws = calibrated.posterior.samples
    for name, mean, sd in zip(
        calibrated.posterior.names, draws.mean(axis=0), draws.std(axis=0), strict=True
    ):
        print(f"{name}  {mean:.3f} ± {sd:.3f}")
    with as_file(EXAMPLES / "records" / "ridgecrest_2019_clc_90.csv") as record:
        predicted = predict_study(study, model, RecordSource(record, scale=0.1))
    for floor, peak in zip(predicted.summary.floors, predicted.peak_acceleration.mean, strict=True):
        print(f"{floor}  peak {peak:.2f} m/s2")
    for result in (calibrated, predicted):
        print(*draw(result, study.result("pictures")), sep="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("study"))
