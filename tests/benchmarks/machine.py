"""What a benchmark ran on."""

import platform
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from femupdate import __version__
from femupdate.workers import processor_count

_PACKAGES = ("numpy", "scipy", "torch")


@dataclass(frozen=True, kw_only=True)
class Machine:
    """Where and when a benchmark ran."""

    processor: str  # its name
    cores: int  # that this process may use
    system: str  # operating system
    python: str  # version
    # Versions of packages that do the work, None for one that is not installed
    packages: dict[str, str | None]
    femupdate: str  # version
    date: str  # UTC, ISO 8601

    def sentence(self) -> str:
        """All of it on one line."""
        packages = ", ".join(f"{name} {found}" for name, found in self.packages.items() if found)
        return (
            f"{self.date[:10]}, {self.processor}, {self.cores} cores, {self.system}, "
            f"Python {self.python}, {packages}, femupdate {self.femupdate}"
        )


def this_machine(*packages: str) -> Machine:
    """Describe this machine, now, with the versions of further packages."""
    return Machine(
        processor=_processor(),
        cores=processor_count(),
        system=f"{platform.system()} {platform.machine()}",
        python=sys.version.split()[0],
        packages={name: _version(name) for name in (*_PACKAGES, *packages)},
        femupdate=__version__,
        date=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def _processor() -> str:
    """Name of the processor; Linux keeps it in a file only."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
