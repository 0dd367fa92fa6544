"""Something on a floor that vibrates by itself."""

import numpy as np
from torch import Tensor

from femupdate.effects.effect import (
    DrawnBuilding,
    Effect,
    EffectParameter,
    Glyph,
    Port,
    Terms,
    as_complex,
)
from femupdate.effects.structure import Structure


class TunedAppendage(Effect):
    """A mass on a spring and a dashpot on one floor."""

    name = "tuned_appendage"
    title = "Vibrating appendage"
    sentence = (
        "Something on the floor vibrates on its own near a natural frequency of the building "
        "(a tank, a mast, a machine on springs) and splits a peak in two."
    )
    clause = "Something of {size} of the mass of {place} vibrates by itself"
    sits = "every floor"
    # Eight by OpenSees, which damps the modes with it, were off by 1.8 % rms.
    own_error = 0.02
    settled_by = "a sensor on the thing itself (tank, mast, machine)"
    parameters = (
        # What is lighter stands for a damping ratio of one mode that the model has not.
        EffectParameter(
            "size", "1", 0.02, lower=0.0, upper=0.3, least=0.01, text="share of the floor's mass"
        ),
        EffectParameter(
            "tuning",
            "1",
            1.0,
            neutral=1.0,
            lower=0.3,
            upper=8.0,
            text="frequency over the building's first at theta = 1",
            tuning=True,
        ),
        EffectParameter(
            "damping", "1", 0.02, neutral=0.02, lower=0.002, upper=0.3, text="damping ratio of it"
        ),
    )

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """A ball on a spring on the floor."""
        foot = drawn.centre(drawn.level(place))
        head = foot + np.array([0.0, 0.0, 0.16 * drawn.size])
        return Glyph.of("spring", foot, head), Glyph.of("ball", head, 0.04 * drawn.size)

    def terms(self, structure: Structure, place: str) -> Terms:
        """Where it stands, the floor's mass and the building's first frequency."""
        floor = structure.floors.index(place)
        mass = float(structure.points.mass[structure.along_floor(floor)].sum())
        port = Port(structure.floor_means[floor], np.array([1.0, structure.levels[floor]]))
        return Terms(port=port, constants=(mass, structure.fundamental[0]))

    def port_stiffness(self, omega: Tensor, sizes: Tensor, constants: tuple[float, ...]) -> Tensor:
        """-omega^2 m T, T the transmissibility of the spring and dashpot."""
        mass, first = constants
        ratio = omega / (first * sizes[:, 1:2])
        carried = as_complex(ratio.new_ones(()), 2.0 * sizes[:, 2:3] * ratio)
        transmitted = carried / (carried - ratio**2)
        return -(omega**2) * mass * sizes[:, :1] * transmitted
