"""Cells of a row of text."""

Row = tuple[int, str]  # line number, text


def find_delimiter(line: str) -> str | None:
    """Return the delimiter of a row; None stands for blanks."""
    # The semicolon comes first: beside it a comma can only be the decimal sign.
    return next((mark for mark in ";\t," if mark in line), None)


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """Split a row into its cells, without blanks and quotes around them."""
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


def is_number(cell: str) -> bool:
    """Return whether a cell reads as a number (nan and inf included)."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
