"""build-model --export: the study's building for another program."""

from pathlib import Path

import numpy as np

from femupdate.building.mesh import mesh_building
from femupdate.building.schema import Building
from femupdate.errors import StudyError
from femupdate.fe.export_opensees import opensees_script
from femupdate.study import Study, write_text

FILE = "opensees_model.py"


def export_opensees(
    study: Study, building: Building, modes: int = 12, shell: str = "ASDShellQ4"
) -> Path:
    """Write a Python script that rebuilds the building in OpenSeesPy, all stiffness factors 1.

    Raises:
        StudyError: the building is lumped, or the study cannot be written.
        BuildingError, ModelError: the building has no mesh, or holds what OpenSees has not.
    """
    if building.kind == "shear":
        raise StudyError(
            f"{building.name} is a shear building of lumped masses, which has no mesh to export; "
            "choose a frame building"
        )
    model = mesh_building(building).model
    name = building.title or building.name
    script = opensees_script(
        model, np.ones(model.groups), name=name, modes=modes, types={"shell": shell}
    )
    path = study.path(FILE)
    write_text(path, script)
    return path
