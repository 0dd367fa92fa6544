"""The command in this process, which is fast, and as the script that users run."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from click.testing import CliRunner

SCRIPT = Path(sys.executable).with_name("femupdate")


@dataclass(frozen=True)
class Outcome:
    """What a command left behind."""

    code: int
    out: str
    err: str

    @property
    def answer(self) -> dict[str, Any]:
        """The one JSON object on stdout, of a command that did its work."""
        assert self.code == 0, self.err
        return json.loads(self.out)

    @property
    def progress(self) -> list[str]:
        """Lines on stderr that tell of progress."""
        lines = self.err.splitlines()
        return [line for line in lines if line.endswith(" ...") or line.startswith("Building ")]

    @property
    def complaint(self) -> str:
        """The one sentence on stderr, of a command that could not do its work."""
        rest = [line for line in self.err.splitlines() if line not in self.progress]
        assert self.code == 1, (self.code, self.err)
        assert self.out == ""
        assert len(rest) == 1, self.err
        assert rest[0].startswith("Error: ")
        assert "Traceback" not in self.err
        return rest[0].removeprefix("Error: ")


def femupdate(*arguments: object) -> Outcome:
    """Run a command in this process; an exception that it does not handle fails the test."""
    from femupdate.cli.main import group

    words = [str(argument) for argument in arguments]
    result = CliRunner().invoke(group, words, catch_exceptions=False)
    return Outcome(result.exit_code, result.stdout, result.stderr)


def script(*arguments: object, **options: Any) -> Outcome:
    """Run the installed script in a process of its own."""
    done = subprocess.run(
        [str(SCRIPT), *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        **options,
    )
    return Outcome(done.returncode, done.stdout, done.stderr)
