"""What leads a diagnosis, and what a repair adds first."""

from types import SimpleNamespace

import pytest

from femupdate.discrepancy import certify, diagnose, repair
from femupdate.discrepancy.diagnose import Finding
from femupdate.discrepancy.evidence import Evidence
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.effects import CATALOGUE, Placed

SETTINGS = DiagnosisSettings()
LATE, MASS = Placed(CATALOGUE["channel_delay"], "RF"), Placed(CATALOGUE["added_mass"], "RF")
DAMPING, GAIN = Placed(CATALOGUE["damping_law"], "all"), Placed(CATALOGUE["channel_gain"], "RF")


def finding(placed, log_evidence, log_e_value=None, certified=True):
    """With a size that anybody would look for, and the test on the other half, if there was one."""
    changes = SimpleNamespace(matters=lambda *_: True)
    tested = None
    if log_e_value is not None:
        tested = certify.Tested(placed.label, (log_e_value, log_e_value), certified)
    fitted = SimpleNamespace(placed=(placed,))
    evidence = Evidence(log_evidence)
    return Finding(placed, None, fitted, evidence, changes, tested, 1.0, 0.1)


def labels(findings):
    return [one.placed.label for one in findings]


@pytest.mark.parametrize(
    ("one", "carried"),
    [
        (finding(LATE, 5.0, 24.0), True),
        (finding(LATE, 5.0, 0.2, certified=False), False),
        (finding(LATE, 5.0), False),
        (finding(LATE, 0.5, 24.0), False),
        (finding(MASS, 5.0, 24.0), False),
        (finding(MASS, 7.0, 24.0), True),
    ],
    ids=["certified", "refused", "not tested", "nothing", "structure", "structure, clear"],
)
def test_of_what_the_halves_certify_an_instrument_needs_less_evidence(one, carried):
    assert one.carried(SETTINGS) == carried


@pytest.fixture
def led(monkeypatch):
    """A function: labels in order, where an effect keeps its evidence beside the first, or not."""

    def run(*findings, beside=True):
        monkeypatch.setattr(diagnose, "_beside", lambda *_: beside)
        return labels(diagnose._instrument_first(None, findings, SETTINGS))

    return run


def test_a_sensor_leads_that_the_other_half_holds_far_likelier(led):
    mass, late = finding(MASS, 12.0, 8.7), finding(LATE, 5.0, 24.0)
    assert led(mass, late) == [LATE.label, MASS.label]
    assert led(mass, late, beside=False) == [MASS.label, LATE.label]


@pytest.mark.parametrize(("log_e_value", "certified"), [(9.0, True), (24.0, False)])
def test_else_a_sensor_of_little_evidence_stays_behind(led, log_e_value, certified):
    late = finding(LATE, 5.0, log_e_value, certified)
    assert led(finding(MASS, 12.0, 8.7), late) == [MASS.label, LATE.label]


@pytest.fixture
def tested(monkeypatch):
    """A function: labels of what is tested half against half, where the model errs or does not."""

    def run(*findings, errs):
        found = []

        def tests(problem, base, fits, tried, share):
            found.extend(one.placed[-1].label for one in fits)
            return {}

        monkeypatch.setattr(diagnose, "certify", tests)
        problem = SimpleNamespace(row=3 if errs else 0, error=SimpleNamespace(first=0))
        diagnose._certified(problem, None, findings, 40, SETTINGS)
        return found

    return run


def test_sensors_are_tested_where_the_model_errs(tested):
    some = finding(MASS, 12.0), finding(LATE, 5.0), finding(GAIN, 0.5), finding(DAMPING, 5.0)
    assert tested(*some, errs=True) == [MASS.label, LATE.label]
    assert tested(*some, errs=False) == [MASS.label]
    assert tested(finding(LATE, 5.0), errs=True) == [LATE.label]


@pytest.fixture
def added(monkeypatch):
    """A function: what is added and what is refused, by what each gains on data kept out."""

    def run(gains, *findings, denied=()):
        monkeypatch.setattr(repair, "denied", lambda found, one, _: one.placed.label in denied)
        found = SimpleNamespace(findings=findings, twins=(), base=None, scores=range(40))
        by_label = {one.placed.label: gain for one, gain in zip(findings, gains, strict=True)}

        def elsewhere(problem, base, fitted):
            return by_label[fitted.placed[-1].label]

        first, refused = repair._chosen(None, found, SETTINGS, elsewhere)
        return first and first.placed.label, labels(refused)

    return run


def test_what_all_data_hold_clearly_likelier_is_added_first(added):
    some = finding(MASS, 12.0), finding(DAMPING, 1.5), finding(LATE, 5.0)
    assert added((7.0, 184.0, 11.0), *some) == (DAMPING.label, [])
    assert added((7.0, 9.0, 11.0), *some) == (MASS.label, [])
    assert added((7.0, 9.0, 16.0), *some) == (MASS.label, [])
    assert added((7.0, 9.0, 20.0), *some) == (LATE.label, [])


def test_an_effect_in_all_places_stays_before_itself_at_one(added):
    everywhere, at_one = (Placed(CATALOGUE["amplitude_softening"], at) for at in ("all", "S2"))
    some = finding(everywhere, 38.0), finding(at_one, 39.0)
    assert added((1.1, 14.5), *some) == (everywhere.label, [])
    assert added((-1.0, 14.5), *some) == (at_one.label, [everywhere.label])


def test_what_data_kept_out_predict_worse_is_refused(added):
    some = finding(MASS, 12.0), finding(LATE, 5.0)
    assert added((-3.0, 11.0), *some) == (LATE.label, [MASS.label])
    assert added((-3.0, 1.0), *some) == (None, [MASS.label])


def test_what_the_halves_deny_is_not_added(added):
    some = finding(MASS, 12.0), finding(LATE, 5.0)
    assert added((9.0, 90.0), *some, denied={LATE.label}) == (MASS.label, [])
