"""What a file is said to hold, what looks wrong in it, and the command to run next."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from femupdate.measurement import (
    RecordedChannel,
    channel_findings,
    floors_of,
    inspect_file,
    pair_findings,
)
from femupdate.measurement.inspection import next_step

RATE = 100.0


def shaken(seed: int = 0, count: int = 6000) -> np.ndarray:
    """A pulse of band-limited noise between quiet ends, in gal, printed with three decimals."""
    rng = np.random.default_rng(seed)
    noise = sosfilt(butter(4, [0.5, 30.0], "band", fs=RATE, output="sos"), rng.normal(size=count))
    time = np.arange(count) / RATE
    envelope = np.exp(-(((time - 20.0) / 8.0) ** 2)) + 0.003
    return np.round(200.0 * envelope * noise + 0.02 * rng.normal(size=count), 3)


def channel(values, **changes) -> RecordedChannel:
    given = {"name": "a", "time_step": 1 / RATE, "unit": "gal", **changes}
    return RecordedChannel(values=np.asarray(values, dtype=float), **given)


def findings(values, si=0.01, **changes):
    return channel_findings(channel(values, **changes), si)


@pytest.mark.parametrize("seed", range(25))
def test_nothing_is_said_of_a_good_record(seed):
    assert findings(shaken(seed)) == ()
    noise = np.random.default_rng(seed).normal(size=20_000)
    assert findings(np.round(noise, 4)) == ()


def clipped(values):
    limit = 0.6 * np.abs(values).max()
    wide = np.repeat(values, 4)  # slow enough for a flat top
    return np.clip(wide, -limit, limit)


def spiked(values):
    values = values.copy()
    values[[3500, 4000]] += [900.0, -700.0]
    return values


def stuck(values):
    values = values.copy()
    values[1800:2000] = values[1800]
    return values


WRONG = {
    "dead": (lambda v: 0 * v + 3.0, "it is dead: every value is 3."),
    "clipped": (clipped, "it is clipped: "),
    "spikes": (spiked, "it has 2 spikes of one sample: 35 s, 40 s."),
    "stuck": (stuck, "it stands still from 18 to 19.99 s"),
    "offset": (lambda v: v + 40.0, "its mean is 40 gal, an offset, which is taken off."),
    "too large": (lambda v: 500.0 * v, "more than any earthquake (5 g): is the unit wrong?"),
    "too small": (lambda v: 1e-7 * v, "below what an accelerometer resolves"),
    "few digits": (lambda v: np.round(v / 20.0), "steps of its digits only"),
}


@pytest.mark.parametrize(("spoil", "said"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said_and_nothing_else(spoil, said):
    (sentence,) = findings(spoil(shaken()))
    assert said in sentence


@pytest.mark.parametrize(
    ("changes", "si", "said"),
    [
        (
            {"unit": None},
            None,
            "the file does not say its unit; give it with --unit (identify needs none).",
        ),
        ({"unit": "mm"}, None, "'mm' is not one of acceleration; export"),
        ({"time_step": 1e-9}, 0.01, "its sampling rate is 1e+09 Hz; buildings are measured at 5"),
        ({"time_step": 1e6}, 0.01, "its sampling rate is 1e-06 Hz"),
        ({"stated_peak": 700.0}, 0.01, "but its header says 700."),
    ],
)
def test_what_the_header_gets_wrong(changes, si, said):
    sentences = findings(shaken(), si, **changes)
    assert said in sentences[0]


def test_channels_that_repeat_or_reverse_another():
    base = shaken()
    # An oscillator at 4 Hz follows the base below half of that.
    floor = base + 0.3 * sosfilt(butter(2, [3.5, 4.5], "band", fs=RATE, output="sos"), base)
    floors = ("base", "2F", "RF", None)
    channels = [channel(v) for v in (base, floor, -floor, floor)]
    said = pair_findings(channels, floors)
    assert said == (
        "channels 2 and 4 hold the same numbers.",
        "channel 3 (a) moves against the base where both should move together, at low frequency:"
        " is its direction reversed?",
    )
    up = [channel(base, direction="Up"), channel(floor, direction="UD"), channel(-floor)]
    assert pair_findings(up, ("base", "2F", None)) == (
        "channels 1, 2 are vertical: no response to the base's horizontal motion.",
    )


PLACES = {
    "Roof - center": "RF",
    "4th floor, east core": "4F",
    "12th Floor": "12F",
    "level 3": "3F",
    "Flr_5": "5F",
    "1st Floor: North": "base",
    "Basement": "base",
    "Free Field": "base",
    "On Ground: Near West Abutment": "base",
    "Ground Floor": "base",
    "2F:1": "2F",
    "RF.y": "RF",
    "EG Decke": None,
    "Deck: Near West Abutment": None,
    "HNE": None,
}


@pytest.mark.parametrize(("text", "floor"), PLACES.items())
def test_floors_are_told_from_words(text, floor):
    assert floors_of([text]) == (floor,)


def placed(location, direction="N", seed=0, **changes):
    return channel(shaken(seed), name=location, location=location, direction=direction, **changes)


def test_next_command_maps_the_direction_with_most_floors(tmp_path):
    channels = [
        placed("Basement", "E", azimuth_deg=90.0),
        placed("Basement", "N", azimuth_deg=0.0),
        placed("Free field", "N", azimuth_deg=0.0),
        placed("2nd floor, west", "S", azimuth_deg=180.0),
        placed("2nd floor, east", "N", azimuth_deg=0.0),
        placed("Roof", "Up"),
        placed("Roof", "N", azimuth_deg=2.0),
    ]
    step = next_step(tmp_path / "a b.zip", channels, None, None)
    assert step.command.endswith("a b.zip' --columns base=2,2F:1=-4,2F:2=5,RF=7")
    assert step.columns["base.y"] == "1"
    assert "check them against the building" in step.advice


def test_next_command_of_a_record_takes_the_strongest_horizontal_component(tmp_path):
    record = [channel(shaken(k) * (k + 1), direction=d) for k, d in enumerate(("NS", "EW", "UD"))]
    step = next_step(tmp_path / "q.csv", record, None, None)
    assert step.command.endswith("q.csv --channel 2")
    assert step.command.startswith("femupdate predict --record ")


def test_two_bases_are_asked_about_and_components_are_a_record(tmp_path, write):
    low = [channel(shaken(k), name=name) for k, name in enumerate(("B1F", "1F", "2F"))]
    assert next_step(tmp_path, low, None, None).advice.startswith("Is the base B1F or 1F?")
    rows = "\n".join(f"{k / 100},{k % 7},{k % 3},{k % 5}" for k in range(90))
    assert "predict --rec" in inspect_file(write(f"t,x (g),y (g),z (g)\n{rows}\n")).step.command


def test_columns_of_a_table_with_other_names(write):
    rows = zip(np.arange(200) / RATE, *(shaken(k)[2000:2200] for k in range(3)), strict=True)
    text = "\n".join(",".join(f"{v:g}" for v in row) for row in rows)
    one = inspect_file(write("t_s,a_base,a_1F,a_roof\n" + text, "t.csv"))
    assert [each.floor for each in one.channels] == ["base", "2F", "RF"]
    assert "--unit UNIT --columns time_s=t_s,base=a_base,2F=a_1F,RF=a_roof" in one.step.command
    one = inspect_file(write("time_s,base,RF,2F.z\ns,gal,gal,gal\n" + text, "u.csv"))
    assert one.step.command.endswith("femupdate calibrate " + str(one.path))
    assert one.summary == "3 channels (tables in CSV or other text)"


def test_response_functions_of_a_table(write):
    text = "frequency_hz,2F,RF\n1,1,1\n2,1.5,2\n3,3,6\n"
    one = inspect_file(write(text, "h.csv"))
    assert one.summary.startswith("2 functions of frequency")
    assert [each.response for each in one.functions] == ["2F", "RF"]
    assert one.step.command.startswith("femupdate calibrate ")


def test_functions_of_columns_that_do_not_say_their_floors(write):
    rows = "\n".join(f"{k},{k}+2j,3" for k in range(1, 5))
    path = write("Frequency (Hz);H 1 (m/s2/N);b\n" + rows.replace(",", ";"), "h 1.csv")
    one = inspect_file(path)
    assert one.function_texts == (
        "function H 1: 4 points from 1 to 4 Hz, m/s2/N",
        "function b: 4 points from 1 to 4 Hz, no unit",
    )
    np.testing.assert_array_equal(one.functions[0].values, np.arange(1, 5) + 2j)
    assert one.step.command.endswith("/h 1.csv' --columns 2F=NAME,RF=NAME")
    told = inspect_file(path, "g/N", {"2F/RF": "H 1"})
    assert [each.response for each in told.functions] == ["2F"]
    assert told.step.command.endswith("/h 1.csv' --unit g/N --columns '2F/RF=H 1'")


def test_hits_of_a_hammer_are_no_spikes():
    force = np.zeros(6000)
    for start in (200, 2500, 4700):
        force[start : start + 4] = [300.0, 2500.0, 1400.0, 100.0]
    assert findings(force, None, quantity="force", unit="N") == ()
    assert findings(force)
    (said,) = findings(np.minimum(force, 100.0), None, quantity="force", unit="N")
    assert said == "it is clipped: 4 samples in a row stand at its largest value."


def test_next_command_of_a_force(tmp_path):
    hammer = channel(shaken(1), name="hammer", quantity="force", unit="N")
    told = [channel(shaken(k), name=f"a{k}") for k in range(2)]
    step = next_step(tmp_path / "a.uff", [hammer, *told], None, None)
    assert step.command.endswith("a.uff --columns force/RF=1,RF=NUMBER")
    step = next_step(tmp_path / "a.mat", [hammer, *told], ["time_s", "hammer", "a0", "a1"], None)
    assert step.command.endswith("a.mat --columns force/RF=hammer,RF=NAME")
    columns = {"force/RF": "1", "2F": "2"}
    step = next_step(tmp_path / "a.uff", [hammer, *told], None, None, columns)
    assert step.command.endswith("calibrate " + str(tmp_path / "a.uff --columns force/RF=1,2F=2"))


def test_genuine_files(shared_file):
    one = inspect_file(shared_file("formats/cesmd_painter_street_nc73666231.zip"))
    assert one.summary == "16 channels (zip, tar and gzip archives of records)"
    assert one.all_findings == (
        "channels 2, 5, 7, 9, 12, 15 are vertical: no response to the base's horizontal motion.",
    )
    assert one.step.command.endswith("--columns base:1=3,base:2=13,base:3=16,RF=6")
    # The peaks stated in data/README.md, cm/s2.
    for number, peak in ((3, 50), (5, 7), (7, 17), (8, 90), (9, 8), (12, 18)):
        one = inspect_file(shared_file(f"data/hotel_quake_{number}.csv"))
        assert one.all_findings == ()
        assert one.channels[0].peak_m_s2 == pytest.approx(peak / 100, abs=5e-3)
    one = inspect_file(shared_file("data/mini_flexible_sine1p0.csv"), "m/s2")
    assert one.all_findings == ()
