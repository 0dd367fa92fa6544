"""Trained surrogates that fit a building: the study's own, or one that is shipped."""

import shlex
from importlib.resources import as_file, files
from pathlib import Path

from femupdate.building.document import Building
from femupdate.building.files import mechanics_hash
from femupdate.errors import SurrogateError
from femupdate.inference.priors import damping_parameter, theta_prior
from femupdate.study import Study, StudyPart
from femupdate.surrogate.storage import TrainedSurrogate, load_surrogate, save_surrogate
from femupdate.workflow.calibrate_settings import FEW

SURROGATE = "surrogate"
TRAINED = StudyPart(
    SURROGATE,
    "surrogate.safetensors",
    "train",
    save_surrogate,
    load_surrogate,
    lambda value: {"samples": value.info.settings["samples"]},
)


def unserved(building: Building) -> str:
    """Why no surrogate can serve a building, in words; empty where one can."""
    if building.effects:
        return "lists effects"
    count = theta_prior(building).size + damping_parameter(building).free
    return f"has {count} parameters" if count > FEW else ""


def find_surrogate(study: Study, building: Building) -> tuple[TrainedSurrogate, Path] | None:
    """The study's own surrogate, or the shipped one, if it was trained for this building."""
    own = study.kept(TRAINED, {"building": mechanics_hash(building)})
    return _shipped(building) if own is None else (own, study.path(TRAINED.file))


def require_surrogate(
    study: Study, building: Building, asked: str | None = None
) -> TrainedSurrogate:
    """A surrogate that fits the building.

    Args:
        asked: name or path by which the building was chosen, for the message.

    Raises:
        SurrogateError: there is none.
    """
    found = find_surrogate(study, building)
    if found is None:
        options = f"--study {shlex.quote(str(study.folder))}"
        options += f" --building {shlex.quote(asked)}" if asked else ""
        raise SurrogateError(
            f"no trained surrogate fits the building {building.name}; run `femupdate train "
            f"{options}` (once for each building), or calibrate with --exact"
        )
    return found[0]


def _shipped(building: Building) -> tuple[TrainedSurrogate, Path] | None:
    resource = files("femupdate.models") / f"{building.name}.safetensors"
    if not resource.is_file():
        return None
    with as_file(resource) as path:
        surrogate = load_surrogate(path)
        fits = surrogate.info.mechanics_hash == mechanics_hash(building)
        return (surrogate, path) if fits else None
