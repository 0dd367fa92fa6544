"""The error of a frame's mesh, learned once from a mesh twice as fine and kept in the study."""

import json
from dataclasses import asdict, replace

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import without_effects
from femupdate.building.frame import FrameBuilding
from femupdate.building.schema import Building
from femupdate.discrepancy.mesh_error import MeshError, learn_mesh_error
from femupdate.discrepancy.thresholds import MESH_ERROR as THRESHOLDS
from femupdate.dynamics.finer_mesh import on_finer_mesh, on_nodes_of
from femupdate.dynamics.reduced_terms import ReducedStructure
from femupdate.dynamics.snapshots import log_even_samples
from femupdate.effects.structure import Structure, structure_of
from femupdate.inference.priors import reduction_target, theta_prior
from femupdate.progress import SILENT, Progress
from femupdate.seeds import even_points
from femupdate.study import Study, as_written, write_text
from femupdate.workflow.effects import finder_origin
from femupdate.workflow.finer_mesh import FinerMesh, half_mesh_size, keep_finer
from femupdate.workflow.model import StudyModel, on_kept_finer

MESH_ERROR = "mesh error"
_FILE = "mesh_error.json"


def with_finer_mesh(study: Study, model: StudyModel, progress: Progress = SILENT) -> StudyModel:
    """The model of a frame on a mesh twice as fine, which is made once and kept.

    A stick comes back as it is, as does a mesh that was read.
    """
    plain, model = without_effects(model.building), on_kept_finer(study, model)
    if not isinstance(plain, FrameBuilding) or model.finer is not None:
        return model
    coarse, fine = structure_of(plain), structure_of(plain, half_mesh_size(plain))
    target = reduction_target(plain)
    # Where meshes are compared, nothing but the mesh may differ.
    everywhere = log_even_samples(replace(target, samples=THRESHOLDS.carried))
    thetas = np.vstack([everywhere, _thetas(plain)])
    found = on_finer_mesh(coarse, model.reduced, fine, target, thetas, progress)
    own = on_nodes_of(coarse, found)
    keep_finer(study, plain, _learned(model, plain, replace(found, model=own)))
    return on_kept_finer(study, model)


def _learned(model: StudyModel, building: FrameBuilding, fine: ReducedStructure) -> FinerMesh:
    if building.by_kind:
        return FinerMesh(fine.model)
    top_hz = float(building.frequency_grid.frequencies_hz()[-1])
    error = learn_mesh_error(model.reduced, fine, _thetas(building), top_hz)
    return FinerMesh(fine.model, error, tuple(fine.terms(one) for one in error.placed))


def open_mesh_error(
    study: Study, model: StudyModel, structure: Structure, progress: Progress = SILENT
) -> MeshError | None:
    """The error of the finder's mesh; None for what is not meshed here.

    Without one in the study it is learned from the finer mesh that calibrations use, and kept.

    Args:
        structure: the full model on the finder's mesh.
    """
    plain = without_effects(model.building)
    if not isinstance(plain, FrameBuilding):
        return None
    kept = kept_mesh_error(study, plain)
    if kept is not None:
        return kept
    finer = with_finer_mesh(study, model, progress).finer
    assert finer is not None
    assert finer.error is not None
    known = dict(zip(finer.error.labels, finer.terms, strict=True))
    fine = ReducedStructure(structure, finer.model, np.zeros((len(structure.axis), 0)), known)
    coarse, target, thetas = structure_of(plain), reduction_target(plain), _thetas(plain)
    own = on_finer_mesh(coarse, model.reduced, structure, target, thetas, progress)
    top_hz = float(plain.frequency_grid.frequencies_hz()[-1])
    found = learn_mesh_error(own.model, fine, thetas, top_hz).of_mesh(THRESHOLDS.finer)
    keep_mesh_error(study, plain, found)
    return found


def kept_mesh_error(study: Study, building: Building) -> MeshError | None:
    """What the study knows of the finder's mesh."""
    kept = study.find(MESH_ERROR, finder_origin(building))
    if kept is None:
        return None
    with as_written(kept):
        content = json.loads(kept.read_text(encoding="utf-8"))
        return MeshError.of(content) if "share_sd" in content else None  # of an earlier version


def keep_mesh_error(study: Study, building: Building, mesh: MeshError) -> None:
    """Write the error of the finder's mesh into a study."""
    study.folder.mkdir(parents=True, exist_ok=True)
    write_text(study.path(_FILE), json.dumps(asdict(mesh), indent=2) + "\n")
    study.record(
        MESH_ERROR, _FILE, "diagnose", finder_origin(building), {"thetas": THRESHOLDS.thetas}
    )


def _thetas(building: Building) -> Floats:
    """Stiffness factors (n, p), even in their logarithm over the inner part of the prior."""
    prior = theta_prior(building)
    low, high = (
        np.log(prior.lower.numpy() * THRESHOLDS.inner),
        np.log(prior.upper.numpy() / THRESHOLDS.inner),
    )
    unit = even_points(THRESHOLDS.thetas, len(low), 4)
    return np.asarray(np.exp(low + (high - low) * unit))
