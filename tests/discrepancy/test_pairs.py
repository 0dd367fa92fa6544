"""Which of two effects goes first where a third imitates both."""

from types import SimpleNamespace

import pytest

from femupdate.discrepancy import pairs
from femupdate.discrepancy.thresholds import DiagnosisSettings


def finding(label, gain, exchange=False):
    return SimpleNamespace(
        placed=SimpleNamespace(label=label, exchange=exchange),
        evidence=SimpleNamespace(log_evidence=gain),
    )


JOINTS, ROCKING, MASS = finding("joints", 96.0), finding("rocking", 80.0), finding("mass", -1.4)
SWAPPED = finding("swapped", 90.0, exchange=True)


@pytest.fixture
def led(monkeypatch):
    """A function: labels in their order, by the log evidence of two at once."""

    def run(findings, together):
        def told(found, *two):
            return together[frozenset(one.placed.label for one in two)]

        monkeypatch.setattr(pairs, "_log_evidence", told)
        found = SimpleNamespace(findings=tuple(findings))
        return [one.placed.label for one in pairs.led_by_a_pair(found, DiagnosisSettings())]

    return run


def test_the_stronger_of_the_best_two_goes_first_though_the_other_shows_nothing(led):
    together = {
        frozenset({"joints", "rocking"}): 120.0,
        frozenset({"joints", "mass"}): 110.0,
        frozenset({"rocking", "mass"}): 305.0,
    }
    assert led([JOINTS, SWAPPED, ROCKING, MASS], together) == [
        "rocking",
        "joints",
        "swapped",
        "mass",
    ]


@pytest.mark.parametrize("best", [290.0, 400.0])
def test_the_first_stays_where_a_pair_with_it_is_as_good(led, best):
    together = {
        frozenset({"joints", "rocking"}): best,
        frozenset({"joints", "mass"}): 110.0,
        frozenset({"rocking", "mass"}): 291.0,
    }
    assert led([JOINTS, ROCKING, MASS], together)[0] == "joints"


def test_one_effect_alone_has_no_pair(led):
    assert led([JOINTS], {}) == ["joints"]
