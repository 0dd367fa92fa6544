"""However a file is damaged, it is read or refused: nothing else ever comes out."""

import io
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from femupdate.errors import MeasurementError
from femupdate.measurement import Histories, read_observation_file, read_record
from tests.measurement import written

VALUES = np.round(50 * np.sin(0.7 * np.arange(70)) + 0.1 * np.arange(70), 3)
PIECES = st.one_of(st.sampled_from([b"", b"\n", b",", b"-", b"1e999", b"NaN", b"\xff", b"0"]),
                   st.binary(max_size=6))  # fmt: skip
HURT = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), PIECES), min_size=1, max_size=3)


def damaged(data: bytes, hurts: list[tuple[float, int, bytes]]) -> bytes:
    for where, length, piece in hurts:
        at = int(where * len(data))
        data = data[:at] + piece + data[at + length :]
    return data


def zipped(members: dict[str, str]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return stream.getvalue()


def outcome(data: bytes, read):
    """What is read from a file of these bytes, or the sentence with which it is refused."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file.csv"
        path.write_bytes(data)
        try:
            return read(path)
        except MeasurementError as error:
            return str(error)


@pytest.mark.parametrize(
    "kind",
    ["jma", "peer", "csmip_v1", "csmip_v2", "knet", "esm", "cosmos", "smc", "zip", "plain"],
)
@given(hurts=HURT)
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_damaged_record(kind, hurts):
    rows = "\n".join(f"{i * 0.01:.2f},{v}" for i, v in enumerate(VALUES))
    text = {
        "jma": lambda: written.jma_text({"NS": VALUES, "EW": -VALUES}),
        "peer": lambda: written.peer_text(VALUES / 981),
        "csmip_v1": lambda: written.csmip_v1_text({"Up": VALUES / 10000, "90 Deg": VALUES / 5000}),
        "csmip_v2": lambda: written.csmip_v2_text(VALUES),
        "knet": lambda: written.knet_text(np.round(VALUES * 100).astype(int), "0.7"),
        "esm": lambda: written.esm_text(VALUES),
        "cosmos": lambda: written.cosmos_text({"90 deg, roof": VALUES, "Up": VALUES / 2}),
        "smc": lambda: written.smc_text(VALUES),
        "zip": lambda: written.esm_text(VALUES),
        "plain": lambda: "time_s,a\ns,gal\n" + rows,
    }[kind]()
    data = zipped({"a.asc": text}) if kind == "zip" else text.encode()
    motion = outcome(damaged(data, hurts), lambda path: read_record(path, channel=1))
    if isinstance(motion, str):
        assert "file.csv" in motion
    else:
        assert np.isfinite(motion.acceleration).all()
        assert motion.peak <= 5 * 9.80665


@pytest.mark.parametrize(
    "kind", ["time_s,base,2F:1,RF\ns,g,gal,g\n", "frequency_hz,2F,RF_re,RF_im\n"]
)
@given(hurts=HURT)
@settings(max_examples=25, deadline=None)
def test_damaged_observation(kind, hurts):
    rows = "\n".join(f"{i * 0.01:.2f},{v / 100},{v},{1 + i}" for i, v in enumerate(VALUES + 60))
    data = outcome(damaged((kind + rows).encode(), hurts), read_observation_file)
    if isinstance(data, str):
        assert "file.csv" in data
    else:
        values = data.acceleration if isinstance(data, Histories) else data.log_frf
        assert np.isfinite(values).all()


@given(st.binary(max_size=300))
@settings(max_examples=50, deadline=None)
def test_any_bytes(data):
    for read in (read_record, read_observation_file):
        assert "file.csv" in str(outcome(data, read))
