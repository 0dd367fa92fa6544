"""build-model: mesh, checks, modes, pictures and the reduced model of a building."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.files import load_building
from femupdate.building.schema import Building
from femupdate.dynamics.reduction import CONFIDENCE, Reduction
from femupdate.errors import StudyError
from femupdate.fe.solve import Modes, lowest_modes
from femupdate.progress import Progress, Silent
from femupdate.study import Study, atomic_path
from femupdate.workflow.model import (
    FrameParts,
    StudyModel,
    choose_building,
    frame_parts,
    keep_model,
    reduce_building,
)
from femupdate.workflow.modes import levels_with_base, reduced_modes, with_base

_MODES = 12
_PICTURES = 3


@dataclass(frozen=True)
class BuildReport:
    """What was built.

    Attributes:
        model: the study's model.
        frequencies_hz: lowest natural frequencies at theta = 1.
        effective_mass: share of the mass that each moves in the direction of the base motion.
        dof: degrees of freedom of the full model after supports.
        elements: shells and beams.
        mass_kg: of the model, its supports included.
        checks: what was checked, a sentence each.
        pictures: files drawn.
    """

    model: StudyModel
    frequencies_hz: Floats
    effective_mass: Floats
    dof: int
    elements: int
    mass_kg: float
    checks: tuple[str, ...]
    pictures: tuple[Path, ...]


def build_study(
    study: Study, building: str | None = None, progress: Progress | None = None
) -> BuildReport:
    """Build the model of a building into a study.

    Raises:
        BuildingError, ModelError: the building cannot be read or cannot stand.
        StudyError: the study holds a posterior of another building, or cannot be written.
    """
    show = progress or Silent()
    # Without a name a study keeps its own building: the default never replaces it.
    chosen = load_building(building) if building else choose_building(study, None)
    _refuse_other(study, chosen)
    if chosen.kind == "shear":
        return _build_lumped(study, chosen)
    parts = frame_parts(chosen)
    modes = lowest_modes(parts.operators, np.ones(parts.operators.parameters), _MODES)
    reduction = reduce_building(chosen, parts, show)
    model = keep_model(study, chosen, reduction)
    write_mesh(parts, study.path("mesh.vtu"), modes)
    pictures = _draw_modes(study, parts, model, show)
    direction = parts.mesh.direction
    excitation = parts.operators.inertia(direction)
    mass = _total_mass(parts)
    effective = (modes.shapes.T @ excitation) ** 2 / mass
    return BuildReport(
        model,
        modes.frequency_hz,
        effective,
        len(parts.operators.free),
        parts.mesh.model.element_count,
        mass,
        _checks(parts, reduction, modes),
        pictures,
    )


def write_mesh(parts: FrameParts, path: Path, modes: Modes | None = None) -> None:
    """Write the mesh as VTU, with story and thickness of the cells and some mode shapes."""
    import meshio

    model = parts.mesh.model
    # The last entry is for elements that no factor scales.
    story = np.array([*(one.story + 1 for one in parts.mesh.factors), 0])
    blocks = model.elements
    data: dict[str, list[np.ndarray]] = {"story": [story[block.group] for block in blocks]}
    for dimension, name in ((2, "thickness_m"), (1, "section_area_m2")):
        data[name] = [block.section * (block.dimension() == dimension) for block in blocks]
    cells = [(block.cell_type, block.nodes) for block in blocks]
    points = {}
    if modes is not None:
        full = parts.operators.expand(modes.shapes).reshape(len(model.nodes), 6, -1)
        points = {
            f"mode_{k + 1}_{f:.3f}_Hz": full[:, :3, k] for k, f in enumerate(modes.frequency_hz)
        }
    mesh = meshio.Mesh(model.nodes, cells, point_data=points, cell_data=data)
    with atomic_path(path) as temporary:
        mesh.write(temporary, file_format="vtu")


def _refuse_other(study: Study, building: Building) -> None:
    """A study with a posterior keeps its building."""
    from femupdate.building.files import mechanics_hash

    kept = study.path("building.toml")
    if not kept.exists() or "posterior" not in study.artefacts():
        return
    own = load_building(kept)
    if mechanics_hash(own) != mechanics_hash(building):
        raise StudyError(
            f"the study {study.folder} holds a posterior of the building {own.name}, which "
            f"{building.name} would overwrite; choose another folder with --study"
        )


def _build_lumped(study: Study, building: Building) -> BuildReport:
    model = keep_model(study, building, reduce_building(building))
    modes = reduced_modes(model.reduced, np.ones((1, model.reduced.parameters)))
    excitation = np.einsum("rj,r->j", modes.vectors[0], model.reduced.excitation)
    mass = float(model.reduced.story_mass[0])
    picture = _draw_sticks(study, model)
    return BuildReport(
        model,
        modes.frequency_hz[0],
        excitation**2 / mass,
        model.reduced.size,
        model.reduced.parameters,
        mass,
        ("Lumped masses: the reduced model is the model itself.",),
        (picture,),
    )


def _total_mass(parts: FrameParts) -> float:
    everything = parts.operators.rigid_translation(parts.mesh.direction)
    return float(everything @ (parts.operators.mass_full @ everything))


def _checks(parts: FrameParts, reduction: Reduction, modes: Modes) -> tuple[str, ...]:
    mass = _total_mass(parts)
    stand = f"The structure stands: lowest frequency {modes.frequency_hz[0]:.3f} Hz."
    weighs = f"Mass of the model {mass / 1e3:.1f} t."
    follows = (
        f"Reduced model: {reduction.model.size} shapes follow {len(parts.operators.free)} degrees "
        f"of freedom within {reduction.rms_error:.2g} rms in ln|H| at {reduction.checks} unseen "
        "sets of stiffness factors."
    )
    certain = (
        f"Reduced model: {reduction.worst_error:.2g} rms at the worst of them, so no more than "
        f"that in at least {reduction.share:.0%} of the prior (confidence {CONFIDENCE:.0%})."
    )
    return stand, weighs, follows, certain


def _draw_modes(
    study: Study, parts: FrameParts, model: StudyModel, show: Progress
) -> tuple[Path, ...]:
    """The first modes that the base motion drives, at theta = 1."""
    from femupdate.report.geometry import Geometry
    from femupdate.report.scenes import mode_shape_scene
    from femupdate.workflow.modes import driven_modes, node_displacements

    geometry = Geometry.of_model(parts.mesh.model)
    modes = reduced_modes(model.reduced, np.ones((1, model.reduced.parameters)))
    chosen = driven_modes(model.reduced, modes, _PICTURES)
    show.start("Drawing mode shapes", len(chosen))
    paths = []
    for number, mode in enumerate(chosen, start=1):
        path = study.path("pictures", f"model_mode_{number}.png")
        shape = node_displacements(model.reduced, modes.vectors[0, :, mode])
        frequency = modes.frequency_hz[0, mode]
        mode_shape_scene(
            geometry, shape, path, title=f"Mode {number}, {frequency:.2f} Hz, all factors 1"
        )
        paths.append(path)
        show.advance()
    return tuple(paths)


def _draw_sticks(study: Study, model: StudyModel) -> Path:
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_sticks import stick_mode_shapes

    modes = reduced_modes(model.reduced, np.ones((1, model.reduced.parameters)))
    count = min(model.reduced.size, _PICTURES)
    shapes = with_base(model.reduced.floor_shapes @ modes.vectors[0][:, :count])
    figure = stick_mode_shapes(
        levels_with_base(model.building),
        shapes.T,
        modes.frequency_hz[0, :count],
        floors=("base", *model.reduced.floors),
        title="Mode shapes, all factors 1",
    )
    return save_figure(figure, study.path("pictures", "model_modes.png"))
