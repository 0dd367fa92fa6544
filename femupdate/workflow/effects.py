"""Bases on which effects act, and the error of a mesh, as a study keeps them."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.building_mesh import BuildingMesh
from femupdate.building.document import Building, mechanics_hash, without_effects
from femupdate.building.kinds import FrameBuilding, MeshBuilding, ShearBuilding
from femupdate.building.mesh import mesh_building
from femupdate.building.split_mesh import LARGE, is_large
from femupdate.discrepancy.mesh_error import MeshError, corrected, learn_mesh_error
from femupdate.discrepancy.search import check_sizes, finder_mesh_size, finder_structure
from femupdate.discrepancy.thresholds import MESH_ERROR as THRESHOLDS
from femupdate.dynamics.finer_mesh import on_finer_mesh, on_nodes_of
from femupdate.dynamics.reduced import ReducedStructure, lumped, reduced_on
from femupdate.dynamics.reduction import reduce_structure
from femupdate.dynamics.snapshots import log_even_samples
from femupdate.dynamics.system import System, parameters_of
from femupdate.effects.registry import building_effects, check_places
from femupdate.effects.structure import Structure, structure_of
from femupdate.inference.parameters import reduction_target, theta_prior
from femupdate.progress import SILENT, Progress
from femupdate.seeds import even_points
from femupdate.storage import check_shapes, read_arrays, write_arrays
from femupdate.study import Study, StudyPart, write_text
from femupdate.workers import return_memory
from femupdate.workflow.model import FINER_PART, FinerMesh, StudyModel, finer_origin, on_kept_finer

BASIS, NEAR_BASIS = "effect basis", "finder's basis"


def open_structure(study: Study, building: Building) -> ReducedStructure:
    """The reduced structure of a study's building, on the basis that the study keeps.

    Without one a basis for the building's effects over the whole prior is made (of a frame, in
    minutes), and kept.
    """
    structure = finder_structure(building)
    if structure.is_stick:
        return lumped(structure)

    def make() -> Floats:
        placed, target = building_effects(building).placed, reduction_target(building)
        # Its box holds what is likely of the sizes of effects besides.
        likely = np.array([parameter.likely for parameter in parameters_of(placed)]).reshape(-1, 2)
        lower, upper = np.append(target.lower, likely[:, 0]), np.append(target.upper, likely[:, 1])
        target = replace(target, lower=lower, upper=upper)
        return reduce_structure(structure, target, placed).reduced.basis

    basis = study.cached(basis_part(BASIS, structure), finder_origin(building), make)
    return reduced_on(structure, basis)


def finder_origin(building: Building) -> dict[str, str]:
    """What everything about the finder's mesh is made from, for the study's record."""
    origin = {"building": mechanics_hash(without_effects(building))}
    size = finder_mesh_size(building)
    return origin if size is None else {**origin, "mesh_m": f"{size:.4g}"}


def keep_basis(study: Study, reduced: ReducedStructure, building: Building) -> None:
    """Write the basis of a building into a study."""
    study.keep(basis_part(BASIS, reduced.structure), finder_origin(building), reduced.basis)


def basis_part(name: str, structure: Structure) -> StudyPart[Floats]:
    """A basis (n, r) for a structure of n degrees of freedom, as a study keeps it."""

    def write(basis: Floats, path: Path) -> None:
        write_arrays(path, basis=basis)

    def read(path: Path) -> Floats:
        data = read_arrays(path)
        check_shapes(data, {"basis": "nr"})
        if len(data["basis"]) != len(structure.axis):
            raise ValueError(f"basis of {len(data['basis'])} degrees of freedom")
        return data["basis"]

    file = {BASIS: "effect_basis.npz", NEAR_BASIS: "finder_basis.npz"}[name]
    return StudyPart(name, file, "diagnose", write, read, lambda basis: {"size": basis.shape[1]})


def finder_basis(
    study: Study,
    building: Building,
    structure: Structure,
    theta: Floats,
    zeta: float,
    make: Callable[[], Floats],
) -> Floats:
    """The last basis (n, r) about theta (p,) in which every effect of a building may act."""
    origin = {
        **finder_origin(building),
        "theta": " ".join(f"{factor:.4g}" for factor in theta),
        "zeta": f"{zeta:.4g}",
    }
    return study.cached(basis_part(NEAR_BASIS, structure), origin, make)


MESH_ERROR = "mesh error"
_THETAS = 8  # sets of factors at which meshes are compared


def with_finer_mesh(study: Study, model: StudyModel, progress: Progress = SILENT) -> StudyModel:
    """The model of a frame on a mesh twice as fine, which is made once and kept.

    A stick comes back as it is, as does a mesh that was read and is large.
    """
    plain, model = without_effects(model.building), on_kept_finer(study, model)
    if isinstance(plain, ShearBuilding) or model.finer is not None:
        return model
    coarse = mesh_building(plain)
    if _stays(plain, coarse):
        progress.say(
            f"The mesh of {plain.name} has more than {LARGE:,} nodes and is taken as fine enough: "
            "its error is in no interval"
        )
        return model
    target = reduction_target(plain)
    # Where meshes are compared, nothing but the mesh may differ.
    everywhere = log_even_samples(replace(target, samples=THRESHOLDS.carried))
    thetas = np.vstack([everywhere, _thetas(plain)])
    fine = structure_of(plain, halved=True)
    found = on_finer_mesh(coarse, model.reduced, fine, target, thetas, progress)
    # A new structure holds no rows of all its stories, which take a fourth of the memory.
    found = replace(found, structure=replace(fine), model=on_nodes_of(coarse, found))
    del fine
    top_hz = float(plain.frequency_grid.frequencies_hz()[-1])
    error = learn_mesh_error(model.reduced, found, _thetas(plain), top_hz)
    finer = FinerMesh(found.model, error, tuple(found.terms(e) for e in error.placed))
    study.keep(FINER_PART, finer_origin(plain), finer)
    del found, finer
    return_memory()
    return on_kept_finer(study, model)


def _stays(building: Building, mesh: BuildingMesh) -> bool:
    """Whether a mesh was read and is too large to be split, so that its error is not learned."""
    return isinstance(building, MeshBuilding) and is_large(mesh)


def open_mesh_error(
    study: Study, model: StudyModel, structure: Structure, progress: Progress = SILENT
) -> MeshError | None:
    """The error of the finder's mesh; None for what is not meshed here.

    Without one in the study it is learned from the finer mesh that calibrations use, and kept.

    Args:
        structure: the full model on the finder's mesh.
    """
    plain = without_effects(model.building)
    if structure.mesh is None or isinstance(plain, ShearBuilding) or _stays(plain, structure.mesh):
        return None

    def learn() -> MeshError:
        finer = with_finer_mesh(study, model, progress).finer
        assert finer is not None
        if structure.mesh is not None and structure.mesh.of_coarser is not None:
            return finer.error.of_half()  # the finder's mesh is the finer one
        known = dict(zip(finer.error.labels, finer.terms, strict=True))
        fine = ReducedStructure(structure, finer.model, np.zeros((len(structure.axis), 0)), known)
        coarse, target, thetas = mesh_building(plain), reduction_target(plain), _thetas(plain)
        found = on_finer_mesh(coarse, model.reduced, structure, target, thetas, progress)
        top_hz = float(plain.frequency_grid.frequencies_hz()[-1])
        ratio = THRESHOLDS.finer if isinstance(plain, FrameBuilding) else 1.0
        learned = learn_mesh_error(found.model, fine, thetas, top_hz).of_mesh(ratio)
        return replace(learned, moved=finer.error.moved)

    return study.cached(MESH_ERROR_PART, finder_origin(plain), learn)


def kept_mesh_error(study: Study, building: Building) -> MeshError | None:
    """What the study knows of the finder's mesh."""
    return study.kept(MESH_ERROR_PART, finder_origin(building))


MESH_ERROR_PART = StudyPart(
    MESH_ERROR,
    "mesh_error.json",
    "diagnose",
    lambda mesh, path: write_text(path, json.dumps(asdict(mesh), indent=2) + "\n"),
    lambda path: MeshError.of(json.loads(path.read_text(encoding="utf-8"))),
    lambda _: {"thetas": _THETAS},
)


def _thetas(building: Building) -> Floats:
    """Stiffness factors (n, p), even in their logarithm over the inner part of the prior."""
    prior = theta_prior(building)
    # Its ends are left out, by a factor of 1.5.
    low, high = np.log(prior.lower.numpy() * 1.5), np.log(prior.upper.numpy() / 1.5)
    unit = even_points(_THETAS, len(low), 4)
    return np.asarray(np.exp(low + (high - low) * unit))


def open_system(study: Study, model: StudyModel) -> System:
    """The study's reduced model with the effects that its building lists, if any."""
    effects = building_effects(model.building)
    if len(effects.placed) == len(model.system.placed):
        return model.system
    reduced = open_structure(study, model.building)
    mesh = kept_mesh_error(study, model.building)
    if mesh is not None:
        reduced = corrected(reduced, mesh)
    check_places(reduced.structure, effects)
    terms = tuple(reduced.terms(effect) for effect in effects.placed)
    system = System(reduced.model, model.law, effects.placed, terms)
    check_sizes(model.building, system, effects.values)
    return system
