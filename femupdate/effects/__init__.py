"""What a model may lack: the catalogue of effects, and what each adds to a structure."""

from femupdate.lazy import lazily

_PUBLIC = {
    "building_effects": "registry",
    "CATALOGUE": "registry",
    "check_places": "registry",
    "DrawnBuilding": "drawn_building",
    "Effect": "effect",
    "effect_named": "registry",
    "Glyph": "drawn_building",
    "Placed": "effect",
    "structure_of": "structure",
    "Terms": "effect",
    "with_effect": "registry",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)
