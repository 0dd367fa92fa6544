"""Whether benchmarks run as commands, and one of them from beginning to end."""

from click.testing import CliRunner
from femupdate.cli.main import group


def test_an_unknown_size_is_one_sentence(tmp_path):
    words = ["benchmark", "solver", "--sizes", "huge", "--output", str(tmp_path)]
    done = CliRunner().invoke(group, words, catch_exceptions=False)
    assert done.exit_code == 1
    assert done.stderr.strip().splitlines()[-1].startswith("Error: there is no size 'huge'")
