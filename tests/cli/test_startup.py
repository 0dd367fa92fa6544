"""What the command says of itself, how soon, and what it says to wrong usage."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from importlib.metadata import version

import click
import pytest
from femupdate.cli.benchmark import command as benchmarks
from femupdate.cli.main import group

from tests.cli.commands import femupdate, script

COMMANDS = group.list_commands(click.Context(group))
BENCHMARKS = benchmarks.list_commands(click.Context(benchmarks))
WITHOUT_STUDY = ("benchmark", "examples", "identify", "inspect", "list")
WITHOUT_SEED = ("compare", "report", "status")
WITH_STUDY = [name for name in COMMANDS if name not in (*WITHOUT_STUDY, *WITHOUT_SEED)]
WORK = ["build-model", "train", "calibrate", "predict", "render"]
HEAVY = ("torch", "scipy", "pyvista", "vtkmodules", "matplotlib", "pydantic", "xarray", "numpy")
COMPILER = "torch._dynamo"

# Runs commands one after the other in one process, and tells what each wrote and which heavy
# modules there are after it.
_IMPORTED = f"""
import contextlib, io, json, sys
from femupdate.cli.main import main
told = []
for words in json.load(sys.stdin):
    sys.argv = ["femupdate", *words]
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
        main()
    heavy = [name for name in {(*HEAVY, COMPILER)!r} if name in sys.modules]
    told.append((out.getvalue(), heavy))
print(json.dumps(told))
"""


def imported(*commands, cwd=None):
    done = subprocess.run(
        [sys.executable, "-c", _IMPORTED],
        input=json.dumps(commands),
        capture_output=True,
        text=True,
        check=True,
        cwd=cwd,
    )
    return json.loads(done.stdout)


def test_help_is_immediate():
    """Asked for is 0.3 s; a busy machine is granted one second in the best of three."""
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        done = script("--help")
        seconds.append(time.perf_counter() - started)
        assert done.code == 0
        assert done.err == ""
    assert min(seconds) < 1.0


def test_nothing_heavy_is_imported_to_say_what_there_is():
    everywhere, seed, study, output = (
        ("--json", "--verbose"),
        "--seed",
        "\n  --study",
        "\n  --output",
    )
    options = {
        ("--help",): (),
        ("-h",): (),
        ("--version",): (),
        **{(name, "--help"): everywhere for name in ("examples", "identify", "inspect", "list")},
        **{(name, "--help"): (*everywhere, seed, study) for name in WITH_STUDY},
        **{("benchmark", n, "--help"): (*everywhere, seed, output) for n in BENCHMARKS},
    }
    told = imported(*options)
    assert {
        tuple(words): heavy for words, (_, heavy) in zip(options, told, strict=True) if heavy
    } == {}
    for (words, wanted), (text, _) in zip(options.items(), told, strict=True):
        assert [option for option in wanted if option not in text] == [], words
        assert ("\n  --study" in text) == (study in wanted), words


def test_training_loads_no_compiler(tmp_path):
    """It takes seconds, and where it brings Triton, ends processes in which VTK has drawn."""
    words = ("train", "--fresh", "--building", "shear_3dof", "--samples", "400")
    ((_, found),) = imported((*words, "--epochs", "1", "--batch", "64"), cwd=tmp_path)
    assert "torch" in found
    assert COMPILER not in found
    assert (tmp_path / "study" / "surrogate.safetensors").exists()


def test_a_glance_at_a_study_takes_no_torch(tmp_path):
    ((text, heavy),) = imported(["status"], cwd=tmp_path)
    assert ("no building yet" in text, "torch" in heavy) == (True, False)


MISSPELT = {
    "file": ["inspect", __file__, "nowhere.csv"],
    "observation": ["calibrate", "nowhere.csv"],
    "second observation": ["calibrate", __file__, "nowhere.csv"],
    "observation to diagnose": ["diagnose", "nowhere.csv"],
    "holdout": ["repair", __file__, "--holdout", "nowhere.csv"],
    "record": ["predict", "--record", "nowhere.csv"],
    "base motion": ["simulate", "-o", "new.csv", "--record", "nowhere.csv"],
    "building": ["build-model", "shear_3dog"],
    "building file": ["train", "--building", "nowhere.toml"],
    "building of an observation": ["calibrate", __file__, "--building", "shear_3dog"],
    "study": ["render", "--study", "nowhere"],
    "study to predict with": ["predict", "--record", __file__, "--study", "nowhere"],
    "output that is there": ["simulate", "-o", __file__],
}


def test_a_misspelt_name_is_told_before_anything_heavy_is_imported(tmp_path):
    told = imported(*MISSPELT.values(), cwd=tmp_path)
    assert dict(zip(MISSPELT, told, strict=True)) == {name: ["", []] for name in MISSPELT}
    assert list(tmp_path.iterdir()) == []


def test_a_misspelt_name_is_told_at_once(tmp_path):
    """Asked for is 0.5 s; of processor time, which a busy machine does not stretch as much."""
    seconds = []
    for _ in range(3):
        before = os.times()
        done = script("calibrate", "nowhere.csv", cwd=tmp_path)
        after = os.times()
        own = after.children_user + after.children_system
        seconds.append(own - before.children_user - before.children_system)
        assert done.complaint == "nowhere.csv: no such file; check the name and the folder"
    assert min(seconds) < 0.5


def test_help_names_every_command_in_the_order_of_the_work():
    words = femupdate("--help").out.split("Commands:")[1].split()
    assert [word for word in words if word in COMMANDS] == COMMANDS
    assert [command for command in COMMANDS if command in WORK] == WORK


def test_the_line_of_a_command_is_whole():
    """The group lists commands with texts of its own, which click would shorten to '...'."""
    assert "..." not in femupdate("--help").out.split("Commands:")[1]


def test_version():
    done = script("--version")
    assert done.out == f"femupdate, version {version('femupdate')}\n"
    assert (done.code, done.err) == (0, "")


@pytest.mark.parametrize(
    ("typed", "meant"), [("build-modle", "build-model"), ("traim", "train"), ("xyzzy", "")]
)
def test_a_mistyped_command_is_told_the_nearest_one(typed, meant):
    done = femupdate(typed, "--json")
    assert (done.code, done.out) == (2, "")
    near = f"; did you mean '{meant}'?" if meant else "\n"
    assert f"No such command '{typed}'{near}" in done.err


def test_no_command_shows_the_help():
    done = script()
    assert done.code == 2
    assert "Commands:" in done.out + done.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["calibrate"], "Missing argument 'OBSERVATIONS...'"),
        (["simulate"], "Missing option '-o'"),
        (["calibrate", "o.csv", "--particles", "10"], "--particles"),
        (["calibrate", "o.csv", "--chains", "0"], "--chains"),
        (["calibrate", "o.csv", "--band", "5"], "lowest and the highest frequency"),
        (["calibrate", "o.csv", "--band", "nan,5"], "lowest and the highest frequency"),
        (["calibrate", "o.csv", "--band", "low,5"], "numbers with commas"),
        (["calibrate", "o.csv", "--columns", "base"], "ours=theirs"),
        (["calibrate", "o.csv", "--seed", "-1"], "--seed"),
        (["calibrate", "o.csv", "--exakt"], "--exact"),
        (["predict", "--record", "r.csv", "--damping", "2"], "--damping"),
        (["predict", "--record", "r.csv", "--scale", "double"], "--scale"),
        (["predict", "--record", "r.csv", "--member", "1,2"], "neither a place nor a wall"),
        (["train", "--samples", "10"], "--samples"),
        (["render", "--modes", "0"], "--modes"),
        (["simulate", "-o", "o.csv", "--theta", "1,x"], "numbers with commas"),
        (["simulate", "-o", "o.csv", "--zeta", "-0.1"], "--zeta"),
        (["build-model", "tower", "cabin"], "unexpected extra argument"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_usage_exits_with_2_a_wrong_value_with_1_and_both_make_nothing(
    tmp_path, monkeypatch, arguments, words
):
    monkeypatch.chdir(tmp_path)
    done = femupdate(*arguments, "--json")
    usage = words.startswith(("Missing", "--exact", "unexpected"))
    assert (done.code, "Usage: " in done.err, done.out) == (1 + usage, usage, "")
    assert words in done.err
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_command_says_how_to_go_on(tmp_path):
    """Here of `build-model` alone, which says that it takes the six-story building by default."""
    words = ["build-model", "--study", str(tmp_path)]
    command = [sys.executable, "-m", "femupdate", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    # What starts the tests in the background may have it ignored.
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, text=True, preexec_fn=heard, **pipes) as running:
        default, first = (running.stderr.readline() for _ in range(2))  # it works for long then
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=120)
    assert "the default" in default
    assert "six_story_wall_frame" in first
    assert (running.returncode, out) == (130, "")
    assert "run the same command again to go on" in err


@pytest.mark.parametrize(
    ("command", "given", "told"),
    [
        ("predict", {}, {"GOMP_SPINCOUNT": "1000", "OMP_NUM_THREADS": "1"}),
        ("train", {}, {"GOMP_SPINCOUNT": "1000", "OPENBLAS_NUM_THREADS": "1"}),
        ("train", *[{"OMP_WAIT_POLICY": "active", "OMP_NUM_THREADS": "2"}] * 2),
    ],
    ids=["nothing said", "training", "a policy"],
)
def test_waiting_threads_sleep_unless_the_user_says_how_they_wait(command, given, told):
    """It is settled before the library is loaded that reads it."""
    code = (
        "import os, sys\n"
        "from femupdate.cli.main import main\n"
        "assert not {'numpy', 'torch'} & set(sys.modules)\n"
        f"try: main(['{command}', '--help'])\n"
        "except SystemExit: pass\n"
        "starts = 'GOMP_', 'OMP_', 'OPENBLAS_'\n"
        "print({k: v for k, v in os.environ.items() if k.startswith(starts)})\n"
    )
    starts = "GOMP_", "OMP_", "OPENBLAS_"
    clean = {k: v for k, v in os.environ.items() if not k.startswith(starts)}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**clean, **given}, capture_output=True, text=True
    )
    assert done.stdout.splitlines()[-1] == str(told)
