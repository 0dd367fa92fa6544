"""The building of a study with its reduced model: made once, then read back."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from femupdate.building.building_mesh import BuildingMesh
from femupdate.building.files import (
    load_building,
    mechanics_hash,
    save_building,
)
from femupdate.building.mesh import mesh_building
from femupdate.building.parameters import factor_ranges
from femupdate.building.schema import Building
from femupdate.building.shear import shear_operators
from femupdate.dynamics.damping import DampingLaw, damping_law
from femupdate.dynamics.effect_response import EffectSystem
from femupdate.dynamics.reduced import ReducedModel
from femupdate.dynamics.reduction import (
    Reduction,
    ReductionTarget,
    reduce_lumped,
    reduce_operators,
)
from femupdate.errors import StudyError
from femupdate.fe.assembly import AffineOperators, assemble
from femupdate.inference.likelihood import SharedErrors
from femupdate.inference.prior import UniformPrior
from femupdate.progress import SILENT, Progress
from femupdate.study import Study, atomic_path

DEFAULT_BUILDING = "six_story_wall_frame"
REDUCED = "reduced model"
_BUILDING_FILE = "building.toml"
_REDUCED_FILE = "reduced_model.npz"
_ARRAYS = (
    "stiffness_terms",
    "stiffness_constant",
    "excitation",
    "floor_shapes",
    "story_inertia",
    "story_mass",
    "story_drift",
)


@dataclass(frozen=True)
class StudyModel:
    """A building ready for inference.

    Attributes:
        building: as its file says.
        reduced: the reduced model.
        law: damping law.
        prior: of the stiffness factors.
        zeta_bounds: range of the damping ratio where it is a nuisance, else None.
        reduction_error: rms difference of ln|H| from the full model; 0 for lumped buildings.
        system: with the effects that the building lists, where a surrogate of them is at work; the
            prior is then of their sizes as well.
        shared: what the mesh of that system leaves open; None for a stick.
    """

    building: Building
    reduced: ReducedModel
    law: DampingLaw
    prior: UniformPrior
    zeta_bounds: tuple[float, float] | None
    reduction_error: float
    system: EffectSystem | None = None
    shared: SharedErrors | None = None

    @property
    def responder(self) -> ReducedModel | EffectSystem:
        """What responses are asked of."""
        return self.system or self.reduced

    @property
    def frequency_hz(self) -> Tensor:
        """(k,) the building's grid, Hz, float64."""
        return torch.from_numpy(self.building.frequency_grid.frequencies_hz())

    @property
    def hash(self) -> str:
        """Of the building's mechanics, prior and grid: what everything else is made from."""
        return mechanics_hash(self.building)

    def made_from(self) -> dict[str, str]:
        """For the study's record."""
        return {"building": self.hash}


@dataclass(frozen=True)
class FrameParts:
    """The full model behind a frame building's reduced one."""

    mesh: BuildingMesh
    operators: AffineOperators


def theta_prior(building: Building) -> UniformPrior:
    """The prior of the stiffness factors, one a story or one a story and kind of member."""
    ranges = factor_ranges(building)
    lower, upper = torch.tensor(list(ranges.values()), dtype=torch.float64).T
    return UniformPrior(tuple(ranges), lower, upper)


def zeta_bounds(building: Building) -> tuple[float, float] | None:
    """Range of the damping ratio where the building leaves it open."""
    zeta = building.prior.zeta
    if zeta is None or building.damping.is_rayleigh:
        return None
    return zeta.lower, zeta.upper


def frame_parts(building: Building, mesh_size: float | None = None) -> FrameParts:
    """Mesh and assemble a frame building."""
    mesh = mesh_building(building, mesh_size)
    return FrameParts(mesh, assemble(mesh.model))


def open_study(
    study: Study, building: str | None = None, progress: Progress | None = None
) -> StudyModel:
    """Return the model of a study; build it first where the study does not hold it yet.

    Args:
        study: the folder.
        building: name or path of a building; default the study's own, or the six-story building
            for an empty study.
        progress: told about the reduction.

    Raises:
        StudyError: the study is of another building.
        BuildingError, ModelError: the building cannot be read or cannot stand.
    """
    chosen = choose_building(study, building)
    kept = study.find(REDUCED, {"building": mechanics_hash(chosen)})
    if kept is not None:
        reduced, error = load_reduced(kept)
        return _study_model(chosen, reduced, error)
    reduction = reduce_building(chosen, progress=progress or SILENT)
    return keep_model(study, chosen, reduction)


def keep_model(study: Study, building: Building, reduction: Reduction) -> StudyModel:
    """Write a building and its reduced model into a study."""
    save_building(building, study.path(_BUILDING_FILE))
    save_reduced(reduction.model, reduction.rms_error, study.path(_REDUCED_FILE))
    model = _study_model(building, reduction.model, reduction.rms_error)
    study.record(
        REDUCED,
        _REDUCED_FILE,
        "build-model",
        model.made_from(),
        {
            "size": reduction.model.size,
            "rms_error": reduction.rms_error,
            "largest_error": reduction.largest_error,
            "checks": reduction.checks,
            "worst_error": reduction.worst_error,
            "share_no_worse": reduction.share,
        },
    )
    return model


def reduce_building(
    building: Building, parts: FrameParts | None = None, progress: Progress = SILENT
) -> Reduction:
    """Make the reduced model of any building."""
    if building.kind == "shear":
        lumped = shear_operators(building)
        model = reduce_lumped(lumped.stiffness_terms, lumped.mass, lumped.floors)
        return Reduction(model, 0.0, 0.0, 0)
    parts = parts or frame_parts(building)
    prior, bounds = theta_prior(building), zeta_bounds(building)
    target = ReductionTarget(
        prior.lower.numpy(),
        prior.upper.numpy(),
        building.frequency_grid.frequencies_hz(),
        bounds[0] if bounds else building.damping.ratio,
        building.reduction.tolerance,
    )
    return reduce_operators(
        parts.operators,
        parts.mesh.floor_nodes,
        np.concatenate([[0.0], parts.mesh.floor_level]),
        parts.mesh.direction,
        target,
        progress,
    )


def reduction_of(model: StudyModel) -> Reduction:
    """The reduction behind a study's model, to be kept in another study of the same structure."""
    return Reduction(model.reduced, model.reduction_error, model.reduction_error, 0)


def save_reduced(model: ReducedModel, rms_error: float, path: Path) -> None:
    """Write a reduced model as npz, atomically."""
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    if model.node_shapes is not None:
        arrays["node_shapes"] = model.node_shapes
    header = json.dumps({"floors": model.floors, "rms_error": rms_error})
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, header=np.array(header), **arrays)


def load_reduced(path: Path) -> tuple[ReducedModel, float]:
    """Read a reduced model and its rms error."""
    with np.load(path) as data:
        header = json.loads(str(data["header"]))
        shapes = data.get("node_shapes")
        arrays = {name: data[name] for name in _ARRAYS}
    model = ReducedModel(**arrays, floors=tuple(header["floors"]), node_shapes=shapes)
    return model, float(header["rms_error"])


def choose_building(study: Study, name: str | None) -> Building:
    """The building asked for, the study's own, or the default one.

    Raises:
        StudyError: the study holds another building than the one asked for.
    """
    kept = study.path(_BUILDING_FILE)
    if not kept.exists():
        return load_building(name or DEFAULT_BUILDING)
    own = load_building(kept)
    if name is None:
        return own
    asked = load_building(name)
    if mechanics_hash(asked) != mechanics_hash(own):
        raise StudyError(
            f"the study {study.folder} holds the building {own.name}, not {asked.name} as asked "
            "(or another version of it); choose another folder with --study"
        )
    return own


def _study_model(building: Building, reduced: ReducedModel, error: float) -> StudyModel:
    return StudyModel(
        building,
        reduced,
        damping_law(building),
        theta_prior(building),
        zeta_bounds(building),
        error,
    )
