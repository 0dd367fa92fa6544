"""Good files of instruments and of tests with forces, to be mutated."""

import io
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats

STEP = 0.02
_COUNT = 200


def wave(factor: float = 1.0, count: int = _COUNT) -> Floats:
    """A history of an earthquake's size, m/s2."""
    time = STEP * np.arange(count)
    return factor * np.exp(-time) * np.sin(9.0 * time + 0.4)


def seismic_files(folder: Path) -> dict[str, bytes]:
    """A record in each format that ObsPy writes, and in SEG-2, by name."""
    import obspy

    found = {"trace.sg2": _seg2(wave().astype("<f4"))}
    head = {"network": "XX", "station": "TWR", "delta": STEP}
    counts = np.round(1000.0 * wave()).astype(np.int32)
    traces = [obspy.Trace(counts, {**head, "channel": code}) for code in ("HNE", "HNN")]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for kind, name, chosen in (
            ("MSEED", "two.mseed", traces),
            ("SAC", "one.sac", traces[:1]),
        ):
            path = folder / name
            obspy.Stream(chosen).write(str(path), format=kind)
            found[name] = path.read_bytes()
            path.unlink()
    return found


def _seg2(values: Any) -> bytes:
    """One trace of 32-bit floats, after the standard (Pullan, Geophysics 55, 1990)."""
    texts = b"".join(
        struct.pack("<H", len(text) + 3) + text + b"\0"
        for text in (b"SAMPLE_INTERVAL 0.02", b"DELAY 0", b"CHANNEL_NUMBER 1")
    )
    texts += struct.pack("<H", 0)
    first = struct.pack("<HHHHBBBBBB", 0x3A55, 1, 4, 1, 1, 0, 0, 1, 10, 0) + bytes(18)
    size = 32 + len(texts)
    trace = struct.pack("<HHIIB", 0x4422, size, values.nbytes, len(values), 4) + bytes(19)
    notes = struct.pack("<H", 0)
    start = 36 + len(notes)
    return first + struct.pack("<I", start) + notes + trace + texts + values.tobytes()


def tdms_file() -> bytes:
    """Two channels with a clock and a force."""
    from nptdms import ChannelObject, TdmsWriter

    clock = {"wf_increment": STEP}
    buffer = io.BytesIO()
    with TdmsWriter(buffer) as writer:
        writer.write_segment(
            [
                ChannelObject("run", "base", wave(), {**clock, "unit_string": "m/s^2"}),
                ChannelObject("run", "RF", wave(2.0), {**clock, "unit_string": "m/s^2"}),
                ChannelObject("run", "hammer", wave(100.0), {**clock, "unit_string": "N"}),
            ]
        )
    return buffer.getvalue()


def kiknet_text(text: str) -> str:
    """A K-NET record as KiK-net numbers its channel."""
    line = next(line for line in text.splitlines() if line.startswith("Dir."))
    return text.replace(line, "Dir.              5")


def universal_files(folder: Path) -> dict[str, bytes]:
    """Histories as text and as binary, response functions, and modes."""
    import pyuff

    found = {}
    for name, binary, kind in (("text.uff", 0, 1), ("binary.uff", 1, 1), ("frf.uff", 0, 4)):
        path = folder / name
        sets = [_function(pyuff, node, binary, kind) for node in (1, 2)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pyuff leaves its file open
            pyuff.UFF(str(path)).write_sets(sets, "add")
        found[name] = path.read_bytes()
        path.unlink()
    path = folder / "modes.uff"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pyuff.UFF(str(path)).write_sets([_mode(pyuff, k) for k in (1, 2)], "add")
    found["modes.uff"] = path.read_bytes()
    path.unlink()
    return found


def _function(pyuff: Any, node: int, binary: int, kind: int) -> dict[str, Any]:
    history = kind == 1
    axis = STEP * np.arange(128) if history else 0.25 * np.arange(1, 129)
    data = wave(float(node), 128) if history else 1.0 / (1.0 - (axis / 9.0) ** 2 + 0.1j * axis)
    found: dict[str, Any] = pyuff.prepare_58(
        binary=binary,
        func_type=kind,
        rsp_node=node,
        rsp_dir=1,
        ref_dir=0 if history else 1,
        ref_node=0 if history else 2,
        data=data,
        x=axis,
        ord_data_type=4 if history else 5,
        num_pts=128,
        abscissa_spec_data_type=17 if history else 18,
        abscissa_inc=float(axis[1] - axis[0]),
        abscissa_spacing=1,
        abscissa_min=float(axis[0]),
        ordinate_spec_data_type=12,
        ordinate_axis_units_lab="m/s2" if history else "m/s2/N",
        orddenom_spec_data_type=0 if history else 13,
        orddenom_axis_units_lab="" if history else "N",
        z_axis_spec_data_type=0,
        z_axis_value=0.0,
    )
    return found


def _mode(pyuff: Any, number: int) -> dict[str, Any]:
    nodes = np.arange(1, 4)
    found: dict[str, Any] = pyuff.prepare_55(
        model_type=1,
        analysis_type=2,
        data_ch=2,
        spec_data_type=8,
        data_type=2,
        n_data_per_node=3,
        r1=np.array([0.3, 0.7, 1.0]),
        r2=np.zeros(3),
        r3=np.zeros(3),
        node_nums=nodes,
        load_case=1,
        mode_n=number,
        freq=1.5 * number,
        modal_m=1.0,
        modal_damp_vis=0.01,
        modal_damp_his=0.0,
    )
    return found


def force_texts() -> dict[str, str]:
    """Responses to a force, histories with their force, complex text."""
    frequency = 0.25 * np.arange(1, 60)
    h = -(frequency**2) / (1.0 - (frequency / 3.0) ** 2 + 0.1j * frequency) / 1e5
    pairs = list(zip(frequency, h, strict=True))
    modulus = "".join(f"{f:g},{abs(x):.5g},{2 * abs(x):.5g},0.1\n" for f, x in pairs)
    text = "".join(f"{f:g},{x.real:.5g}{x.imag:+.5g}j\n" for f, x in pairs)
    time = STEP * np.arange(1500)
    rng = np.random.default_rng(4)
    force = rng.normal(size=1500)
    floors = [np.convolve(force, wave(0.01 * k), "full")[:1500] for k in (1, 2)]
    table = zip(time, force, *floors, strict=True)
    rows = "".join(f"{t:.2f},{p:.5g},{a:.5g},{b:.5g}\n" for t, p, a, b in table)
    return {
        "moduli.csv": f"frequency_hz,2F/RF (m/s2/N),RF/RF (m/s2/N),RF/RF_sd\n{modulus}",
        "complex_text.csv": f"frequency_hz,RF/RF (m/s2/N)\n{text}",
        "hammer.csv": f"time_s,force/RF (kN),2F (m/s2),RF (m/s2)\n{rows}",
    }


def mode_arrays() -> dict[str, Any]:
    """As pyOMA2 has them."""
    shape = np.array([[0.3 + 0.01j, 1.0], [0.7 - 0.02j, -0.4], [1.0 + 0j, -0.7]])
    return {"Fn": [1.5, 4.4], "Xi": [0.01, 0.02], "Phi": shape, "Fn_std": [0.01, 0.02]}


def ambient_text() -> str:
    """Motions of two floors under an unknown excitation, 80 s."""
    rng = np.random.default_rng(5)
    answer = np.exp(-0.4 * STEP * np.arange(400)) * np.sin(22.0 * STEP * np.arange(400))
    second = np.exp(-1.2 * STEP * np.arange(400)) * np.sin(60.0 * STEP * np.arange(400))
    first, other = (np.convolve(rng.normal(size=4000), own)[:4000] for own in (answer, second))
    rows = zip(STEP * np.arange(4000), first + other, 1.6 * first - 0.6 * other, strict=True)
    lines = "".join(f"{t:.2f},{a:.5g},{b:.5g}\n" for t, a, b in rows)
    return f"time_s,2F (m/s2),RF (m/s2)\n{lines}"


MAPPING = """\
# Which channel of station.csv is which floor.
unit = "gal"

[columns]
base = 1
RF = "-2"
"RF.y" = "3"
"2F:1" = "East wall"
"""
