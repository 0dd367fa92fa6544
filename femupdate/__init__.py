"""femupdate: calibrates finite-element models of buildings to measured vibration."""

from pathlib import Path as _Path

__version__ = "0.1.0"

# In a checkout `cli/`, `models/` and `examples/` lie beside this folder; installed, inside it. The
# benchmarks, in `tests/benchmarks/`, are in a checkout alone.
_checkout = _Path(__file__).resolve().parent.parent
if (_checkout / "cli" / "main.py").exists():
    __path__.extend([str(_checkout), str(_checkout / "tests")])
