"""Buildings as documents, in SI units: what a test does not ask about is said here alone."""

from femupdate.building import from_document
from femupdate.dynamics import lumped
from femupdate.effects import structure_of


def concrete(modulus=25e9, density=2400.0):
    return {"concrete": {"youngs_modulus": modulus, "poisson_ratio": 0.2, "density": density}}


def rectangle(width, depth):
    return {"shape": "rectangle", "width": width, "depth": depth}


def around(kind, step, count, ratio, lower, upper):
    """Every building's kind, grid of frequencies, prior of the factors, and damping ratio."""
    return {
        "name": "made",
        "kind": kind,
        "frequency_grid": {"start": step, "step": step, "count": count},
        "prior": {"theta": {"lower": lower, "upper": upper}},
        "damping": {"law": "constant", "ratio": ratio},
    }


def stick(masses, springs, heights=None, *, grid=(0.2, 45), ratio=0.02, **changes):
    """Masses (f,) on springs (f,) from the ground up, kg and N/m; a height that is None is left."""
    heights = [None] * len(masses) if heights is None else heights
    stories = [
        {"name": f"S{n}", "mass": float(m), "stiffness": float(k)} | ({"height": h} if h else {})
        for n, (m, k, h) in enumerate(zip(masses, springs, heights, strict=True), 1)
    ]
    return around("shear", *grid, ratio, 0.5, 2.0) | {"stories": stories} | changes


def reduced_stick(masses, springs):
    """The same as its own reduced model."""
    return lumped(structure_of(from_document(stick(masses, springs)))).model


def frame(x, y, heights, *, size, direction="x", grid=(0.2, 150), ratio=0.02, **changes):
    """Grid lines by name, heights by story, m, columns at all corners and beams between them."""
    corner = f"{next(iter(x))}-{next(iter(y))}"
    made = around("frame", *grid, ratio, 1 / 3, 3.0) | {
        "grid": {"x": x, "y": y},
        "stories": [{"name": name, "height": height} for name, height in heights.items()],
        "materials": concrete(),
        "sections": {"column": rectangle(0.4, 0.6), "beam": rectangle(0.3, 0.5)},
        "columns": [{"section": "column"}],
        "beams": [{"section": "beam"}],
        "mesh": {"size": size},
        "sensors": {"direction": direction, "points": [corner]},
    }
    return made | changes


def towers(*, slabs=False, top=3.5):
    """A podium 18 m long under two towers 6 m long, of beams that carry the mass."""
    heights = {"P1": 4.5, "P2": 4.0, "A1": 3.2, "A2": 3.2, "B1": 3.2, "B2": top}
    made = frame(
        {"A": 0.0, "B": 6.0, "C": 12.0, "D": 18.0},
        {"1": 0.0, "2": 5.0},
        heights,
        size=3.0,
        grid=(0.1, 100),
        materials=concrete(28e9),
        sections={"column": rectangle(0.5, 0.5), "beam": rectangle(0.3, 0.6)},
        columns=[{"section": "column", "stories": ["P1", "P2"]}],
        beams=[{"section": "beam", "floors": ["2F", "3F"]}],
        slabs=[],
        sensors={
            "direction": "x",
            "points": ["A-1", "B-2"],
            "floors": {"6F": ["C-1", "D-2"], "RF": ["C-1", "D-2"]},
        },
        prior={"theta": {"lower": 0.5, "upper": 2.0}},
    )
    made["stories"][4]["on"] = "P2"
    stand = {"A1 A2": ("A", "B", ["4F", "5F"]), "B1 B2": ("C", "D", ["6F", "RF"])}
    plate = {"y": ["1", "2"], "thickness": 0.2, "diaphragm": "rigid"}
    rows = [plate | {"x": ["A", "D"], "floors": ["2F", "3F"]}]
    for stories, (start, end, floors) in stand.items():
        at = [f"{x}-{y}" for x in (start, end) for y in "12"]
        along = {"section": "beam", "along": ["1", "2"], "from": start, "to": end}
        made["columns"].append({"section": "column", "at": at, "stories": stories.split()})
        made["beams"] += [along | {"floors": floors}]
        made["beams"] += [{"section": "beam", "along": [start, end], "floors": floors}]
        rows.append(plate | {"x": [start, end], "floors": floors})
    return made | ({"slabs": rows} if slabs else {})
