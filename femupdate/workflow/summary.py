"""The posterior in figures and sentences, as a file beside its draws."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.errors import StudyError
from femupdate.inference.identifiability import Identifiability, identifiability
from femupdate.inference.posterior import Posterior
from femupdate.inference.predictive_check import PredictiveCheck
from femupdate.study import Study, write_text

SUMMARY = "posterior_summary.json"


def identified(posterior: Posterior) -> Identifiability:
    """What the data have told about the parameters of a posterior."""
    return identifiability(
        posterior.samples, posterior.lower, posterior.upper, names=posterior.names
    )


def write_summary(
    study: Study,
    posterior: Posterior,
    found: Identifiability,
    misfit: float,
    notes: Sequence[str],
    check: PredictiveCheck | None = None,
) -> Path:
    """Write means, standard deviations, quantiles, combinations and modes as JSON."""
    draws = posterior.samples
    low, median, high = np.quantile(draws, [0.05, 0.5, 0.95], axis=0)
    columns = {
        "name": posterior.names,
        "mean": draws.mean(axis=0).tolist(),
        "sd": draws.std(axis=0, ddof=1).tolist(),
        "q05": low.tolist(),
        "median": median.tolist(),
        "q95": high.tolist(),
    }
    content = {
        "drawn_by": asdict(posterior.drawn),
        "floors": posterior.observation.floors,
        "source": posterior.observation.source,
        "draws": len(draws),
        "parameters": [
            dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)
        ],
        "misfit": misfit,
        "posterior_predictive_p": None if check is None else check.as_dict(),
        "identifiability": identifiability_record(found),
        "notes": list(notes),
    }
    path = study.result(SUMMARY)
    write_text(path, json.dumps(content, indent=1) + "\n")
    return path


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
    """What `write_summary` wrote; empty where there is none, as after a repair.

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
