"""Buildings as documents, in SI units: what a test does not ask about is said here alone."""


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
