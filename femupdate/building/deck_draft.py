"""A building file for a deck: its units and floors, and what a deck lacks, with comments."""

import json
import os
from pathlib import Path

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.deck import Deck, read_deck
from femupdate.building.deck_model import DeckModel, deck_model
from femupdate.building.quantities import ALL
from femupdate.building.shipped import building_text, is_deck
from femupdate.errors import BuildingError, UnitError
from femupdate.storage import atomic_path
from femupdate.units import factor

_SYSTEMS = tuple(
    f"{force},{length}"
    for force in ("N", "kN", "MN", "kgf", "tf", "lbf", "kip")
    for length in ("m", "cm", "mm", "in", "ft")
)
# Young's modulus (GPa) and density (kg/m3) of concrete, steel, aluminium, timber and masonry.
_MATERIALS = np.array(
    [
        [[15, 50], [1500, 2700]],
        [[180, 220], [7400, 8200]],
        [[65, 75], [2600, 2900]],
        [[5, 18], [350, 900]],
        [[1, 15], [1400, 2300]],
    ]
)
_GREAT = 0.2  # of the largest floor's area (or length of beams) is a floor of its own
_CLOSE = 0.4  # of the usual height: nearer levels are one floor
_GRIDS = ((10.0, 0.02), (25.0, 0.05), (50.0, 0.1))  # Hz: highest frequency, step


def deck_units(deck: Deck, units: str | None) -> tuple[str, str, str]:
    """Units of force and length of a deck, and how they are known.

    Args:
        units: as the user says them, such as "kN,m".
    """
    if units:
        force, _, length = (part.strip() for part in units.partition(","))
        try:
            factor(force, "force"), factor(length, "length")
        except UnitError as error:
            raise BuildingError(f"--units {units}: {error}; write force and length: N,mm") from None
        return force, length, "as you said"
    materials = [(c.real(1, 0.0), c.real(4, 0.0)) for c in deck.of("MAT1")]
    known = np.array([pair for pair in materials if min(pair) > 0.0]).reshape(-1, 2)
    fitting = []
    for system in _SYSTEMS:
        newton, metre = (
            factor(u, k) for u, k in zip(system.split(","), ("force", "length"), strict=True)
        )
        scale = np.array([newton / metre**2 * 1e-9, newton / metre**4 * deck.mass_factor])
        figures = (known * scale)[:, None, :]
        inside = (figures >= _MATERIALS[..., 0]) & (figures <= _MATERIALS[..., 1])
        if len(known) and inside.all(axis=2).any(axis=1).all():
            fitting.append((system, figures[0, 0]))
    if len(fitting) == 1:
        (system, (young, density)) = fitting[0]
        force, length = system.split(",")
        why = f"the only ones with a usual material ({young:.4g} GPa, {density:.4g} kg/m3)"
        return force, length, why
    could = f"could be {' or '.join(name for name, _ in fitting)}" if fitting else "tell none"
    raise BuildingError(
        f"{deck.file.name}: bulk data has no units, and its materials {could}; say force and "
        "length by --units, such as --units N,mm"
    )


def floor_levels(read: DeckModel) -> tuple[Floats, list[str]]:
    """Levels (stories,) of the floors above the base, m, and what is not one of them.

    A floor is where slabs lie; without slabs where beams do, else where columns end.

    Raises:
        BuildingError: nothing of this lies above the base.
    """
    model, base = read.model, float(read.model.nodes[read.held, 2].min())
    z, weight = np.zeros(0), np.zeros(0)
    for kind in ("slab", "beam", "column"):  # which ends at a floor
        blocks = [block.taken(np.flatnonzero(block.kind == kind)) for block in model.elements]
        if not len(z) and any(map(len, blocks)):
            z = np.concatenate([model.nodes[b.nodes][:, :, 2].max(axis=1) for b in blocks])
            weight = np.concatenate([block.measure(model.nodes) for block in blocks])
            z, weight = z[z > base + _LOW], weight[z > base + _LOW]
    if not len(z):
        raise BuildingError(
            "no slab, beam or column lies above the nodes that are held; check SPC and CORD2R"
        )
    heights, which = np.unique(z.round(3), return_inverse=True)
    area = np.bincount(which.ravel(), weights=weight)
    levels, area = heights[area >= _GREAT * area.max()], area[area >= _GREAT * area.max()]
    while len(levels) > 1:
        gaps = np.diff([base, *levels])
        close = int(gaps.argmin())
        if gaps[close] >= _CLOSE * np.median(gaps):
            break
        drop = close if close == 0 or area[close] < area[close - 1] else close - 1
        levels, area = np.delete(levels, drop), np.delete(area, drop)
    other = [f"{height - base:.4g}" for height in heights[~np.isin(heights, levels)][:8]]
    return levels - base, other


_LOW = 0.02  # m above the base: the lowest story of a model on a bench


def draft_text(file: Path, units: str | None, beside: Path) -> str:
    """The building file of a deck.

    Args:
        units: force and length, where the deck's materials do not tell them.
        beside: folder in which the text is to lie.
    """
    deck = read_deck(file)
    force, length, why = deck_units(deck, units)
    read = deck_model(deck, factor(length, "length"), factor(force, "force"), ignored=ALL)
    base = float(read.model.nodes[read.held, 2].min())
    levels, other = floor_levels(read)
    top, step = next((g for g in _GRIDS if g[0] >= 8 * 46.0 / levels[-1]), _GRIDS[-1])
    middle = 0.5 * (read.model.nodes[:, :2].min(axis=0) + read.model.nodes[:, :2].max(axis=0))
    stories = "\n".join(
        f'[[stories]]\nname = "S{k}"\nheight = "{height:.9g} m"\n'
        for k, height in enumerate(np.diff([0.0, *levels]), 1)
    )
    more = f"# Levels that are no floor of their own: {', '.join(other)} m.\n" if other else ""
    return _DRAFT.format(
        name=file.stem,
        unknown=json.dumps(deck.unknown or ["RBE3"]),
        file=os.path.relpath(file, beside).replace(os.sep, "/"),
        force=force,
        length=length,
        why=why,
        base=f"{base:.9g}",
        stories=stories,
        more=more,
        x=f"{middle[0]:.6g}",
        y=f"{middle[1]:.6g}",
        step=step,
        count=round(top / step),
    )


_DRAFT = """\
# Written by femupdate for a deck of Nastran, which has members, masses and supports.
# What a deck lacks is below: correct it, and say where sensors are.
name = "{name}"
kind = "mesh"

[mesh]
file = "{file}"
unit = "{length}"      # of length in the deck, {why}
force = "{force}"
base = "{base} m"      # level of the lowest node that is held
# ignore = {unknown}  # cards to be left out, which are named and counted

# Floors lie at the sums of these heights above the base.
# Members belong to the story between whose floors they are.
{more}{stories}
[sensors]
direction = "x"        # of the measured motion, x or y
points = [["{x} m", "{y} m"]]   # in plan; the nearest node on the level of every floor
# [sensors.floors]
# RF = [["0 m", "0 m"], ["10 m", "5 m"]]

[frequency_grid]       # frequencies at which responses are compared
start = "{step} Hz"
step = "{step} Hz"
count = {count}

[prior.theta]          # stiffness of every story over that of the deck
lower = "1/3"
upper = 3

[prior.zeta]           # the damping ratio that is sought
lower = 0.005
upper = 0.1

[damping]              # for predictions where nothing was measured
law = "constant"
ratio = 0.02
"""


def load_text(path: Path | str, units: str | None) -> tuple[str, str] | None:
    """What to call a deck, and its draft as a building file; None of another file."""
    if not is_deck(path):
        return None
    building_text(path)  # which says what is no file
    file = Path(path).expanduser()
    return str(path), draft_text(file, units, file.parent)


def write_draft(deck: Path | str, units: str | None, path: Path) -> Path:
    """Write the building file of a deck, and return its path."""
    if not is_deck(deck):
        raise BuildingError(f"{deck}: a draft is made of a deck of Nastran (.bdf, .nas); name one")
    building_text(deck)
    text = draft_text(Path(deck).expanduser(), units, path.expanduser().parent)
    with atomic_path(path.expanduser(), BuildingError) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return path


def deck_words(path: Path, units: str | None) -> tuple[str, ...]:
    """What is in a deck, a sentence each."""
    deck = read_deck(path)
    try:
        force, length, why = deck_units(deck, units)
    except BuildingError as error:
        listed = ", ".join(f"{len(cards)} {name}" for name, cards in deck.cards.items())
        return f"Cards: {listed}.", f"Units: {error}."
    read = deck_model(deck, factor(length, "length"), factor(force, "force"), ignored=ALL)
    levels, other = floor_levels(read)
    size = np.ptp(read.model.nodes, axis=0)
    refused = [f"Refused unless ignored: {', '.join(deck.unknown)}."] if deck.unknown else []
    no_floor = f" No floor of their own: {', '.join(other)} m." if other else ""
    return (
        f"Units {force} and {length}: {why}.",
        f"{size[0]:.4g} m by {size[1]:.4g} m in plan, {size[2]:.4g} m high.",
        f"Floors at {', '.join(f'{z:.4g}' for z in levels)} m above the base.{no_floor}",
        *read.notes,
        *refused,
    )
