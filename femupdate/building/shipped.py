"""The text of a building file, by path or by the name of a shipped building.

Nothing heavy is imported here, so that a misspelt name is answered at once.
"""

import os
from importlib.resources import files
from pathlib import Path

from femupdate.errors import BuildingError, close
from femupdate.storage import check_regular

_SUFFIX = ".toml"
# Program whose model a file is, by its ending.
PROGRAMS = {
    ".bdf": "Nastran",
    ".nas": "Nastran",
    ".json": "OpenSees",
    ".s2k": "SAP2000",
    ".$2k": "SAP2000",
    ".e2k": "ETABS",
    ".$et": "ETABS",
}


def shipped_buildings() -> tuple[str, ...]:
    """Return the names of the buildings that come with femupdate."""
    names = (entry.name for entry in files("femupdate.models").iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX)))


def program_of(path: str | Path) -> str | None:
    """The program whose model a file is, by its ending; None of another file."""
    return PROGRAMS.get(Path(path).suffix.lower())


def building_text(path_or_name: str | Path) -> tuple[str, str]:
    """Return what to call a building file, and its text; other programs' models are not read here.

    Raises:
        BuildingError: there is no such file, or it is not UTF-8 text.
    """
    text = str(path_or_name)
    path = Path(path_or_name).expanduser()
    is_path = text.endswith(_SUFFIX) or "/" in text or os.sep in text
    if isinstance(path_or_name, str) and not is_path and text in shipped_buildings():
        name = text + _SUFFIX
        return name, files("femupdate.models").joinpath(name).read_text(encoding="utf-8")
    try:
        check_regular(path, BuildingError)
        if program_of(path):
            return text, ""
        # Drawings of towers take some hundred thousand bytes.
        if path.stat().st_size > 20_000_000:
            raise BuildingError(f"{text}: this is too large for a building file; check the path")
        return text, path.read_text(encoding="utf-8")
    except FileNotFoundError:
        shipped = shipped_buildings()
        raise BuildingError(
            f"{text}: there is no such building file; the shipped buildings are "
            f"{', '.join(shipped)}{close(Path(text).stem, shipped)}"
        ) from None
    except UnicodeDecodeError:
        raise BuildingError(f"{text}: this is not UTF-8 text; save it as UTF-8") from None
    except OSError as error:
        raise BuildingError(f"{text}: cannot be read ({error.strerror}); check the path") from None
