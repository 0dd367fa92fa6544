"""Responses to a force: units, columns, universal files, and what is refused."""

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.measurement import force_unit, in_band, inspect_file, kind_in, read_measured

G = 9.80665


def read(path, **how):
    return kind_in(read_measured(path), **how)


@pytest.mark.parametrize(
    ("text", "power", "factor"),
    [
        ("m/s2/N", 2, 1.0),
        ("(m/s^2)/N", 2, 1.0),
        ("m/s²/kN", 2, 1e-3),
        ("(1/N)*(m/s²)", 2, 1.0),
        ("g/N", 2, G),
        ("mg / lbf", 2, 1e-3 * G / 4.4482216152605),
        ("1/kg", 2, 1.0),
        ("1/t", 2, 1e-3),
        ("m/s/N", 1, 1.0),
        ("mm/s/kN", 1, 1e-6),
        ("m/N", 0, 1.0),
        ("mm/kN", 0, 1e-6),
        ("in/kip", 0, 0.0254 / 4448.2216152605),
    ],
)
def test_units(text, power, factor):
    assert force_unit(text) == (power, pytest.approx(factor, rel=1e-12))


@pytest.mark.parametrize("text", ["m/s2", "N", "-", "", "g", "N/m", "m/s2/s", "kg", "furlong/N"])
def test_other_units(text):
    assert force_unit(text) is None


def test_every_quantity_is_one_accelerance(write):
    """|A| = omega |V| = omega^2 |X|, in columns with units, with an option, complex as text."""
    frequency = np.array([0.0, 1.0, 2.0, 4.0])
    omega = 2 * np.pi * frequency
    receptance = np.array([3.0, 1.0 - 2.0j, 0.5j, -0.1])
    mobility, accelerance = 1j * omega * receptance, -(omega**2) * receptance

    cases = [
        ("RF/2F (mm/N)", 1e3 * receptance, {}, "receptance"),
        ("RF (m/s/N)", mobility, {"force": "2F"}, "mobility"),
        ("RF", accelerance / G, {"force": "2F", "unit": "g/N"}, "accelerance"),
    ]
    for head, values, how, quantity in cases:
        pairs = zip(frequency, values, strict=True)
        text = "\n".join(f"{f:g},{v.real:.12g}{v.imag:+.12g}j" for f, v in pairs)
        (one,) = read(write(f"frequency_hz,{head}\n{text}\n"), **how)
        assert (one.excitation.force, one.quantity, one.floors) == ("2F", quantity, ("RF",))
        np.testing.assert_array_equal(one.frequency_hz, frequency[1:])
        np.testing.assert_allclose(np.exp(one.log_frf[0]), np.abs(accelerance[1:]), rtol=1e-9)


def test_several_forces_and_a_standard_deviation(write):
    rows = "\n".join(f"{f},1,{2 * f},3,.1" for f in range(1, 21))
    path = write(f"frequency_hz,2F/RF,RF/RF,2F/2F,RF/RF_sd\n{rows}\n", "force.csv")
    low, roof = read(path, unit="m/s2/N", noise=0.3)
    assert (low.excitation.force, low.floors) == ("2F", ("2F",))
    assert (roof.excitation.force, roof.floors) == ("RF", ("2F", "RF"))
    own = in_band(roof, ("2F", "3F", "RF"), (3.0, 15.0))
    np.testing.assert_array_equal(own.frequency_hz, np.arange(3.0, 16.0))
    np.testing.assert_allclose(own.log_frf[1], np.log(2.0 * np.arange(3.0, 16.0)))
    np.testing.assert_array_equal(own.noise_sd[:, 0], [0.3, 0.1])
    assert own.notes == ("Noise on ln|H| taken as 0.3 for 2F.",)
    with pytest.raises(MeasurementError, match="fewer than ten frequencies lie between 3 and 5 Hz"):
        in_band(roof, ("2F", "RF"), (3.0, 5.0))
    with pytest.raises(MeasurementError, match="file of another building"):
        in_band(roof, ("2F", "3F"), (1.0, 20.0))


ROWS = "1,2,3\n2,2,3\n3,2,3\n"


@pytest.mark.parametrize(
    ("head", "how", "message"),
    [
        ("2F (m/s2/N),RF (m/s2/N)", {}, r"in m/s2/N is one to a force; say at which floor"),
        ("2F,RF", {"unit": "m/s2/N"}, r"column '2F': the floor at which the force acts is not"),
        ("2F/RF,RF/RF", {}, r"column '2F/RF': a response to a force has no unit"),
        ("2F/RF,RF/RF", {"unit": "m/s2"}, r"a response to a force cannot be in 'm/s2'"),
        ("2F/RF (m/N),RF/RF (m/s/N)", {}, r"several quantities, mobility and receptance"),
        ("2F/RF,RF/RF", {"unit": "m/N", "force": "2F"}, r"another floor than the force option, 2F"),
        ("2F,2F/RF", {"unit": "m/N", "force": "RF"}, r"'2F/RF' and '2F' are the same response"),
        ("2F/RF_re,RF/RF", {"unit": "m/N"}, r"floor 2F must have either the column 2F"),
        ("2F/9X,RF/RF", {"unit": "m/N"}, r"unknown column '2F/9X'"),
    ],
)
def test_wrong_tables(write, head, how, message):
    with pytest.raises(MeasurementError, match=message):
        read(write(f"frequency_hz,{head}\n{ROWS}", "force.csv"), **how)


def test_base_frfs_as_complex_text(write):
    path = write("frequency_hz,2F\n1,1+0j\n2,3-4j\n3,-1e-1+2E+0i\n", "frf.csv")
    (table,) = read(path)
    found = np.exp(table.log_frf + 1j * table.phase)
    np.testing.assert_allclose(found[0], [1.0, 3.0 - 4.0j, -0.1 + 2.0j])
    assert inspect_file(path).step.command == f"femupdate calibrate {path}"


def test_inspect(write):
    told = inspect_file(write(f"frequency_hz,2F/RF (m/N),RF/RF (m/N)\n{ROWS}", "a.csv"))
    assert told.function_texts[0].startswith(
        "frequency response 2F, 2F over a force at RF: 3 points"
    )
    assert told.step.command.endswith("a.csv")
    silent = inspect_file(write(f"frequency_hz,2F (m/N),RF (m/N)\n{ROWS}", "b.csv"))
    assert silent.step.command.endswith("b.csv --force FLOOR")
    bare = inspect_file(write(f"frequency_hz,2F/RF,RF/RF\n{ROWS}", "c.csv"))
    assert bare.step.command.endswith("c.csv --unit m/s2/N")


# pyuff leaves its own file open when it writes numbers in binary.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_functions_of_a_universal_file(tmp_path):
    pyuff = pytest.importorskip("pyuff", reason="pyuff (extra `formats`) is not installed")
    path, frequency = tmp_path / "hammer.uff", 0.5 * np.arange(1, 21)
    curves = np.array([[1.0], [-2.0]]) * (1.0 + 1j * frequency)
    for node, curve in enumerate(curves, start=3):
        one = pyuff.prepare_58(
            binary=0, func_type=4, rsp_node=node, rsp_dir=1, ref_dir=1, ref_node=4,
            data=curve, x=frequency, ord_data_type=6, num_pts=20,
            abscissa_spec_data_type=18, abscissa_inc=0.5, abscissa_spacing=1, abscissa_min=0.5,
            ordinate_spec_data_type=12, ordinate_axis_units_lab="(m/s2)/N",
            orddenom_spec_data_type=13, z_axis_spec_data_type=0, z_axis_value=0.0,
        )  # fmt: skip
        pyuff.UFF(str(path)).write_sets(one, "add")
    names = {"2F/RF": "1", "RF/RF": "point 4 +X/point 4 +X"}
    (one,) = read(path, columns=names)
    assert (one.excitation.force, one.floors) == ("RF", ("2F", "RF"))
    np.testing.assert_allclose(np.exp(one.log_frf), np.abs(curves), rtol=1e-5)
    with pytest.raises(MeasurementError, match=r"by number: 1 = point 3 \+X/point 4 \+X"):
        read(path, columns={"2F/RF": "9"})
    with pytest.raises(MeasurementError, match=r"say which floor each response function is"):
        read(path)
