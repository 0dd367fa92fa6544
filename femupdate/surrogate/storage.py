"""Trained surrogates on disk: safetensors with the purpose of the training in the header.

A study keeps its own; some buildings come with one.
"""

import json
import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from femupdate.building.document import Building, mechanics_hash
from femupdate.errors import SurrogateError, brief
from femupdate.storage import write_bytes
from femupdate.study import Study, StudyPart
from femupdate.surrogate.network import Mvae, NetworkSizes

# Half precision is enough for the observation encoder, whose proposals are refined. Errors of the
# parameter encoder and the decoder would shift every posterior.
_HALF_PRECISION = ("observation_encoder.", "x_mean", "x_scale")


_UNREADABLE = (
    AttributeError,
    IndexError,
    KeyError,
    OSError,
    OverflowError,
    RuntimeError,  # torch's and, as RecursionError, that of JSON
    SafetensorError,
    TypeError,
    ValueError,
)

# Stands for any set of floors in the record of a calibration.
ANY_FLOORS = "any"


@dataclass(frozen=True)
class SurrogateInfo:
    """What a trained surrogate is for.

    Attributes:
        mechanics_hash: of the building's mechanics, prior and frequency grid.
        noise_sd: standard deviation of ln|H| that it was trained with.
        settings: of data set and training.
        metrics: losses and times of the training.
        calibration: how often its regions held the truth, on simulations; empty where not counted.
    """

    building: str
    mechanics_hash: str
    floors: tuple[str, ...]
    noise_sd: float
    version: str
    settings: Mapping[str, Any]
    metrics: Mapping[str, float]
    calibration: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Surrogate:
    """The networks and their purpose.

    >>> import femupdate
    >>> found = femupdate.train("house", "shear_3dof")  # a shipped one fits: nothing is trained
    >>> isinstance(found.surrogate, femupdate.Surrogate), found.trained
    (True, False)
    >>> found.surrogate.info.floors
    ('2F', '3F', 'RF')
    """

    __repr__ = brief

    mvae: Mvae
    info: SurrogateInfo


def save_surrogate(surrogate: Surrogate, path: Path) -> None:
    """Write a surrogate, atomically."""
    tensors = {}
    for name, tensor in surrogate.mvae.state_dict().items():
        kind = torch.float16 if name.startswith(_HALF_PRECISION) else torch.float32
        tensors[name] = tensor.detach().to("cpu", kind).contiguous()
    header = {"sizes": asdict(surrogate.mvae.sizes), **asdict(surrogate.info)}
    write_bytes(path, save(tensors, metadata={"femupdate": json.dumps(header)}))


def load_surrogate(path: Path) -> Surrogate:
    """Read a surrogate.

    Raises:
        SurrogateError: the file is missing, is not a surrogate or is cut short.
    """
    try:
        with safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})["femupdate"])
            state = {name: file.get_tensor(name).float() for name in file.keys()}  # noqa: SIM118
        sizes, held = header.pop("sizes"), sum(value.numel() for value in state.values())
        asked = NetworkSizes(**sizes)
        if min(sizes.values()) < 0 or asked.least_weights > held:
            raise ValueError(f"{held} weights are not of its sizes")
        # The weights that they start from are drawn at random: leave the caller's state alone.
        with torch.random.fork_rng(devices=[]):
            mvae = Mvae(asked)
        mvae.load_state_dict(state)
        wrong = [name for name, value in state.items() if not torch.isfinite(value).all()]
        if wrong:
            raise ValueError(f"{wrong[0]} holds a value that is no number")
        header.pop("likelihood_power", None)  # in shipped weights; it was 1 within its error
        info = SurrogateInfo(**{**header, "floors": tuple(header["floors"])})
        return Surrogate(mvae.eval(), info)
    except _UNREADABLE as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise SurrogateError(
            f"{path} is not a trained surrogate of femupdate ({reason}); run `femupdate train`"
        ) from error


TRAINED = StudyPart(
    "surrogate",
    "surrogate.safetensors",
    "train",
    save_surrogate,
    load_surrogate,
    lambda value: {"samples": value.info.settings["samples"]},
)


def find_surrogate(study: Study, building: Building) -> tuple[Surrogate, Path] | None:
    """The study's own surrogate, or the shipped one, if it was trained for this building."""
    kept = study.kept(TRAINED, {"building": mechanics_hash(building)})
    if kept is not None:
        return kept, study.path(TRAINED.file)
    resource = files("femupdate.models") / f"{building.name}.safetensors"
    if not resource.is_file():
        return None
    with as_file(resource) as path:
        surrogate = load_surrogate(path)
        fits = surrogate.info.mechanics_hash == mechanics_hash(building)
        return (surrogate, path) if fits else None


def require_surrogate(study: Study, building: Building) -> Surrogate:
    """A surrogate that fits the building.

    Raises:
        SurrogateError: there is none.
    """
    found = find_surrogate(study, building)
    if found is None:
        raise SurrogateError(
            f"no trained surrogate fits the building {building.name}; run `femupdate train --study "
            f"{shlex.quote(str(study.folder))}` (once for each building), or calibrate with --exact"
        )
    return found[0]
