"""What a model may lack: the catalogue of effects, and what each adds to a structure."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "effect": "DrawnBuilding Effect Glyph Placed Terms",
        "registry": "building_effects CATALOGUE check_places effect_named with_effect",
        "structure": "structure_of",
    },
)
