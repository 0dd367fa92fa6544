"""demo: that what it needs is shipped, and its chain of steps on a building of seconds."""

import json
import shutil
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from femupdate.building import load_building
from femupdate.measurement import GroundMotion, read_observation_file, read_record
from femupdate.report import draw
from femupdate.study import Study
from femupdate.surrogate import TrainingSettings
from femupdate.workflow import CalibrationSettings, demo, open_study, train_study
from tests.helpers import Recorded, write_record

EXAMPLES = files("femupdate.examples")


def test_what_the_demo_reads_is_shipped():
    building = load_building("six_story_wall_frame")
    observation = read_observation_file(Path(str(EXAMPLES / demo.OBSERVATION)))
    assert observation.floors == building.floors
    truth = json.loads((EXAMPLES / demo.TRUTH).read_text(encoding="utf-8"))
    assert len(truth["theta"]) == len(building.story_names)
    assert truth["building"] == building.name
    record = read_record(Path(str(EXAMPLES / demo.RECORD)))
    assert record.peak == pytest.approx(3.376, abs=0.001)


@pytest.fixture(scope="module")
def shipped(tmp_path_factory, tower_observation):
    """A folder of examples with the tower's files under the demo's names."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copy(tower_observation.path, folder / demo.OBSERVATION)
    (folder / demo.TRUTH).write_text(json.dumps({"theta": tower_observation.theta}))
    time = np.arange(500) * 0.02
    motion = GroundMotion(3.0 * np.exp(-0.5 * time) * np.sin(20.0 * time), 0.02)
    (folder / demo.RECORD).parent.mkdir()
    write_record(folder / demo.RECORD, motion)
    return folder


@pytest.fixture(scope="module")
def shown(tmp_path_factory, shipped, tower_file):
    """The demo on the tower, with a surrogate of little learning."""
    study = Study(tmp_path_factory.mktemp("demo") / "study")
    model = open_study(study, str(tower_file))
    train_study(study, model, 400, TrainingSettings(epochs=4, batch=64))
    log = Recorded()
    settings = CalibrationSettings(particles=400, seed=1)
    given = {"building": str(tower_file), "examples": shipped, "settings": settings}
    return demo.run_demo(study, progress=log, **given), study, log


def test_the_steps_are_told_in_order(shown):
    steps = [text.split()[0] for text in shown[2].said if text[0].isdigit()]
    assert steps == [f"{k}/5" for k in range(1, 6)]


def test_every_picture_shows_something(shown):
    report, study, _ = shown
    pictures = draw(report, study.path("pictures"))
    # That of the modes of the posterior is drawn already.
    everything = set(study.path("pictures").iterdir())
    assert len(set(pictures)) == len(everything) - 1 == 7
    for path in everything:
        assert imread(path)[..., :3].std() > 0.01, path
    assert study.path("pictures", "posterior_cases.png") in pictures


def test_the_demo_writes_the_tables_of_its_steps(shown):
    report, _, _ = shown
    names = {sheet.name for sheet in report.tables()}
    assert {"posterior", "frf_fit", "predicted_peaks", "floor_histories", "modes"} <= names
