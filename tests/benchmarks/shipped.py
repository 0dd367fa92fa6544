"""Shipped buildings and surrogates, ready for a benchmark."""

import hashlib
from importlib.resources import as_file, files

from femupdate.building import load_building
from femupdate.building.document import Building
from femupdate.dynamics import System, damping_law
from femupdate.inference.parameters import damping_parameter, theta_prior
from femupdate.surrogate import Surrogate, load_surrogate
from femupdate.workflow import StudyModel, reduce_building


def benchmark_model(name: str = "shear_4dof") -> StudyModel:
    """A shipped building, ready for inference; frames are reduced, which takes a minute."""
    building = load_building(name)
    reduction = reduce_building(building)
    reduced = reduction.reduced.model
    return StudyModel(
        building,
        reduced,
        System(reduced, damping_law(building)),
        theta_prior(building),
        damping_parameter(building),
        reduction.rms_error,
    )


def shipped_surrogate(building: Building) -> Surrogate:
    """The surrogate that is shipped with a building."""
    with as_file(files("femupdate.models") / f"{building.name}.safetensors") as path:
        return load_surrogate(path)


def surrogate_mark(surrogate: Surrogate) -> str:
    """A hash of all weights: cases of another likelihood are other cases."""
    digest = hashlib.sha256()
    for tensor in surrogate.mvae.state_dict().values():
        digest.update(tensor.detach().cpu().numpy().tobytes())
    return digest.hexdigest()
