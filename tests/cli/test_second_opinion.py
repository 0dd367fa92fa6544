"""The building as a script for another program."""

import ast


def test_build_model_exports_a_script(femupdate, tmp_path, cabin_file):
    arguments = ("--export", "opensees", "--shell", "ShellMITC4", "--study", tmp_path, "--json")
    answer = femupdate("build-model", cabin_file, *arguments).answer
    assert answer["exported"] == [str(tmp_path / "opensees_model.py")]
    script = (tmp_path / "opensees_model.py").read_text(encoding="utf-8")
    ast.parse(script)
    assert "'shell': 'ShellMITC4'" in script


def test_a_shear_building_cannot_be_exported(femupdate, tmp_path, tower_file):
    done = femupdate("build-model", tower_file, "--export", "opensees", "--study", tmp_path)
    assert done.code == 1
    assert "no mesh to export" in done.err
