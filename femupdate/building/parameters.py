"""Stiffness factors: one a story, of Young's modulus of all that the story owns."""

from femupdate.building.document import Building


def factor_titles(building: Building) -> dict[str, str]:
    """Return what every stiffness factor is of, bottom to top: {"theta_1": "story S1", ...}."""
    return {f"theta_{k}": f"story {name}" for k, name in enumerate(building.story_names, 1)}


def factor_ranges(building: Building) -> dict[str, tuple[float, float]]:
    """Return lowest and highest value of every stiffness factor, by its name."""
    ranges = [building.prior.theta_of(story) for story in building.story_names]
    names = factor_titles(building)
    return {name: (kept.lower, kept.upper) for name, kept in zip(names, ranges, strict=True)}
