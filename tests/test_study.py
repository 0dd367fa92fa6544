"""The study folder: what is recorded, found, missed and refused."""

import json
import signal
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from femupdate import __version__
from femupdate.errors import InferenceError, StudyError
from femupdate.study import (
    LAYOUT,
    MAIN_POSTERIOR,
    MANIFEST,
    Study,
    StudyPart,
    file_hash,
    locked,
    made_by,
    owner_of,
    write_text,
)
from femupdate.workflow.effects import MESH_ERROR, NEAR_BASIS
from femupdate.workflow.model import FINER

MADE_FROM = {"building": "ab12", "observation": "cd34"}


@pytest.fixture
def study(tmp_path):
    return Study(tmp_path / "study")


@pytest.fixture
def recorded(study):
    write_text(study.path("posterior.nc"), "draws")
    study.record("posterior", "posterior.nc", "calibrate", MADE_FROM, {"particles": 500})
    return study


def test_an_empty_study_is_no_folder_yet(study):
    assert study.artefacts() == {}
    assert study.find("posterior", MADE_FROM) is None
    study.check_fresh("posterior", MADE_FROM, "calibrate")
    assert not study.folder.exists()


def test_what_is_recorded_is_found(recorded):
    path = recorded.find("posterior", MADE_FROM)
    assert path == recorded.path("posterior.nc")
    assert recorded.require("posterior", "calibrate") == path
    artefact = Study(recorded.folder).artefacts()["posterior"]
    assert artefact.file == "posterior.nc"
    assert artefact.command == "calibrate"
    assert artefact.version == __version__
    assert artefact.settings == {"particles": 500}
    assert artefact.made_from == MADE_FROM
    assert artefact.sha256 == file_hash(path)
    assert artefact.created.endswith("+00:00")


@pytest.mark.parametrize(
    "made_from",
    [{}, {"building": "ab12"}, {**MADE_FROM, "observation": "ee"}, {**MADE_FROM, "more": "1"}],
)
def test_what_was_made_from_something_else_is_not_found(recorded, made_from):
    assert recorded.find("posterior", made_from) is None


@pytest.mark.parametrize("change", ["edited", "cut short", "gone"])
def test_a_file_that_is_not_the_recorded_one_is_noticed(recorded, change):
    path = recorded.path("posterior.nc")
    if change == "gone":
        path.unlink()
    else:
        path.write_text("drawn" if change == "edited" else "dra")
    assert recorded.find("posterior", MADE_FROM) is None
    wanted = r"holds no posterior; run `femupdate calibrate` first"
    if change != "gone":
        wanted = r"posterior\.nc is not the file that femupdate wrote .*run `femupdate calibrate`"
    with pytest.raises(StudyError, match=wanted):
        recorded.require("posterior", "calibrate")


def test_a_stale_artefact_is_named_with_what_has_changed(recorded):
    recorded.check_fresh("posterior", MADE_FROM, "calibrate")
    recorded.check_fresh("posterior", {"building": "ab12"}, "calibrate")
    with pytest.raises(StudyError, match=r"made from another observation; run `femupdate"):
        recorded.check_fresh("posterior", {**MADE_FROM, "observation": "x"}, "calibrate")
    with pytest.raises(StudyError, match="from another building and observation"):
        recorded.check_fresh("posterior", {"building": "", "observation": ""}, "calibrate")


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        "3",
        "null",
        '"text"',
        "{}",
        '{"artefacts": []}',
        '{"artefacts": 3}',
        '{"artefacts": {"posterior": 3}}',
        '{"artefacts": {"posterior": {}}}',
        '{"artefacts": {"posterior": {"file": "a", "mood": "b"}}}',
        "[" * 100_000,
        '{"artefacts": {}, "layout": "new"}',
        '{"artefacts": {}, "layout": ' + "9" * 5000 + "}",
    ],
)
def test_a_record_that_cannot_be_read(recorded, content):
    recorded.path(MANIFEST).write_text(content)
    for attempt in (
        recorded.artefacts,
        lambda: recorded.find("posterior", MADE_FROM),
        lambda: recorded.require("posterior", "calibrate"),
    ):
        with pytest.raises(StudyError, match=r"study\.json cannot be read .*move it away"):
            attempt()


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=8,
)


@settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(value=json_values, inside=st.booleans())
def test_no_record_ends_in_a_traceback(study, value, inside):
    study.folder.mkdir(exist_ok=True)
    content = {"artefacts": {"posterior": value}} if inside else value
    study.path(MANIFEST).write_text(json.dumps(content), encoding="utf-8")
    try:
        assert study.artefacts() == {}
    except StudyError as error:
        assert "cannot be read" in str(error)  # noqa: PT017


@pytest.mark.parametrize("file", ["../posterior.nc", "/etc/passwd", "deep/../../x"])
def test_a_record_that_reaches_outside_its_study(recorded, file):
    content = json.loads(recorded.path(MANIFEST).read_text())
    content["artefacts"]["posterior"]["file"] = file
    recorded.path(MANIFEST).write_text(json.dumps(content))
    with pytest.raises(StudyError, match="lies outside the study"):
        recorded.artefacts()


def test_the_words_of_the_running_command_are_kept(recorded):
    assert "words" not in recorded.artefacts()["posterior"].settings
    with made_by(("calibrate", "my run.csv", "--exact")):
        recorded.record("posterior", "posterior.nc", "calibrate", MADE_FROM, {"particles": 500})
    kept = recorded.artefacts()["posterior"].settings
    assert kept == {"particles": 500, "words": ["calibrate", "my run.csv", "--exact"]}
    recorded.record("posterior", "posterior.nc", "calibrate", MADE_FROM)
    assert recorded.artefacts()["posterior"].settings == {}


@pytest.mark.parametrize(
    "changed",
    [
        {"further": "run.csv"},
        {"further": [1]},
        {"scale": "x"},
        {"words": "calibrate run.csv"},
        {"words": []},
        {"words": ["calibrate", 1]},
        {"words": ["calibrate", ["run.csv"]]},
        {"words": ["calibrate", "\x1b[2J"]},
        {"words": ["calibrate", "two\nlines"]},
        {"words": ["calibrate", "x" * 200_000]},
        {"words": None},
    ],
)
def test_settings_that_no_command_wrote(recorded, changed):
    record = json.loads(recorded.path(MANIFEST).read_text())
    record["artefacts"]["posterior"]["settings"] = changed
    recorded.path(MANIFEST).write_text(json.dumps(record))
    with pytest.raises(StudyError, match="which no command wrote") as told:
        recorded.artefacts()
    assert len(str(told.value)) < 400 + len(str(recorded.folder))
    assert str(told.value).isprintable()


def test_the_study_of_a_newer_femupdate_is_refused(recorded):
    content = json.loads(recorded.path(MANIFEST).read_text())
    assert content["layout"] == LAYOUT
    newer = {**content, "layout": LAYOUT + 1, "femupdate": "9.1", "artefacts": {"x": {"a": 1}}}
    recorded.path(MANIFEST).write_text(json.dumps(newer))
    with pytest.raises(StudyError, match=r"newer femupdate \(9\.1, this is .*update femupdate"):
        recorded.artefacts()


def note(**changes):
    """A text as a part of a study."""
    fields = {
        "name": "note",
        "file": "notes/note.txt",
        "command": "calibrate",
        "write": lambda text, path: write_text(path, text),
        "read": lambda path: path.read_text(encoding="utf-8"),
        "settings": lambda text: {"length": len(text)},
    }
    return StudyPart(**{**fields, **changes})


def test_a_part_is_made_once(study):
    made = []

    def make():
        made.append("made")
        return f"note {len(made)}"

    assert [study.cached(note(), MADE_FROM, make) for _ in range(3)] == ["note 1"] * 3
    assert study.artefacts()["note"].settings == {"length": 6}
    assert study.cached(note(), {**MADE_FROM, "building": "other"}, make) == "note 2"
    assert study.kept(note(), MADE_FROM) is None


def test_a_part_that_was_damaged_or_says_too_little_is_made_again(study):
    study.keep(note(), MADE_FROM, "first")
    study.path("notes/note.txt").write_text("cut")
    assert study.cached(note(), MADE_FROM, lambda: "second") == "second"
    assert study.cached(note(read=lambda _: None), MADE_FROM, lambda: "third") == "third"


def test_a_part_that_cannot_be_made_leaves_nothing(study):
    def fails():
        raise InferenceError("no")

    with pytest.raises(InferenceError):
        study.cached(note(), MADE_FROM, fails)
    assert not study.folder.exists()


@pytest.mark.parametrize(
    ("key", "owner"),
    [
        ("posterior", MAIN_POSTERIOR),
        ("roof prediction", "roof"),
        (NEAR_BASIS, MAIN_POSTERIOR),
        (MESH_ERROR, MAIN_POSTERIOR),
        (FINER, MAIN_POSTERIOR),
    ],
)
def test_only_posteriors_and_predictions_have_an_owner(key, owner):
    assert owner_of(key) == owner


@pytest.mark.parametrize("name", ["reduced model", "surrogate"])
def test_a_refusal_takes_a_new_study_along_but_no_training(study, name):
    study.folder.mkdir()

    def refused():
        with study.whole():
            for file in ("building.toml", "made.npz"):
                study.path(file).write_text("made")
            study.record(name, "made.npz", "train", {})
            raise InferenceError("refused")

    with pytest.raises(InferenceError):
        refused()
    left = {path.name for path in study.folder.iterdir()}
    kept = {"building.toml", "made.npz", "study.json"} if name == "surrogate" else set()
    assert left == kept


HOLD = """\
import sys, time
from pathlib import Path
from femupdate.study import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the study; it never frees it of its own accord."""
    command = [sys.executable, "-c", HOLD, str(tmp_path / "study")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_another_process_waits(holder, tmp_path):
    wanted = "^another process is writing into the study"
    with pytest.raises(StudyError, match=wanted), locked(tmp_path / "study"):
        pass


@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM"])
def test_a_lock_dies_with_its_owner(holder, tmp_path, name):
    holder.send_signal(getattr(signal, name))
    holder.wait()
    assert (tmp_path / "study" / ".lock").exists()  # what is left of it holds nobody up
    with locked(tmp_path / "study"):
        pass
    assert not (tmp_path / "study").exists() or not list((tmp_path / "study").iterdir())


def test_parts_of_killed_processes_are_removed(tmp_path):
    parts = [
        ".posterior-0a1b2c3d.part.nc",
        "pictures/.modes-12345678.part.png",
    ]
    others = [".posterior.part.nc", "posterior-0a1b2c3d.part.nc", "notes/.x-12345678.part.txt"]
    for name in (*parts, *others):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("half")
    with locked(tmp_path):
        pass
    assert not any((tmp_path / name).exists() for name in parts)
    assert all((tmp_path / name).exists() for name in others)


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(StudyError, match=r"cannot write .*check the folder"),
        locked(tmp_path / "file" / "study"),
    ):
        pass
