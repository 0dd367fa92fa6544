"""A frame's reduced model on a mesh twice as fine, as a study keeps it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from femupdate.building.document import Building, mechanics_hash, without_effects
from femupdate.building.frame import FrameBuilding
from femupdate.discrepancy.mesh_error import MeshError, corrected_model
from femupdate.discrepancy.mesh_scatter import OpenMesh
from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.effect import Stiffness, Terms
from femupdate.storage import check_shapes, read_arrays, write_arrays
from femupdate.study import Study, StudyPart

FINER = "finer mesh"
_TERMS = {"term_owner": "t", "term_story": "t", "term_series": "t", "term_matrix": "trr"}


@dataclass(frozen=True, eq=False)
class FinerMesh:
    """A building on a mesh of half the size of its own.

    Attributes:
        model: its reduced model; node shapes are at the nodes of the building's own mesh.
        error: of the building's own mesh, as this one shows it; None where stiffness factors
            belong to kinds of members, which can make up for it themselves.
        terms: what the effects that stand for the error add to the model.
    """

    model: ReducedModel
    error: MeshError | None = None
    terms: tuple[Terms, ...] = ()

    @cached_property
    def corrected(self) -> ReducedModel:
        """The model, brought nearer to an infinitely fine mesh."""
        if self.error is None:
            return self.model
        return corrected_model(self.model, self.error.of_half(), self.terms)

    @property
    def left_open(self) -> OpenMesh | None:
        """What that leaves open of the corrected model."""
        return None if self.error is None else OpenMesh(self.error.of_half(), self.terms)

    def write(self, path: Path) -> None:
        """Write it as npz, atomically."""
        error = None if self.error is None else asdict(self.error)
        header = json.dumps({"floors": self.model.floors, "error": error})
        arrays = {**self.model.arrays(), **self._term_arrays()}
        write_arrays(path, header=np.array(header), **arrays)

    @classmethod
    def read(cls, path: Path) -> "FinerMesh":
        """Read what `write` has written."""
        data = read_arrays(path)
        header = json.loads(str(data["header"]))
        model = ReducedModel.of_arrays(data, header["floors"])
        if header["error"] is None:
            return cls(model)
        error = MeshError.of(header["error"])
        return cls(model, error, _terms(data, len(error.labels)))

    def _term_arrays(self) -> dict[str, NDArray[Any]]:
        """Stiffness of the terms, one after the other, with the number of the effect of each."""
        parts = [(k, one) for k, terms in enumerate(self.terms) for one in terms.stiffness]
        size = self.model.size
        matrices = [one.matrix.numpy().astype(np.float32) for _, one in parts]
        return {
            "term_owner": np.array([k for k, _ in parts], dtype=np.int64),
            "term_story": np.array([one.story for _, one in parts], dtype=np.int64),
            "term_series": np.array([one.series for _, one in parts], dtype=np.float64),
            "term_matrix": np.array(matrices, dtype=np.float32).reshape(-1, size, size),
        }


def half_mesh_size(building: FrameBuilding) -> float:
    """Of the finer mesh, m."""
    return MESH_ERROR.half * building.mesh.size


def finer_part(building: FrameBuilding) -> StudyPart[FinerMesh]:
    """The finer mesh of a building, as a study keeps it."""
    size = half_mesh_size(building)
    return StudyPart(
        FINER,
        "finer_mesh.npz",
        "calibrate",
        FinerMesh.write,
        FinerMesh.read,
        lambda _: {"mesh_m": size},
    )


def kept_finer(study: Study, building: Building) -> FinerMesh | None:
    """That of a study, or None where it has none.

    Raises:
        StudyError: its file holds something else.
    """
    if not isinstance(building, FrameBuilding):
        return None
    return study.kept(finer_part(building), finer_origin(building))


def finer_origin(building: FrameBuilding) -> dict[str, str]:
    """What it is made from, for the study's record."""
    return {
        "building": mechanics_hash(without_effects(building)),
        "mesh_m": f"{half_mesh_size(building):.4g}",
    }


def _terms(data: Mapping[str, NDArray[Any]], count: int) -> tuple[Terms, ...]:
    check_shapes(data, {**_TERMS, "stiffness_constant": "rr"})
    parts: list[list[Stiffness]] = [[] for _ in range(count)]
    columns: Sequence[NDArray[Any]] = [data[name] for name in _TERMS]
    for owner, story, series, matrix in zip(*columns, strict=True):
        whole = torch.from_numpy(matrix.astype(np.float64))
        parts[owner].append(Stiffness(int(story), whole, float(series)))
    return tuple(Terms(stiffness=tuple(one)) for one in parts)
