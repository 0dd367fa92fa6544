"""Identified modes in tables and universal files: read, put on floors, refused, inspected."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import RecordedMode, inspect_file, kind_in, mode_findings, read_measured
from femupdate.measurement.modes import in_phase, mac, phase_collinearity


def read(path, **how):
    return kind_in(read_measured(path), **how)


TABLE = """# identified by somebody
mode,frequency_hz,frequency_sd_hz,damping (%),damping_sd (%),2F,RF,RF_sd
1,1.75,0.01,1.0,0.2,0.35,-1,0.02
2,5.03,,1.3,,-0.98,,
3,7.70,-,,n/a,0.1,0.6,0.03
"""


def test_every_column(write):
    modes = read(write(TABLE, "modes.csv"))
    assert (modes.names, modes.floors, modes.source) == (("1", "2", "3"), ("2F", "RF"), "modes.csv")
    np.testing.assert_array_equal(modes.frequency_hz, [1.75, 5.03, 7.7])
    np.testing.assert_array_equal(modes.frequency_sd_hz, [0.01, np.nan, np.nan])
    np.testing.assert_allclose(modes.damping, [0.01, 0.013, np.nan])
    np.testing.assert_allclose(modes.damping_sd, [0.002, np.nan, np.nan])
    np.testing.assert_array_equal(modes.shape, [[0.35, -1.0], [-0.98, np.nan], [0.1, 0.6]])
    np.testing.assert_array_equal(modes.shape_sd, [[np.nan, 0.02], [np.nan] * 2, [np.nan, 0.03]])


def test_foreign_names_semicolons_and_units_in_a_row(write):
    text = "Mode;f;xi;phi roof;phi ground;junk\n-;Hz;%;-;-;-\n1;1,75;2,0;1,0;0,1;5\n2;5,5;;;;\n"
    names = {"frequency_hz": "f", "damping": "xi", "RF": "phi roof", "2F": "phi ground"}
    modes = read(write(text, "m.csv"), columns=names)
    np.testing.assert_array_equal(modes.frequency_hz, [1.75, 5.5])
    np.testing.assert_allclose(modes.damping, [0.02, np.nan])
    np.testing.assert_array_equal(modes.shape[0], [0.1, 1.0])


F = np.array([[3.80, 10.1, 16.0], [3.84, 10.0, np.nan], [3.82, 10.3, 16.4]])
TESTS = {
    "test,f1,f2,f3": (("run 1", '"run 2, calm"', '"run, 3"'), ","),
    "Date;Mode 1 [Hz];Mode 2 [Hz];Mode 3 [Hz]": (("2024-01-01", "2024-01-02", "2024-02-01"), ";"),
    "freq_1 (Hz)|1st damping (%)|freq_2 (Hz)|freq_3 (Hz)": ((), "|"),
}


@pytest.mark.parametrize("head", TESTS)
def test_many_tests_of_modes_with_a_row_each(write, head):
    names, mark = TESTS[head]
    damped = "damping" in head
    rows = [
        [*([name] if names else []), *map(str, f)]
        for name, f in zip(names or "abc", F, strict=True)
    ]
    rows = [row[:1] + ["2.0"] * damped + row[1:] for row in rows]
    text = "\n".join([head, *(mark.join(row) for row in rows)])
    modes = read(write(text.replace(".", "," if mark == ";" else ".").replace("nan", ""), "m.csv"))
    np.testing.assert_allclose(modes.frequency_hz, np.nanmean(F, axis=0))
    error = np.nanstd(F, axis=0, ddof=1) / np.sqrt([3, 3, 2])
    np.testing.assert_allclose(modes.frequency_sd_hz, error, rtol=1e-5)
    np.testing.assert_allclose(modes.damping[0], 0.02 if damped else np.nan)
    assert "3 tests: of every mode" in read_measured(write(text, "m.csv")).notes[-1]


@pytest.mark.parametrize("name", ["Test", "date", "run no."])
def test_many_tests_of_modes_in_a_long_table(write, name):
    """Periods of 1/2 and 1/6 s; shapes in any scale, and one mode that one test has not found."""
    rows = [
        ("A-1", 1, 0.5, 3, 0.5, 1),
        ("A-1", 2, 1 / 6, 5, -1, 1),
        ("7 May", 1, 1 / 2.2, "", -1, -2),
    ]
    head = f"{name},Mode,Period (s),damping (%),2F,RF\n"
    text = head + "".join(",".join(map(str, row)) + "\n" for row in rows)
    modes = kind_in(read_measured(write(text, "m.csv")))
    np.testing.assert_allclose(modes.frequency_hz, [2.1, 6.0])
    np.testing.assert_allclose(modes.frequency_sd_hz, [0.1, np.nan])
    np.testing.assert_allclose(modes.damping, [0.03, 0.05])
    np.testing.assert_allclose(modes.shape, [[0.5, 1.0], [-1.0, 1.0]])
    with pytest.raises(MeasurementError, match=r"line 5.*mode 1 is given twice"):
        kind_in(read_measured(write(text + "A-1,1,0.4,,,\n", "m.csv")))


@pytest.mark.parametrize("cell", ["3+4j", "(3+4j)", "3 + 4 i", "3.0+4.0*I"])
def test_complex_shapes_are_turned_to_be_real(write, cell):
    text = f"mode,frequency_hz,2F,RF\n1,2.0,{cell},6+8j\n2,3.0,1j,-2j\n"
    modes = read(write(text, "m.csv"))
    np.testing.assert_allclose(modes.shape[:, 1] / modes.shape[:, 0], [2.0, -2.0], rtol=1e-12)
    np.testing.assert_allclose(np.abs(modes.shape[0]), [5.0, 10.0], rtol=1e-12)
    assert modes.notes == ()


def test_a_shape_out_of_phase_is_told(write):
    path = write("mode,frequency_hz,2F,RF\n1,2.0,1,1j\n", "m.csv")
    said = ("mode 1 at 2 Hz: the sensors do not move in phase",)
    assert read(path).doubts == inspect_file(path).findings == said
    assert phase_collinearity(np.array([1.0, 1j])) == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(in_phase(np.array([2.0, -1.0]) * np.exp(0.7j)) ** 2, [4.0, 1.0])


def test_modes_of_a_universal_file(shared_file):
    pytest.importorskip("pyuff", reason="pyuff (extra `formats`) is not installed")
    path = shared_file("formats/uff55_translation.uff")
    modes = read(path, columns={"2F": "point 1 +Y", "RF": "point 4 +Y"})
    np.testing.assert_array_equal(modes.frequency_hz, [10.0, 12.0, 13.0])
    np.testing.assert_allclose(modes.shape[0], [-1.46518, 0.724863])
    with pytest.raises(MeasurementError, match=r"say which are.*among point 1 \+X, point 1 \+Y"):
        read(path)
    with pytest.raises(MeasurementError, match=r"no component 'point 9 \+X' to take for 2F"):
        read(path, columns={"2F": "point 9 +X"})
    with pytest.raises(MeasurementError, match=r"component 'point 4 \+Y' is mapped twice"):
        read(path, columns={"2F": "point 4 +Y", "RF": "point 4 +Y"})


def test_inspect(write):
    one = inspect_file(write(TABLE, "modes.csv"))
    assert one.summary == "3 modes (tables of identified modes)"
    assert one.mode_texts[0] == "mode 1 at 1.75 ± 0.01 Hz, damping ratio 0.01, 2 components"
    assert one.step.command.startswith("femupdate calibrate ")
    assert one.as_dict()["modes"][1]["damping"] == pytest.approx(0.013)


def test_findings():
    def mode(frequency, shape, **changed):
        return RecordedMode(
            frequency_hz=frequency,
            sensors=("2F", "RF"),
            shape=np.array(shape),
            **{"name": "1", **changed},
        )

    twice = (mode(2.0, [1.0, 2.0]), mode(2.02, [-1.0, -2.1], name="2"))
    assert mode_findings(twice)[0].endswith("this looks like one mode found twice")
    assert mode_findings((twice[0], mode(2.02, [2.0, -1.0]), mode(2.5, [1.0, 2.0]))) == ()
    assert mac(*(seen.shape for seen in twice)) == pytest.approx((1 + 4.2) ** 2 / (5 * 5.41))
    (told,) = mode_findings((mode(2.0, [1.0, 2.0], damping=2e-4),))  # .02 under a title in %
    assert told.endswith("damping ratio of 0.0002: is it a ratio, and not in percent?")
    doubtful = mode(2.0, [0.0, 0.0], damping=0.2, frequency_sd_hz=0.5)
    assert [text.split(" at 2 Hz")[1] for text in mode_findings((doubtful,))] == [
        " has a damping ratio of 0.2",
        " is hardly known: ±0.5 Hz",
        ": every component of the shape is zero",
    ]


@pytest.mark.parametrize("count", [3, 6])
def test_shapes_without_signs_are_told(count):
    """Modes of a chain of equal stories, with the signs that they have and with none."""
    stiffness = 2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    stiffness[-1, -1] = 1.0
    squared, shapes = np.linalg.eigh(stiffness)
    floors = (*(f"{k}F" for k in range(2, count + 1)), "RF")
    modes = [
        RecordedMode(frequency_hz=np.sqrt(value), sensors=floors, shape=shape, name=str(k))
        for k, (value, shape) in enumerate(zip(squared, shapes.T, strict=True), start=1)
    ][:3]
    assert mode_findings(modes) == ()
    (said,) = mode_findings([replace(mode, shape=np.abs(mode.shape)) for mode in modes])
    assert said.startswith("no shape has a minus, though in mode 2, 3 floors move less")
    assert mode_findings([replace(mode, shape=np.abs(mode.shape)) for mode in modes[:1]]) == ()


HEAD = "mode,frequency_hz,damping,2F,RF\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD, r"has a header but no data"),
        (HEAD + "1,1.7,0.02,1\n", r"line 2: the row has 4 cells where 5 are expected"),
        (HEAD + "1,,0.02,1,2\n", r"line 2, column frequency_hz: the mode has no frequency"),
        (HEAD + "1,-2,0.02,1,2\n", r"line 2, column frequency_hz: the mode has no frequency"),
        (HEAD + "1,1.7,2.1,1,2\n", r"damping ratio of mode 1 is 2.1, .* damping \(%\)"),
        (HEAD + "1,1.7,-0.02,1,2\n", r"damping ratio of mode 1 is -0.02"),
        (HEAD + "1,1.7,low,1,2\n", r"line 2, column 'damping': 'low' is not a number"),
        (HEAD + "1,1.7,inf,1,2\n", r"line 2, column 'damping': the value is inf"),
        (
            "3,frequency_hz,damping\n1,1.7,0.02\n",
            r"line 1: the first cell of the header is a number",
        ),
        ("mode,frequency_hz,7X\n1,2,3\n", r"unknown column '7X'.*identified modes are mode,"),
        ("mode,freqency_hz\n1,2\n", r"unknown column 'freqency_hz' \(did you mean 'frequency_hz'"),
        ("mode,2F\n1,2\n", r"there is no column frequency_hz; columns of identified modes"),
        ("mode,frequency_hz,2F,2F\n1,2,3,4\n", r"two columns are called '2F'"),
        ("mode,frequency_hz,2F_re\n1,2,3\n", r"must have either the column 2F or both 2F_re"),
        ("mode,frequency_hz (rpm),2F\n1,2,3\n", r"unknown unit 'rpm' for frequency"),
        ("mode,frequency_hz,2F (mm)\n1,2,3\n", r"cannot be in 'mm'; damping is.*complex"),
        ("mode,frequency_hz,frequency_sd_hz\n1,2,0\n", r"deviation of the frequency of mode 1"),
        ("mode,frequency_hz,2F,2F_sd\n1,2,3,-1\n", r"a standard deviation of the shape of mode 1"),
        ("mode,period_s,frequency_hz,RF\n1,.25,5,1\n", "do not fit each other; leave out one"),
        ("test,f1,f2\n1,3.8,10\n2,3.9\n", r"line 3: the row has 2 cells where 3 are expected"),
        ("test,f1,f2\n1,3.8,10\n2,10.1,3.9\n", "line 3, .*10.1 Hz and the next one at 3.9 Hz, in"),
        (HEAD + "1,1.7,.02,1,2\nMean,1.7,.02,,\n", "line 3: 'Mean' is no mode and no test; remove"),
        ("mode,frequency_hz,RF.y\n1,2,3\n", r"none of the shapes' components is a floor's in dir"),
    ],
)
def test_wrong_tables(write, text, message):
    with pytest.raises(MeasurementError, match=message):
        read(write(text, "m.csv"))


def test_modes_not_numbered_by_frequency_are_said(write):
    path = write("date,T1,T2\n2024-02-20,.1,.26\n2024-03-07,.11,.27\n", "m.csv")
    assert read_measured(path).notes[1:] == ("The modes are not numbered by frequency.",)


def test_circular_frequencies_and_letters_of_modes(write):
    text = "mode,{0},damping (%),2F,RF\nX1,11,2,.4,1\nT1,18.85,2,.9,-1\nX2,31.4,2,-1,.5\n"
    for title in ("omega (rad/s)", "omega", "frequency (rad/s)", "Circular frequency (rad/s)"):
        modes = read(write(text.format(title), "m.csv"))
        assert modes.names == ("1", "2", "3")
        np.testing.assert_allclose(2.0 * np.pi * modes.frequency_hz, [11.0, 18.85, 31.4])
