"""A station archive, from `inspect` to the posterior by the command that it proposes."""

import shlex
import zipfile

import numpy as np
import pytest

from femupdate.measurement import read_observation_file
from tests.cli.commands import femupdate

PLACES = {"base": "Basement", "2F": "2nd floor, north wall", "RF": "Roof"}


def esm(values, time_step, place):
    head = {
        "EVENT_NAME": "SIMULATED",
        "STATION_NAME": place,
        "SAMPLING_INTERVAL_S": f"{time_step:.6f}",
        "NDATA": len(values),
        "UNITS": "cm/s^2",
        "STREAM": "HNE",
    }
    lines = [*(f"{key}: {value}" for key, value in head.items()), *(f"{v:.6f}" for v in values)]
    return "\n".join(lines) + "\n"


@pytest.fixture
def archive(tmp_path, tower_observation):
    data = read_observation_file(tower_observation.path)
    path = tmp_path / "station.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for number, (channel, row) in enumerate(zip(data.channels, data.acceleration, strict=True)):
            text = esm(100.0 * row, data.time_step, PLACES[channel.floor])
            packed.writestr(f"{number}.asc", text)
    return path


def test_inspect_proposes_the_command_that_calibrates(
    archive, tower_file, tower_observation, tmp_path
):
    (one,) = femupdate("inspect", archive, "--json").answer["files"]
    assert one["next"] == f"femupdate calibrate {archive} --columns base=1,2F=2,RF=3"
    options = ("--building", tower_file, "--exact", "--particles", 200, "--chains", 1, "--json")
    answers = [
        femupdate(*words, *options, "--study", tmp_path / f"study {number}").answer
        for number, words in enumerate(
            [shlex.split(one["next"])[1:], ["calibrate", tower_observation.path]]
        )
    ]
    assert answers[0]["floors"] == ["2F", "RF"]
    # The same numbers but for their printed digits.
    np.testing.assert_allclose(answers[0]["mean"], answers[1]["mean"], rtol=1e-3)
