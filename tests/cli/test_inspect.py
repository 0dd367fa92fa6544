"""`femupdate inspect`: any measured file in words, as JSON and as a picture."""

from pathlib import Path

import numpy as np
import pytest

from tests.cli.commands import femupdate


@pytest.fixture
def table(tmp_path):
    time = np.arange(1200) * 0.01
    base = np.round(np.random.default_rng(1).normal(size=1200), 4)
    roof = np.round(2.0 * np.roll(base, 3), 4)
    roof[700] = 80.0
    path = tmp_path / "obs.csv"
    rows = "\n".join(f"{t:.2f},{b},{r}" for t, b, r in zip(time, base, roof, strict=True))
    path.write_text("time_s,base,RF\ns,m/s2,m/s2\n" + rows)
    return path


def test_in_words(table):
    done = femupdate("inspect", table)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0] == f"{table}: 2 channels (tables in CSV or other text)"
    assert lines[1].split()[::3] == ["channel", "rate", "peak"]
    assert " ".join(lines[3].split()) == "2 RF acceleration 100 Hz 1200 11.99 s 80 m/s²"
    assert "  - channel 2 (RF): it has 1 spike of one sample: 7 s." in lines
    assert lines[-2] == f"Next: femupdate calibrate {table}"
    assert "--building" in lines[-1]


def test_as_json_with_a_picture(table, tmp_path):
    picture = tmp_path / "seen.png"
    answer = femupdate("inspect", table, "--json", "--picture", picture).answer
    (one,) = answer["files"]
    assert one["next"] == f"femupdate calibrate {table}"
    assert [c["floor"] for c in one["channels"]] == ["base", "RF"]
    assert "spike" in one["findings"][1]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "study").exists()


def test_a_file_that_cannot_be_read_does_not_hide_the_others(table, tmp_path):
    bad = tmp_path / "bad.csv"
    bad.write_text("Dear all,\nplease find it attached.\n")
    done = femupdate("inspect", bad, table)
    assert done.code == 1
    assert done.err.startswith(f"Error: {bad}: the file is in none of the known formats")
    assert f"Next: femupdate calibrate {table}" in done.out
    assert f"{bad}: the file is in none of the known" in femupdate("inspect", bad).complaint
    assert "no such file" in femupdate("inspect", tmp_path / "no.csv").complaint


def test_wrong_units_of_a_model_are_not_proposed_again(tmp_path):
    deck = Path(__file__).parents[2] / "examples" / "tower.bdf"
    for wrong in ("kip,in", "m,N"):
        done = femupdate("inspect", deck, "--units", wrong)
        assert wrong in done.out.splitlines()[-2]
        assert done.out.splitlines()[-1] == f"Next: femupdate build-model {deck} --draft tower.toml"
