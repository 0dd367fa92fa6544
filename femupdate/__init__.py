"""femupdate: calibrates finite-element models of buildings to measured vibration."""

from importlib import import_module as _import_module
from pathlib import Path as _Path
from typing import Any as _Any

__version__ = "0.1.0"

# In a checkout `cli/`, `models/` and `examples/` lie beside this folder; installed, inside it. The
# benchmarks, in `tests/benchmarks/`, are in a checkout alone.
_checkout = _Path(__file__).resolve().parent.parent
if (_checkout / "cli" / "main.py").exists():
    __path__.extend([str(_checkout), str(_checkout / "tests")])

# Imported when first used: the commands start without what the work itself needs.
_INTERFACE = (
    *("Building", "Observation", "RecordSource"),
    *("calibrate", "compare", "diagnose", "predict"),
)


def __getattr__(name: str) -> _Any:
    if name in _INTERFACE:
        return getattr(_import_module("femupdate.interface"), name)
    raise AttributeError(f"module 'femupdate' has no attribute {name!r}")
