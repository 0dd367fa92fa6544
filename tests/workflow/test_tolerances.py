"""Masses, gains and clocks that a building knows to a tolerance alone."""

from pathlib import Path

import numpy as np
import pytest

import femupdate
from femupdate.errors import BuildingError

SHIPPED = Path(femupdate.__file__).parents[1] / "models" / "shear_3dof.toml"
PLAIN = SHIPPED.read_text().partition("[tolerances]")[0]  # the shipped ones are all zero
FACTORS = (0.9, 1.2, 0.8)
MASSES = (0.03, -0.04, 0.02)  # by which those of the file are wrong
TOLERANCES = '[tolerances]\nmass = "3 %"\n'


@pytest.fixture(scope="module")
def stick(tmp_path_factory):
    """A file of `shear_3dof` with more text, and an observation whose masses are other ones."""
    folder = tmp_path_factory.mktemp("tolerances")
    path = folder / "run.csv"
    floors = zip(("2F", "3F", "RF"), MASSES, strict=True)
    effects = tuple((f"added_mass@{floor}", (share,)) for floor, share in floors)
    femupdate.simulate(
        "shear_3dof", path, theta=FACTORS, zeta=0.02, duration_s=60.0, seed=3, effects=effects
    )

    def calibrated(more):
        building = folder / f"stick_{len(more)}.toml"
        building.write_text(PLAIN + more)
        how = {"exact": True, "particles": 400, "building": str(building)}
        return femupdate.calibrate(folder / building.stem, path, **how)

    return calibrated


def test_what_masses_do_to_factors_is_in_their_intervals(stick):
    sure, wide = stick(""), stick(TOLERANCES)
    known, loose = (report.posterior.of("stiffness").samples for report in (sure, wide))
    # The wrong masses put factors 3 to 5 % off, and intervals of .5 % miss the truth.
    low, high = np.quantile(known, [0.05, 0.95], axis=0)
    assert ((low > FACTORS) | (high < FACTORS)).any()
    low, high = np.quantile(loose, [0.05, 0.95], axis=0)
    assert ((low < FACTORS) & (high > FACTORS)).all()
    # Shares of the masses are seen, their common level is not: three that err by 3 % each leave
    # 3 % over the root of three to all factors alike (four hundred draws know a sd to 3.5 %).
    assert loose.std(axis=0) / FACTORS == pytest.approx(0.03 / 3.0**0.5, rel=0.08)
    told = next(note for note in wide.notes if "by tolerances" in note)
    assert "masses 9" in told or "masses 100" in told
    # What was measured stays as sure: frequencies scatter no more than before.
    assert first_frequency(wide).std() < 1.2 * first_frequency(sure).std()


def first_frequency(report):
    """Of some draws, rad/s."""
    drawn = report.posterior.parameters.split(report.posterior.thinned(400, 0))
    return report.model.system.modes(drawn.theta, drawn.sizes).omega.min(dim=1).values.numpy()


def test_modes_may_be_damped_about_the_law(tmp_path):
    ratios = 'law = "modes"\nratios = [0.02, 0.026, 0.015]\nanchors = ["3.9 Hz", "11 Hz", "16 Hz"]'
    truth, own = tmp_path / "truth.toml", tmp_path / "own.toml"
    truth.write_text(PLAIN.replace('law = "constant"', ratios))
    own.write_text(PLAIN + '[tolerances]\ndamping_of_modes = "20 %"\n')
    run = tmp_path / "run.csv"
    femupdate.simulate(truth, run, theta=FACTORS, zeta=0.02, duration_s=60.0, seed=3)
    how = {"exact": True, "particles": 200, "building": str(own)}
    report = femupdate.calibrate(tmp_path / "study", run, **how)
    # A constant ratio leaves factors known to a thousandth and less; now it is a tenth of that.
    known = report.posterior.of("stiffness").samples
    assert known.mean(axis=0) == pytest.approx(FACTORS, rel=5e-4)
    assert (known.std(axis=0) < 4e-4).all()
    # The first mode's own ratio, seen to a hundredth, in place of one between all modes.
    first = report.posterior.names.index("damping_of_modes_tolerance@f1.size")
    of_first = report.posterior.zeta_samples * (1.0 + report.posterior.samples[:, first])
    assert of_first.mean() == pytest.approx(0.02, rel=0.03)
    assert "the data are explained" in str(report)
    assert any("damping of modes" in note for note in report.notes)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("mass = 0.03", "tolerances.mass: 0.03 has no unit"),
        ('mass = "-3 %"', "tolerances.mass: '-3 %' is not a not negative share"),
        ('gain = "60 %"', "tolerances.gain: it is above 50 %"),
        ('members = "10 %"', "tolerances.members: it is for frames and meshes"),
        ('delay = "3 %"', "tolerances.delay: "),
        ('delay = "1 s"', "tolerances.delay: it is above 50 ms"),
        ('masses = "3 %"', "tolerances.masses"),
    ],
)
def test_a_tolerance_that_is_none_is_refused_by_its_key(tmp_path, line, said):
    path = tmp_path / "stick.toml"
    path.write_text(PLAIN + f"[tolerances]\n{line}\n")
    with pytest.raises(BuildingError, match="tolerances") as raised:
        femupdate.Building.load(path)
    assert said in str(raised.value)
