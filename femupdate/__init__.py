"""femupdate: calibrates finite-element models of buildings to measured vibration."""

from pathlib import Path as _Path
from typing import TYPE_CHECKING as _TYPE_CHECKING

from femupdate.lazy import lazily as _lazily

__version__ = "0.1.0"

# In a checkout `cli/`, `models/` and `examples/` lie beside this folder; installed, inside it. The
# benchmarks, in `tests/benchmarks/`, are in a checkout alone.
_checkout = _Path(__file__).resolve().parent.parent
if (_checkout / "cli" / "main.py").exists():
    __path__.extend([str(_checkout), str(_checkout / "tests")])

# Where each public name is: imported when it is first used, so that commands start without it.
_NOUNS = {
    "Building": "building.files:AnyBuilding",
    "Diagnosis": "discrepancy.findings",
    "Effect": "effects.effect",
    "GroundMotion": "measurement.record",
    "Likelihood": "inference.likelihood",
    "ModelError": "inference.likelihood",
    "Observation": "measurement.observation",
    "Parameters": "inference.parameters",
    "Posterior": "inference.posterior",
    "Prediction": "report.prediction",
    "Recording": "measurement.recording",
    "Structure": "effects.structure",
    "Study": "study",
    "Surrogate": "surrogate.storage",
    "System": "dynamics.system",
}

if _TYPE_CHECKING:
    from femupdate.building.common import Building
    from femupdate.discrepancy.findings import Diagnosis
    from femupdate.dynamics.system import System
    from femupdate.effects.effect import Effect
    from femupdate.effects.structure import Structure
    from femupdate.inference.likelihood import Likelihood, ModelError
    from femupdate.inference.parameters import Parameters
    from femupdate.inference.posterior import Posterior
    from femupdate.interface import (
        calibrate,
        compare,
        diagnose,
        predict,
        reduce,
        repair,
        simulate,
        status,
        train,
    )
    from femupdate.measurement.observation import Observation
    from femupdate.measurement.record import GroundMotion
    from femupdate.measurement.recording import Recording
    from femupdate.report.prediction import Prediction
    from femupdate.study import Study
    from femupdate.surrogate.storage import Surrogate
    from femupdate.workflow.build import build_model
    from femupdate.workflow.demo import run_demo as demo
    from femupdate.workflow.inspect_files import identify, inspect
    from femupdate.workflow.page import write_report
    from femupdate.workflow.render import render_study as render
    from femupdate.workflow.shipped import copy_examples
    from femupdate.workflow.shipped import list_all as catalogue


__all__ = [
    "Building",
    "Diagnosis",
    "Effect",
    "GroundMotion",
    "Likelihood",
    "ModelError",
    "Observation",
    "Parameters",
    "Posterior",
    "Prediction",
    "Recording",
    "Structure",
    "Study",
    "Surrogate",
    "System",
    "build_model",
    "calibrate",
    "catalogue",
    "compare",
    "copy_examples",
    "demo",
    "diagnose",
    "identify",
    "inspect",
    "predict",
    "reduce",
    "render",
    "repair",
    "simulate",
    "status",
    "train",
    "write_report",
]

_VERBS = [_name for _name in __all__ if _name.islower()]
__getattr__ = _lazily(__name__, {**_NOUNS, **dict.fromkeys(_VERBS, "python")})


def __dir__() -> list[str]:
    return [*__all__, "__version__", "__doc__", "__path__"]
