"""Whether benchmarks run as commands, and one of them from beginning to end."""

import runpy
import sys

import pytest
from click.testing import CliRunner
from femupdate.cli.main import group


def test_an_unknown_size_is_one_sentence(tmp_path):
    words = ["benchmark", "solver", "--sizes", "huge", "--output", str(tmp_path)]
    done = CliRunner().invoke(group, words, catch_exceptions=False)
    assert done.exit_code == 1
    assert done.stderr.strip().splitlines()[-1].startswith("Error: there is no size 'huge'")


@pytest.mark.parametrize("name", ["fresh", "score"])
def test_help_of_a_module_is_no_folder(name, monkeypatch, capsys, tmp_path):
    module = f"femupdate.benchmarks.missing_effects.{name}"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    monkeypatch.delitem(sys.modules, module, raising=False)
    runpy.run_module(module, run_name="__main__")
    assert name in capsys.readouterr().out
    assert not list(tmp_path.iterdir())
