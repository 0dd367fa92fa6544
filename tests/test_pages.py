"""Every command line of README, tutorial and guides runs, with the shipped files alone.

The search for what is missing runs once, on the tutorial's record; elsewhere its files are there.
"""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner
from femupdate.cli.main import group

ROOT = Path(__file__).resolve().parent.parent
GUIDES = ROOT / "docs" / "how-to"
TUTORIAL = ROOT / "docs" / "tutorial" / "first-hour.md"
# In this order each finds what those before it have made, as where a study is there already.
FIRST = [ROOT / "README.md", TUTORIAL, GUIDES / "own-building.md", GUIDES / "own-records.md"]
PAGES = [*FIRST, *sorted({*GUIDES.glob("*.md")} - {*FIRST, GUIDES / "benchmarks.md"})]
# Large models have a small one in their place.
SMALL = {
    "six_story_wall_frame": "cabin.toml",
    "six_story_white_noise.csv": "cabin.csv",
    "X2:S1": "P:low",
}
LITTLE = {
    "calibrate": ["--particles", "200", "--no-pictures"],
    "predict": ["--samples", "8", "--member-draws", "2", "--no-pictures"],
    "render": ["--modes", "1", "--samples", "5"],
    "train": ["--samples", "1000", "--epochs", "1"],
    "build-model": ["--no-pictures"],
}
NUMBER = re.compile(r"[-+]?\d+\.?\d*(e[-+]?\d+)?")


def blocks(page):
    """Blocks of code without a language, as lines; then commands in sentences and tables."""
    text = page.read_text(encoding="utf-8")
    for language, block in re.findall(r"^```(\w*)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        if language:
            continue
        yield block.replace("\\\n", " ").replace("\n$ ", "\n").removeprefix("$ ").splitlines()
    # In a sentence a command may stand for all its calls.
    yield [line for line in re.findall(r"`(femupdate [^`]*)`", text) if "." in line]


def shape(line):
    """A line with its numbers left open, for they may differ in the last digits."""
    return " ".join(NUMBER.sub("#", line).split())


@pytest.mark.slow
def test_every_command_line_runs_and_prints_what_the_page_shows(cabin_file, tmp_path, monkeypatch):
    def run(words):
        done = CliRunner().invoke(group, words)
        failed.extend([f"{shlex.join(words)}: {done.stderr}"] * done.exit_code)
        return done.stdout

    failed = []

    monkeypatch.chdir(tmp_path)
    run(["examples"])
    monkeypatch.chdir("examples")
    for name in ("cabin.toml", "my_building.toml"):
        Path(name).write_text(cabin_file.read_text())
    noise = ["--duration", "20", "--sampling", "50", "--band", "0.5,22", "--mesh-size", "2"]
    run(["simulate", "-o", "cabin.csv", "--building", "cabin.toml", *noise])
    ran = {}
    for page in PAGES:
        printed = ""
        for block in blocks(page):
            lines = [line for line in block if line.startswith("femupdate ")]
            for line in lines:
                for old, new in SMALL.items():
                    line = line.replace(old, new)
                words = shlex.split(line.partition("  #")[0])[1:]
                key = " ".join(
                    word for word in words if word not in ("-v", "--building", "shear_4dof")
                )
                if words == ["examples"] or key in ran:
                    printed = ran.get(key, "")
                    continue
                search = words[0] in ("diagnose", "repair") and words[1] != "run1.csv"
                if search or "soft/repaired" in words:
                    files = [word for word in words if word.endswith(".csv")]
                    failed += [file for file in files if not Path(file).exists()]
                    words = [words[0], "--help"]  # the search itself runs on run1.csv
                more = noise[:6] if words[0] == "simulate" and "--record" not in words else []
                if words[0] in ("diagnose", "repair", "identify"):
                    more = ["--no-pictures"]
                printed = ran[key] = run([*words, *more, *LITTLE.get(words[0], ["-v"])])
            if not lines and page == TUTORIAL and "run1.csv" in key:
                seen = [shape(line) for line in printed.splitlines()]
                shown = [shape(line) for line in block if line.strip() != "..."]
                failed += [line for line in shown if not any(s.startswith(line) for s in seen)]
    assert failed == []
    errors = re.search(
        r"error of the histories (\S+) -> (\S+),", ran["repair run1.csv --holdout run2.csv"]
    )
    assert float(errors[1]) > 0.1 > float(errors[2])
