"""Candidates after fitting: what leads them, what is said of them, and the verdict."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch

from femupdate.discrepancy.evidence import Consequence, Tested, laplace
from femupdate.discrepancy.fit import DIFFERENCE, Cell, Fit, Remains, with_last, with_more
from femupdate.discrepancy.score import Score
from femupdate.discrepancy.thresholds import VERDICT, DiagnosisSettings
from femupdate.dynamics.system import Rows
from femupdate.effects.effect import Effect, Placed, Sway
from femupdate.effects.structure import Structure
from femupdate.effects.tolerances import TOLERANCES, USUAL, tolerance_of
from femupdate.errors import brief
from femupdate.inference.likelihood import summed
from femupdate.units import percent

LITTLE = 0.005  # share of the misfit beyond the noise that rounds to none
NONE, NAMED, PARTLY, AMBIGUOUS = "none", "named", "partly", "ambiguous"
INDISTINGUISHABLE, UNKNOWN, NONLINEAR = "indistinguishable", "unknown", "nonlinear"
STANDS_IN = "Much of the misfit stays: what is named may stand in for what else is missing."


@dataclass(frozen=True, eq=False)
class Finding:
    """One candidate after fitting, the last effect of a fit.

    Attributes:
        log_evidence: over the model without it.
        changes: what it does to frequencies and responses.
        tested: on data to which it was not fitted; None where it was not.
        size, size_sd: of its first parameter.
    """

    score: Score
    fitted: Fit
    log_evidence: float
    changes: Consequence
    tested: Tested | None
    size: float
    size_sd: float

    @property
    def placed(self) -> Placed:
        """Effect and place."""
        return self.fitted.placed[-1]

    def matters(self, settings: DiagnosisSettings) -> bool:
        """Whether an engineer would notice what it changes."""
        return self.changes.matters(settings.least_frequency, settings.least_response)

    @property
    def large_enough(self) -> bool:
        """Whether anybody would look for an effect of this size."""
        return all(
            abs(self.size - first.neutral) >= first.least
            for first in self.placed.effect.parameters[:1]
        )

    @property
    def log_density(self) -> float:
        """Of the data at its fit, summed over what the model may err by."""
        return float(summed(self.fitted.densities))

    @property
    def at_limit(self) -> bool:
        """Whether its size ends where the effect's sizes end: it may stand for another."""
        return any(
            abs(limit - self.size) < 1e-3 * abs(limit - first.neutral)
            for first in self.placed.effect.parameters[:1]
            for limit in (first.lower, first.upper)
        )

    @property
    def tolerated(self) -> int:
        """At how many places the model lets the same vary within a tolerance; 0, if not here."""
        present = self.fitted.placed[:-1]
        number = tolerance_of(self.placed, present)
        return 0 if number is None else sum(p.effect is present[number].effect for p in present)

    def needed(self, settings: DiagnosisSettings) -> float:
        """Log evidence that a name needs.

        An instrument's effect that the halves of the data certify needs little more: where the
        model itself errs, its error may take the place of a delay or a gain. Where the model lets
        the same vary within a tolerance, that it is off is certain, and the tolerance is the one
        rival; by chance one of many floors is off further than another.
        """
        if self.tolerated:
            return settings.over_next + float(np.log(self.tolerated))
        certified = self.tested is not None and self.tested.certified
        easier = self.placed.effect.instrument and certified
        return VERDICT.positive if easier else settings.over_none

    def carried(self, settings: DiagnosisSettings) -> bool:
        """Whether the evidence carries it, on data to which it was not fitted too."""
        enough = self.log_evidence >= self.needed(settings)
        return enough and (self.tested is None or self.tested.certified or bool(self.tolerated))

    def names(self, base: Fit, settings: DiagnosisSettings) -> bool:
        """Whether evidence and consequence carry a name, and it removes more than noise."""
        sure = self.carried(settings) and self.matters(settings)
        return sure and self.removes(base) >= LITTLE

    def removes(self, base: Fit) -> float:
        """Share of the misfit that it removes; all, where a tolerance had removed it before."""
        return 1.0 if self.tolerated else removed(base, self.fitted)

    def contains(self, other: "Finding") -> bool:
        """Whether it is another effect with a parameter more."""
        same_place = self.placed.place == other.placed.place
        return same_place and other.placed.effect.name in self.placed.effect.contains

    def far_behind(self, other: "Finding", settings: DiagnosisSettings) -> bool:
        """Whether other data hold it far less likely, where what both are fitted to does not.

        So they must wherever errors known beforehand are taken from.
        """
        if self.tested is None or other.tested is None:
            return False
        both = zip(self.tested.log_e_values, other.tested.log_e_values, strict=True)
        return all(mine < value - settings.margin(value) for mine, value in both)

    @property
    def in_words(self) -> str:
        """Effect, place and size: "3F carries 9.8 % more mass than modelled (± 0.3 %; 2.1 t)"."""
        effect, (size, sd) = self.placed.effect, self.told
        said = effect.said(self.placed.place, size)
        if not effect.parameters:
            return said
        mass = "" if self.mass is None else f"; {mass_in_words(self.mass)}"
        return f"{said} ({effect.scatter(size, sd)}{mass})"

    @cached_property
    def told(self) -> tuple[float, float]:
        """Size and standard deviation as a reader is told them: shares of what all else is.

        How well that is known counts as well: what a dashpot adds to the first damping ratio falls
        with the square of its story's factor.
        """
        effect, fitted = self.placed.effect, self.fitted
        if type(effect).unit is Effect.unit:
            return self.size, self.size_sd
        structure, model = fitted.likelihood.reduced.structure, fitted.system.model
        floor, count = self.placed.place.partition("/")[0], len(effect.parameters)
        place = model.floors.index(floor) if floor in model.floors else 0
        # At the fit, and beside it by every unknown.
        moved = DIFFERENCE * torch.eye(len(fitted.z)).to(fitted.z)
        theta, _, sizes = fitted.steps.split(fitted.z + torch.cat([0.0 * moved[:1], moved]))
        others = replace(fitted.system, placed=fitted.placed[:-1], terms=fitted.system.terms[:-1])
        shapes = torch.from_numpy(np.vstack([model.floor_shapes[-1:], model.story_drift]))
        modes = others.modes(theta, sizes[:, :-count], Rows(shapes, shapes.new_zeros(1, 3)))
        roof = modes.rows[:, 0] * modes.participation[:, 0]
        first = int(roof[0].abs().argmax())  # the mode that the base drives most
        omega = modes.omega[:, first]
        drift = omega[:, None] * modes.rows[:, 1 : len(shapes), first]
        sways = zip(roof.sum(dim=1).tolist(), omega.tolist(), drift.numpy(), strict=True)
        units = np.array([effect.unit(Sway(*sway), place) for sway in sways])
        in_file = effect.unit(Sway(structure.roof, *structure.fundamental), place)
        told = torch.from_numpy(in_file / units) * sizes[:, -count]
        slopes = (told[1:] - told[0]) / DIFFERENCE
        sd = float((slopes @ fitted.covariance() @ slopes).sqrt())
        return float(told[0]), float(np.hypot(sd, effect.own_error * float(told[0])))

    def within(self, fitted: Fit, number: int) -> "Finding":
        """With the size that it has as one of the effects of another fit."""
        last = with_last(fitted, number)
        size, sd = last.last_size
        return replace(self, fitted=last, size=size, size_sd=sd)

    @property
    def mass(self) -> float | None:
        """What it adds, kg; None where it adds none, or the model's masses are nominal."""
        added = self.fitted.system.terms[-1].mass
        if added is None or self.fitted.likelihood.building.forces_are_relative:
            return None
        mass = self.size * float(added.rigid[0, 0])
        return mass if abs(mass) > 1e-3 else None  # an eccentricity moves masses alone


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Where the model fails and what could be missing.

        >>> import femupdate
        >>> found = femupdate.diagnose("house", "run.csv", building="shear_3dof").diagnosis
        >>> found.verdict
        'none'

    Attributes:
        base: the model as it is, at its most probable parameters.
        verdict: "none", "named" (certain, and nothing of note is left), "partly" (certain, and
            something else is missing), "ambiguous", "indistinguishable", "unknown" or "nonlinear".
        findings: fitted candidates, the most probable first.
        scores: all score tests, the strongest first.
        unobservable: labels of effects that these sensors could not show.
        twins: labels that the leading finding cannot be told from.
        left: what the model misses, with the effect where one is named, or with both of a pair.
        pair: two that explain together what the best alone does not, the stronger first, with the
            sizes that they have together; empty where none was sought or found.
        allowed: the model with the usual tolerances, where they explain what no name may then.
    """

    __repr__ = brief

    base: Fit
    verdict: str
    findings: tuple[Finding, ...]
    scores: tuple[Score, ...]
    unobservable: tuple[str, ...]
    twins: tuple[str, ...]
    left: Remains
    sentence: str
    pair: tuple[Finding, ...] = ()
    allowed: Fit | None = None

    @property
    def p_value(self) -> float:
        """Of noise alone leaving the residuals of the model as it is."""
        return self.base.p_value

    @property
    def residuals(self) -> tuple[Cell, ...]:
        """Of the model as it is, by floor and band."""
        return self.base.cells()

    @property
    def leading(self) -> Finding | None:
        """The most probable finding."""
        return self.findings[0] if self.findings else None

    def close(self, settings: DiagnosisSettings) -> tuple[Finding, ...]:
        """The leading findings between which the error of a basis for all effects may decide."""
        if self.leading is None or self.verdict in (NONE, UNKNOWN):
            return ()
        value = self.leading.log_evidence
        least = value - max(settings.close * value, settings.over_none)
        return tuple(finding for finding in self.findings if finding.log_evidence > least)[:4]

    @property
    def would_decide(self) -> tuple[str, ...]:
        """Sentences on what would decide, where the first is not told from its twins."""
        if not self.twins or self.leading is None:
            return ()
        twins = [finding.placed for finding in self.findings if finding.placed.label in self.twins]
        return tuple(
            f"Without the model, {placed.label} is settled by {placed.effect.settled_by}."
            for placed in (self.leading.placed, *twins[: VERDICT.compared])
        )


Beside = Callable[[Finding, Finding], bool]
"""Whether the second of two explains beside the first most of what it explains alone."""


def keeps_beside(first: Finding, other: Finding, settings: DiagnosisSettings) -> bool:
    """Whether an effect explains beside the first most of what it explains without it."""
    both = with_more(first.fitted, other.placed, other.fitted.known_of(-1))
    of = both.likelihood
    gain = laplace(of, both) - laplace(of, first.fitted)
    return gain >= max(other.needed(settings), VERDICT.beside * other.log_evidence)


def in_order(
    findings: Sequence[Finding], settings: DiagnosisSettings, beside: Beside
) -> tuple[Finding, ...]:
    """The findings by their evidence, but for what goes first.

    What says less than the first goes before it, where that is not clearly better: the same effect
    in all places says not where, and in one place needs no range; one that the first contains has a
    parameter less. Then comes an instrument's effect that is missing beside the first and close to
    it, for an instrument is mended before the structure is judged by it. One that the other half of
    the data holds far likelier than the first need not be close.
    """

    def least(first: Finding) -> float:
        return first.log_evidence - settings.margin(first.log_evidence)

    def led_by(finding: Finding) -> tuple[Finding, ...]:
        return (finding, *(other for other in findings if other is not finding))

    for finding in findings[1:]:
        first = findings[0]
        wider = finding.placed.place == "all" or first.placed.is_range
        wider = wider and finding.placed.effect is first.placed.effect
        simpler = (wider and not finding.placed.is_range) or first.contains(finding)
        if simpler and finding.log_evidence > least(first) and finding.carried(settings):
            findings = led_by(finding)
            break
    for finding in findings[1:]:
        first = findings[0]
        if first.placed.effect.instrument:
            break
        close = finding.log_evidence > least(first) or first.far_behind(finding, settings)
        sure = finding.carried(settings) and finding.matters(settings)
        if finding.placed.effect.instrument and close and sure and beside(first, finding):
            return led_by(finding)
    return tuple(findings)


def others_than(first: Finding, others: Sequence[Finding]) -> list[Finding]:
    """Others than the same effect at one place, where it leads in all: that does not say where.

    One place that is likelier than all says so. Ranges of places do not, where it leads in one.
    """
    everywhere, ranges = first.placed.place == "all", first.placed.is_range
    return [
        other
        for other in others
        if other.placed.effect is not first.placed.effect
        or not (everywhere or (other.placed.is_range and not ranges))
        or (not other.placed.is_range and other.log_evidence > first.log_evidence)
    ]


def rivals(
    findings: Sequence[Finding], settings: DiagnosisSettings, beside: Beside
) -> list[Finding]:
    """What the first finding cannot be told from by its evidence, or but for the priors of sizes.

    What other data refuse is no rival, nor what they hold far less likely, nor the same thing with
    a parameter more, nor what is missing as well.
    """
    first = findings[0]
    least = first.log_evidence - settings.margin(first.log_evidence)
    alike = first.log_density - settings.over_next
    near = [o for o in findings[1:] if o.log_evidence > least or o.log_density > alike]
    return [
        other
        for other in others_than(first, near)
        if other.carried(settings)
        and not other.far_behind(first, settings)
        and not other.contains(first)
        and not beside(first, other)
    ]


def unseen(
    unobservable: tuple[str, ...], verdict: str, findings: Sequence[Finding], twins: Sequence[str]
) -> tuple[str, ...]:
    """Labels of what cannot be seen, but for what the verdict names: that was seen.

    At the size of its prior an effect may be too faint to show; what is there may be larger.
    """
    if verdict in (NONE, UNKNOWN):
        return unobservable
    named = {findings[0].placed.label, *twins}
    return tuple(label for label in unobservable if label not in named)


def grouped(labels: Sequence[str], structure: Structure) -> str:
    """Labels by their effect, neighbouring floors and stories as one: "added_mass@2F to 9F"."""

    def rank(place: str, order: Sequence[str]) -> int:
        return order.index(place) if place in order else -1

    orders = structure.floors, structure.building.story_names
    groups: dict[str, list[list[str]]] = {}
    for order in orders:
        # Floor by floor, whatever the order in which they were found.
        labels = sorted(labels, key=lambda label: rank(label.partition("@")[2], order))
    for label in labels:
        name, _, place = label.partition("@")
        runs = groups.setdefault(name, [])
        follows = runs and any(
            0 <= rank(runs[-1][-1], order) == rank(place, order) - 1 for order in orders
        )
        if follows:
            runs[-1].append(place)
        else:
            runs.append([place])
    parts = []
    for name, runs in groups.items():
        places = [run if len(run) < 3 else [f"{run[0]} to {run[-1]}"] for run in runs]
        parts.append(f"{name}@{', '.join(place for run in places for place in run)}")
    return "; ".join(parts)


def removed(base: Fit, best: Fit) -> float:
    """Share of the squared residuals beyond the noise that a better fit does without."""
    return (base.chi2 - best.chi2) / max(base.chi2 - base.likelihood.effective, 1.0)


def mass_in_words(mass: float) -> str:
    """A mass (kg) in a unit of its size."""
    return f"{mass:.3g} kg" if abs(mass) < 100.0 else f"{1e-3 * mass:.3g} t"


def within_tolerances(verdict: str, findings: Sequence[Finding], left: Remains) -> str:
    """The verdict where the usual tolerances explain what the leading finding does."""
    start = "Nothing needs to be added" if verdict == NONE else "No cause is certain"
    return (
        f"{start}: masses that are known to {percent(USUAL.mass, 1)}, gains to "
        f"{percent(USUAL.gain, 1)} and clocks to {1e3 * USUAL.delay:.1g} ms, as is usual, explain "
        f"as much as the likeliest effect ({findings[0].placed.in_words}). Where they are known "
        f"better, state [tolerances]. {left.sentence}"
    ).rstrip()


def taken(fitted: Fit, least: float = 0.0) -> Iterator[tuple[str, str]]:
    """What a model takes of each kind of tolerance: "masses", "2F -.3 %, RF +2 %".

    Args:
        least: standard deviations from which a place is told.
    """
    for key, what in TOLERANCES.items():
        factor, unit = (1e3, "ms") if key == "delay" else (100.0, "%")
        used = [
            f"{placed.place} {factor * fitted.known_of(number)[0]:+.2g} {unit}"
            for number, placed in enumerate(fitted.placed)
            if placed.effect.name == f"{key}_tolerance"
            and abs(fitted.known_of(number)[0]) > least * placed.effect.parameters[0].scale
        ]
        if used:
            yield what, ", ".join(used)


def strained(fitted: Fit) -> str:
    """What a model takes of tolerances beyond twice what they are, in a sentence or none."""
    far = " and ".join(f"{what} ({used})" for what, used in taken(fitted, 2.0))
    return f" This takes more than twice the tolerance of {far}: look there." if far else ""


def others_instead(first: Finding) -> str:
    """What shows as a floor's mass does: without a force only ratios of masses count."""
    forces = [data for data in first.fitted.likelihood.data if getattr(data, "forced", False)]
    if first.placed.effect.name != "added_mass" or forces:
        return ""
    share = 1.0 / (1.0 + first.told[0]) - 1.0
    than = f"{percent(abs(share), 1)} {'more' if share > 0.0 else 'less'}"
    return f" Much the same shows where all other floors carry {than}."


def share_in_words(share: float) -> str:
    """A share in per cent, or "none" and "all" where it is no less."""
    return "none" if share < LITTLE else percent(share) if share < 1.0 else "all"


def sentence_of(
    verdict: str, findings: Sequence[Finding], twins: Sequence[str], left: Remains, share: float
) -> str:
    """The verdict for an engineer, with twins in words.

    The share is that which the first removes of the misfit. Beside an unknown cause, zero where
    there are no candidates.
    """
    if verdict == NONE:
        text = "The model explains the data; nothing needs to be added."
        if findings and findings[0].tested is not None and findings[0].tested.certified:
            text += f" {findings[0].in_words}, but that is of no consequence."
        return f"{text} {left.sentence}".rstrip()
    if verdict == UNKNOWN:
        text = (
            "The model misses the data by more than their noise, and no effect of the catalogue is "
            "certain to explain it."
        )
        if share > 0.0:
            likely = [
                finding.placed.in_words
                for finding in findings
                if finding.log_evidence >= VERDICT.positive
            ]
            text += (
                f" The likeliest candidates remove {share_in_words(share)} of the misfit and may "
                f"only stand in for the cause: {'; '.join(likely[:3])}."
            )
        return f"{text} {left.sentence}".rstrip()
    first = findings[0]
    words = f"{first.in_words}. {first.placed.effect.sentence}"
    if verdict == NAMED:
        return f"{words}{others_instead(first)} {left.sentence}".rstrip()
    if verdict == PARTLY:
        told = f"It removes {share_in_words(share)} of the misfit beyond the noise;"
        doubt = "" if share >= VERDICT.most else f" {STANDS_IN}"
        return f"{words} {told} something else is missing as well.{doubt} {left.sentence}"
    which = "sensors cannot" if verdict == INDISTINGUISHABLE else "data do not"
    return f"{'. Or: '.join([first.in_words, *twins])}. These {which} tell which."
