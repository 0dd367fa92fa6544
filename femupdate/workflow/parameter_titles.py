"""What every parameter of a posterior is of: a story, or an effect at its place."""

from collections.abc import Mapping, Sequence

from femupdate.building.parameters import factor_titles
from femupdate.building.schema import Building
from femupdate.effects.effect import Parameter, Placed
from femupdate.effects.registry import CATALOGUE


def parameter_titles(building: Building, names: Sequence[str]) -> Mapping[str, str]:
    """Titles by name, such as "story S3" or "Added mass at 3F: share of the floor's mass"."""
    known = factor_titles(building)
    return {name: known.get(name) or effect_title(name) for name in names}


def effect_parameter(name: str) -> Parameter | None:
    """The parameter of the catalogue that one such as "added_mass@3F.size" is."""
    effect_name, _, rest = name.partition("@")
    effect = CATALOGUE.get(effect_name)
    known = () if effect is None else effect.parameters
    return next((one for one in known if one.name == rest.rpartition(".")[2]), None)


def effect_title(name: str) -> str:
    """What a parameter such as "added_mass@3F.size" is of; the name itself where it is another."""
    effect_name, _, rest = name.partition("@")
    place, effect = rest.rpartition(".")[0], CATALOGUE.get(effect_name)
    if effect is None:
        return name
    own = effect_parameter(name)
    text = "" if own is None else f": {own.text or own.name}"
    unit = "" if own is None or own.unit == "1" else f" ({own.unit})"
    return f"{Placed(effect, place).in_words}{text}{unit}"
