"""build-model: mesh, checks, modes and the reduced model of a building."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import Building, mechanics_hash
from femupdate.building.files import load_building
from femupdate.building.mesh import BuildingMesh, mesh_building
from femupdate.building.model_files import asks, write_draft
from femupdate.dynamics.reduction import CONFIDENCE
from femupdate.dynamics.tracking import FullModes, mesh_modes
from femupdate.effects.structure import structure_of
from femupdate.errors import BuildingError, FemupdateError, StructureError, StudyError
from femupdate.fe.export import bulk_data, opensees_script
from femupdate.progress import SILENT, Progress
from femupdate.result import Item, Note, Notes, Picture, Result, first_lines
from femupdate.storage import atomic_path
from femupdate.study import BUILDING_FILE, Study, study_of, typed, write_text
from femupdate.tables import Column, Table
from femupdate.units import percent
from femupdate.workflow.model import (
    StudyModel,
    choose_building,
    keep_reduction,
    reduce_building,
    say_building,
)
from femupdate.workflow.modes import full_modes, keep_modes, modes_of_model
from femupdate.workflow.observed import direction_of

DEFAULT_BUILDING = "six_story_wall_frame"  # of a new study, for `build-model` alone
_SHOWN = 12  # lowest modes that are told; above them those that move a share of the mass


@dataclass(frozen=True, kw_only=True)
class BuildReport(Result):
    """What was built.

    Attributes:
        modes: lowest of the full model at theta = 1.
        dof: degrees of freedom of the full model after supports.
        mass_kg: of the model, its supports included.
    """

    folder: Path
    model: StudyModel
    modes: FullModes
    dof: int
    elements: int
    mass_kg: float
    checks: tuple[str, ...]

    @property
    def frequencies_hz(self) -> Floats:
        """Lowest natural frequencies at theta = 1."""
        return self.modes.frequency_hz[:_SHOWN]

    @property
    def effective_mass(self) -> Floats:
        """Share of the mass that each of them moves in the direction of the base motion."""
        return self.modes.effective_mass[:_SHOWN, "xy".index(direction_of(self.model.building))]

    def items(self) -> Iterator[Item]:
        """Sizes, modes and checks."""
        building, modes = self.model.building, self.modes
        # The lowest modes, and those above them that move much.
        mass = modes.effective_mass.max(axis=1)
        told = [k for k in range(len(mass)) if k < _SHOWN or mass[k] >= 0.01]
        content = {
            "building": building.name,
            "frequencies_hz": self.frequencies_hz,
            "effective_mass": self.effective_mass,
            "mass_kg": self.mass_kg,
            "reduced_size": self.model.reduced.size,
            "reduction_error": self.model.reduction_error,
        }
        sizes = f"{self.dof} degrees of freedom, {self.elements} elements"
        frequency = modes.frequency_hz[told]
        heavy = [k for k in told if modes.effective_mass[k].max() >= 0.1] or told
        yield from first_lines(
            f"Verdict: {building.title or building.name} stands ({sizes}, "
            f"{self.mass_kg / 1e3:.4g} t).",
            "Heaviest modes: "
            + ", ".join(f"{modes.frequency_hz[k]:.3f} Hz ({modes.direction[k]})" for k in heavy[:8])
            + ".",
            f"look at the pictures, then `{typed('calibrate FILE', self.folder / BUILDING_FILE)}`",
        )
        yield Note(content=content)
        yield Note(f"  {sizes}", {"dof": self.dof, "elements": self.elements}, detail=True)
        columns = (
            Column([k + 1 for k in told], "mode", key="mode"),
            Column(frequency, "Hz", [f"{value:.3f}" for value in frequency], key="frequency_hz"),
            Column([modes.direction[k] for k in told], "direction", key="direction"),
            *(
                Column(
                    shares,
                    f"effective mass {axis.upper()}",
                    [percent(share, 1) for share in shares],
                    key=f"effective_mass_{axis}",
                )
                for axis, shares in zip("xy", modes.effective_mass[told].T, strict=True)
            ),
        )
        yield Table(name="modes", key="modes", columns=columns, detail=True)
        for axis, shares in zip("XY", np.cumsum(modes.effective_mass, axis=0).T, strict=True):
            if shares[-1] > 0.0:
                enough = int(np.searchsorted(shares, 0.9)) + 1
                first = f"; 90 % are reached with mode {enough}" if enough <= len(shares) else ""
                total = percent(shares[-1], 1)
                yield Note(
                    f"  All {len(shares)} modes move {total} of the mass along {axis}{first}.",
                    detail=True,
                )
        yield Notes(self.checks, key="checks", detail=True)

    def figures(self) -> Iterator[Picture]:
        """The modes that move most of the mass, at theta = 1."""
        from femupdate.workflow.render import mode_pictures

        yield from mode_pictures(
            self.model, modes_of_model(self.model, self.modes, 3), "model_mode"
        )


def build_model(
    study: Study | Path | str,
    building: Path | str | None = None,
    *,
    units: str | None = None,
    draft: Path | str | None = None,
    export: str | None = None,
    progress: Progress = SILENT,
) -> BuildReport:
    """Build, check and reduce the model of a building; its modes and what was checked.

    Args:
        building: its file, another program's model or a shipped name; default: of the study, or
            the six-story one in a new study.
        units: force and length of another program's model, such as "N,mm".
        draft: building file to write for such a model, and to build.
        export: "opensees" or "nastran": write the model for it, into the study.

    Raises:
        BuildingError, StructureError: the building cannot be read or cannot stand.
        StudyError: the study holds a posterior of another building, or cannot be written.
    """
    study, name = study_of(study), building
    if draft is not None:
        if name is None:
            raise BuildingError("a draft needs another program's model; name its file")
        building, units = write_draft(str(name), units, Path(draft)), None
    try:
        report = _build(study, building, units, progress)
    except FemupdateError as failure:
        if draft is not None and not asks(str(name), failure):
            Path(draft).expanduser().unlink(missing_ok=True)
        raise
    if export is not None:
        _export(study, report.model.building, export)
    return report


def _build(
    study: Study, building: Path | str | None, units: str | None, progress: Progress
) -> BuildReport:
    if building is None and not study.path(BUILDING_FILE).exists():
        building = DEFAULT_BUILDING
        progress.say("No building is named: the default is taken, not yours")
    chosen = load_building(building, units) if building else choose_building(study, None)
    say_building(chosen, progress)
    kept = study.path(BUILDING_FILE)
    if kept.exists() and study.posteriors():  # whose building stays
        held = load_building(kept)
        if mechanics_hash(held) != mechanics_hash(chosen):
            which = "another version of " if held.name == chosen.name else "the building "
            raise StudyError(
                f"the study {study.folder} already holds a posterior of {which}{held.name}; choose "
                f"another folder for {chosen.name} with --study, or delete this one"
            )
    structure = structure_of(chosen)
    mesh, operators = structure.mesh, structure.operators
    if mesh is None or operators is None:
        model = keep_reduction(study, chosen, reduce_building(chosen, structure))
        return BuildReport(
            folder=study.folder,
            model=model,
            modes=full_modes(model),
            dof=model.reduced.size,
            elements=model.reduced.parameters,
            mass_kg=float(model.reduced.story_mass[0]),
            checks=("Lumped masses: the reduced model is the model itself.",),
        )
    modes = mesh_modes(structure)
    try:
        reduction = reduce_building(chosen, structure, progress)
    except StructureError as error:
        below = modes.frequency_hz[modes.frequency_hz < chosen.frequency_grid.stop]
        first = ", ".join(f"{hz:.3g}" for hz in below[:3])
        raise StructureError(
            f"{error}, below which are {len(below)} modes ({first} Hz, ...)"
        ) from None
    model = keep_reduction(study, chosen, reduction)
    keep_modes(study, model, modes)
    write_mesh(mesh, study.path("mesh.vtu"), modes)
    everything = operators.rigid_translation(mesh.direction)
    mass = float(everything @ (operators.mass_full @ everything))
    size = len(operators.free)
    checks = (
        f"The structure stands: lowest frequency {modes.frequency_hz[0]:.3f} Hz.",
        f"Mass of the model {mass / 1e3:.1f} t.",
        f"Reduced model: {reduction.reduced.model.size} shapes follow {size} degrees of freedom "
        f"within {reduction.rms_error:.2g} rms in ln|H| at {reduction.checks} unseen sets of "
        "stiffness factors.",
        f"Reduced model: {reduction.worst_error:.2g} rms at the worst of them, so no more than "
        f"that in at least {percent(reduction.share)} of the prior "
        f"(confidence {percent(CONFIDENCE)}).",
        *mesh.notes,
    )
    return BuildReport(
        folder=study.folder,
        model=model,
        modes=modes,
        dof=size,
        elements=mesh.model.element_count,
        mass_kg=mass,
        checks=checks,
    )


def write_mesh(mesh: BuildingMesh, path: Path, modes: FullModes) -> None:
    """Write the mesh as VTU, with story and thickness of the cells and some mode shapes."""
    import meshio

    blocks = mesh.model.elements
    # Elements that no factor scales are of the story 0.
    data: dict[str, list[np.ndarray]] = {"story": [block.group + 1 for block in blocks]}
    for dimension, name in ((2, "thickness_m"), (1, "section_area_m2")):
        data[name] = [block.section * (block.dimension() == dimension) for block in blocks]
    cells = [(block.cell_type, block.nodes) for block in blocks]
    points = {
        f"mode_{k + 1}_{frequency:.3f}_Hz": modes.shapes[k].reshape(-1, 3)
        for k, frequency in enumerate(modes.frequency_hz[:_SHOWN])
    }
    found = meshio.Mesh(mesh.model.nodes, cells, point_data=points, cell_data=data)
    with atomic_path(path) as temporary:
        found.write(temporary, file_format="vtu")


EXPORTS = {"nastran": "model.bdf", "opensees": "opensees_model.py"}
"""Files of a study that other programs read, by the program."""


def _export(study: Study, building: Building, program: str) -> None:
    """Write bulk data in N and m, or a Python script for OpenSeesPy, all stiffness factors 1.

    Raises:
        StudyError: the building has no mesh, or there is no such program.
    """
    if building.kind == "shear":
        raise StudyError(
            f"{building.name} is a shear building of lumped masses, which has no mesh to export; "
            "choose a frame building"
        )
    if program not in EXPORTS:
        raise StudyError(f"{program!r} is no program to export to; choose nastran or opensees")
    model, name = mesh_building(building).model, building.title or building.name
    if program == "nastran":
        text = bulk_data(model)
    else:
        text = opensees_script(model, np.ones(model.groups), name=name, modes=12)
    write_text(study.path(EXPORTS[program]), text)
