"""Writers of record files, after the published descriptions of the formats."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared"
Writer = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Writer:
    """Write a text (or bytes) to a file of the test and return its path."""

    def writer(content: str | bytes, name: str = "record.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return writer


@pytest.fixture
def shared_file() -> Callable[[str], Path]:
    """Return a file of the folder `shared` beside the project, or skip."""

    def finder(name: str) -> Path:
        path = SHARED / name
        if not path.exists():
            pytest.skip(f"the measured file {name} is not beside this checkout")
        return path

    return finder


@pytest.fixture
def wave() -> np.ndarray:
    """37 values like no others of one sign: an asymmetric pulse of 0.3 g, printed in gal."""
    time = np.arange(37) * 0.02
    return np.round(300 * np.exp(-3 * time) * np.sin(9 * time + 0.4) - 20 * time, 3)


def jma_text(channels: dict[str, Sequence[float]], rate: str = "50Hz", spare: str = "") -> str:
    names, columns = list(channels), list(channels.values())
    rows = [",".join(f"{value:.3f}" for value in row) for row in zip(*columns, strict=True)]
    header = [
        "SITE CODE= 50101KOBE,135.18,34.69" + spare,
        " LAT.=  34.6900" + spare,
        " LON.= 135.1800" + spare,
        f" SAMPLING RATE= {rate}" + spare,
        " UNIT  = gal(cm/s/s)" + spare,
        "INITIAL TIME = 2024 01 17 05 46 26" + spare,
        " " + ",".join(names) + spare,
    ]
    return "\n".join([*header, *rows]) + "\n"


def peer_text(values: Sequence[float], count: int | None = None, step: str = ".0100") -> str:
    words = [f"{value:15.7E}" for value in values]
    rows = ["".join(words[i : i + 5]) for i in range(0, len(words), 5)]
    header = [
        "PEER NGA STRONG MOTION DATABASE RECORD",
        "Testville, 10/18/1989, Gilroy - Gavilan Coll., 337",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        f"NPTS=   {len(values) if count is None else count}, DT=   {step} SEC,",
    ]
    return "\n".join([*header, *rows]) + "\n"


def fixed(values: Sequence[float], width: int, decimals: int, per_line: int = 8) -> list[str]:
    """Rows of Fortran (8f9.6) output: no zero before the point, columns that may touch."""
    words = []
    for value in values:
        word = (
            f"{value:.{decimals}f}".replace("0.", ".", 1)
            if abs(value) < 1
            else f"{value:.{decimals}f}"
        )
        assert len(word) <= width
        words.append(word.rjust(width))
    return ["".join(words[i : i + per_line]) for i in range(0, len(words), per_line)]


def csmip_v1_text(channels: dict[str, Sequence[float]], rate: str = "100") -> str:
    lines: list[str] = []
    for number, (name, values) in enumerate(channels.items(), start=1):
        lines += [
            "Uncorrected Accelerogram Data             Processed: 07/06/19, CGS  test",
            "Station Id. TST     35.816N, 117.598W",
            f"Chan  {number}: {name}",
            "    1  100    1    3    3  100 -999    3",
            f" {len(values)} Accelerogram points at {rate} pts/sec in units of g.  "
            "     Format: (8f9.6)  ",
            *fixed(values, 9, 6),
            f"/&  ----------  End of Data for Station Channel   {number}  ----------",
        ]
    return "\n".join(lines) + "\n"


def csmip_v2_text(values: Sequence[float]) -> str:
    n = len(values)
    lines = [
        "Corrected accelerogram   58667-L2866       Chan  1:  H1         from   ",
        "Chan  5: 270 Deg (Sta Chn: 12)    Location: Roof - center",
        f"  {n} points of instrument- and baseline-corrected accel, veloc and displ data ",
        f"  {n} points of accel data equally spaced at  .005 sec, in cm/sec2. (8f10.6)    ",
        *fixed(values, 10, 6),
        f"  {n} points of veloc data equally spaced at  .005 sec, in cm/sec.  (8f10.6)    ",
        *fixed([0.5] * n, 10, 6),
        "/&  ----------  End of data for channel  5  ----------",
    ]
    return "\n".join(lines) + "\n"


def knet_text(counts: Sequence[int], duration: str) -> str:
    words = [f"{count:9d}" for count in counts]
    header = [
        "Origin Time       2018/01/24 19:51:00",
        "Lat.              41.0",
        "Long.             142.5",
        "Depth. (km)       30",
        "Mag.              6.2",
        "Station Code      TST005",
        "Station Lat.      41.2948",
        "Station Long.     141.1972",
        "Station Height(m) 10",
        "Record Time       2018/01/24 19:51:40",
        "Sampling Freq(Hz) 100Hz",
        f"Duration Time(s)  {duration}",
        "Dir.              E-W",
        "Scale Factor      7845(gal)/8223790",
        "Max. Acc. (gal)   29.070",
        "Last Correction   2018/01/24 19:51:41",
        "Memo.             ",
    ]
    rows = ["".join(words[i : i + 8]) + " " for i in range(0, len(words), 8)]
    return "\n".join([*header, *rows]) + "\n"


@pytest.fixture
def texts() -> dict[str, Callable[..., str]]:
    """The writers by the name of their format."""
    return {
        "jma": jma_text,
        "peer": peer_text,
        "csmip_v1": csmip_v1_text,
        "csmip_v2": csmip_v2_text,
        "knet": knet_text,
    }
