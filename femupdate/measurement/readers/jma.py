"""JMA strong-motion CSV: a header of KEY= value lines, then a table of NS, EW and UD."""

from pathlib import Path

from femupdate.measurement.recording import RecordedChannel, Recording, azimuth_of
from femupdate.measurement.table import Row, cells_of, drop_trailing_blanks, is_number, parse_rows
from femupdate.measurement.text import TextFile, header_value, positive, read_text

READS = "JMA strong-motion CSV"

_RATE = r"SAMPLING\s*(?:RATE|FREQ\w*)\s*=\s*([^\s,]+?)\s*HZ"


def recognises(head: str, suffix: str) -> bool:
    first = next((line for line in head.split("\n") if line.strip() and line[0] != "#"), "")
    return first.strip().strip('"').upper().startswith("SITE CODE")


def read(path: Path) -> Recording:
    """All channels, in the unit that the header states."""
    file = read_text(path)
    at, rate = header_value(file, _RATE, "SAMPLING RATE in Hz")
    step = 1.0 / positive(file, rate.group(1), "SAMPLING RATE", at)
    _, unit = header_value(file, r"^\W*UNIT\s*=\s*([^,]+)", "UNIT")
    names, rows = _channels_and_rows(file)
    values, _ = parse_rows(file, rows, ",", names)
    return Recording(
        file,
        tuple(
            RecordedChannel(
                name=name,
                values=column,
                time_step=step,
                unit=unit.group(1).strip(),
                direction=name,
                azimuth_deg=azimuth_of(name),
            )
            for name, column in zip(names, values.T, strict=True)
        ),
    )


def _channels_and_rows(file: TextFile) -> tuple[tuple[str, ...], list[Row]]:
    rows = file.rows()
    for position, (_, text) in enumerate(rows):
        if is_number(cells_of(text, ",")[0]):
            break
        if "=" not in text:
            # Spreadsheets leave empty cells behind every row, here and in the header.
            rows = drop_trailing_blanks(rows[position:], ",")
            return tuple(cells_of(rows[0][1], ",")), rows[1:]
    raise file.error("the row of channel names (NS,EW,UD) is missing; restore the header")
