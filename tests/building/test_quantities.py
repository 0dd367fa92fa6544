"""Quantities as text, and the figures of sections."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femupdate.building.entry import format_quantity
from femupdate.building.sections import rectangle_torsion_constant
from femupdate.units import parse_quantity

KINDS = ("length", "area", "inertia", "mass", "stress", "density", "stiffness", "frequency")


@given(value=st.floats(1e-12, 1e15), kind=st.sampled_from(KINDS))
def test_written_quantity_reads_back_exactly(value, kind):
    assert parse_quantity(format_quantity(value, kind), kind) == value


@pytest.mark.parametrize(
    ("value", "kind", "text"),
    [
        (0.18, "length", "0.18 m"),
        (0.045, "length", "45 mm"),
        (24.4e9, "stress", "24.4 kN/mm2"),
        (1000.0, "stiffness per mass", "1000 1/s2"),
        (3.0, "length", "3 m"),
    ],
)
def test_written_quantity_is_short(value, kind, text):
    assert format_quantity(value, kind) == text


# Timoshenko and Goodier 1951, article 94, table of k1 (sides a >= b, J = k1 a b^3): the table is
# printed with three or four digits.
@pytest.mark.parametrize(
    ("ratio", "factor", "digits"),
    [(1.0, 0.1406, 4), (1.5, 0.196, 3), (2.0, 0.229, 3), (3.0, 0.263, 3), (10.0, 0.312, 3)],
)
def test_torsion_constant_of_rectangles(ratio, factor, digits):
    constant = rectangle_torsion_constant(0.2 * ratio, 0.2)
    assert constant / (0.2 * ratio * 0.2**3) == pytest.approx(factor, abs=0.6 * 10.0**-digits)
    assert rectangle_torsion_constant(0.2, 0.2 * ratio) == pytest.approx(constant, rel=1e-14)


def test_torsion_constant_of_a_thin_strip():
    # b/a -> 0: a b^3 / 3 (1 - 0.630 b / a), the same source.
    assert rectangle_torsion_constant(1.0, 0.001) == pytest.approx(
        1e-9 / 3 * (1 - 0.6302e-3), rel=1e-6
    )
    assert np.isfinite(rectangle_torsion_constant(1e3, 1e-6))
