"""Published static shell tests, each as a function that returns value / target."""

import numpy as np

PARALLEL, TRAPEZOID, RECTANGLE = "para", "trap", "rect"
IN_PLANE = (2, 3, 4)


def cook(meshes, count):
    """Cook's membrane (48, 44, 16): tip displacement over 23.96."""
    s, t, quads = meshes.grid(count, count)
    points = np.stack([48 * s, 44 * s + t * (44 - 28 * s), 0 * s], axis=1)
    fixed = meshes.hold(len(s), (s == 0, range(6)), (s >= 0, IN_PLANE))
    load = np.zeros((len(s), 6))
    load[:, 1] = meshes.line_weights(s == 1, t)
    shells = meshes.shells(quads, 1.0, 1.0, 1 / 3)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    return u[(s == 1) & (t == 0.5), 1].item() / 23.96


def straight_cantilever(meshes, shape, case):
    """MacNeal and Harder (1985): 6 x 0.2 x 0.1 in six elements."""
    s, t, quads = meshes.grid(6, 1)
    inner = (s > 0) & (s < 1)
    sway = {RECTANGLE: 0.0 * s, PARALLEL: 1.0 + 0.0 * s, TRAPEZOID: (-1.0) ** np.round(6 * s)}[
        shape
    ]
    points = np.stack([6 * s + inner * sway * (0.2 * t - 0.1), 0.2 * t, 0 * s], axis=1)
    tip = s == 1
    load = np.zeros((len(s), 6))
    direction, target = {
        "extension": (0, 3e-5),
        "in-plane": (1, 0.1081),
        "out-of-plane": (2, 0.4321),
        "twist": (2, 0.03208),
    }[case]
    load[tip, direction] = (10 * t[tip] - 5) if case == "twist" else 0.5
    fixed = meshes.hold(len(s), (s == 0, range(6)))
    shells = meshes.shells(quads, 0.1, 1e7, 0.3)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    value = np.ptp(u[tip, 2]) / 0.2 if case == "twist" else u[tip, direction].mean()
    return value / target


def curved_cantilever(meshes, direction):
    """MacNeal and Harder (1985): radii 4.12 and 4.32, 90 degrees in six elements."""
    s, t, quads = meshes.grid(6, 1)
    radius, angle = 4.12 + 0.2 * t, 0.5 * np.pi * (1 - s)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * s], axis=1)
    load = np.zeros((len(s), 6))
    load[s == 1, direction] = 0.5
    fixed = meshes.hold(len(s), (s == 0, range(6)))
    shells = meshes.shells(quads, 0.1, 1e7, 0.25)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    return u[s == 1, direction].mean() / {1: 0.08734, 2: 0.5022}[direction]


def twisted_beam(meshes, thickness, along):
    """MacNeal and Harder (1985): 12 x 1.1, turned by 90 degrees, 12 x 2 warped elements."""
    s, t, quads = meshes.grid(12, 2)
    angle, width = 0.5 * np.pi * s, 1.1 * (t - 0.5)
    points = np.stack([12 * s, width * np.cos(angle), width * np.sin(angle)], axis=1)
    direction = {"width": 2, "thickness": 1}[along]
    load = np.zeros((len(s), 6))
    load[:, direction] = meshes.line_weights(s == 1, t) * (1.0 if thickness > 0.1 else 1e-6)
    target = {
        (0.32, "width"): 5.424e-3,
        (0.32, "thickness"): 1.754e-3,
        (0.0032, "width"): 5.256e-3,
        (0.0032, "thickness"): 1.294e-3,
    }[thickness, along]
    fixed = meshes.hold(len(s), (s == 0, range(6)))
    shells = meshes.shells(quads, thickness, 29e6, 0.22)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    return u[(s == 1) & (t == 0.5), direction].item() / target


def rectangular_plate(meshes, length, edges, loading, count):
    """MacNeal and Harder (1985): 2 x `length`, a quarter of it; `edges` "ss" or "cl"."""
    s, t, quads = meshes.grid(count, count)
    points = np.stack([s, 0.5 * length * t, 0 * s], axis=1)
    along_y, along_x = s == 1, t == 1  # the supported edges
    held = {"ss": ((2, 3), (2, 4)), "cl": (range(6), range(6))}[edges]
    fixed = meshes.hold(
        len(s),
        (s >= 0, (0, 1, 5)),
        (s == 0, (4,)),
        (t == 0, (3,)),
        (along_y, held[0]),
        (along_x, held[1]),
    )
    load = np.zeros((len(s), 6))
    if loading == "q":
        load[:, 2] = 1e-4 * meshes.area_shares(points, quads)
    else:
        load[(s == 0) & (t == 0), 2] = 1e-4
    shells = meshes.shells(quads, 1e-4, 1.7472e7, 0.3)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    target = {
        (2, "ss", "q"): 4.062,
        (10, "ss", "q"): 12.97,
        (2, "ss", "p"): 11.60,
        (10, "ss", "p"): 16.96,
        (2, "cl", "q"): 1.26,
        (10, "cl", "q"): 2.56,
        (2, "cl", "p"): 5.60,
        (10, "cl", "p"): 7.23,
    }[length, edges, loading]
    return u[(s == 0) & (t == 0), 2].item() / target


def scordelis_lo(meshes, count):
    """Roof R = 25, L = 50 under its weight, a quarter of it: middle of the free edge, 0.3024."""
    s, t, quads = meshes.grid(count, count)
    angle = np.radians(40) * t
    points = np.stack([25 * s, 25 * np.sin(angle), 25 * np.cos(angle)], axis=1)
    fixed = meshes.hold(
        len(s),
        (s == 0, (0, 4, 5)),  # middle of the length
        (t == 0, (1, 3, 5)),  # crown
        (s == 1, (1, 2)),  # end diaphragm
    )
    load = np.zeros((len(s), 6))
    load[:, 2] = -90 * meshes.area_shares(points, quads)
    shells = meshes.shells(quads, 0.25, 4.32e8, 0.0)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    return -u[(s == 0) & (t == 1), 2].item() / 0.3024


def hemisphere(meshes, count, target=0.0940):
    """Hemisphere R = 10 with an 18 degree hole, pulled and pushed at its foot."""
    s, t, quads = meshes.grid(count, count)
    azimuth, elevation = 0.5 * np.pi * s, np.radians(72) * t
    points = 10 * np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=1,
    )
    first, second = (s == 0) & (t == 0), (s == 1) & (t == 0)
    fixed = meshes.hold(len(s), (s == 0, (1, 3, 5)), (s == 1, (0, 4, 5)), (first, (2,)))
    load = np.zeros((len(s), 6))
    load[first, 0], load[second, 1] = 1.0, -1.0
    shells = meshes.shells(quads, 0.04, 6.825e7, 0.3)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    return u[first, 0].item() / target


def pinched_cylinder(meshes, count):
    """Cylinder R = 300, L = 600 between diaphragms, an octant of it: under the load, 1.8248e-5."""
    s, t, quads = meshes.grid(count, count)
    angle = 0.5 * np.pi * t
    points = np.stack([300 * s, 300 * np.sin(angle), 300 * np.cos(angle)], axis=1)
    fixed = meshes.hold(
        len(s),
        (s == 0, (0, 4, 5)),
        (t == 0, (1, 3, 5)),
        (t == 1, (2, 3, 4)),
        (s == 1, (1, 2)),
    )
    loaded = (s == 0) & (t == 0)
    load = np.zeros((len(s), 6))
    load[loaded, 2] = -0.25
    shells = meshes.shells(quads, 3.0, 3e6, 0.3)
    u = meshes.displacement(meshes.model(points, fixed, shells=shells), load)
    return -u[loaded, 2].item() / 1.8248e-5
