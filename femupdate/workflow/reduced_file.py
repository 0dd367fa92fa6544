"""Reduced models as a study keeps them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.array_archive import check_shapes, read_arrays, write_arrays
from femupdate.dynamics.reduced import BaseRotation, ReducedModel, ReleasedBase
from femupdate.study import StudyPart

_ARRAYS = {
    "stiffness_terms": "prr",
    "stiffness_constant": "rr",
    "excitation": "r",
    "floor_shapes": "fr",
    "story_inertia": "sr",
    "story_mass": "s",
    "story_drift": "sr",
}
_ROTATION = ("force", "mass", "story_moment", "levels")
_RELEASED = ("flexibility", "mass")


@dataclass(frozen=True, eq=False)
class CertifiedModel:
    """A reduced model and how far it was found to be from the full one.

    Attributes:
        model: without effects.
        rms_error: of ln|H|; 0 for lumped buildings.
        certified: further figures of its error, for the study's record.
    """

    model: ReducedModel
    rms_error: float
    certified: Mapping[str, float] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write it as npz, atomically."""
        header = json.dumps({"floors": self.model.floors, "rms_error": self.rms_error})
        write_arrays(path, header=np.array(header), **reduced_arrays(self.model))

    @classmethod
    def read(cls, path: Path) -> "CertifiedModel":
        """Read what `write` has written, but for what only the study's record has."""
        data = read_arrays(path)
        header = json.loads(str(data["header"]))
        return cls(reduced_from(data, header["floors"]), float(header["rms_error"]))

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


def reduced_arrays(model: ReducedModel) -> dict[str, NDArray[Any]]:
    """All of a reduced model but the names of its floors."""
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    if model.node_shapes is not None:
        arrays["node_shapes"] = model.node_shapes
    if model.rotation is not None:
        arrays |= {f"rotation_{name}": getattr(model.rotation, name) for name in _ROTATION}
    if model.released is not None:
        arrays |= {f"released_{name}": getattr(model.released, name) for name in _RELEASED}
    return arrays


def reduced_from(data: Mapping[str, NDArray[Any]], floors: Sequence[str]) -> ReducedModel:
    """What `reduced_arrays` gave.

    Raises:
        ArchiveError: an array is missing, or of another shape.
    """
    check_shapes(data, _ARRAYS)
    turned, released = (
        {key.removeprefix(start): data[key] for key in data if key.startswith(start)}
        for start in ("rotation_", "released_")
    )
    return ReducedModel(
        **{name: data[name] for name in _ARRAYS},
        floors=tuple(floors),
        node_shapes=data.get("node_shapes"),
        rotation=BaseRotation(**turned) if turned else None,
        released=ReleasedBase(**released) if released else None,
    )
