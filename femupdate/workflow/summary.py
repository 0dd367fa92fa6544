"""The posterior in figures and sentences, as a file beside its draws."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.errors import StudyError
from femupdate.inference.identifiability import Identifiability, identifiability
from femupdate.inference.posterior import Posterior
from femupdate.study import Study

SUMMARY = "posterior_summary.json"


def identified(posterior: Posterior) -> Identifiability:
    """What the data have told about the parameters of a posterior."""
    return identifiability(
        posterior.samples, posterior.lower, posterior.upper, names=posterior.names
    )


def identifiability_record(found: Identifiability) -> dict[str, Any]:
    """Plain numbers and text, for JSON."""
    return {
        "undetermined": found.undetermined,
        "left_alone": list(found.left_alone),
        "combinations": [
            {
                "kept": part.kept,
                "words": found.describe(part),
                "weight": _named(found.names, part.weight),
            }
            for part in found.combinations
        ],
        "modes": [
            {key: np.asarray(value).tolist() for key, value in asdict(mode).items()}
            for mode in found.modes
        ],
    }


def _named(names: Sequence[str], values: ArrayLike) -> dict[str, float]:
    return {name: float(v) for name, v in zip(names, np.asarray(values), strict=True)}


def kept_summary(study: Study) -> dict[str, Any]:
    """What the report of a calibration wrote; empty where there is none, as after a repair.

    Raises:
        StudyError: the file cannot be read.
    """
    path = study.result(SUMMARY)
    if not path.exists():
        return {}
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise StudyError(
            f"{path} cannot be read ({error}); run `femupdate calibrate` again"
        ) from error
