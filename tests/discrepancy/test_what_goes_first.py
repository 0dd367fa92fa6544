"""What leads a diagnosis, and what a repair adds first."""

from types import SimpleNamespace

import pytest

from femupdate.discrepancy import certify
from femupdate.discrepancy.diagnose import Finding
from femupdate.discrepancy.evidence import Evidence
from femupdate.discrepancy.thresholds import DiagnosisSettings
from femupdate.effects import CATALOGUE, Placed

SETTINGS = DiagnosisSettings()
LATE, MASS = Placed(CATALOGUE["channel_delay"], "RF"), Placed(CATALOGUE["added_mass"], "RF")


def finding(placed, log_evidence, log_e_value=None, certified=True):
    """With a size that anybody would look for, and the test on the other half, if there was one."""
    changes = SimpleNamespace(matters=lambda *_: True)
    tested = None
    if log_e_value is not None:
        tested = certify.Tested(placed.label, (log_e_value, log_e_value), certified)
    fitted = SimpleNamespace(placed=(placed,))
    evidence = Evidence(log_evidence)
    return Finding(placed, None, fitted, evidence, changes, tested, 1.0, 0.1)


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
