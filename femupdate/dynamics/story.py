"""Story shear and story drift: what the structure carries and how far it gives way."""

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.dynamics.closed_form import split_sizes
from femupdate.dynamics.system import Rows, System
from femupdate.errors import ModelError


def story_rows(system: System, sizes: Tensor) -> Rows:
    """Rows (N, f + 2 s, r) of the floors, the inertia above each story, and the story drifts.

    The story carries the inertia of all that lies above it, Q_i = -(inertia_i . q'' + mass_i a_g),
    positive when the floor above is pushed back from a positive drift, so that Q / d = +k in a
    shear building. What damping carries is part of Q. The drift d is the displacement of the floor
    above less that of the floor below.

    Args:
        system: with its effects, whose masses count.
        sizes: (N, q) of the effects.
    """
    model, count = system.model, len(sizes)
    rotation, stories = model.rotation, len(model.story_mass)
    levels = np.zeros(len(model.floors)) if rotation is None else rotation.levels
    moment = np.zeros(stories) if rotation is None else rotation.story_moment
    # Sensors may be more than floors; a story's drift is that of the floors themselves.
    turned = np.diff(levels[-stories:], prepend=0.0) if stories else np.zeros(0)
    shapes = np.concatenate([model.floor_shapes, model.story_inertia, model.story_drift])
    rigid = np.concatenate(
        [
            np.column_stack([np.ones(len(levels)), levels]),
            np.column_stack([model.story_mass, moment]),
            np.column_stack([np.zeros(stories), turned]),
        ]
    )
    wide = [torch.from_numpy(part).expand(count, -1, -1).clone() for part in (shapes, rigid)]
    own = slice(len(levels), len(levels) + stories)
    for terms, values in zip(system.terms, split_sizes(system.placed, sizes), strict=True):
        if terms.mass is not None:
            weight = values[:, 0, None, None]
            wide[0][:, own] += weight * torch.as_tensor(terms.mass.above)
            wide[1][:, own] += weight * torch.as_tensor(terms.mass.above_rigid)
    return Rows(*wide)


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
        story = int(np.argwhere(np.atleast_1d(~(power > 0.0)))[0][-1]) + 1
        raise ModelError(
            f"story {story} does not drift, so shear against drift has no slope; "
            "is the base acceleration zero?"
        )
    return np.einsum("...n,...n->...", shear, centred) / power
