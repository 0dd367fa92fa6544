"""What a model may lack: the catalogue of effects, and what each adds to a structure."""

from femupdate.effects.catalogue import CATALOGUE, effect_named
from femupdate.effects.effect import Effect, Parameter, Placed, Port, Terms
from femupdate.effects.structure import Structure, structure_of

__all__ = [
    "CATALOGUE",
    "Effect",
    "Parameter",
    "Placed",
    "Port",
    "Structure",
    "Terms",
    "effect_named",
    "structure_of",
]
