"""Writers of record files, after the published descriptions of the formats."""

from collections.abc import Sequence


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


def esm_text(values: Sequence[float], kind: str = "ACCELERATION", stream: str = "HNE") -> str:
    header = {
        "EVENT_NAME": "TEST",
        "EVENT_ID": "IT-2016-0001",
        "STATION_NAME": "TESTVILLE",
        "SAMPLING_INTERVAL_S": "0.005000",
        "NDATA": str(len(values)),
        "UNITS": "cm/s^2",
        "STREAM": stream,
        "PGA_CM/S^2": f"{max(values, key=abs):.6f}",
        "DATA_TYPE": kind,
        "USER5": "",
    }
    lines = [f"{key}: {value}" for key, value in header.items()]
    return "\n".join([*lines, *(f"{value:.6f}" for value in values)]) + "\n"


def cosmos_text(channels: dict[str, Sequence[float]], step_ms: str = "5.0") -> str:
    """COSMOS Volume 2: an acceleration and a velocity block for each `direction, location`."""
    lines: list[str] = []
    for number, (name, values) in enumerate(channels.items(), start=1):
        direction, _, location = name.partition(", ")
        n, lasts = len(values), round(len(values) * 0.005)
        integers, reals = ["-999"] * 100, ["-999.0"] * 100
        integers[53] = direction.split()[0] if direction[0].isdigit() else "400"
        reals[61], reals[63] = step_ms, f"{max(values, key=abs):.5f}"
        for quantity, data in (("acceleration", values), ("velocity", [0.5] * n)):
            lines += [
                f"Corrected {quantity}    (Format v01.20 with 13 text lines)",
                f"Sta Chan {number:3d}:{direction} (Rcrdr Chan {number:2d}) Location:{location}",
                " 100 Integer-header values follow on  10 lines, Format= (10I8)",
                *("".join(v.rjust(8) for v in integers[i : i + 10]) for i in range(0, 100, 10)),
                " 100 Real-header values follow on  17 lines, Format= (6F13.6)",
                *("".join(v.rjust(13) for v in reals[i : i + 6]) for i in range(0, 100, 6)),
                '   1 Comment line(s) follow, each starting with a "|":',
                "| made",
                f"{n:8d} {quantity} pts, approx {lasts:3d} secs, units=cm/sec2(04),Format=(8f10.5)",
                *fixed(data, 10, 5),
                f"End-of-data for Chan {number:2d} {quantity}",
            ]
    return "\n".join(lines) + "\n"


def smc_text(values: Sequence[float], title: str = "2 CORRECTED ACCELEROGRAM") -> str:
    integers, reals = [-32768] * 48, [1.7e38] * 50
    integers[12], integers[13], integers[15], integers[16] = 90, 171, 1, len(values)
    reals[1] = 200.0
    lines = [title, "*", "1103", "", "", "station = TEST  component= 171", ""]
    lines[6] = f"epicentral dist =      2.0       pk acc = {max(values, key=abs):9.2E}"
    lines += ["", "*", "*", "*"]
    lines += ["".join(f"{v:10d}" for v in integers[i : i + 8]) for i in range(0, 48, 8)]
    lines += ["".join(f"{v:15.7E}" for v in reals[i : i + 5]) for i in range(0, 50, 5)]
    lines += ["|<loclbl=>4th floor, east core<end>"]
    words = [f"{v:.4E}".replace("E+0", "E+").replace("E-0", "E-").rjust(10) for v in values]
    return "\n".join([*lines, *("".join(words[i : i + 8]) for i in range(0, len(words), 8))]) + "\n"
