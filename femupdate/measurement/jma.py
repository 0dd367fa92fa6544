"""JMA strong-motion CSV: a header of KEY= value lines, then a table of NS, EW and UD."""

from femupdate.measurement.recording import RawChannel, header_value, positive
from femupdate.measurement.table import (
    Row,
    cells_of,
    drop_trailing_blanks,
    is_number,
    parse_rows,
)
from femupdate.measurement.text import TextFile

_RATE = r"SAMPLING\s*(?:RATE|FREQ\w*)\s*=\s*([^\s,]+?)\s*HZ"


def is_jma(file: TextFile) -> bool:
    """Return whether a file begins with the site code that JMA writes."""
    return file.rows()[0][1].strip().strip('"').upper().startswith("SITE CODE")


def read_jma(file: TextFile) -> tuple[RawChannel, ...]:
    """Read all channels of a JMA CSV, in the unit that its header states.

    Raises:
        MeasurementError: the sampling rate, the unit or the row of channel names is missing, or a
            cell is not a number.
    """
    at, rate = header_value(file, _RATE, "SAMPLING RATE in Hz")
    step = 1.0 / positive(file, rate.group(1), "SAMPLING RATE", at)
    _, unit = header_value(file, r"^\W*UNIT\s*=\s*([^,]+)", "UNIT")
    names, rows = _channels_and_rows(file)
    values, _ = parse_rows(file, rows, ",", names)
    return tuple(
        RawChannel(name, values[:, position], step, unit.group(1).strip())
        for position, name in enumerate(names)
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
