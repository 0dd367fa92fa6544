"""Units against the definitions of the SI and of the yard and pound agreement, and the errors."""

import inspect
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femupdate import errors
from femupdate.errors import FemupdateError, UnitError
from femupdate.units import UNITS, factor, parse_quantity


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("180 mm", "length", 0.18),
        ("5 ft", "length", 1.524),  # the foot is 0.3048 m
        ("36 in", "length", 0.9144),
        ("0.5 km", "length", 500.0),
        ("12 cm2", "area", 12e-4),
        ("250 mm^4", "inertia", 250e-12),
        ("3 t", "mass", 3000.0),
        ("3 g", "mass", 0.003),
        ("2 lb", "mass", 0.90718474),  # the pound is 0.45359237 kg
        ("24.4 kN/mm2", "stress", 24.4e9),
        ("30 MPa", "stress", 30e6),
        ("1 psi", "stress", 0.45359237 * 9.80665 / 0.0254**2),
        ("1 ksi", "stress", 1000 * 0.45359237 * 9.80665 / 0.0254**2),
        ("2.4 t/m3", "density", 2400.0),
        ("2 kN/mm", "stiffness", 2e6),
        ("7 MN/m", "stiffness", 7e6),
        ("1000 N/m/kg", "stiffness per mass", 1000.0),
        ("5 ms", "time", 0.005),
        ("250 gal", "acceleration", 2.5),
        ("0.3 g", "acceleration", 0.3 * 9.80665),
        ("20 mg", "acceleration", 0.02 * 9.80665),
        ("2 ft/s2", "acceleration", 0.6096),
        ("12 in/s2", "acceleration", 0.3048),
        ("20 Hz", "frequency", 20.0),
    ],
)
def test_quantities_in_si(text, kind, value):
    assert parse_quantity(text, kind) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("name", ["m/s2", "m/s^2", "m/s**2", "m/s/s", "m/s²", " m/s2 ", "M/S2"])
def test_spellings_of_one_unit(name):
    assert factor(name, "acceleration") == 1.0


def test_case_carries_meaning_but_for_accelerations():
    for name in ("mPa", "mpa", "KN/m", "CM", "hz"):
        for kind in ("stress", "stiffness", "length", "frequency"):
            with pytest.raises(UnitError, match="unknown unit"):
                factor(name, kind)


@settings(deadline=None)
@given(
    value=st.floats(-1e12, 1e12),
    kind=st.sampled_from(sorted(UNITS)),
    data=st.data(),
    spaces=st.sampled_from(["", " ", "  ", "\t"]),
)
def test_every_number_with_every_unit(value, kind, data, spaces):
    name = data.draw(st.sampled_from(sorted(UNITS[kind])))
    text = f"{spaces}{value!r}{spaces or ' '}{name}{spaces}"
    assert parse_quantity(text, kind) == value * UNITS[kind][name]


@pytest.mark.parametrize("text", ["3 furlong", "3 kg", "1,5 m", "2.8e m", "3 m m", "3 m/s2"])
def test_units_of_another_kind(text):
    with pytest.raises(UnitError, match=r"unknown unit .* for length; use one of m, cm, mm"):
        parse_quantity(text, "length")


def test_a_long_row_of_blanks_takes_no_time():
    started = time.process_time()
    assert parse_quantity(f" 3 {' ' * 20_000} m ", "length") == 3.0
    with pytest.raises(UnitError, match="unknown unit"):
        parse_quantity(f"3 k{' ' * 20_000}m", "length")
    assert time.process_time() - started < 0.5


def test_every_error_can_be_caught_as_one():
    raised = [
        value
        for _, value in inspect.getmembers(errors, inspect.isclass)
        if value.__module__ == errors.__name__
    ]
    assert len(raised) > 5
    for error in raised:
        assert issubclass(error, FemupdateError)
        assert error.__doc__
        assert str(error("what is wrong")) == "what is wrong"
    assert not issubclass(FemupdateError, ValueError | OSError)
