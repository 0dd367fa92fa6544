"""The building as a script for another program."""

import ast


def test_build_model_exports_a_script(femupdate, tmp_path, cabin_file):
    arguments = ("--export", "opensees", "--shell", "ShellMITC4", "--study", tmp_path, "--json")
    answer = femupdate("build-model", cabin_file, *arguments).answer
    assert answer["exported"] == [str(tmp_path / "opensees_model.py")]
    script = (tmp_path / "opensees_model.py").read_text(encoding="utf-8")
    ast.parse(script)
    assert "'shell': 'ShellMITC4'" in script
