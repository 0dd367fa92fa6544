"""Observation files: histories and FRF tables, good and bad."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import Histories, read_observation_file

N = 100
NAMES = ("base", "2F:1", "2F:2", "RF", "RF.y")
SAMPLES = np.round(
    [np.sin((k + 1) * 0.37 * np.arange(N)) + 0.01 * k * np.arange(N) for k in range(5)], 4
)


def histories_text(
    names=NAMES, samples=SAMPLES, units: str | None = "s,gal,gal,m/s2,g,mg", mark: str = ","
) -> str:
    head = ["# test", ",".join(["time_s", *names])] + ([units] if units else [])
    rows = [
        ",".join([f"{i * 0.005:.3f}", *(f"{v:.4f}" for v in column)])
        for i, column in enumerate(samples.T)
    ]
    return "\n".join([*head, *rows]).replace(",", mark) + "\n"


def frf_text(frequency, columns, head="frequency_hz", units="") -> str:
    rows = [
        ",".join(f"{v:.6g}" for v in row) for row in zip(frequency, *columns.values(), strict=True)
    ]
    return "\n".join([",".join([head, *columns]), *([units] if units else []), *rows])


@pytest.mark.parametrize("mark", [",", ";", "\t"])
@pytest.mark.parametrize("start", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_histories_with_a_unit_for_every_column(write, mark, start, end):
    text = start + histories_text(mark=mark).replace("\n", end)
    data = read_observation_file(write(text, "obs.csv"))
    assert isinstance(data, Histories)
    assert data.time_step == 0.005
    factors = np.array([0.01, 0.01, 1.0, 9.80665, 9.80665e-3])
    np.testing.assert_allclose(data.acceleration, SAMPLES * factors[:, None], rtol=1e-14)
    assert [c.name for c in data.channels] == list(NAMES)
    assert [(c.floor, c.sensor, c.direction) for c in data.channels] == [
        ("base", "", "x"),
        ("2F", "1", "x"),
        ("2F", "2", "x"),
        ("RF", "", "x"),
        ("RF", "", "y"),
    ]
    assert data.floors == ("2F", "RF")
    assert data.source == "obs.csv"


@pytest.mark.parametrize(("first", "time"), [(0, "1"), (1, "200 Hz")])
def test_a_table_without_header_whose_columns_are_told_by_number(write, first, time):
    rows = histories_text(units=None).splitlines()[2:]
    bare = "\n".join(row.split(",", first)[first] for row in rows)
    columns = {"time_s": time} | {ours: str(k + 2 - first) for k, ours in enumerate(NAMES)}
    data = read_observation_file(write(bare), unit="gal", columns=columns)
    assert [channel.name for channel in data.channels] == list(NAMES)
    assert data.time_step == pytest.approx(0.005, rel=1e-12)
    np.testing.assert_allclose(data.acceleration, SAMPLES * 0.01, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "time", "words"),
    [
        (histories_text(), "200 Hz", "the file has times; leave out the rate of 200 Hz"),
        *[("0.1,0.2\n" * 20, f"{r} Hz", f"time_s={r} Hz is no rate") for r in (0, "nan", -5)],
    ],
)
def test_a_rate_that_cannot_be(write, text, time, words):
    with pytest.raises(MeasurementError, match=words):
        read_observation_file(write(text), columns={"time_s": time, "base": "1", "2F": "2"})


def test_unit_option_and_units_beside_the_names(write):
    data = read_observation_file(write(histories_text(units=None)), unit="gal")
    np.testing.assert_allclose(data.acceleration, SAMPLES * 0.01, rtol=1e-14)
    beside = tuple(f"{name} (gal)" for name in NAMES)
    data = read_observation_file(write(histories_text(beside, units=None)))
    np.testing.assert_allclose(data.acceleration, SAMPLES * 0.01, rtol=1e-14)
    assert data.channels[1].name == "2F:1"


def test_floors_are_sorted_from_bottom_to_top_and_names_fold_case(write):
    names = ("rf", "10F", "Base", "2f", "3F:west.Y")
    data = read_observation_file(write(histories_text(names)))
    assert data.floors == ("2F", "3F", "10F", "RF")
    assert [c.name for c in data.channels] == ["RF", "10F", "base", "2F", "3F:west.y"]


def test_other_peoples_names_are_mapped_and_the_rest_left_out(write):
    text = histories_text(("a_base", "a_1F", "2F", "temp", "a_top"), units=None)
    text = text.replace("time_s", "t_s")
    columns = {"time_s": "t_s", "base": "a_base", "2F": "a_1F", "3F": "2F", "RF": "a_top"}
    data = read_observation_file(write(text), "m/s2", columns)
    assert [c.name for c in data.channels] == ["base", "2F", "3F", "RF"]
    np.testing.assert_array_equal(data.acceleration, SAMPLES[[0, 1, 2, 4]])


@pytest.mark.parametrize("name", ["t", "t_s", "time", "Time (s)", "time [s]", "Seconds"])
def test_usual_names_of_times_in_seconds_need_no_mapping(write, name):
    text = histories_text(units="s,gal,gal,gal,gal,gal").replace("time_s", name)
    np.testing.assert_allclose(read_observation_file(write(text)).time_step, 0.005)


@pytest.mark.parametrize("name", ["t_ms", "time_min", "tension"])
def test_a_name_that_may_mean_another_unit_is_not_taken_for_seconds(write, name):
    with pytest.raises(MeasurementError, match="one column must be time_s"):
        read_observation_file(write(histories_text().replace("time_s", name)))


def test_frf_table_of_magnitudes_with_some_noise(write):
    frequency = [0.5, 1.0, 2.5]
    columns = {"RF": [1.1, 3, 0.2], "2F_sd": [0.1, 0.2, 0.3], "2F": [1, 2, 0.5]}
    table = read_observation_file(write(frf_text(frequency, columns, units="Hz,-,-,-")))
    np.testing.assert_array_equal(table.frequency_hz, frequency)
    assert table.floors == ("2F", "RF")
    np.testing.assert_allclose(np.exp(table.log_frf), [[1, 2, 0.5], [1.1, 3, 0.2]])
    np.testing.assert_array_equal(table.noise_sd, [[0.1, 0.2, 0.3], [0.2] * 3])
    assert table.notes == ("Noise on ln|H| taken as 0.2 for RF.",)
    assert table.phase is None


def test_frf_table_of_complex_values(write):
    columns = {"RF_re": [1, 0, -1], "RF_im": [0, -2, -0.5], "2F_re": [1, 1, 1], "2F_im": [0, 0, 1]}
    table = read_observation_file(write(frf_text([1, 2, 4], columns)))
    found = np.exp(table.log_frf + 1j * table.phase)
    np.testing.assert_allclose(found, [[1, 1, 1 + 1j], [1, -2j, -1 - 0.5j]], atol=1e-15)
    np.testing.assert_allclose(table.log_frf[1], np.log([1, 2, np.sqrt(1.25)]), atol=1e-15)


def with_row(number: int, old: str, new: str) -> str:
    lines = histories_text().split("\n")
    assert old in lines[number - 1]
    lines[number - 1] = lines[number - 1].replace(old, new, 1)
    return "\n".join(lines)


GOOD = histories_text()
HISTORY_ERRORS = {
    "no header": (GOOD.split("mg\n")[1], "line 1: the first row must name the columns"),
    "no unit": (histories_text(units=None), "column 'base': the file does not say its unit"),
    "blank unit": (GOOD.replace("s,gal,gal", "s,gal,"), "column '2F:1': the file does not say"),
    "wrong unit": (GOOD.replace(",mg", ",mm"), "unknown unit 'mm' for acceleration"),
    "no time": (GOOD.replace("time_s", "zeit"), "the first is 'zeit'; rename it or map it"),
    "times missing": ("base (g),RF (g)\n" + "\n".join(f"{i % 5},{i % 7}" for i in range(N)),
        "the first is 'base'; give the samples a second by --rate 200"),
    "unknown column": (GOOD.replace(",RF,", ",roof,"),
        "unknown column 'roof' (did you mean 'RF'?); columns"),
    "near miss": (GOOD.replace("base", "bse"), "unknown column 'bse' (did you mean 'base'?)"),
    "first floor": (GOOD.replace("2F:1", "1F"), "unknown column '1F'"),
    "repeated": (GOOD.replace("2F:2", "2F:1"), "line 2: two columns are called '2F:1'"),
    "repeated in other case": (GOOD.replace("RF.y", "rf"), "column 'rf' is there twice"),
    "no base": (GOOD.replace("base", "3F"), "there is no column base"),
    "base alone": ("time_s,base\ns,g\n" + "\n".join(f"{i},{i % 7}" for i in range(N)), "no floor"),
    "text": (with_row(50, "0.230,", "0.230,?"), "line 50, column 'base': '?-0.9667' is not a num"),
    "extra cell": (with_row(9, "0.025,", "0.025,,"), "line 9: the row has 7 cells where 6"),
    "two rows": ("\n".join(GOOD.split("\n")[:5]), "line 5: 2 rows are too short for a spectrum"),
    "short": ("\n".join(GOOD.split("\n")[:66]), "line 66: 63 rows are too short for a spectrum"),
    "gap": ("\n".join(GOOD.split("\n")[:40] + GOOD.split("\n")[41:]), "line 41, column 'time_s'"),
    "818 g": (histories_text(samples=SAMPLES / np.abs(SAMPLES[0]).max() * 818, units="s,g,g,g,g,g"),
        "column 'base': the base peaks at 818 g"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("nan", r"the .* or nan \(1 in all\)"),
        ("", "the cell is blank"),
        ("inf", "the value is inf"),
    ],
)
def test_bad_cell_is_named_by_line_and_column(write, cell, message):
    lines = GOOD.split("\n")
    cells = lines[69].split(",")
    cells[3] = cell
    lines[69] = ",".join(cells)
    with pytest.raises(MeasurementError, match=f"line 70, column '2F:2': {message}"):
        read_observation_file(write("\n".join(lines)))


@pytest.mark.parametrize(
    ("row", "message"),
    [(0, "column 'base': every value is 0: .*base that moves"), (3, "'RF': .* leave it out")],
)
def test_dead_channel(write, row, message):
    samples = SAMPLES.copy()
    samples[row] = 0.0
    with pytest.raises(MeasurementError, match=message):
        read_observation_file(write(histories_text(samples=samples)))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"base": "bas"}, r"no column 'bas' to take for base \(did you mean 'base'\?\)"),
        ({"3F": "RF", "4F": "RF"}, "column 'RF' is mapped twice"),
        ({"RF.y": "RF"}, "column 'RF.y' is there twice"),
        ({"roof": "RF"}, "unknown column 'roof'"),
        ({"frequency_hz": "RF"}, "one column must be time_s or frequency_hz"),
    ],
)
def test_bad_mapping(write, columns, message):
    with pytest.raises(MeasurementError, match=message):
        read_observation_file(write(GOOD), columns=columns)


@pytest.mark.parametrize("theirs", ["Roof sensor", "roof SENSOR", "roof", "Roof sensor (m/s2)"])
def test_a_column_goes_by_its_whole_name_in_any_case_or_by_its_first_word(write, theirs):
    path = write(GOOD.replace("RF,", "Roof sensor,", 1))
    data = read_observation_file(path, columns={"3F": theirs})
    np.testing.assert_allclose(data.acceleration[data.rows("3F", "x")], SAMPLES[3:4] * 9.80665)


FREQUENCY = [1.0, 2.0, 3.0, 4.0]
H = [1.0, 2.0, 3.0, 0.5]
FRF_ERRORS = {
    "two rows": (frf_text([1, 2], {"RF": [1, 2]}), "line 3: 2 rows are no response function"),
    "decreasing": (frf_text([1, 3, 2, 4], {"RF": H}), "line 4, column frequency_hz: the freq"),
    "repeated frequency": (frf_text([1, 2, 2, 4], {"RF": H}), "line 4, column frequency_hz"),
    "negative frequency": (frf_text([-1, 2, 3, 4], {"RF": H}), "line 2, column frequency_hz"),
    "zero": (frf_text(FREQUENCY, {"RF": [1, 0, 3, 4]}), "line 3, column 'RF': |H| is 0"),
    "negative": (frf_text(FREQUENCY, {"RF": [1, 2, -3, 4]}), "line 4, column 'RF': |H| is -3"),
    "complex zero": (frf_text(FREQUENCY, {"RF_re": [1, 0, 3, 4], "RF_im": [1, 0, 0, 0]}),
        "line 3, column 'RF_re': |H| is 0"),
    "no imaginary part": (frf_text(FREQUENCY, {"RF_re": H}), "floor RF must have either"),
    "both": (frf_text(FREQUENCY, {"RF_re": H, "RF_im": H, "RF": H}), "floor RF must have either"),
    "noise alone": (frf_text(FREQUENCY, {"RF_sd": H}), "floor RF must have either"),
    "zero noise": (frf_text(FREQUENCY, {"RF": H, "RF_sd": [1, 2, 3, 0]}),
        "line 5, column 'RF_sd': the standard deviation of ln|H| is 0, and no measurement"),
    "two modes": (frf_text([3.8, 10], {"RF": [1, 2]}), "modes are told by a column mode"),
    "nan noise": (frf_text(FREQUENCY, {"RF": H, "RF_sd": [1, 2, np.nan, 4]}),
        "line 4, column 'RF_sd': the cell is blank"),
    "radians": (frf_text(FREQUENCY, {"RF": H}, units="rpm,-"), "unknown unit 'rpm'"),
    "base": (frf_text(FREQUENCY, {"base": H, "RF": H}), "unknown column 'base'"),
    "sensor": (frf_text(FREQUENCY, {"RF:1": H}), "unknown column 'RF:1'"),
    "too large": (frf_text(FREQUENCY, {"RF": [1, 1e9, 2, 1]}), "line 3, column 'RF': |H| is 1e+09"),
    "too small": (frf_text(FREQUENCY, {"RF": [1, 1e-200, 2, 1]}), "|H| is 1e-200, and no meas"),
    "large part": (frf_text(FREQUENCY, {"RF_re": [1e200] * 4, "RF_im": H}), "|H| is 1e+200"),
    "little noise": (frf_text(FREQUENCY, {"RF": H, "RF_sd": [1e-300] * 4}), "of ln|H| is 1e-300"),
    "frequencies alone": (frf_text(FREQUENCY, {}), "no column of a floor"),
}  # fmt: skip


ERRORS = HISTORY_ERRORS | {f"frf: {name}": case for name, case in FRF_ERRORS.items()}


@pytest.mark.parametrize(("text", "message"), ERRORS.values(), ids=ERRORS)
def test_a_bad_table(write, text, message):
    with pytest.raises(MeasurementError) as caught:
        read_observation_file(write(text, "bad.csv"))
    assert message in str(caught.value)
    assert "bad.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_real_bench_top_frame(shared_file):
    columns = {"base": "a_base", "2F": "a_1F", "3F": "a_2F", "RF": "a_3F"}
    path = shared_file("data/mini_flexible_northridge.csv")
    data = read_observation_file(path, "m/s2", columns)
    # 120 Hz in the file's own comment; its times are rounded to 1e-6 s.
    assert data.time_step == 1 / 120
    assert data.acceleration.shape == (4, 12116)
    np.testing.assert_array_equal(
        data.acceleration[:, 46], [0.003609, 0.019520, 0.041422, 0.053366]
    )
    with pytest.raises(MeasurementError, match=r"unknown column 'a_base'.*: rename it or map it"):
        read_observation_file(path, "m/s2")


@pytest.mark.parametrize("value", ["1e300", "-5e4"])
def test_a_spike_that_no_floor_feels(write, value):
    lines = histories_text(units="s,m/s2,m/s2,m/s2,m/s2,m/s2").splitlines()
    cells = lines[40].split(",")
    lines[40] = ",".join([*cells[:4], value, *cells[5:]])
    with pytest.raises(MeasurementError, match=r"'RF': value 38 is .*which no floor feels"):
        read_observation_file(write("\n".join(lines), "obs.csv"))


@pytest.mark.parametrize("factor", [1e-9 / 0.005, 1e6 / 0.005])
def test_a_time_step_with_which_nothing_is_measured(write, factor):
    head, *rest = histories_text().split("\n", 3)
    rows = [line.split(",", 1) for line in rest[-1].splitlines()]
    table = "\n".join(f"{factor * float(time):.12g},{cells}" for time, cells in rows)
    with pytest.raises(MeasurementError, match=r"the time step is .* s, and buildings are"):
        read_observation_file(write("\n".join([head, *rest[:-1], table]), "obs.csv"))
