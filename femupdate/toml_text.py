"""TOML of any file, read without a traceback and in little time."""

import re
import tomllib
from typing import Any

_TOO_DEEP = "its lists or tables are nested too deeply; take them apart"
# Fifty names with dots between them, where a key may begin.
_DEEP_KEY = re.compile(r"""(?:^|[{,\[])[ \t]*(?:[\w"'-]+[ \t]*\.[ \t]*){50}""", re.MULTILINE)


def toml_content(text: str) -> dict[str, Any]:
    """Return what a text in TOML says.

    Raises:
        ValueError: it is not TOML, it is nested too deeply, or a number has too many digits; the
            message says what to do.
    """
    if _DEEP_KEY.search(text):  # tomllib's time grows with the square of their number
        raise ValueError(_TOO_DEEP)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"this is not valid TOML: {error}; correct that line") from None
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except ValueError as error:  # such as a number of more digits than Python reads
        raise ValueError(f"a value cannot be read ({error}); write a shorter one") from None
