"""Sections by shape against published tables and closed forms."""

import numpy as np
import pytest
from pydantic import TypeAdapter

from femupdate.building import Section

SECTION = TypeAdapter(Section)


def figures(**document):
    return SECTION.validate_python(document).figures()


# Rolled sections of EN 10365 / ArcelorMittal's sales programme: h, b, tw, tf, r in mm; A in cm2,
# Iy (strong), Iz (weak) and It in cm4, as printed (three or four digits).
ROLLED = [
    ("IPE 300", 300, 150, 7.1, 10.7, 15, 53.81, 8356, 603.8, 20.12),
    ("HEA 200", 190, 200, 6.5, 10, 18, 53.83, 3692, 1336, 20.98),
    ("HEB 300", 300, 300, 11, 19, 27, 149.1, 25170, 8563, 185.0),
    ("HEM 400", 432, 307, 21, 40, 27, 325.8, 104100, 19340, 1515),
]


@pytest.mark.parametrize("row", ROLLED, ids=[row[0] for row in ROLLED])
def test_rolled_sections_against_the_table(row):
    _, h, b, w, f, r, area, strong, weak, torsion = row
    found = figures(
        shape="I",
        depth=h / 1e3,
        width=b / 1e3,
        web_thickness=w / 1e3,
        flange_thickness=f / 1e3,
        root_radius=r / 1e3,
    )
    assert found.area * 1e4 == pytest.approx(area, rel=1e-3)
    assert found.inertia_y * 1e8 == pytest.approx(strong, rel=1e-3)
    assert found.inertia_z * 1e8 == pytest.approx(weak, rel=1e-3)
    # The tables were computed with an older formula for the fillets; they differ by up to 2.3 %.
    assert found.torsion_constant * 1e8 == pytest.approx(torsion, rel=0.025)


# CHS 219.1 x 8 (EN 10210-2): A 53.06 cm2, I 2960 cm4, It 5919 cm4.
def test_pipe_against_the_table():
    found = figures(shape="pipe", diameter=0.2191, thickness=0.008)
    assert found.area * 1e4 == pytest.approx(53.06, rel=5e-4)
    assert found.inertia_y * 1e8 == pytest.approx(2960, rel=5e-4)
    assert found.torsion_constant * 1e8 == pytest.approx(5919, rel=5e-4)
    assert found.shear_area_z / found.area == pytest.approx(0.5, rel=0.01)  # thin: one half


def test_circle():
    found = figures(shape="circle", diameter=0.5)
    assert found.area == pytest.approx(np.pi / 16, rel=1e-12)
    assert found.inertia_y == found.inertia_z == pytest.approx(np.pi * 0.5**4 / 64, rel=1e-12)
    assert found.torsion_constant == pytest.approx(np.pi * 0.5**4 / 32, rel=1e-12)
    assert found.shear_area_y / found.area == pytest.approx(6 / 7, rel=1e-12)


def test_t_section_worked_by_hand():
    """Web 300 x 450 under a flange 1500 x 150 (mm).

    A = 360e3; centroid 193.125 mm below the top: (225e3 x 75 + 135e3 x 375) / 360e3 = 187.5 mm;
    I = 1500 150^3/12 + 225e3 112.5^2 + 300 450^3/12 + 135e3 187.5^2 = 1.02937e10 mm4.
    """
    found = figures(shape="T", width=0.3, depth=0.6, flange_width=1.5, flange_thickness=0.15)
    assert found.area == pytest.approx(0.36, rel=1e-12)
    by_hand = 1500 * 150**3 / 12 + 225e3 * 112.5**2 + 300 * 450**3 / 12 + 135e3 * 187.5**2
    assert found.inertia_y == pytest.approx(by_hand * 1e-12, rel=1e-9)
    assert found.inertia_z == pytest.approx((150 * 1500**3 + 450 * 300**3) / 12 * 1e-12, rel=1e-9)


def test_size_of_a_section_given_by_figures_is_that_of_its_rectangle():
    found = figures(
        shape="figures",
        area=0.18,
        shear_area_y=0.15,
        shear_area_z=0.15,
        inertia_y=0.3 * 0.6**3 / 12,
        inertia_z=0.6 * 0.3**3 / 12,
        torsion_constant=3.7e-3,
    )
    np.testing.assert_allclose(found.size, (0.3, 0.6), rtol=1e-12)
