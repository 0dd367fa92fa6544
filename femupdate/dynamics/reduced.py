"""The reduced model: the building seen through a few shapes, affine in theta."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femupdate.arrays import Floats
from femupdate.storage import check_shapes

# Arrays of a reduced model, with a letter an axis.
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


@dataclass(frozen=True, eq=False, kw_only=True)
class BaseRotation:
    """What a base that turns does to a reduced model.

    Attributes:
        force: (r,) force on each coordinate per unit angular acceleration of the base.
        mass: (2, 2) mass, first and second moment of it about the base.
        story_moment: (s,) first moment of the mass above the middle of each story.
        levels: (f,) heights above the base of what the floor rows observe, m.
    """

    force: Floats
    mass: Floats
    story_moment: Floats
    levels: Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class ReleasedBase:
    """A base that forces move.

    Attributes:
        flexibility: (2,) of springs that hardly hold it, m/N and 1/(N m); zero where it is held.
        mass: (2, 2) of what moves with it beside the building, kg.
    """

    flexibility: Floats
    mass: Floats


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """Galerkin projection of a building on a mass-orthonormal basis V (mass matrix = identity).

    With K(theta) = stiffness_constant + sum_i theta_i stiffness_terms[i], relative displacement
    u = V q, uniform base acceleration a_g in one direction with influence vector i:
        q'' + C q' + K(theta) q = -excitation a_g.

    Attributes:
        stiffness_terms: (p, r, r) one symmetric matrix a parameter, 1/s2.
        stiffness_constant: (r, r) the part that no parameter scales, 1/s2.
        excitation: (r,) V^T M i, the base motion's force on each coordinate per unit acceleration.
        floor_shapes: (f, r) displacement of each observed floor (mean over its sensor points, in
            the direction of the motion) per unit coordinate.
        floors: names of the observed floors, bottom to top ("2F" ... "RF").
        story_inertia: (s, r) force of inertia of all that lies above story i, per unit
            acceleration of each coordinate (row i = i_above^T M V), kg.
        story_mass: (s,) mass above the middle of story i in the direction of motion, kg.
        story_drift: (s, r) displacement of the floor above less that of the floor below.
        node_shapes: (N, 3, r) displacement of every node, float32, or None where not kept.
        rotation: of the base; None where the model knows of its translation alone.
        released: the base under forces; None where they do not move it.
    """

    stiffness_terms: Floats
    stiffness_constant: Floats
    excitation: Floats
    floor_shapes: Floats
    floors: tuple[str, ...]
    story_inertia: Floats
    story_mass: Floats
    story_drift: Floats
    node_shapes: NDArray[np.float32] | None = None
    rotation: BaseRotation | None = None
    released: ReleasedBase | None = None

    @property
    def size(self) -> int:
        """Number of reduced coordinates r."""
        return self.stiffness_constant.shape[0]

    @property
    def parameters(self) -> int:
        """Number of stiffness parameters p."""
        return self.stiffness_terms.shape[0]

    def stiffness(self, theta: Floats) -> Floats:
        """Reduced stiffness matrices, (..., p) -> (..., r, r), 1/s2."""
        return self.stiffness_constant + np.einsum("...p,pij->...ij", theta, self.stiffness_terms)

    def first(self, count: int) -> "ReducedModel":
        """The model on the first shapes of its basis."""
        own, rotation = slice(count), self.rotation
        return replace(
            self,
            stiffness_terms=self.stiffness_terms[:, own, own],
            stiffness_constant=self.stiffness_constant[own, own],
            excitation=self.excitation[own],
            floor_shapes=self.floor_shapes[:, own],
            story_inertia=self.story_inertia[:, own],
            story_drift=self.story_drift[:, own],
            node_shapes=None,
            rotation=None if rotation is None else replace(rotation, force=rotation.force[own]),
        )

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All of it but the names of its floors, for a file."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        if self.node_shapes is not None:
            arrays["node_shapes"] = self.node_shapes
        if self.rotation is not None:
            arrays |= {f"rotation_{name}": getattr(self.rotation, name) for name in _ROTATION}
        if self.released is not None:
            arrays |= {f"released_{name}": getattr(self.released, name) for name in _RELEASED}
        return arrays

    @classmethod
    def of_arrays(cls, data: Mapping[str, NDArray[Any]], floors: Sequence[str]) -> "ReducedModel":
        """What `arrays` gave.

        Raises:
            ArchiveError: an array is missing, or of another shape.
        """
        check_shapes(data, _ARRAYS)
        turned, released = (
            {key.removeprefix(start): data[key] for key in data if key.startswith(start)}
            for start in ("rotation_", "released_")
        )
        return cls(
            **{name: data[name] for name in _ARRAYS},
            floors=tuple(floors),
            node_shapes=data.get("node_shapes"),
            rotation=BaseRotation(**turned) if turned else None,
            released=ReleasedBase(**released) if released else None,
        )
