"""Files as loggers and people write them: what is done is said, and what it gives is right."""

import datetime
import itertools
import re

import numpy as np
import pytest
from scipy.io import savemat
from scipy.ndimage import uniform_filter1d
from scipy.signal import cont2discrete, lfilter, ss2tf

from femupdate.errors import MeasurementError
from femupdate.measurement import floors_of, inspect_file, read_observation_file

STEP = 0.01
NAMES = ("base", "2F", "3F", "RF")


def shaken(count: int = 4000, step: float = STEP) -> np.ndarray:
    """(4, n) accelerations, m/s2, of a base and three floors with modes at 3.8, 10 and 16 Hz."""
    rng = np.random.default_rng(5)
    base = rng.normal(size=count)
    squared, shapes = np.linalg.eigh(
        np.diag([2.1, 2.0, 0.8]) - np.diag([1.2, 0.8], 1) - np.diag([1.2, 0.8], -1)
    )
    floors = np.zeros((3, count))
    for omega, shape in zip(2.0 * np.pi * 8.72 * np.sqrt(squared), shapes.T, strict=True):
        A = np.array([[0.0, 1.0], [-(omega**2), -0.04 * omega]])
        C = np.array([[-(omega**2), -0.04 * omega]])
        above, below = ss2tf(
            *cont2discrete((A, np.array([[0.0], [-1.0]]), C, np.zeros((1, 1))), step)[:4]
        )
        floors += np.outer(shape * shape.sum(), lfilter(above[0], below, base))
    return np.vstack([base, floors]) + 0.003 * rng.normal(size=(4, count))


ROWS = shaken()
TIME = STEP * np.arange(ROWS.shape[1])


def table(time, rows=ROWS, head="time_s,base,2F,3F,RF\ns,m/s2,m/s2,m/s2,m/s2", mark=",") -> str:
    """A table; times are printed as they come, blank cells are NaN."""
    cells = [[f"{v:.6f}" if np.isfinite(v) else "" for v in row] for row in np.transpose(rows)]
    return "\n".join([head, *(mark.join([t, *c]) for t, c in zip(time, cells, strict=True))]) + "\n"


def printed(form: str, time=TIME) -> list[str]:
    return [form.format(t) for t in time]


def dated(form: str, first: str = "2024-01-02 15:00:00") -> list[str]:
    """Moments; %L are milliseconds."""
    begin = datetime.datetime.fromisoformat(first)
    moments = [begin + datetime.timedelta(milliseconds=10 * k) for k in range(TIME.size)]
    return [m.strftime(form.replace("%L", f"{m.microsecond // 1000:03d}")) for m in moments]


def at(time, rows=ROWS) -> np.ndarray:
    """The rows at other times, band-limited."""
    from scipy.signal import resample

    fine = resample(rows, 16 * rows.shape[1], axis=1)
    own = STEP / 16 * np.arange(fine.shape[1])
    return np.array([np.interp(time, own, row) for row in fine])


def blanked(row: int, cells: slice) -> np.ndarray:
    rows = ROWS.copy()
    rows[row, cells] = np.nan
    return rows


def scaled(**factors: float) -> np.ndarray:
    return ROWS * np.array([[factors.get(name, 1.0)] for name in ("base", "f2", "f3", "rf")])


_JITTER = np.sort(TIME + 3e-4 * np.random.default_rng(1).normal(size=TIME.size))
_SLOW = TIME + 1e-4 * TIME**2  # a clock that loses 0.8 % in the end

_M_S2 = ",m/s2,m/s2,m/s2,m/s2"
_TITLES = "base,2F,3F,RF\n"
_COMMON = "".join(f",{name} (m/s2)" for name in NAMES)
_GAP = blanked(1, slice(1000, 1040))
_TIMES = printed("{:.2f}")
TABLES = {
    "times in ms": table(printed("{:.0f}", 1e3 * TIME), head="time_ms," + _TITLES + _M_S2),
    "since 1970": table(printed("{:.0f}", 1.7e12 + 1e3 * TIME), head="timestamp" + _COMMON),
    "two decimals": table(printed("{:.2f}", 0.5 * TIME)),
    "whole seconds": table(printed("{:.0f}", np.floor(TIME))),
    "jitter": table(printed("{:.6f}", _JITTER), at(_JITTER)),
    "clock that slows down": table(printed("{:.6f}", _SLOW[:3980]), at(_SLOW[:3980])),
    "starts late": table(_TIMES, blanked(3, slice(0, 500))),
    "gap": table(_TIMES, _GAP),
    "half rate": table(_TIMES, blanked(2, slice(1, None, 2))),
    "quotes": table(printed('"{:,.3f}"', 1e3 * TIME), head='"time_s (ms)",' + _TITLES + _M_S2),
    "points of thousands": table(
        _TIMES, 1e3 * ROWS, "time_s;base;2F;3F;RF\ns;mm/s2;mm/s2;mm/s2;mm/s2", ";"
    ).replace(".", ","),
    "units of each": table(
        _TIMES,
        scaled(base=1 / 9.80665, f2=100.0, rf=1e3 / 9.80665),
        "time_s," + _TITLES + "s,g,gal,m/s2,mg",
    ),
    "12-hour clock": table(dated("%m/%d/%Y %I:%M:%S.%L %p", "2024-01-02 11:59:50")),
    "day first": table(
        dated("%d.%m.%Y %H:%M:%S,%L"), mark=";", head=f"time_s,{_TITLES}{_M_S2}".replace(",", ";")
    ),
    "offset": table(dated("%Y-%m-%dT%H:%M:%S.%L+09:00", "2024-01-02 23:59:50")),
    "colons": table(dated("%H:%M:%S:%L", "2024-01-02 23:59:50")),
    "month in letters": table(dated("%d-%b-%Y %H:%M:%S.%L")),
    "date behind a number": table(
        [f"{k},{t}" for k, t in enumerate(dated("%Y-%m-%d %H:%M:%S.%L"))], head="No,Date" + _COMMON
    ),
    "words for no value": table(_TIMES, _GAP).replace(",,", ",N/A,"),
    "one blank cell": table(_TIMES, blanked(2, slice(1500, 1501))),
    "a row lost": table(np.delete(_TIMES, 1500), np.delete(ROWS, 1500, 1)),
    "rows lost": table(np.delete(_TIMES, slice(90, 99)), np.delete(ROWS, slice(90, 99), 1)),
    "a row twice": table(np.insert(_TIMES, 90, "0.89"), np.insert(ROWS, 90, ROWS[:, 89], 1)),
    "days of a spreadsheet": table(
        printed("{:.11f}", 45000.5 + TIME / 86400), head="time_s" + _COMMON
    ),
    "bars, D and microseconds": re.sub(
        r"(?<=\d)\|(?=[-\d])",
        "D+00|",
        table(
            printed("{:.0f}", 1e6 * TIME),
            head=f"time_s,{_TITLES}us{_M_S2}".replace(",", "|"),
            mark="|",
        ),
    ),
    "marks of units": table(
        _TIMES,
        scaled(base=1e6 / 9.80665, f2=1.0, f3=100 / 9.80665, rf=100.0),
        "time_s,base (µg),2F [m·s⁻²],3F (%g),RF (cm s^-2)",
    ).replace("\n", "\r"),
    "minutes": table(dated("%M:%S.%L", "2024-03-05 23:59:50"), head="Date" + _COMMON),
    "date and time apart": table(dated("%Y/%m/%d,%H:%M:%S.%L"), head="date,time" + _COMMON),
}
# Words that inspect says; rate of what is read, Hz; its samples.
SAID = {
    "since 1970": ("ms since 1970", 100, 4000),
    "two decimals": ("rounded to 0.01 s: 200 Hz", 200, 4000),
    "whole seconds": ("rounded to 1 s: 100 Hz", 100, 4000),
    "jitter": ("are interpolated to 100 Hz", 100, 3999),
    "clock that slows down": ("are interpolated to 100 Hz", 100, 3995),
    "starts late": ("RF 5 s later", 100, 3500),
    "gap": ("blank cells: it is used from 10.4", 100, 2960),
    "half rate": ("all are taken at 50 Hz", 50, 2000),
    "words for no value": ("blank cells: it is used from 10.4", 100, 2960),
    "one blank cell": ("'3F': blank cells, 1 in all, are interpolated", 100, 4000),
    "a row lost": ("1 row is missing after 14.99 s: interpolated", 100, 4000),
    "rows lost": ("9 rows are missing after 0.89 s: the longer part is used", 100, 3901),
    "a row twice": ("Rows that are there twice are left out, first line 93", 100, 4000),
    "days of a spreadsheet": ("read as days", 100, 4000),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_read_as_they_come(write, name):
    text, (words, rate, samples) = TABLES[name], SAID.get(name, ("", 100, 4000))
    path = write(text, "any.csv")
    called = [name for name in ("timestamp", "time_ms") if text.startswith(name)]
    columns = {"time_s": called[0]} if called else None
    seen = inspect_file(path)
    assert words in " ".join((*seen.rotation, *seen.all_findings))
    assert words or seen.all_findings == ()
    read = read_observation_file(path, columns=columns)
    assert (round(1.0 / read.time_step, 6), read.acceleration.shape) == (rate, (4, samples))
    if rate == 100:
        uneven = "interpolated" in words
        begin = 0 if uneven else ROWS.shape[1] - samples
        apart = read.acceleration - ROWS[:, begin : begin + samples]
        if uneven:  # of white noise the upper half cannot be had back
            assert uniform_filter1d(apart, 9, axis=1)[:, 20:-20].std() < 0.02
        else:
            assert np.abs(apart).max() < 2e-5


@pytest.mark.parametrize(
    ("cell", "row"),
    [
        *[("25:00:01", 0), ("10:61:01", 3999), ("13:05:00 PM", 0), ("2024-13-05 10:00", 90)],
        *[("nan", 0), ("nan", 90)],
    ],
)
def test_a_wrong_moment_is_named_with_its_row_and_column(write, row, cell):
    times = dated("%d-%b-%Y %H:%M:%S.%L" if "-" in cell else "%H:%M:%S.%L")
    path = write(table([*times[:row], cell, *times[row + 1 :]]), "any.csv")
    with pytest.raises(MeasurementError, match=f"line {row + 3}, .*'{cell}' is not a time"):
        inspect_file(path)


WRONG = {
    "late": (at(TIME - 0.8)[3], 3, "channel 4 (RF) runs 799 ms behind"),
    "two seconds early": (at(TIME + 2.0)[1], 1, "channel 2 (2F) runs 1.99 s ahead"),
    "fast clock": (at(TIME * 1.008)[3], 3, "channel 4 (RF) drifts against channel 1 (base)"),
    "quarter": (0.25 * ROWS[3], 3, "channel 4 (RF) moves 0.25"),
    "base in g": (ROWS[0] / 9.80665, 0, "channel 1 (base) moves 0.10"),
    "turned": (-ROWS[2], 2, "channel 3 (3F) moves against the base"),
}


@pytest.mark.parametrize("order", [*itertools.permutations(range(4))][1::3])
def test_channels_under_each_other_s_names_are_told(write, order):
    path = write(table(printed("{:.2f}"), ROWS[list(order)]), "x.csv")
    (finding,) = inspect_file(path).all_findings
    if order[0] == 0:
        assert "are they swapped? (Beside each other" in finding
    else:
        assert f"channel {order.index(0) + 1} (" in finding
        assert finding.endswith("or is it relative to the base?")


@pytest.mark.parametrize(("row", "number", "words"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_channel_is_said_and_nothing_else(write, row, number, words):
    rows = ROWS.copy()
    rows[number] = row
    (finding,) = inspect_file(write(table(printed("{:.2f}"), rows), "wrong.csv")).all_findings
    assert words in finding


_LOST = np.arange(9, 1500, 10)
REFUSED = {
    "one blank cell": (
        table(printed("{:.2f}", TIME[:90]), blanked(2, slice(50, 51))[:, :90]),
        "line 53, column '3F': the cell is blank",
    ),
    "rows missing again and again": (
        table(np.delete(printed("{:.2f}"), _LOST), np.delete(ROWS, _LOST, 1)),
        "the sampling is not uniform",
    ),
    "a header in the middle": (
        table(printed("{:.2f}"), ROWS).replace("\n0.50,", "\ntime_s,base,2F,3F,RF\n0.50,"),
        "the header comes again, .*: remove it where the times go on, else make each part a file",
    ),
    "channels as rows": (
        "\n".join(
            ",".join([name, *(f"{v:.4f}" for v in row)])
            for name, row in zip(("time_s", *NAMES), [TIME, *ROWS], strict=True)
        ),
        "if channels are rows here, turn the table",
    ),
    "rows without times": (
        "\n".join(",".join([name, *map(str, row)]) for name, row in zip(NAMES, ROWS, strict=True)),
        "none of the known formats, .* a row that names its columns, then a row for each time",
    ),
    "two clocks": (
        table(_TIMES, [*ROWS[:2], TIME, *ROWS[2:]], "time_s,base,2F,time_s,3F,RF"),
        "two columns are called 'time_s'; keep one where both are alike",
    ),
    "commas twice": (
        table(printed("{:.2f}")).replace(".", ","),
        "export the table with semicolons",
    ),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_told_is_refused_with_its_place(write, text, message):
    with pytest.raises(MeasurementError, match=message):
        read_observation_file(write(text, "bad.csv"))


def test_counts_take_a_factor_for_each_channel(write):
    factors = {"base": 4e-6, "2F": 5e-6, "3F": 4e-6, "RF": 2e-5}
    counts = np.rint(ROWS / np.array(list(factors.values()))[:, None])
    path = write(table(_TIMES, counts, "time_s,base,2F,3F,RF"), "counts.csv")
    assert any("counts of a digitiser" in words for words in inspect_file(path).all_findings)
    read = read_observation_file(path, "m/s2", {k: f"{k}*{v}" for k, v in factors.items()})
    np.testing.assert_allclose(read.acceleration, ROWS, atol=2e-5)
    same = read_observation_file(path, "2e-6 m/s2").acceleration
    np.testing.assert_allclose(same[0], 2e-6 * counts[0])


def test_two_clocks_of_a_file_are_brought_to_one_or_refused(tmp_path):
    late = {"time_s": TIME, "base": ROWS[0], "F2": ROWS[1], "time_roof": TIME + 3.0, "RF": ROWS[3]}
    late["RF"] = at(TIME + 3.0)[3]
    savemat(tmp_path / "two.mat", late)
    columns = {"base": "base", "2F": "F2", "RF": "RF"}
    read = read_observation_file(tmp_path / "two.mat", "m/s2", columns)
    np.testing.assert_allclose(read.acceleration[2][:3000], ROWS[3][300:3300], atol=1e-6)
    assert "RF 3 s later" in " ".join(read.notes)
    savemat(tmp_path / "odd.mat", {**late, "t_x": TIME * 1.01})
    with pytest.raises(MeasurementError, match="two clocks"):
        read_observation_file(tmp_path / "odd.mat", "m/s2", columns)


def universal(name: str, start: float, rows: list[str], even: int, node: int, step=STEP) -> str:
    lines = ["    -1", "    58", "r", "NONE", "01-JAN-24 10:00:00", "NONE", "NONE"]
    lines.append(
        f"    1         1    0         0 {name:<10}{node:10d}   1       NONE         0   0"
    )
    lines.append(
        f"{2 if even else 4:10d}{len(rows):10d}{even:10d}{start:13.5e}{step:13.5e}{0.0:13.5e}"
    )
    lines += [
        "        17    0    0    0 Time                 s",
        "        12    1    0    0 Acceleration         m/s2",
        *["         0    0    0    0 NONE                 NONE"] * 2,
    ]
    return "\n".join([*lines, *rows, "    -1", ""])


UNIVERSAL = {  # name, start of the roof, its row as text
    "late start": ("NONE", 3.0, 1, lambda t, v: f"{v:13.5e}"),
    "long name": ("PF-I-0301y+", 0.0, 1, lambda t, v: f"{v:13.5e}"),
    "D exponents": ("NONE", 0.0, 0, lambda t, v: f"{t:20.12e}{v:20.12e}".replace("e", "D")),
    "pairs": ("NONE", 0.0, 0, lambda t, v: f" {t:.12E} {v:.12E}"),
}


@pytest.mark.parametrize(("name", "start", "even", "form"), UNIVERSAL.values(), ids=UNIVERSAL)
def test_universal_files_of_other_programs(write, name, start, even, form):
    pytest.importorskip("pyuff")
    rows = [*ROWS[:3], at(TIME + start)[3]]
    text = "".join(
        universal(
            name,
            start if k == 3 else 0.0,
            [form(t, v) for t, v in zip(TIME, row, strict=True)],
            even,
            k + 1,
        )
        for k, row in enumerate(rows)
    )
    path = write(text, "other.uff")
    columns = {floor: str(k) for k, floor in enumerate(NAMES, start=1)}
    read = read_observation_file(path, columns=columns)
    places = [each.channel.location for each in inspect_file(path).channels]
    assert places == [f"point {k} +X" for k in range(1, 5)]
    begin = round(start / STEP)
    np.testing.assert_allclose(read.acceleration[0], ROWS[0][begin:], atol=1e-4)
    np.testing.assert_allclose(
        read.acceleration[3][: -begin - 1], ROWS[3][begin : -begin - 1], atol=1e-4
    )
    assert ("3 s later" in " ".join(read.notes)) == (start > 0.0)


def test_sheets_of_workbooks_are_tables(tmp_path):
    xlsxwriter = pytest.importorskip("xlsxwriter")
    head = ["Date", "Ground (g)", "Floor 1 (g)", "Floor 2 (g)", "Roof (g)"]
    moments = [
        datetime.datetime(2024, 3, 5, 23, 59) + datetime.timedelta(milliseconds=10 * k)
        for k in range(400)
    ]
    sheets = {
        "Info": [["A frame"]],
        "Data": [["Run 3", "of 5"], [], head]
        + [[t, *v] for t, v in zip(moments, ROWS.T / 9.80665, strict=False)],
    }
    for name in ("one.xlsx", "two.xlsx"):
        with xlsxwriter.Workbook(tmp_path / name, {"default_date_format": "hh:mm:ss.000"}) as book:
            for title, rows in sheets.items():
                sheet = book.add_worksheet(title)
                for k, row in enumerate(rows):
                    sheet.write_row(k, 0, row)
        sheets["Again"] = sheets["Data"]
    step = inspect_file(tmp_path / "one.xlsx").step
    assert "base=Ground,2F=Floor 1,3F=Floor 2,RF=Roof" in step.command
    read = read_observation_file(tmp_path / "one.xlsx", columns=step.columns)
    assert read.time_step == 0.01
    np.testing.assert_allclose(read.acceleration, ROWS[:, :400], atol=1e-12)
    with pytest.raises(MeasurementError, match=r"tables on 2 sheets \(Data, Again\)"):
        read_observation_file(tmp_path / "two.xlsx")


def test_frfs_without_header_are_mapped_by_number(write):
    values = np.array(
        [[1.0 + 0.5j, -2.0 - 0.1j], [1.5 + 0.1j, 0.2 - 3.0j], [2.5 + 0.2j, 0.3 - 1.0j]]
    )
    rows = [[f"{f:g}", *row] for f, row in zip((1.0, 1.5, 2.0), values, strict=True)]
    complex_text = "\n".join(f"{f},{a:.2f},{b:.2f}".replace("j", "i") for f, a, b in rows)
    parts = "\n".join(f"{f},{a.real},{a.imag},{b.real},{b.imag}" for f, a, b in rows)
    both = {"2F_re": "2", "2F_im": "3", "RF_re": "4", "RF_im": "5"}
    for text, columns in ((complex_text, {"2F": "2", "RF": "3"}), (parts, both)):
        path = write(text, "frf.csv")
        seen = read_observation_file(path, columns={"frequency_hz": "1", **columns})
        np.testing.assert_allclose(np.exp(seen.log_frf + 1j * seen.phase), values.T)
    assert "of frequencies say it by --columns" in inspect_file(path).step.advice


@pytest.mark.parametrize(
    "names",
    [
        "Ground Floor1 Floor2 Roof",
        "Boden 1.OG 2.OG Dach",
        "foundation Level_1 Level_2 Level_3",
        "1F 2F 3F RF",
        "基礎 2階 3階 屋上",
        "acc_base acc_2F x3F acc_roof",
        "basement 2nd_floor 3rd_floor top",
        "Kellerdecke_x Floor1_x Floor2_x Roof_x",
        "Sol Étage_1 Étage_2 Toiture",
        "Base Piano_1 Piano_2 Copertura",
        "Solo Andar_1 Andar_2 Cobertura",
        "Zemin 1._Kat 2._Kat Çatı",
        "ground first_floor second_floor third_floor",
        "1st 2nd 3rd Roof",
        "RDC R+1 R+2 Toiture",
        "Sous-sol 1er_étage 2e_étage Toiture",
        "KG 1._Stock 2._Stock 3._Stock",
        "Sótano Piso_1 Piso_2 Azotea",
    ],
)
def test_floors_have_the_names_that_people_give(names):
    assert floors_of(names.split()) == NAMES


def test_the_next_command_runs_with_the_names_that_people_give(write):
    names, floors = ["Dach", "1.OG", "Boden", "2.OG"], ("RF", "2F", "base", "3F")
    path = write(
        table(_TIMES, head=",".join(["time_s", *names]) + "\ns" + ",m/s2" * 4), "named.csv"
    )
    columns = inspect_file(path).step.columns
    assert columns == dict(zip(floors, names, strict=True))
    assert read_observation_file(path, columns=columns).floors == ("2F", "3F", "RF")


def test_columns_in_two_directions_are_not_taken_for_two_sensors(write):
    names = ["Ground_EW", "Roof_EW", "Ground_NS", "Roof_NS"]
    head = ",".join(["time_s", *names]) + "\ns" + ",m/s2" * 4
    path = write(table(_TIMES, head=head), "xy.csv")
    step = inspect_file(path).step
    assert step.columns == dict(zip(("base", "RF", "base.y", "RF.y"), names, strict=True))
    assert "base=Ground_EW,RF=Roof_EW" in step.command


def test_nothing_is_proposed_where_a_column_is_left_over(write):
    head = "time_s,Ground,A,Floor2,Roof\ns" + ",m/s2" * 4
    path = write(table(_TIMES, head=head), "a.csv")
    step = inspect_file(path).step
    assert step.command == ""
    assert "which floor A is" in step.advice
    assert "such as 'base=Ground,RF=Roof'" in step.advice


def test_what_is_proposed_fits_the_file(write):
    text = table(_TIMES)
    mapped = inspect_file(
        write(text.replace("time_s", "clock"), "a.csv"), None, {"time_s": "clock"}
    )
    assert mapped.step.command.startswith("femupdate calibrate")
    assert inspect_file(write(text.replace("m/s2", "mm"), "b.csv")).step.command == ""
    each_its_clock = table(_TIMES, [ROWS[0], TIME, ROWS[3]], "t1 (s),base (g),t2 (s),RF (g)")
    assert read_observation_file(write(each_its_clock, "c.csv"), None, {"time_s": "t1"}).floors == (
        "RF",
    )
    with pytest.raises(MeasurementError, match="leave time_s=clock out"):
        inspect_file(write(table(dated("%H:%M:%S.%L")), "d.csv"), None, {"time_s": "clock"})


def test_sensors_in_opposite_corners_are_not_said_to_be_swapped(write):
    """A floor that turns moves less at one corner than the floor below at the other."""
    rows = ROWS[[0, 1, 2, 2, 3, 3]]
    rows[4] = ROWS[3] - 0.8 * (ROWS[3] - ROWS[0])
    head = "time_s,base,2F:1,3F:1,3F:2,RF:2,RF:1\ns" + ",m/s2" * 6
    path = write(table(printed("{:.2f}"), rows, head), "turns.csv")
    assert not any(
        "3F:1" in words for words in inspect_file(path).all_findings if "swapped" in words
    )
