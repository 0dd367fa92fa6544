"""The error of a frame's mesh, learned once and kept in the study."""

import json
from dataclasses import asdict

import numpy as np
from scipy.stats import qmc

from femupdate.arrays import Floats
from femupdate.building.document import without_effects
from femupdate.building.frame import FrameBuilding
from femupdate.building.schema import Building
from femupdate.discrepancy.mesh_error import MeshError, learn_mesh_error
from femupdate.discrepancy.thresholds import MESH_ERROR as THRESHOLDS
from femupdate.effects.structure import Structure, structure_of
from femupdate.progress import Progress, Silent
from femupdate.study import Study, damaged, write_text
from femupdate.workflow.effects import finder_origin
from femupdate.workflow.model import theta_prior

MESH_ERROR = "mesh error"
_FILE = "mesh_error.json"


def open_mesh_error(
    study: Study, building: Building, structure: Structure, progress: Progress | None = None
) -> MeshError | None:
    """The error of the building's mesh; None for what is not meshed here.

    Without one in the study it is learned from a finer mesh, in minutes, and kept.

    Args:
        study: that keeps it.
        building: of the study.
        structure: its full model on the finder's mesh.
        progress: told about the steps.
    """
    plain = without_effects(building)
    if not isinstance(plain, FrameBuilding):
        return None
    kept = kept_mesh_error(study, plain)
    if kept is not None:
        return kept
    fine = structure_of(plain, THRESHOLDS.finer**2 * plain.mesh.size)
    grid = plain.frequency_grid.frequencies_hz()
    found = learn_mesh_error(structure, fine, _thetas(plain), grid, progress or Silent())
    keep_mesh_error(study, plain, found)
    return found


def kept_mesh_error(study: Study, building: Building) -> MeshError | None:
    """What the study knows of its building's mesh."""
    kept = study.find(MESH_ERROR, finder_origin(building))
    if kept is None:
        return None
    try:
        content = json.loads(kept.read_text(encoding="utf-8"))
        if "points" not in content:  # learned before responses were compared
            return None
        return MeshError(
            tuple(content["labels"]),
            tuple(content["mean"]),
            tuple(content["sd"]),
            *(float(content[name]) for name in ("left", "effect", "shape", "points")),
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise damaged(kept, error) from error


def keep_mesh_error(study: Study, building: Building, mesh: MeshError) -> None:
    """Write a mesh error into a study."""
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
    unit = qmc.Sobol(len(low), seed=np.random.default_rng(4)).random(THRESHOLDS.thetas)
    return np.asarray(np.exp(low + (high - low) * unit))
