"""What a study keeps of its building's mesh error."""

import json

import pytest

from femupdate.building.files import load_building
from femupdate.discrepancy.mesh_error import MeshError
from femupdate.study import Study
from femupdate.workflow.mesh_error import keep_mesh_error, kept_mesh_error

LEARNED = MeshError(
    ("wall_stiffness@ground", "cracked_beams@upper"),
    (-0.02, 0.05),
    (0.001, 0.006),
    2e-3,
    0.02,
    3e-3,
    0.01,
)


@pytest.fixture
def kept(tmp_path):
    study, building = Study(tmp_path), load_building("two_story_openings")
    keep_mesh_error(study, building, LEARNED)
    return study, building


def test_it_comes_back_as_it_was_learned(kept):
    assert kept_mesh_error(*kept) == LEARNED


def test_that_of_another_mesh_is_not_taken(kept):
    study, building = kept
    finer = building.model_copy(update={"mesh": building.mesh.model_copy(update={"size": 0.2})})
    assert kept_mesh_error(study, finer) is None


@pytest.mark.parametrize("missing", [("points",), ("effect", "shape", "points")])
def test_one_that_was_learned_of_less_is_learned_again(kept, missing):
    path = next(kept[0].folder.glob("mesh_error.json"))
    content = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({k: v for k, v in content.items() if k not in missing}))
    assert kept_mesh_error(*kept) is None
