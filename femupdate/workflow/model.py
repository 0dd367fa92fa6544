"""The building of a study with its reduced model: made once, then read back."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from femupdate.building.document import Building, mechanics_hash, without_effects
from femupdate.building.files import load_building, save_building
from femupdate.building.kinds import FrameBuilding, ShearBuilding
from femupdate.discrepancy.mesh_error import MeshError, OpenMesh, corrected_model
from femupdate.dynamics.damping import DampingLaw, damping_law
from femupdate.dynamics.reduced import ReducedModel
from femupdate.dynamics.reduction import Reduction, reduce_structure
from femupdate.dynamics.system import System
from femupdate.effects.effect import Stiffness, Terms
from femupdate.effects.structure import Structure, structure_of
from femupdate.errors import StudyError, brief
from femupdate.inference.likelihood import KnownErrors
from femupdate.inference.parameters import (
    Parameter,
    Parameters,
    damping_parameter,
    reduction_target,
    theta_prior,
)
from femupdate.progress import SILENT, Progress
from femupdate.storage import check_shapes, read_arrays, write_arrays
from femupdate.study import BUILDING_FILE, MAIN_POSTERIOR, Study, StudyPart

FINER = "finer mesh"
_TERMS = {"term_owner": "t", "term_story": "t", "term_series": "t", "term_matrix": "trr"}


@dataclass(frozen=True, eq=False)
class FinerMesh:
    """A building on a mesh of half the size of its own.

    Attributes:
        model: its reduced model; node shapes are at the nodes of the building's own mesh.
        error: of the building's own mesh, as this one shows it.
        terms: what the effects that stand for the error add to the model.
    """

    model: ReducedModel
    error: MeshError
    terms: tuple[Terms, ...]

    @cached_property
    def corrected(self) -> ReducedModel:
        """The model, brought nearer to an infinitely fine mesh."""
        return corrected_model(self.model, self.error.of_half(), self.terms)

    @property
    def left_open(self) -> OpenMesh:
        """What that leaves open of the corrected model."""
        return OpenMesh(self.error.of_half(), self.terms)

    def write(self, path: Path) -> None:
        """Write it as npz, atomically."""
        header = json.dumps({"floors": self.model.floors, "error": asdict(self.error)})
        # Stiffness of the terms, one after the other, with the number of the effect of each.
        parts = [(k, term) for k, terms in enumerate(self.terms) for term in terms.stiffness]
        matrices = [term.matrix.numpy().astype(np.float32) for _, term in parts]
        size = self.model.size
        write_arrays(
            path,
            header=np.array(header),
            **self.model.arrays(),
            term_owner=np.array([k for k, _ in parts], dtype=np.int64),
            term_story=np.array([term.story for _, term in parts], dtype=np.int64),
            term_series=np.array([term.series for _, term in parts], dtype=np.float64),
            term_matrix=np.array(matrices, dtype=np.float32).reshape(-1, size, size),
        )

    @classmethod
    def read(cls, path: Path) -> "FinerMesh":
        """Read what `write` has written."""
        data = read_arrays(path)
        header = json.loads(str(data["header"]))
        model = ReducedModel.of_arrays(data, header["floors"])
        error = MeshError.of(header["error"])
        check_shapes(data, {**_TERMS, "stiffness_constant": "rr"})
        parts: list[list[Stiffness]] = [[] for _ in error.labels]
        columns: Sequence[NDArray[Any]] = [data[name] for name in _TERMS]
        for owner, story, series, matrix in zip(*columns, strict=True):
            whole = torch.from_numpy(matrix.astype(np.float64))
            parts[owner].append(Stiffness(int(story), whole, float(series)))
        return cls(model, error, tuple(Terms(stiffness=tuple(part)) for part in parts))


FINER_PART = StudyPart(FINER, "finer_mesh.npz", "calibrate", FinerMesh.write, FinerMesh.read)
"""The finer mesh of a building, as a study keeps it."""


def finer_origin(building: Building) -> dict[str, str]:
    """What it is made from, for the study's record."""
    origin = {"building": mechanics_hash(without_effects(building))}
    if isinstance(building, FrameBuilding):
        origin["mesh_m"] = f"{0.5 * building.mesh.size:.4g}"
    return origin


@dataclass(frozen=True, eq=False)
class CertifiedModel:
    """A reduced model and how far it was found to be from the full one.

    Attributes:
        rms_error: of ln|H|; 0 for lumped buildings.
        certified: further figures of its error, for the study's record.
    """

    model: ReducedModel
    rms_error: float
    certified: Mapping[str, float] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write it as npz, atomically."""
        header = json.dumps({"floors": self.model.floors, "rms_error": self.rms_error})
        write_arrays(path, header=np.array(header), **self.model.arrays())

    @classmethod
    def read(cls, path: Path) -> "CertifiedModel":
        """Read what `write` has written, but for what only the study's record has."""
        data = read_arrays(path)
        header = json.loads(str(data["header"]))
        return cls(ReducedModel.of_arrays(data, header["floors"]), float(header["rms_error"]))

    def settings(self) -> dict[str, float]:
        """For the study's record."""
        return {"size": self.model.size, "rms_error": self.rms_error, **self.certified}


REDUCED = StudyPart(
    "reduced model",
    "reduced_model.npz",
    "build-model",
    CertifiedModel.write,
    CertifiedModel.read,
    CertifiedModel.settings,
)


@dataclass(frozen=True)
class StudyModel:
    """A building ready for inference.

    Attributes:
        reduced: the reduced model; on the finer mesh where the study has one.
        reduction_error: rms difference of ln|H| from the full model; 0 for lumped buildings.
        system: the reduced model and its damping; with the effects that the building lists where a
            surrogate of them is at work, and the prior is then of their sizes as well.
        shared: what the mesh of that system leaves open; None for a stick.
        finer: what the study keeps of a mesh twice as fine; None for a stick.
    """

    __repr__ = brief

    building: Building
    reduced: ReducedModel
    system: System
    prior: Parameters
    damping: Parameter
    reduction_error: float
    shared: KnownErrors | None = None
    finer: FinerMesh | None = None

    @property
    def law(self) -> DampingLaw:
        """Damping law."""
        return self.system.law

    @property
    def parameters(self) -> Parameters:
        """Everything that is inferred or known of the response, the damping ratio last."""
        return self.prior + Parameters((self.damping,))

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


def open_study(
    study: Study, building: str | None = None, progress: Progress = SILENT
) -> StudyModel:
    """Return the model of a study; build it first where the study does not hold it yet.

    A frame is on the finer mesh from its first calibration on, and so is all that follows.

    Args:
        building: name or path of a building; default the study's own.

    Raises:
        StudyError: the study has no building and none is named, or is of another one.
        BuildingError, StructureError: the building cannot be read or cannot stand.
    """
    chosen = choose_building(study, building)
    say_building(chosen, progress)
    kept = study.kept(REDUCED, {"building": mechanics_hash(chosen)})
    if kept is not None:
        return on_kept_finer(study, _study_model(chosen, kept))
    return keep_reduction(study, chosen, reduce_building(chosen, progress=progress))


def open_calibrated(study: Study, progress: Progress = SILENT) -> StudyModel:
    """Return the model of a study that has a posterior of just this model."""
    study.require(MAIN_POSTERIOR, "calibrate")
    building = choose_building(study, None)
    study.check_fresh(MAIN_POSTERIOR, {"building": mechanics_hash(building)}, "calibrate")
    return open_study(study, None, progress)


def on_kept_finer(study: Study, model: StudyModel) -> StudyModel:
    """The model on the finer mesh that its study keeps, or as it is where there is none."""
    finer, building = model.finer, model.building
    if finer is None and not isinstance(building, ShearBuilding):
        finer = study.kept(FINER_PART, finer_origin(building))
    if finer is None or finer is model.finer:
        return model
    system = System(finer.corrected, model.law)
    return replace(
        model, reduced=finer.corrected, system=system, shared=finer.left_open, finer=finer
    )


def keep_reduction(study: Study, building: Building, reduction: Reduction) -> StudyModel:
    """Write a building and its reduced model into a study, as it was certified."""
    certified = {
        "checks": reduction.checks,
        "worst_error": reduction.worst_error,
        "share_no_worse": reduction.share,
    }
    reduced = CertifiedModel(reduction.reduced.model, reduction.rms_error, certified)
    return keep_model(study, building, reduced)


def keep_model(study: Study, building: Building, reduced: CertifiedModel) -> StudyModel:
    """Write a building and its reduced model into a study."""
    save_building(building, study.path(BUILDING_FILE))
    study.keep(REDUCED, {"building": mechanics_hash(building)}, reduced)
    return _study_model(building, reduced)


def reduce_building(
    building: Building, structure: Structure | None = None, progress: Progress = SILENT
) -> Reduction:
    """Make the reduced model of any building, without its effects."""
    plain = structure or structure_of(building)
    return reduce_structure(plain, reduction_target(building), progress=progress)


def say_building(chosen: Building, progress: Progress) -> None:
    """Say first of all which building a command works on."""
    title = "" if chosen.title in ("", chosen.name) else f" ({chosen.title})"
    progress.say(f"Building {chosen.name}{title}")


def choose_building(study: Study, name: str | None) -> Building:
    """The building asked for, or the study's own; none is assumed.

    Raises:
        StudyError: there is neither, or the study holds another building than the one asked for.
    """
    kept = study.path(BUILDING_FILE)
    if not kept.exists():
        if name is None:
            raise StudyError(
                f"the study {study.folder} has no building yet; name one with --building, or run "
                "`femupdate build-model NAME` first"
            )
        return load_building(name)
    held = load_building(kept)
    if name is None:
        return held
    asked = load_building(name)
    if mechanics_hash(asked) != mechanics_hash(held):
        raise StudyError(
            f"the study {study.folder} holds the building {held.name}, not {asked.name} as asked "
            "(or another version of it); choose another folder with --study, or delete this one"
        )
    return held


def _study_model(building: Building, reduced: CertifiedModel) -> StudyModel:
    return StudyModel(
        building,
        reduced.model,
        System(reduced.model, damping_law(building)),
        theta_prior(building),
        damping_parameter(building),
        reduced.rms_error,
    )
