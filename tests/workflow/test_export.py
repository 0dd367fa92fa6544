"""build-model --export: the building in another program."""

import importlib.util
import json
import re
import subprocess
import sys

import numpy as np
import pytest

from femupdate.building import load_building
from femupdate.effects import structure_of
from femupdate.errors import StudyError
from femupdate.study import Study
from femupdate.workflow.build import export_opensees


def test_a_building_has_the_same_frequencies_in_opensees(cabin_file, tmp_path):
    if importlib.util.find_spec("openseespy") is None:
        pytest.skip("OpenSeesPy is not installed")
    from femupdate.fe import lowest_modes

    text = cabin_file.read_text(encoding="utf-8")
    (tmp_path / "fine.toml").write_text(re.sub(r"size = .*", 'size = "0.5 m"', text))
    building = load_building(tmp_path / "fine.toml")
    script = export_opensees(Study(tmp_path), building, modes=5)
    done = subprocess.run([sys.executable, script, "--json"], capture_output=True, text=True)
    if "libblas" in done.stderr:
        pytest.skip("OpenSeesPy lacks BLAS on this system")
    assert done.returncode == 0, done.stderr
    theirs = json.loads(done.stdout.strip().splitlines()[-1])["frequencies_hz"]
    operators = structure_of(building).operators
    ours = lowest_modes(operators, np.ones(operators.parameters), 5).frequency_hz
    np.testing.assert_allclose(theirs, ours, rtol=0.01)


def test_a_shear_building_has_no_mesh_to_export(tower_file, tmp_path):
    with pytest.raises(StudyError, match="no mesh to export"):
        export_opensees(Study(tmp_path), load_building(tower_file))
    assert not list(tmp_path.iterdir())
