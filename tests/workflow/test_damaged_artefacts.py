"""Artefacts that are not what they should be although the study's record has their hash."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femupdate.errors import StudyError
from femupdate.inference import Parameters, load_posterior, save_posterior
from femupdate.storage import read_arrays, write_arrays
from femupdate.study import MANIFEST, file_hash, write_text
from femupdate.workflow import (
    RecordSource,
    kept_mesh_error,
    kept_posterior,
    open_structure,
    open_study,
    predict_study,
    render_study,
    write_report,
)
from femupdate.workflow.effects import BASIS, MESH_ERROR, finder_origin

SHIPPED = Path(__file__).parents[2] / "examples" / "records" / "ridgecrest_2019_clc_90.csv"


def rerecorded(study, name):
    """Let the study's record have the hash of the file as it is now."""
    manifest = study.path(MANIFEST)
    content = json.loads(manifest.read_text())
    entry = content["artefacts"][name]
    entry["sha256"] = file_hash(study.path(entry["file"]))
    manifest.write_text(json.dumps(content))


def changed(**new):
    def change(path):
        write_arrays(path, **{**read_arrays(path), **new})

    return change


def without(name):
    def change(path):
        write_arrays(path, **{k: v for k, v in read_arrays(path).items() if k != name})

    return change


DAMAGES = {
    "junk": lambda path: path.write_bytes(bytes(range(256)) * 9),
    "nothing": lambda path: path.write_bytes(b""),
    "half": lambda path: path.write_bytes(path.read_bytes()[:2000]),
    "a missing array": without("excitation"),
    "another shape": changed(excitation=np.ones(7)),
    "not a number": changed(story_mass=np.array([np.nan, 1.0])),
    "text": changed(story_mass=np.array(["a", "b"])),
    "no header": without("header"),
    "a broken header": changed(header=np.array("{")),
    "a header without end": changed(header=np.array("[" * 100_000)),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_reduced_model_with_the_right_hash(tower, damage):
    path = tower.path("reduced_model.npz")
    DAMAGES[damage](path)
    rerecorded(tower, "reduced model")
    before = path.read_bytes()
    with pytest.raises(StudyError, match=r"reduced_model\.npz is not what .*remove it and run"):
        open_study(tower)
    assert path.read_bytes() == before
    path.unlink()
    open_study(tower)
    assert open_study(tower).reduced.floors == ("2F", "RF")


@pytest.mark.parametrize(
    ("basis", "message"),
    [
        (np.ones((3, 2)), "basis of 3 degrees of freedom"),
        (np.ones(3), r"basis has the shape \(3,\)"),
        (np.full((3, 2), np.inf), "holds a value that is no number"),
    ],
)
def test_a_basis_of_another_structure(cabin_study, basis, message):
    building = open_study(cabin_study).building
    path = cabin_study.path("effect_basis.npz")
    write_arrays(path, basis=basis)
    cabin_study.record(BASIS, path.name, "diagnose", finder_origin(building))
    with pytest.raises(StudyError, match=message):
        open_structure(cabin_study, building)


@pytest.mark.parametrize(
    "content",
    ["", "{", "[" * 100_000, '{"share_sd": 1}', '{"share_sd": 1, "labels": 3}'],
    ids=["empty", "cut", "without end", "keys missing", "no list"],
)
def test_a_mesh_error_that_is_none(cabin_study, content):
    building = open_study(cabin_study).building
    write_text(cabin_study.path("mesh_error.json"), content)
    cabin_study.record(MESH_ERROR, "mesh_error.json", "diagnose", finder_origin(building))
    with pytest.raises(StudyError, match=r"mesh_error\.json is not what femupdate writes there"):
        kept_mesh_error(cabin_study, building)


def of_other_factors(posterior):
    first, second, *rest = posterior.parameters.entries
    others = (replace(first, name="story_1"), replace(second, name="story_9"))
    return replace(posterior, parameters=Parameters((*others, *rest)))


def of_other_floors(posterior):
    observation = replace(posterior.observation, floors=("2F", "9F"))
    return replace(posterior, observation=observation)


@pytest.mark.parametrize("change", [of_other_factors, of_other_floors])
def test_a_posterior_of_another_building_with_the_right_hash(tower, tower_model, change):
    path = tower.path("posterior.nc")
    assert kept_posterior(tower, tower_model.building).names
    save_posterior(change(load_posterior(path)), path)
    rerecorded(tower, "posterior")
    message = r"the posterior in .* is not of tower: .*9.*run `femupdate calibrate` again"
    with pytest.raises(StudyError, match=message):
        render_study(tower, model=tower_model)
    with pytest.raises(StudyError, match=message):
        predict_study(tower, tower_model, RecordSource(SHIPPED))
    with pytest.raises(StudyError, match=message):
        write_report(tower)


def test_a_heap_without_end_in_a_posterior(tower):
    """Free space of no size in a heap of texts: HDF5 reads it for ever, and Ctrl-C is not heard."""
    path = tower.path("posterior.nc")
    data = bytearray(path.read_bytes())
    at = data.index(b"GCOL")
    data[at + 16 : at + 2000] = bytes(1984)
    path.write_bytes(data)
    with pytest.raises(StudyError, match=r"a heap of texts in it is damaged\)"):
        load_posterior(path)


def test_a_prediction_that_is_none(tower, tower_model):
    predict_study(tower, tower_model, RecordSource(SHIPPED))
    tower.path("prediction.nc").write_bytes(b"none")
    rerecorded(tower, "prediction")
    message = r"prediction\.nc cannot be read; run `femupdate predict --record FILE` again"
    with pytest.raises(StudyError, match=message):
        write_report(tower)
