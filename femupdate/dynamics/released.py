"""A base that nothing holds, such as a specimen on rails, or one hung up for a hammer test.

Motion of the base is measured on what moves: under it a building responds as on a fixed base.
Forces move the base too. It stands on springs so soft that they do not show: the motion of the
whole has a frequency of a thousandth of the first one, and responses err by the square of that
frequency over their own.
"""

import numpy as np

from femupdate.dynamics.reduced import ReleasedBase
from femupdate.effects.structure import ROTATION, TRANSLATION, Structure

_SOFT = 1e-3  # frequency on the springs over the building's first one


def released_base(structure: Structure) -> ReleasedBase | None:
    """How forces move the base of a structure; None where its building says that it is held."""
    supports = structure.building.supports
    if supports is None or not structure.building.moving_base:
        return None
    own = np.zeros((2, 2))
    own[TRANSLATION, TRANSLATION] = supports.mass or 0.0
    inertia = (structure.rigid_mass + own).diagonal()
    flexibility = 1.0 / (inertia * (_SOFT * structure.fundamental[0]) ** 2)
    if supports.base == "slides":
        flexibility[ROTATION] = 0.0
    return ReleasedBase(flexibility=flexibility, mass=own)
