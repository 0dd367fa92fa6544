"""Files of strong-motion stations: genuine ones by the peaks in their headers, and written ones."""

import gzip
import io
import tarfile
import zipfile

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import (
    RecordedChannel,
    azimuth_of,
    read_measured,
    read_observation_file,
    read_record,
)
from tests.measurement import written

EXACT = {"rtol": 1e-14, "atol": 0}


@pytest.mark.parametrize(
    ("name", "count", "values", "unit"),
    [
        ("formats/cesmd_painter_street_ferndale_2015.zip", 17, 8511, "cm/sec2"),
        ("formats/cesmd_painter_street_nc73666231.zip", 16, 6561, "cm/sec2"),
        ("formats/cesmd_petrolia_1991_chan012.v2", 1, 2000, "CM/SEC/SEC"),
        ("formats/usgs_1103_HN2_4E_a.smc", 1, 8200, "cm/s2"),
    ],
)
def test_genuine_files_have_the_peaks_that_their_headers_state(
    shared_file, name, count, values, unit
):
    recording = read_measured(shared_file(name))
    assert len(recording.channels) == count
    for channel in recording.channels:
        assert (channel.values.size, channel.unit) == (values, unit)
        assert channel.location
        # Three digits or three decimals are printed.
        peak = np.abs(channel.values).max()
        assert peak == pytest.approx(channel.stated_peak, rel=5e-3 / 10, abs=5e-4)


def test_station_archive_is_an_observation(shared_file):
    path = shared_file("formats/cesmd_painter_street_ferndale_2015.zip")
    recording = read_measured(path)
    assert recording.format == "archive"
    assert recording.notes[0].startswith(
        "Other files of the archive that hold no accelerations: 17 (CH"
    )
    free, top = recording.channels[16], recording.channels[6]
    assert (free.location, free.direction) == ("On Ground: Near West Abutment", "Tran")
    assert (top.location, top.direction) == ("Middle Bent: Top of Column", "Tran")
    assert sum(channel.vertical for channel in recording.channels) == 7
    data = read_observation_file(path, columns={"base": "17", "RF": "7"})
    assert (data.time_step, data.floors) == (0.01, ("RF",))
    np.testing.assert_allclose(data.acceleration, np.array([free.values, top.values]) * 0.01)
    with pytest.raises(MeasurementError, match=r"does not say which floors .*17 = Tran, On Ground"):
        read_observation_file(path)


def test_esm(write, wave):
    path = write(written.esm_text(wave), "a.asc")
    motion = read_record(path)
    np.testing.assert_allclose(motion.acceleration, wave * 1e-2, **EXACT)
    assert read_measured(path).format == "esm"
    assert (motion.time_step, motion.channel) == (0.005, "HNE")
    (channel,) = read_measured(write(written.esm_text(wave, stream="HNZ"))).channels
    assert channel.vertical
    assert channel.location == "TESTVILLE"
    assert channel.stated_peak == np.abs(wave).max()


def test_cosmos_passes_over_velocity(write, wave):
    path = write(written.cosmos_text({"90 deg, Roof - center": wave, "Up, Basement": -wave / 3}))
    first, second = read_measured(path).channels
    np.testing.assert_array_equal(first.values, wave)
    np.testing.assert_allclose(second.values, -wave / 3, atol=5e-6)
    assert (first.name, first.location) == ("90 deg, Roof - center", "Roof - center")
    assert (first.azimuth_deg, second.azimuth_deg, second.vertical) == (90.0, None, True)
    assert first.time_step == second.time_step == 0.005
    assert first.stated_peak == pytest.approx(np.abs(wave).max())
    motion = read_record(path, channel="90 deg")
    np.testing.assert_allclose(motion.acceleration, wave * 0.01, atol=5e-8)


def test_smc_written(write, wave):
    (channel,) = read_measured(write(written.smc_text(wave), "a.smc")).channels
    np.testing.assert_allclose(channel.values, wave, rtol=5e-5)
    assert (channel.time_step, channel.location) == (0.005, "4th floor, east core")


BAD = {
    "smc velocity": ("smc", "2 CORRECTED ACCELEROGRAM", "3 VELOCITY", "holds velocity, not accel"),
    "smc spectra": (
        "smc",
        "2 CORRECTED ACCELEROGRAM",
        "5 RESPONSE SPECTRA",
        "an SMC file of spectra, which",
    ),
    "smc too many": ("smc", "      1480 ", "      1479 ", "announces 1479 values but 1480 fo"),
    "smc header cut": ("smc", "    -32768\n", "\n", "lines of numbers are not whole"),
    "esm velocity": ("esm", "TYPE: ACCELERATION", "TYPE: VELOCITY", "take the .ACC file"),
    "esm count": ("esm", "NDATA: 1480", "NDATA: 1481", "announces 1481 values but 1480 follow"),
    "esm no step": ("esm", "_INTERVAL_S: 0.005000", "_INTERVAL_S:", "does not give SAMPLING_INT"),
    "esm no unit": ("esm", "UNITS:", "UNIT:", "does not give UNITS"),
    "cosmos counts": ("cosmos", "units=cm/sec2", "units=counts", "do not give what a count is"),
    "cosmos rate": ("cosmos", " 5.0", "50.0", "no sampling interval with which 1480 values last 7"),
    "cosmos count": ("cosmos", "1480 acc", "1481 acc", "announces 1481 values in channel Tran but"),
}


@pytest.mark.parametrize(("kind", "old", "new", "message"), BAD.values(), ids=BAD)
def test_spoiled_station_file(write, wave, kind, old, new, message):
    values = np.tile(wave, 40)
    good = getattr(written, f"{kind}_text")({"Tran": values} if kind == "cosmos" else values)
    read_record(write(good, "good.txt"))
    assert old in good
    path = write(good.replace(old, new, 1), "bad.txt")
    with pytest.raises(MeasurementError) as caught:
        read_record(path)
    assert message in str(caught.value)
    assert "bad.txt" in str(caught.value)


def packed(path, members, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return path


def tarred(path, members, mode="w:gz"):
    with tarfile.open(path, mode) as archive:
        for name, text in members.items():
            data = text.encode()
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    return path


def test_two_archives_of_a_building_by_the_places_of_their_sensors(tmp_path, wave):
    """Files beside accelerations are passed over; numbers that changed hands are refused."""
    kinds = {"a": "2 CORRECTED ACCELEROGRAM", "v": "3 VELOCITY", "d": "4 CORRECTED DISPLACEMENT"}
    kinds["r"] = "5 RESPONSE SPECTRA"

    def archive(name, order):
        text = {key: written.smc_text(np.tile(wave, 2), title) for key, title in kinds.items()}
        names = [(place, f"CH{k}_{key}.smc", key) for k, place in enumerate(order) for key in kinds]
        members = {
            file: text[key].replace("4th floor, east core", place) for place, file, key in names
        }
        up = {"CH9_a.smc": text["a"].replace(f"{90:10d}{171:10d}", f"{0:10d}{171:10d}")}
        return packed(tmp_path / name, members | up)

    first = archive("first.zip", ["Basement", "2nd floor", "Roof"])
    other = archive("other.zip", ["Roof", "Basement", "2nd floor"])
    channels = read_measured(first).channels
    assert [channel.quantity for channel in channels] == ["acceleration"] * 4
    by_place = {"base": "Basement", "RF": "-Roof"}
    for path in (first, other):
        assert read_observation_file(path, columns=by_place).floors == ("RF",)
    assert read_record(other, channel="RF", columns=by_place).channel.endswith("Roof")
    by_number = {"base": "1", "RF": "3"}
    read_observation_file(first, columns=by_number)
    with pytest.raises(MeasurementError, match=r"Roof' is taken for base and .*2nd floor' for RF"):
        read_observation_file(other, columns=by_number)
    with pytest.raises(MeasurementError, match=r"is vertical, as the file says"):
        read_observation_file(first, columns={"base": "1", "RF": "4"})
    with pytest.raises(MeasurementError, match=r"is vertical, as the file says"):
        read_record(first, channel=4)


@pytest.fixture(params=["zip", "tar.gz", "tar"])
def archived(request, tmp_path):
    """A function: an archive of members under a name, in each of the layouts."""

    def make(name, members):
        path = tmp_path / f"{name}.{request.param}"
        if request.param == "zip":
            return packed(path, members)
        return tarred(path, members, "w:gz" if request.param == "tar.gz" else "w")

    return make


def test_archive_of_other_records_and_a_note(archived, wave):
    counts = np.round(wave * 100).astype(int)
    knet = written.knet_text(counts, "0.37")
    members = {
        "b/A.EW": knet,
        "b/A.NS": knet.replace("E-W", "N-S"),
        "a/C.EW": knet,
        "readme.txt": "Two lines\nof prose, 1.\n",
    }
    recording = read_measured(archived("k", members))
    assert [c.name for c in recording.channels] == ["E-W, C", "E-W, A", "N-S"]
    assert recording.notes == (
        "Other files of the archive that hold no accelerations: 1 (readme.txt).",
    )
    assert [c.azimuth_deg for c in recording.channels] == [90.0, 90.0, 0.0]


def test_archive_of_one_table_and_of_two(tmp_path):
    rows = "\n".join(f"{k * 0.01:.2f},{k % 7},{k % 5}" for k in range(80))
    table = "time_s,base,RF\ns,gal,gal\n" + rows
    assert read_observation_file(packed(tmp_path / "t.zip", {"o.csv": table})).floors == ("RF",)
    with pytest.raises(MeasurementError, match=r"v\.zip: o\.csv, line 5, column 'RF': '\?' is"):
        read_measured(packed(tmp_path / "v.zip", {"o.csv": table.replace("0.02,2,2", "0.02,2,?")}))
    with pytest.raises(MeasurementError, match=r"w\.zip, column 'base': the file does not say"):
        read_observation_file(packed(tmp_path / "w.zip", {"o.csv": table.replace("gal", "")}))
    with pytest.raises(MeasurementError, match=r"several tables \(a\.csv, b\.csv\); unpack it"):
        read_measured(packed(tmp_path / "u.zip", {"a.csv": table, "b.csv": table}))


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"../../a.v2": "x"}, r"would write '../../a.v2' outside its folder"),
        ({"/etc/a.v2": "x"}, "outside its folder"),
        ({"..\\a.v2": "x"}, "outside its folder"),
        ({f"{k}.v2": "" for k in range(2001)}, "holds 2001 files"),
        ({"note.txt": "Nothing here.\n"}, "holds no record, only note.txt"),
    ],
)
def test_archive_that_is_refused(tmp_path, archived, members, message):
    path = archived("bad", members)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(MeasurementError, match=message) as caught:
        read_record(path)
    assert path.name in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before


def bomb_in_a_header(path):
    """A tar archive whose first header holds far more than its packed size."""
    with tarfile.open(path, "w:gz", format=tarfile.PAX_FORMAT) as archive:
        info = tarfile.TarInfo("a.v2")
        info.pax_headers = {"comment": "0" * 20_000_000}
        archive.addfile(info)
    return path


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: packed(p / "z.zip", {"a.v2": "0" * 20_000_000}), "times its own size: no"),
        (lambda p: tarred(p / "t.tgz", {"a.v2": "0" * 20_000_000}), "times its own size: no"),
        (lambda p: bomb_in_a_header(p / "h.tgz"), "times its own size: no archive of records"),
        (
            lambda p: packed(p / "w.zip", {"[Content_Types].xml": "x", "xl/workbook.xml": "y"}),
            "is a workbook",
        ),
        (lambda p: packed(p / "n.zip", {}), "holds no record, only nothing"),
        (lambda p: tarred(p / "n.tgz", {}), "holds no record, only nothing"),
    ],
)
def test_bombs_and_workbooks(tmp_path, make, message):
    with pytest.raises(MeasurementError, match=message):
        read_record(make(tmp_path))


def test_links_in_an_archive_lead_nowhere(tmp_path, wave):
    path = tmp_path / "links.tar.gz"
    with tarfile.open(path, "w:gz") as archive:
        link = tarfile.TarInfo("b.asc")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        archive.addfile(link)
    with pytest.raises(MeasurementError, match="holds no record, only nothing"):
        read_record(path)


@pytest.mark.parametrize(
    "spoil", [lambda data: data[: len(data) // 2], lambda data: data[:2] + b"\0" * 30]
)
def test_packed_files_that_are_no_archive(tmp_path, wave, spoil):
    whole = tarred(tmp_path / "a.tar.gz", {"a.asc": written.esm_text(wave)}).read_bytes()
    path = tmp_path / "cut.tar.gz"
    path.write_bytes(spoil(whole))
    with pytest.raises(MeasurementError, match="archives of records, but is damaged"):
        read_record(path)


def test_a_record_packed_alone(tmp_path, wave):
    path = tmp_path / "a.asc.gz"
    path.write_bytes(gzip.compress(written.esm_text(wave).encode()))
    np.testing.assert_array_equal(read_measured(path).channels[0].values, wave)
    for text, message in (
        (b"Some text.\n", r"holds no record, only a\.asc"),
        (b"0" * 20_000_000, "times its own size: no archive"),
    ):
        path.write_bytes(gzip.compress(text))
        with pytest.raises(MeasurementError, match=message):
            read_record(path)


def test_archive_with_a_bad_record_names_the_member(tmp_path, wave):
    text = written.esm_text(wave).replace("NDATA: 37", "NDATA: 99")
    path = packed(tmp_path / "s.zip", {"sub/a.asc": text})
    with pytest.raises(MeasurementError, match=r"s\.zip: sub/a\.asc, line 5: the header announces"):
        read_record(path)


@pytest.mark.parametrize(
    ("text", "azimuth"),
    [
        *[("90 Deg", 90), ("360 DEG", 0), ("N-S", 0), ("EW", 90), ("EW2", 90), ("N35E", 35)],
        *[("S 10 W", 190), ("north", 0), ("Long", None), ("Up", None), ("400", None), ("", None)],
    ],
)
def test_azimuths(text, azimuth):
    assert azimuth_of(text) == azimuth


@pytest.mark.parametrize("text", ["Up", "UD", "U-D", "UD1", "Z", "vert", "Down", "EW"])
def test_vertical(text):
    channel = RecordedChannel(name="1", values=np.ones(9), time_step=0.01, unit="g", direction=text)
    assert channel.vertical == (text != "EW")
