"""Input that cannot be used: exit code 1, one sentence, and nothing written."""

import os
import resource
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from femupdate.study import locked
from tests.cli.commands import femupdate, script
from tests.helpers import snapshot

ROWS = 400  # of an observation: enough for a spectrum


@dataclass(frozen=True)
class Bench:
    """Files to make bad ones from."""

    folder: Path
    tower: Path
    rows: tuple[str, ...]

    def file(self, name, content):
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def observation(self, *rows, name="bad.csv"):
        return self.file(name, "\n".join(rows or self.rows) + "\n")

    def changed(self, line, old, new):
        """A good observation with a change in one line (0 and 1 are the head)."""
        rows = list(self.rows)
        assert old in rows[line]
        rows[line] = rows[line].replace(old, new, 1)
        return self.observation(*rows)


@pytest.fixture
def bench(tmp_path, tower_file, tower_observation):
    lines = tower_observation.path.read_text().splitlines()
    head = next(n for n, line in enumerate(lines) if line.startswith("time_s"))
    folder = tmp_path / "input"
    folder.mkdir()
    shutil.copy(tower_file, folder)
    return Bench(folder, folder / "tower.toml", tuple(lines[head : head + 2 + ROWS]))


@pytest.fixture(params=["fresh", "kept"])
def study(request, tmp_path, tower_study):
    folder = tmp_path / request.param
    return Path(shutil.copytree(tower_study, folder)) if request.param == "kept" else folder


def in_g(bench):
    """Values of 818 (gal) in columns that claim g."""
    rows = [row.split(",") for row in bench.rows]
    rows[1] = ["s", "g", "g", "g"]
    peak = max(abs(float(row[1])) for row in rows[2:])
    scaled = [[row[0], *(f"{float(c) * 818 / peak:.5g}" for c in row[1:])] for row in rows[2:]]
    return bench.observation(*map(",".join, [*rows[:2], *scaled]))


BAD_OBSERVATIONS = {
    "missing": (lambda b: b.folder / "nowhere.csv", ["nowhere.csv", "no such file"]),
    "two rows": (lambda b: b.observation(*b.rows[:4]), ["2 rows are too short"]),
    "other building": (lambda b: b.changed(0, "2F,RF", "3F,RF"), ["3F", "2F, RF"]),
    "wrong unit": (in_g, ["base", "818 g", "is the unit wrong?"]),
    "noise alone": (
        # The floors do not follow the base.
        lambda b: b.observation(
            *b.rows[:2],
            *(
                f"{k / 50},{x:.5g},{y:.5g},{z:.5g}"
                for k, (x, y, z) in enumerate(np.random.default_rng(1).normal(size=(1000, 3)))
            ),
        ),
        ["no point of the frequency grid can be used"],
    ),
    "unlike the building": (  # found out when it is built and sampled
        lambda b: b.observation(
            "frequency_hz,2F,RF", *(f"{f:.1f},{1 + f % 3:.2f},9" for f in np.arange(0.5, 12, 0.1))
        ),
        ["unlike anything that tower can do"],
    ),
}


@pytest.mark.parametrize("case", BAD_OBSERVATIONS)
def test_an_observation_that_cannot_be_used(bench, study, case):
    make, words = BAD_OBSERVATIONS[case]
    before = snapshot(study)
    done = femupdate(
        "calibrate", make(bench), "--building", bench.tower, "--exact", "--study", study, "--json"
    )
    for word in words:
        assert word in done.complaint
    assert snapshot(study) == before
    assert study.exists() == bool(before)


OTHER_TOWER = ('stiffness = "4 MN/m"', 'stiffness = "5 MN/m"')
BAD_REQUESTS = {
    "sensors": (["--sensors", "7F"], ["there is no 7F to use", "2F, RF"]),
    "band": (["--band", "13,14"], ["fewer than ten frequencies", "--band"]),
    "unit of the file": (["--unit", "g"], ["m/s2", "the unit option says g"]),
    "name twice": (["--columns", "base=base,2F=2F,2F=RF"], ["is given twice"]),
    "factor": (["--columns", "base=base,2F=2F*1e999"], ["there is no column '2F*1e999'"]),
    "building": (["--building", "shear_3dog"], ["shear_3dog", "did you mean 'shear_3dof'"]),
    "malformed": (["--building", "bad.toml"], ["bad.toml", "not valid TOML", "line 10"]),
}


@pytest.mark.parametrize("case", BAD_REQUESTS)
def test_a_calibration_that_cannot_be_asked_for(bench, study, monkeypatch, case):
    options, words = BAD_REQUESTS[case]
    before = snapshot(study)
    building = [] if "--building" in options else ["--building", bench.tower]
    monkeypatch.chdir(bench.file("bad.toml", bench.tower.read_text().replace("3 t", '3 t"')).parent)
    done = femupdate(
        "calibrate", bench.observation(), "--exact", "--study", study, *building, *options
    )
    for word in words:
        assert word in done.complaint
    assert snapshot(study) == before
    assert study.exists() == bool(before)


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "repair", "simulate", "train"])
def test_without_a_building_none_is_assumed(command, bench, tmp_path):
    """Another building's finding, posterior or record is never what was meant."""
    files = {"simulate": ["-o", tmp_path / "made.csv"], "train": []}
    study = tmp_path / "new"
    done = femupdate(command, *files.get(command, [bench.observation()]), "--study", study)
    assert "has no building yet; name one with --building" in done.complaint
    assert not study.exists()


def test_another_building_than_the_study_has(bench, calibrated):
    before = snapshot(calibrated)
    other = bench.file("other.toml", bench.tower.read_text().replace(*OTHER_TOWER))
    for command in (["calibrate", bench.observation(), "--exact"], ["train"]):
        done = femupdate(*command, "--building", other, "--study", calibrated)
        assert "holds the building tower, not tower as asked" in done.complaint
        assert "--study" in done.complaint
    done = femupdate("build-model", other, "--study", calibrated)
    assert "already holds a posterior of another version of tower" in done.complaint
    assert snapshot(calibrated) == before


def test_too_few_samples_are_told_before_any_is_drawn(bench, tmp_path):
    done = femupdate(
        "train", "--building", bench.tower, "--samples", 300, "--study", tmp_path / "study"
    )
    assert "300 samples are too few for batches of 512" in done.complaint
    assert done.progress == []
    assert not (tmp_path / "study").exists()


def motion(count=300):
    time = np.arange(count) * 0.02
    return time, np.exp(-0.3 * time) * np.sin(9.0 * time + 0.4)


def plain(bench, factor=1.0, unit="m/s2"):
    rows = [f"{t:.2f},{factor * a:.6g}" for t, a in zip(*motion(), strict=True)]
    return bench.observation("time_s,EW", f"s,{unit}", *rows, name="record.csv")


def two_channels(bench):
    rows = [f"{t:.2f},{a:.6g},{-a:.6g}" for t, a in zip(*motion(), strict=True)]
    return bench.observation("time_s,EW,NS", "s,gal,gal", *rows, name="record.csv")


BAD_RECORDS = {
    "several channels": (lambda b: [two_channels(b)], ["2 channels", "1 = EW"]),
    "scale of zero": (lambda b: [plain(b), "--scale", "0"], ["cannot be scaled by 0"]),
    "measured elsewhere": (
        lambda b: [plain(b), "--measured", b.observation()],
        ["do not match the record's 300"],
    ),
    "measured, other building": (
        lambda b: [
            plain(b),
            "--measured",
            b.observation(
                "time_s,base,7F",
                "s,m/s2,m/s2",
                *(f"{t:.2f},{a:.6g},{2 * a:.6g}" for t, a in zip(*motion(), strict=True)),
            ),
        ],
        ["none of its floors (7F)", "2F, RF"],
    ),
}


@pytest.mark.parametrize("case", BAD_RECORDS)
def test_a_record_that_cannot_be_used(bench, calibrated, case):
    make, words = BAD_RECORDS[case]
    before = snapshot(calibrated)
    done = femupdate("predict", "--study", calibrated, "--json", "--record", *make(bench))
    for word in words:
        assert word in done.complaint
    assert snapshot(calibrated) == before


def predict(bench, study):
    return ["predict", "--study", study, "--record", plain(bench), "--json"]


def render(bench, study):
    return ["render", "--study", study, "--json"]


@pytest.fixture(params=[predict, render], ids=["predict", "render"])
def after(request, bench):
    """A command that needs a posterior."""
    return lambda study: request.param(bench, study)


def test_no_study(after, tmp_path):
    done = femupdate(*after(tmp_path / "study"))
    assert "holds no posterior; run `femupdate calibrate` first" in done.complaint
    assert not (tmp_path / "study").exists()


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("posterior.nc", "holds no posterior; run `femupdate calibrate` first"),
        ("building.toml", "has no building yet"),  # no other building must step in
    ],
)
def test_a_file_of_the_study_is_gone(after, calibrated, file, said):
    (calibrated / file).unlink()
    before = snapshot(calibrated)
    done = femupdate(*after(calibrated))
    assert said in done.complaint
    assert snapshot(calibrated) == before


@pytest.mark.parametrize(
    "damage",
    [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: data[:-1] + b"\x55"],
    ids=["cut", "emptied", "changed"],
)
def test_a_posterior_that_is_not_what_was_written(after, calibrated, damage):
    path = calibrated / "posterior.nc"
    path.write_bytes(damage(path.read_bytes()))
    before = snapshot(calibrated)
    done = femupdate(*after(calibrated))
    assert str(path) in done.complaint
    assert "run `femupdate calibrate` again" in done.complaint
    assert snapshot(calibrated) == before


def test_a_posterior_of_another_version_of_the_building(after, calibrated, tower_file):
    """The file in the study was edited since: the model is not rebuilt for a stale posterior."""
    (calibrated / "building.toml").write_text(tower_file.read_text().replace(*OTHER_TOWER))
    before = snapshot(calibrated)
    done = femupdate(*after(calibrated))
    assert "was made from another building; run `femupdate calibrate` again" in done.complaint
    assert snapshot(calibrated) == before


def commands(bench, study):
    """One of every command, each with input that is good."""
    observation = bench.observation(name="good.csv")
    return {
        "build-model": ["build-model", bench.tower],
        "train": ["train", "--building", bench.tower, "--samples", 200, "--batch", 32],
        "calibrate": [
            *("calibrate", observation, "--building", bench.tower),
            *("--exact", "--particles", 200, "--chains", 1),
        ],
        "predict": predict(bench, study),
        "render": render(bench, study),
        "simulate": ["simulate", "-o", study / "new.csv", "--building", bench.tower],
    }


NAMES = ["build-model", "train", "calibrate", "predict", "render", "simulate"]


@pytest.mark.parametrize("command", NAMES)
def test_a_study_that_is_a_file(bench, tmp_path, command):
    place = bench.file("study", "mine")
    done = femupdate(*commands(bench, tmp_path)[command], "--study", place)
    assert f"{place} is a file, not a folder" in done.complaint
    assert place.read_text() == "mine"


@pytest.mark.parametrize("command", NAMES[:-1])
def test_a_folder_without_permission_is_told_at_once(bench, calibrated, monkeypatch, command):
    """Not after minutes of sampling. The system's answer is put on: root may write anywhere."""
    before = snapshot(calibrated)
    monkeypatch.setattr("os.access", lambda path, mode: not mode & os.W_OK)
    done = femupdate(*commands(bench, calibrated)[command], "--study", calibrated)
    assert f"cannot write into {calibrated}" in done.complaint
    assert done.progress == []
    assert snapshot(calibrated) == before


def full(*_, **__):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("when", ["os.replace", "pathlib.Path.touch"])
@pytest.mark.parametrize("command", ["calibrate", "simulate"])
def test_a_full_disk_leaves_every_file_as_it_was(bench, calibrated, monkeypatch, command, when):
    before = snapshot(calibrated)
    arguments = commands(bench, calibrated)[command]
    monkeypatch.setattr(when, full)
    done = femupdate(*arguments, "--study", calibrated)
    assert "the disk is full; free some space and run the command again" in done.complaint
    assert snapshot(calibrated) == before


def test_a_study_that_another_process_writes_into(bench, calibrated):
    before = snapshot(calibrated)
    with locked(calibrated):
        done = femupdate(*commands(bench, calibrated)["calibrate"], "--study", calibrated)
        assert "another process is writing into the study" in done.complaint
    assert done.progress == []
    assert snapshot(calibrated) == before


def _at_most_10_kb():
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))


def test_files_that_cannot_grow_are_not_left_half(bench, calibrated):
    """A limit of the system cuts a file short in the middle, where HDF5 itself would crash."""
    before = snapshot(calibrated)
    words = (*predict(bench, calibrated), "--samples", 8, "--no-pictures")
    done = script(*words, preexec_fn=_at_most_10_kb)
    assert "cannot write" in done.complaint
    assert ".nc: files may not grow that large here" in done.complaint
    assert snapshot(calibrated) == before
