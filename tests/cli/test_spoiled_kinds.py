"""Spoiled files of modes, force tests, stations and instruments: one sentence, nothing written."""

import io
import zipfile

import numpy as np
import pytest

MODES = "mode,frequency_hz,frequency_sd_hz,damping,damping_sd,2F,RF,RF_sd\n"
ONE = "1,3.2,0.01,0.02,0.002,0.6,1,0.02\n"
FORCE = "frequency_hz,2F/RF (m/s2/N),RF/RF (m/s2/N)\n"
CURVE = "".join(f"{0.5 * k},{1e-4 * k**2:g},{2e-4 * k**2:g}\n" for k in range(1, 25))
SHAKEN = "".join(f"{0.02 * k:.2f},{(7 * k) % 11 - 5},{(5 * k) % 7 - 3}\n" for k in range(100))
UFF = "    -1\n    58\n"


def npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def archive(**members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as packed:
        for name, text in members.items():
            packed.writestr(name, text)
    return stream.getvalue()


def edited(old, new):
    """A table of one mode with a change."""
    assert old in MODES + ONE
    return (MODES + ONE).replace(old, new, 1)


SPOILED = {
    # identified modes
    "modes, head alone": ("a.csv", MODES, "has a header but no data"),
    "modes, no frequency": ("a.csv", edited("frequency_hz", "period_s"), "unknown column"),
    "modes, blank frequency": ("a.csv", edited("3.2", ""), "the mode has no frequency"),
    "modes, frequency of zero": ("a.csv", edited("3.2", "0"), "it must be above 0"),
    "modes, negative frequency": ("a.csv", edited("3.2", "-3.2"), "it must be above 0"),
    "modes, frequency in words": ("a.csv", edited("3.2", "three"), "'three' is not a number"),
    "modes, infinite frequency": ("a.csv", edited("3.2", "inf"), "the value is inf"),
    "modes, damping in percent": ("a.csv", edited("0.02,", "2.0,"), "behind the column's name"),
    "modes, damping in metres": ("a.csv", edited("damping,", "damping (m),"), "cannot be in 'm'"),
    "modes, no spread": ("a.csv", edited("0.01", "0"), "standard deviation of the frequency"),
    "modes, spread below zero": ("a.csv", edited("0.002", "-1"), "standard deviation of the damp"),
    "modes, shape without spread": ("a.csv", edited("1,0.02\n", "1,0\n"), "not above 0"),
    "modes, floor of another": ("a.csv", edited("2F,RF", "7F,RF"), "7F"),
    "modes, sensor twice": ("a.csv", edited("2F,RF,", "RF,RF,"), "two columns are called 'RF'"),
    "modes, half a complex shape": ("a.csv", edited("2F,", "2F_re,"), "both 2F_re and 2F_im"),
    "modes, a cell too many": ("a.csv", MODES + ONE[:-1] + ",9\n", "the row has 9 cells"),
    "modes, a row cut off": ("a.csv", MODES + "1,3.2,0.01\n", "the row has 3 cells"),
    "modes, only points": ("a.npz", npz(Fn=[3.2], Phi=[[0.6], [1.0]]), "none of the shapes' comp"),
    "modes, damping of another": (
        "a.npz",
        npz(Fn=[3.2], Phi=[[0.6], [1.0]], Xi=[0.02, 0.03]),
        "give one for each mode",
    ),
    # force tests
    "force, no unit": ("a.csv", FORCE.replace(" (m/s2/N)", "") + CURVE, "has no unit"),
    "force, unit of weight": ("a.csv", FORCE.replace("m/s2/N", "kg") + CURVE, "unknown column"),
    "force, two quantities": ("a.csv", FORCE.replace("m/s2/N", "m/N", 1) + CURVE, "quantities"),
    "force, in MN": ("a.csv", FORCE.replace("m/s2/N", "m/s2/MN") + CURVE, "masses allow"),
    "force, floor of another": ("a.csv", FORCE.replace("2F/RF", "8F/RF") + CURVE, "8F"),
    "force, at no floor": ("a.csv", FORCE.replace("2F/RF", "2F/9F") + CURVE, "9F"),
    "force, same twice": ("a.csv", FORCE.replace("2F/RF", "RF/RF") + CURVE, "two columns"),
    "force, negative size": ("a.csv", FORCE + CURVE.replace("0.0001", "-1"), "-1"),
    "force, few frequencies": (
        "a.csv",
        FORCE + CURVE[: CURVE.index("3.0,")],
        "fewer than ten frequencies",
    ),
    "force, falling frequencies": (
        "a.csv",
        FORCE + "".join(reversed(CURVE.splitlines(keepends=True))),
        "increas",
    ),
    "record, dead force": (
        "a.csv",
        "time_s,force/RF (N),RF (m/s2)\n" + "".join(f"{0.02 * k:.2f},0,1\n" for k in range(100)),
        "the force was not recorded",
    ),
    "record, force alone": (
        "a.csv",
        "time_s,force/RF (N)\n" + "".join(f"{0.02 * k:.2f},{k % 3}\n" for k in range(100)),
        "no floor that responds",
    ),
    "record, force without unit": (
        "a.csv",
        "time_s,force/RF,RF (m/s2)\n" + SHAKEN,
        "the force's unit is not given",
    ),
    "record, too short": (
        "a.csv",
        "time_s,force/RF (N),RF (m/s2)\n" + SHAKEN[: SHAKEN.index("0.50")],
        "too short for a spectrum",
    ),
    "floors alone": ("a.csv", "time_s,2F (gal),RF (gal)\n" + SHAKEN, "femupdate identify"),
    # stations and instruments
    "archive of nothing": ("a.zip", archive(), "holds no record"),
    "archive of letters": ("a.zip", archive(**{"b.txt": "Dear all,\n"}), "holds no record"),
    "archive that leaves": ("a.zip", archive(**{"../b.csv": "1"}), "outside its folder"),
    "archive, cut": ("a.zip", archive(**{"b.csv": MODES + ONE})[:-30], "cannot be opened"),
    "universal file, cut": ("a.uff", UFF, "read"),
    "universal file of geometry": ("a.uff", "    -1\n   999\n    -1\n", "has the sets"),
    "miniSEED, cut": ("a.mseed", b"000001D ABC  BHZNZ" + bytes(40), "cannot be read"),
    "miniSEED 3": ("a.mseed", b"MS\x03\x00\x00\x00", "known but not supported"),
    "TDMS, cut": ("a.tdms", b"TDSm\x0e\x00\x00\x00", "has a time step"),
    "MATLAB, cut": ("a.mat", b"MATLAB 5.0 MAT-file" + bytes(60), "cannot be read"),
    "a pickle": ("a.pkl", b"\x80\x04\x95\x00", "can run code"),
    "objects in numpy": ("a.npz", npz(Fn=np.array([{}], dtype=object)), "numpy.savez"),
    "LabVIEW": ("a.lvm", "LabVIEW Measurement\t\nWriter_Version\t2\n", "export it as TDMS"),
    "raw pairs": ("a.raw", "UNCORRECTED ACCELEROGRAM DATA\n 0.0 1.0\n", "take the .V1"),
    "spectra": ("a.v3", "RESPONSE AND FOURIER AMPLITUDE SPECTRA (86 PERIODS)\n", "spectra of"),
    "SMC of spectra": ("a.smc", "5 RESPONSE SPECTRUM\n" + 10 * "*\n", "not an acceleration"),
    "no rate": ("a.npz", npz(base=np.arange(99.0), RF=np.arange(99.0)), "neither times nor"),
}


@pytest.mark.parametrize(("name", "content", "words"), SPOILED.values(), ids=SPOILED)
def test_one_sentence_and_nothing_written(femupdate, tower_file, tmp_path, name, content, words):
    pytest.importorskip("obspy")
    pytest.importorskip("nptdms")
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    study = tmp_path / "study"
    done = femupdate("calibrate", path, "--building", tower_file, "--study", study)
    assert words in done.complaint
    assert name in done.complaint
    assert sorted(p.name for p in tmp_path.iterdir()) in ([name], sorted([name, "study"]))
    assert not (study / "posterior.nc").exists()
