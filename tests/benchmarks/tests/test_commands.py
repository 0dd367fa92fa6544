"""Whether benchmarks run as commands, and one of them from beginning to end."""

from click.testing import CliRunner
from femupdate.cli.main import group


def test_an_unknown_size_is_one_sentence(tmp_path):
    words = ["benchmark", "solver", "--sizes", "huge", "--output", str(tmp_path)]
    done = CliRunner().invoke(group, words, catch_exceptions=False)
    assert done.exit_code == 1
    assert done.stderr.strip().splitlines()[-1].startswith("Error: there is no size 'huge'")


def test_a_table_is_printed_for_people(tmp_path):
    words = ["benchmark", "all", "--only", "model shear_3dof", "--output", str(tmp_path)]
    done = CliRunner().invoke(group, words, catch_exceptions=False)
    # On a slow machine the run counts as fallen.
    assert "lines are outside of their tolerance" in done.stdout
    assert "model shear_3dof: frequency 1 Hz" in done.stdout
