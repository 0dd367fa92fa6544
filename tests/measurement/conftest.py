"""Files of records for tests."""

from collections.abc import Callable
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
