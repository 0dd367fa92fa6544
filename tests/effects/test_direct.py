"""Every structural effect against a direct solution of the full equations with it."""

from dataclasses import replace

import numpy as np
import pytest

from femupdate.dynamics import RayleighDamping
from femupdate.effects import CATALOGUE
from femupdate.fe import Beams, Shells
from tests.effects.equations import lumped_masses

ZETA = 0.03
# Both sides solve the same equations; what is left is rounding, over K's condition number.
RTOL = 2e-8


def agree(ours, exact):
    np.testing.assert_allclose(ours, exact, rtol=RTOL, atol=RTOL * np.abs(exact).max(axis=1).min())


def static_roof(case):
    """Displacement of the roof per unit base acceleration at theta = 1, s2."""
    K = case.structure.stiffness(np.ones(len(case.theta))).toarray()
    return case.equations.rows[-1] @ np.linalg.solve(K, case.equations.force[:, 0])


def ground(case, sway=0.0, rocking=0.0):
    """Springs under the base that move the roof by these shares of its static displacement."""
    roof, mass = static_roof(case), case.equations.rigid_mass
    springs = {}
    if sway:
        springs[0] = mass[0, 0] / (sway * roof)
    if rocking:
        springs[1] = mass[0, 1] * case.equations.levels[-1] / (rocking * roof)
    return springs


def floor_masses(case, floor):
    """(n,) masses on the degrees of freedom of one floor, the others zero."""
    if case.mesh is None:
        return np.where(np.arange(len(case.theta)) == floor, np.diag(case.equations.M), 0.0)
    model = case.mesh.model
    level = case.mesh.floor_level[floor]
    there = np.isclose(model.nodes[:, 2], level)
    spread = np.zeros((len(model.nodes), 6))
    spread[there, :3] = lumped_masses(model)[there, None]
    return spread.ravel()[case.structure.operators.free]


def drift(case, story):
    equations = case.equations
    rows = equations.rows if equations.means is None else equations.means
    return rows[story] - (rows[story - 1] if story else 0.0)


def test_rayleigh_law_of_the_model(case):
    law = RayleighDamping(0.04, (1.0, 20.0))
    exact = case.equations.frf(
        case.frequency_hz, proportional=(law.mass_coefficient, law.stiffness_coefficient)
    )
    agree(case.frf(law=law), exact)


@pytest.mark.parametrize("size", [0.3, -0.1])
def test_added_mass(case, size):
    for floor, name in enumerate(case.structure.floors):
        changed = case.equations.with_mass(size * floor_masses(case, floor))
        agree(
            case.frf(f"added_mass@{name}", sizes=[size], zeta=ZETA),
            changed.frf(case.frequency_hz, ZETA),
        )


@pytest.mark.parametrize(("sway", "rocking"), [(0.2, 0.0), (0.0, 0.3), (0.1, 1.5)])
def test_flexible_ground(case, sway, rocking):
    sizes = [size for size in (sway, rocking) if size]
    names = [n for n, s in (("base_sway", sway), ("foundation_rocking", rocking)) if s]
    changed = case.equations.but(ground=ground(case, sway, rocking))
    agree(
        case.frf(*(f"{name}@base" for name in names), sizes=sizes, zeta=ZETA),
        changed.frf(case.frequency_hz, ZETA),
    )


@pytest.mark.parametrize("size", [0.05, -0.1])
def test_table_pitch(case, size):
    changed = case.equations.but(pitch=size)
    agree(
        case.frf("table_pitch@base", sizes=[size], zeta=ZETA), changed.frf(case.frequency_hz, ZETA)
    )


def test_story_damper(case):
    for story, name in enumerate(case.structure.floors):
        rate = CATALOGUE["story_damper"].terms(case.structure, name).constants[0]
        changed = case.equations.but(dashpots=((drift(case, story), 0.1 * rate),))
        agree(
            case.frf(f"story_damper@{name}", sizes=[0.1], zeta=ZETA),
            changed.frf(case.frequency_hz, ZETA),
        )


@pytest.mark.parametrize("tuning", [0.6, 1.0, 2.5])
def test_tuned_appendage(case, tuning):
    for floor, name in enumerate(case.structure.floors):
        effect = CATALOGUE["tuned_appendage"]
        omega = effect.terms(case.structure, name).constants[1]
        along = case.equations.rigid[:, 0] > 0.0
        mass = floor_masses(case, floor)[along].sum()
        changed = case.equations.but(appendages=((floor, 0.1 * mass, tuning * omega, 0.02),))
        agree(
            case.frf(f"tuned_appendage@{name}", sizes=[0.1, tuning, 0.02], zeta=ZETA),
            changed.frf(case.frequency_hz, ZETA),
        )


def test_appendages_and_dampers_on_a_flexible_base(case):
    """Ports act on each other, and ride on the base."""
    roof = len(case.structure.floors) - 1
    mass, omega = CATALOGUE["tuned_appendage"].terms(case.structure, "RF").constants
    rate = CATALOGUE["story_damper"].terms(case.structure, "RF").constants[0]
    changed = case.equations.but(
        ground=ground(case, 0.2, 0.4),
        pitch=0.03,
        dashpots=((drift(case, roof), 0.1 * rate),),
        appendages=((roof, 0.15 * mass, 1.2 * omega, 0.02),),
    )
    labels = (
        "story_damper@RF",
        "base_sway@base",
        "tuned_appendage@RF",
        "table_pitch@base",
        "foundation_rocking@base",
    )
    agree(
        case.frf(*labels, sizes=[0.1, 0.2, 0.15, 1.2, 0.02, 0.03, 0.4], zeta=ZETA),
        changed.frf(case.frequency_hz, ZETA),
    )


def test_damping_law_rayleigh(case):
    """The whole other law is C = a M + b K with the model's ratio at both anchors."""
    first = CATALOGUE["damping_law"].terms(case.structure, "rayleigh").constants[0]
    low, high = first, 6.0 * first
    exact = case.equations.frf(
        case.frequency_hz,
        proportional=(2 * ZETA * low * high / (low + high), 2 * ZETA / (low + high)),
    )
    # The ratio of the highest modes is cut to .9, at frequencies that the grid does not reach.
    ours = case.frf("damping_law@rayleigh", sizes=[1.0], zeta=ZETA)
    np.testing.assert_allclose(ours, exact, rtol=1e-5)


def softened(model, kind, groups, factor, bending):
    """The model with the members of a kind times a factor, in some stories."""

    def factors(part):
        return np.where((part.kind == kind) & np.isin(part.group, groups), factor, 1.0)

    shells, beams = model.elements_of(Shells), model.elements_of(Beams)
    by_shell, by_beam = factors(shells), factors(beams)
    changes = ("inertia_y", "inertia_z") if bending else ("youngs_modulus",)
    shells = replace(shells, youngs_modulus=shells.youngs_modulus * by_shell)
    beams = replace(beams, **{name: getattr(beams, name) * by_beam for name in changes})
    return replace(model, elements=(shells, beams))


@pytest.mark.parametrize(
    ("effect", "kind", "size", "bending"),
    [
        ("wall_stiffness", "wall", -0.4, False),
        ("wall_stiffness", "wall", 1.5, False),
        ("slab_participation", "slab", -0.5, False),
        ("cracked_beams", "beam", -0.6, True),
        ("cracked_columns", "column", -0.6, True),
    ],
)
@pytest.mark.parametrize("place", ["all", "low", "high"])
def test_stiffness_of_members(frame, effect, kind, size, bending, place):
    groups = {"all": [0, 1], "low": [0], "high": [1]}[place]
    model = softened(frame.mesh.model, kind, groups, 1.0 + size, bending)
    # Cracks take stiffness away, no rotary inertia.
    changed = frame.equations.but(K=frame.equations_of(model).K)
    exact = changed.frf(frame.frequency_hz, ZETA)
    agree(frame.frf(f"{effect}@{place}", sizes=[size], zeta=ZETA), exact)


def eccentric(case, size):
    """(n,) masses that move the centre of each floor's mass across the motion, by hand."""
    model = case.mesh.model
    own, across = lumped_masses(model), model.nodes[:, 1 - case.mesh.direction]
    more = np.zeros((len(model.nodes), 6))
    for level in case.mesh.floor_level:
        here = np.isclose(model.nodes[:, 2], level)
        arm = across[here] - np.average(across[here], weights=own[here])
        shift = size * np.ptp(across[here]) * own[here].sum()
        more[here, :3] = (own[here] * arm * shift / (own[here] * arm**2).sum())[:, None]
    return more.ravel()[case.structure.operators.free]


def test_eccentricity(frame):
    changed = frame.equations.with_mass(eccentric(frame, 0.08))
    agree(
        frame.frf("eccentricity@all", sizes=[0.08], zeta=ZETA),
        changed.frf(frame.frequency_hz, ZETA),
    )
