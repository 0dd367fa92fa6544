"""Two effects at once, where a third imitates both or the first leaves most of the misfit."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest

from femupdate.discrepancy import pairs
from femupdate.discrepancy.diagnose import NAMED, PARTLY, STANDS_IN
from femupdate.discrepancy.thresholds import DiagnosisSettings

# Squares beyond the noise, of 1000; nothing is left below 100.
ALONE = {"joints": 700.0, "rocking": 800.0, "mass": 990.0, "swapped": 990.0}


@dataclass(frozen=True)
class Fitted:
    """The little of a fit that is asked for."""

    chi2: float

    @property
    def likelihood(self):
        return SimpleNamespace(effective=0.0)


@dataclass(frozen=True)
class Found:
    """The little of a diagnosis that is asked for."""

    findings: tuple
    verdict: str = PARTLY
    base: Fitted = Fitted(1000.0)
    pair: tuple = ()
    left: object = None
    sentence: str = "as it was"

    @property
    def leading(self):
        return self.findings[0]


@dataclass(frozen=True)
class Finding:
    """The little of a finding that is asked for."""

    label: str
    gain: float
    fitted: Fitted
    holds: bool = True
    noticed: bool = True

    @property
    def placed(self):
        return SimpleNamespace(label=self.label, exchange=self.label == "swapped")

    @property
    def evidence(self):
        return SimpleNamespace(log_evidence=self.gain)

    @property
    def in_words(self):
        return f"There is {self.label}"

    def needed(self, settings):
        return settings.over_none

    def carried(self, settings):
        return self.holds

    def matters(self, settings):
        return self.noticed


def finding(label, gain):
    return Finding(label, gain, Fitted(ALONE[label]))


JOINTS, ROCKING, MASS = finding("joints", 96.0), finding("rocking", 80.0), finding("mass", -1.4)
SWAPPED = finding("swapped", 90.0)
ALL = (JOINTS, SWAPPED, ROCKING, MASS)
SPLIT = {
    frozenset({"joints", "rocking"}): 120.0,
    frozenset({"joints", "mass"}): 110.0,
    frozenset({"rocking", "mass"}): 305.0,
}


@pytest.fixture
def told(monkeypatch):
    """A function: what becomes of a diagnosis, by the log evidence of two at once."""

    def run(found, together=SPLIT, size=0.0, squares=50.0, denied=False, **second):
        def both(found, pair, settings):
            beside = replace(pair[1], fitted=Fitted(squares), **second)
            return pair[0], beside

        def log_evidence(pair):
            return together[frozenset(one.label for one in pair)]

        left = SimpleNamespace(size=size, sentence="")
        monkeypatch.setattr(pairs, "_log_evidence", log_evidence)
        monkeypatch.setattr(pairs, "_together", both)
        monkeypatch.setattr(pairs, "denied", lambda *_: denied)
        monkeypatch.setattr(pairs, "remains", lambda *_: left)
        return pairs.with_pair(found, DiagnosisSettings())

    return run


def labels(findings):
    return [one.label for one in findings]


def test_the_best_two_are_told_though_a_third_leads_and_one_shows_nothing_alone(told):
    found = told(Found(ALL))
    assert labels(found.pair) == ["rocking", "mass"]
    assert labels(found.findings) == ["rocking", "mass", "joints", "swapped"]
    assert found.sentence == (
        "Two effects together: There is rocking. There is mass. They remove 95 % of the misfit "
        "beyond the noise, joints alone 30 %."
    )


@pytest.mark.parametrize(
    ("with_first", "pair"), [(290.0, ["rocking", "mass"]), (303.0, ["joints", "rocking"])]
)
def test_the_first_stays_where_a_pair_with_it_is_as_good(told, with_first, pair):
    found = told(Found(ALL), {**SPLIT, frozenset({"joints", "rocking"}): with_first})
    assert labels(found.pair) == pair


@pytest.mark.parametrize(
    "without",
    [{"denied": True}, {"holds": False}, {"noticed": False}, {"squares": 750.0}],
    ids=["first refused", "second refused", "no consequence", "less than the first alone"],
)
def test_what_other_data_or_the_misfit_do_not_carry_is_not_told(told, without):
    found = Found(ALL)
    assert told(found, **without) is found


@pytest.mark.parametrize(
    "found",
    [
        Found(ALL, verdict=NAMED),
        Found((replace(JOINTS, fitted=Fitted(400.0)), ROCKING, MASS)),
        Found((JOINTS, SWAPPED)),
    ],
    ids=["nothing is left", "the first removes most", "no second"],
)
def test_no_pair_is_sought_where_the_first_will_do_or_has_none(told, found):
    assert told(found, {}) is found


def test_what_two_leave_is_said(told):
    assert "Something else is missing as well." in told(Found(ALL), size=0.05).sentence
    assert told(Found(ALL), size=0.05, squares=600.0).sentence.endswith(STANDS_IN)
