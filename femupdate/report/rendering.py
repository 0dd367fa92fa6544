"""Whether pictures can be rendered here: asked once, in a process that may crash."""

import functools
import logging
import subprocess
import sys
from dataclasses import dataclass
from typing import Literal

logger = logging.getLogger(__name__)

Renderer = Literal["auto", "pyvista", "matplotlib"]

TIMEOUT = 60.0  # s; a first picture takes one to five
ADVICE = (
    "to render with PyVista install libegl1 and libgl1-mesa-dri, or libosmesa6 "
    "(Debian and Ubuntu packages)"
)
_PICTURE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere())
picture = plotter.screenshot(return_img=True)
plotter.close()
raise SystemExit(0 if picture.std() > 1.0 else 3)
"""


@dataclass(frozen=True)
class Rendering:
    """Whether PyVista can render, and if not why, as half a sentence."""

    works: bool
    reason: str = ""


@functools.lru_cache(maxsize=1)
def rendering() -> Rendering:
    """Return whether PyVista can render off screen here; the answer holds for the process.

    Without graphics libraries VTK crashes at its first picture instead of raising an error, so the
    first picture is made in a process of its own. Where it fails, the log says what to install.
    """
    found = probe((sys.executable, "-P", "-c", _PICTURE))
    if not found.works:
        logger.warning("PyVista cannot render here (%s): %s", found.reason, ADVICE)
    return found


def renders(renderer: Renderer) -> bool:
    """Return whether PyVista makes the picture: where it is named, or "auto" and works."""
    return renderer == "pyvista" or (renderer == "auto" and rendering().works)


def probe(command: tuple[str, ...], timeout: float = TIMEOUT) -> Rendering:
    """Run a command that makes a picture and tell whether it lived."""
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Rendering(False, f"no picture within {timeout:.0f} s")
    except OSError as error:
        return Rendering(False, f"no process could be started: {error.strerror}")
    return Rendering(done.returncode == 0, _reason(done.returncode, done.stderr))


def _reason(code: int, errors: bytes) -> str:
    if code == 0:
        return ""
    if code == 3:
        return "the first picture is blank"
    if code < 0 or code > 128:
        return "the first picture crashes"
    lines = errors.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else f"exit status {code}"
