"""What users report of their files, and the first day of one: each file is told what is right."""

import shlex

import pytest
from click.testing import CliRunner
from femupdate.cli.main import group

from femupdate.building import load_building

FOUR = ("--columns", "base=1,2F=2,3F=3,RF=4")
THREE = ("--columns", "base=1,2F=2,RF=3")
RIGHT = "Nothing looks wrong."
# Of every file what `inspect` must say; the reasons stand beside the files.
SAID = {
    "reports/blank_gap_40.csv": ("Cut to the time that all channels have, 20.4", "blank cells"),
    "reports/blank_starts_late.csv": ("Cut to the time that all channels have, 7 to", RIGHT),
    "reports/clean_seed3_120s.csv.gz": (RIGHT,),
    "reports/counts.csv": ("give what a count is with --unit", "RF=RF*4.7e-6"),
    "reports/damping_0.001.csv": (RIGHT,),
    "reports/date_am_pm.csv": ("100 Hz", RIGHT),
    "reports/date_offset.csv": ("100 Hz", RIGHT),
    "reports/epoch_ms.csv": ("read as ms since 1970", "100 Hz"),
    "reports/gain_base_quarter.csv": ("(base) moves 0.251 times as much as all floors",),
    "reports/gain_roof_quarter.csv": ("(RF) moves 0.249 times as much as channel 1",),
    "reports/jitter_phone.csv": ("are interpolated to 100 Hz",),
    "reports/knet_max_differs.NS": ("peaks at 127.4 gal, but its header says 13.23",),
    "reports/late_roof_800ms.csv": ("(RF) runs 800 ms behind channel 1",),
    "reports/long_name.uff": ("point 4 +X", RIGHT),
    "reports/mixed_units.csv": (RIGHT,),
    "reports/model.e2k": ("it has no STORY or no POINT",),
    "reports/model.tcl": ("OpenSees",),
    "reports/modes_damping_negative.csv": ("damping ratio of -0.01", "leave blank"),
    "reports/modes_foreign.csv": ("mode 2 at 6.3 Hz",),
    "reports/modes_no_sd.csv": (RIGHT,),
    "reports/roof_clock_4000ppm.csv": ("1000 s of its clock are 1003.7 s",),
    "reports/start_3s_late.tdms": ("by the file, RF 3 s later than the first",),
    "reports/start_3s_late.uff": ("point 4 +X 3 s later than the first",),
    "reports/theta1_0.2_below_prior.csv.gz": (RIGHT,),
    "reports/times_two_decimals_125hz.csv": ("rounded to 0.01 s: 125 Hz is taken",),
    "reports/times_two_decimals_200hz.csv": ("rounded to 0.01 s: 200 Hz is taken",),
    "reports/times_whole_seconds.csv": ("rounded to 1 s: 100 Hz is taken",),
    "reports/two_clocks.mat": ("RF 3 s later than the first", "3 channels"),
    "reports/two_rates.tdms": ("50 Hz",),
    "reports/two_rates.uff": ("50 Hz",),
    "reports/uneven_20_20.uff": ("1200", RIGHT),
    "first_day/names_en.csv": ("base=Ground,2F=Floor1,3F=Floor2,RF=Roof",),
    "first_day/quoted_thousands.csv": ("Times in ms are called time_s (ms)", "1436"),
}
MAPPED = {"reports/two_rates": THREE, "reports/": FOUR}


def told(words):
    """Output of a command, and its exit code."""
    result = CliRunner().invoke(group, words)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return " ".join(result.output.split()), result.exit_code


@pytest.mark.parametrize("name", SAID)
def test_inspect_says_what_is_right(shared_file, name):
    path = shared_file(f"cases/{name}")
    mapped = next(how for start, how in {**MAPPED, "": ()}.items() if name.startswith(start))
    output, _ = told(["inspect", str(path), *(mapped if path.suffix in (".uff", ".tdms") else ())])
    for words in SAID[name]:
        assert words in output


def test_channels_of_one_direction_are_no_record_of_one_place(shared_file):
    output, _ = told(["inspect", str(shared_file("cases/reports/two_rates.uff"))])
    assert "calibrate" in output
    assert "--columns base=NUMBER,RF=NUMBER Put in which channels are base and RF" in output


# Building files that are refused before anything is computed.
REFUSED = {
    "reports/springs_1_newton.toml": "supports.kx: the whole building would move at 0.0003 Hz",
    "reports/springs_soft_1e4.toml": "supports.kx: the whole building would move at 0.03 Hz",
    "reports/windows_path_mo.toml": "write / in its place",
    "reports/windows_path_tn.toml": "write / or single quotes",
    "first_day/unit_MPa.toml": "is no concrete, of which 10 to 60 GPa are usual",
    "first_day/mmcol.toml": "correct the member that is too heavy",
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_building_that_is_wrong_is_refused_in_a_sentence(shared_file, name, tmp_path):
    path, study = shared_file(f"cases/{name}"), tmp_path / "study"
    output, code = told(shlex.split(f"build-model {path} --study {study} --no-pictures"))
    assert code == 1
    assert "Error: " in output
    assert REFUSED[name] in output
    assert not (study / "reduced_model.npz").exists()


# Building files that are taken, and what is asked about their figures.
ASKED = {
    "reports/slabs_9m_bays.toml": "bays of 9 by 9 m bend from about 3.6 Hz",
    "first_day/story_order.toml": "their names count downwards",
    **{f"first_day/{name}.toml": "" for name in ("rc3", "steel8", "stick", "tower20")},
    "reports/mezzanine_diagonal_modes.toml": "",
}


@pytest.mark.parametrize("name", ASKED)
def test_a_building_is_asked_about_or_taken_in_silence(shared_file, name, caplog):
    load_building(shared_file(f"cases/{name}"))
    assert ASKED[name] in caplog.text
    assert caplog.text == "" or ASKED[name]


# What `calibrate` says first, beyond `inspect`; its exit code.
NAMED = "--columns base=Ground,2F=Floor1,3F=Floor2,RF=Roof --unit m/s2 --building"
CALIBRATED = {
    # As `inspect` proposes it; the file's base is bent, which makes .99 of 1.
    "../first_day/names_en.csv": ("the data are explained", 0),
    "modes_foreign.csv": ("mode 2 at 6.3 Hz is left out", 0),
    "modes_damping_negative.csv": ("leave the cell blank", 1),
    "modes_no_sd.csv": ("Verdict: the data are explained", 0),
    "damping_0.001.csv": ("presses against the prior's lower limit", 0),
    "theta1_0.2_below_prior.csv.gz": ("change lower of [prior.theta]", 1),
    "gain_roof_quarter.csv": ("right? If not, --columns RF=NAME*4.02 corrects it", 0),
    "roof_clock_4000ppm.csv": ("RF has 11 % of the points", 0),
    # The likelihood of the whole record, its noise given, says .8994 +- .0002 for the truth of .9.
    "clean_seed3_120s.csv.gz": ("story S1 0.898", 0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CALIBRATED)
def test_calibrate_says_what_is_right(shared_file, name, tmp_path):
    path, (words, code) = shared_file(f"cases/reports/{name}"), CALIBRATED[name]
    how = "--building shear_3dof --particles 300 --no-pictures --quiet"
    how += f" {NAMED} {path.with_name('stick.toml')}" * (path.stem == "names_en")
    output, ended = told(shlex.split(f"calibrate {path} --study {tmp_path / 's'} {how}"))
    assert (words in output, ended) == (True, code), output


def test_every_file_is_ticked_off(shared_file):
    shared = shared_file("cases/reports/README.md").parents[1]
    files = {f"{d}/{f.name}" for d in ("reports", "first_day") for f in (shared / d).iterdir()}
    code = {"reports/README.md", "first_day/make_stick_data.py"}
    assert files - code == {*SAID, *REFUSED, *ASKED}
