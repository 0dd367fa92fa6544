"""Story shear and story drift: what the structure carries and how far it gives way."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.dynamics.reduced import ReducedModel
from femupdate.errors import ModelError


@dataclass(frozen=True)
class Outputs:
    """Quantities that are linear in the response: displacement q + acceleration q'' + base a_g.

    Attributes:
        displacement: (o, r) share of the reduced displacements q.
        acceleration: (o, r) share of the reduced relative accelerations q''.
        base: (o,) share of the base acceleration.
    """

    displacement: Floats
    acceleration: Floats
    base: Floats

    def __add__(self, other: "Outputs") -> "Outputs":
        return Outputs(
            np.concatenate([self.displacement, other.displacement]),
            np.concatenate([self.acceleration, other.acceleration]),
            np.concatenate([self.base, other.base]),
        )


def floor_acceleration_outputs(model: ReducedModel) -> Outputs:
    """Absolute acceleration of the f observed floors, m/s2: relative plus base."""
    shapes = model.floor_shapes
    return Outputs(np.zeros_like(shapes), shapes, np.ones(len(shapes)))


def story_shear_outputs(model: ReducedModel) -> Outputs:
    """Shear Q of the s stories, N.

    The story carries the inertia of all that lies above it,
        Q_i = -(story_inertia_i . q'' + story_mass_i a_g),
    positive when the floor above is pushed back from a positive drift, so that Q / d = +k in a
    shear building. What damping carries is part of Q.
    """
    inertia = model.story_inertia
    return Outputs(np.zeros_like(inertia), -inertia, -np.asarray(model.story_mass, dtype=float))


def story_drift_outputs(model: ReducedModel) -> Outputs:
    """Drift d of the s stories, m: displacement of the floor above less that of the floor below."""
    drift = model.story_drift
    return Outputs(drift, np.zeros_like(drift), np.zeros(len(drift)))


def story_stiffness(shear: Floats, drift: Floats) -> Floats:
    """Return the stiffness of every story: the least-squares slope of shear against drift.

    Both are taken about their mean, so that an offset of a measured drift does no harm.

    Args:
        shear: (..., n) N.
        drift: (..., n) m.

    Returns:
        (...) N/m.

    Raises:
        ModelError: the shapes differ, or a story does not move.
    """
    shear, drift = np.asarray(shear, dtype=float), np.asarray(drift, dtype=float)
    if shear.shape != drift.shape:
        raise ModelError(
            f"shear {shear.shape} and drift {drift.shape} differ in shape; give one drift a shear"
        )
    centred = drift - drift.mean(axis=-1, keepdims=True)
    power = np.einsum("...n,...n->...", centred, centred)
    if not np.all(power > 0.0):
        story = int(np.argwhere(np.atleast_1d(power <= 0.0))[0][-1]) + 1
        raise ModelError(
            f"story {story} does not drift, so shear against drift has no slope; "
            "is the base acceleration zero?"
        )
    return np.einsum("...n,...n->...", shear, centred) / power
