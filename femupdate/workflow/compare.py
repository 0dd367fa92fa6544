"""compare: which stories changed between two posteriors, as before and after an event."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.building.document import factor_titles
from femupdate.building.files import load_building
from femupdate.errors import InferenceError, StudyError
from femupdate.inference.change import NAMED, Changes, changes
from femupdate.inference.posterior import Posterior, load_posterior
from femupdate.report.scale import plus_minus, with_unit
from femupdate.result import Item, Note, Notes, Picture, Result, wrapped
from femupdate.study import BUILDING_FILE, Study
from femupdate.tables import Column, Table


@dataclass(frozen=True, kw_only=True)
class State:
    """A posterior of a building in one state.

    Attributes:
        titles: what its factors are of, by name; empty where no building file is beside it.
        hashes: of what it was made from, where its study says so.
        summary: that the calibration kept; empty where no study is known.
    """

    name: str
    posterior: Posterior
    titles: Mapping[str, str]
    hashes: Mapping[str, str]
    summary: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CompareReport(Result):
    """What changed from one state to the other, of the p stiffness factors of both."""

    before: State
    after: State
    names: tuple[str, ...]
    changes: Changes
    notes: tuple[str, ...]

    @cached_property
    def draws(self) -> tuple[Floats, Floats]:
        """(n, p) and (m, p) factors of both states."""
        before, after = (state.posterior.of("stiffness") for state in (self.before, self.after))
        return before.samples, after.samples

    @property
    def titles(self) -> tuple[str, ...]:
        """What the factors are of."""
        return tuple(self.before.titles.get(name, name) for name in self.names)

    @property
    def verdict(self) -> str:
        """ "changed", "unchanged" or "unclear"."""
        if (self.changes.probability >= NAMED).any():
            return "changed"
        return "unchanged" if self.changes.none >= 0.8 else "unclear"

    @property
    def named(self) -> tuple[str, ...]:
        """Names of the factors that changed, by the verdict; none where all changed alike."""
        if self.verdict != "changed" or self.changes.alike > 0.5:
            return ()
        pairs = zip(self.names, self.changes.probability, strict=True)
        return tuple(name for name, probability in pairs if probability >= NAMED)

    def sentence(self) -> str:
        """The verdict for an engineer."""
        found = self.changes
        # From the smallest to the largest visible change.
        low, high = (
            100.0 * np.expm1(value) for value in (found.visible.min(), found.visible.max())
        )
        size = f"{low:.2g} %" if high < 1.2 * low else f"{low:.2g} to {high:.2g} % (by story)"
        seen = f"One story changing by {size} or more would"
        if self.verdict == "unchanged":
            return (
                f"Nothing has changed, with a probability of {_share(found.none)}. {seen} have "
                "been seen."
            )
        if self.verdict == "unclear":
            likeliest = int(found.probability.argmax())
            return (
                "The data do not tell whether anything changed: the probability that nothing did "
                f"is {_share(found.none)}. Most likely to have changed is {self.titles[likeliest]} "
                f"({_share(found.probability[likeliest])}). {seen} be seen."
            )
        if found.alike > 0.5:
            return (
                f"All stiffnesses changed alike, by {_change(found.size[0], found.size_sd[0])}, "
                f"with a probability of {_share(found.alike)}. Look for a common reason first: "
                "temperature, level of motion, or masses."
            )
        named = [self.names.index(name) for name in self.named]
        parts = [
            f"{self.titles[k]}{' changed' if k == named[0] else ''} by "
            f"{_change(found.size[k], found.size_sd[k])} "
            f"(probability {_share(found.probability[k])})"
            for k in named
        ]
        return f"The stiffness of {', that of '.join(parts)}."

    def items(self) -> Iterator[Item]:
        """The verdict, every factor, and notes."""
        found, (before, after) = self.changes, self.draws
        yield Note(
            wrapped(self.sentence()),
            {
                "before": self.before.name,
                "after": self.after.name,
                "verdict": self.verdict,
                "sentence": self.sentence(),
                "probability_of_no_change": found.none,
                "probability_of_all_alike": found.alike,
            },
        )
        sizes = zip(found.size, found.size_sd, strict=True)
        columns = (
            Column(self.names, key="parameter"),
            Column(self.titles, "factor of", key="of"),
            *(
                Column(
                    draws.mean(axis=0),
                    name,
                    [plus_minus(values.mean(), values.std()) for values in draws.T],
                    key=name,
                )
                for name, draws in (("before", before), ("after", after))
            ),
            Column(
                np.expm1(found.size),
                "change, if any",
                [_change(size, sd) for size, sd in sizes],
                key="change",
            ),
            Column(np.exp(found.size) * found.size_sd, key="change_sd"),
            Column(
                found.probability,
                "probability",
                [_share(value) for value in found.probability],
                key="probability",
            ),
            Column(np.expm1(found.visible), key="visible_from"),
        )
        yield Table(name="changes", key="changes", columns=columns)
        yield Notes(self.notes, key="notes")

    def figures(self) -> Iterator[Picture]:
        """The intervals of all factors before and after."""
        from femupdate.report.plot_posterior import theta_intervals

        both = dict(zip(("Before", "After"), self.draws, strict=True))
        bounds, title = (
            self.before.posterior.of("stiffness").bounds,
            "Stiffness factors before and after",
        )
        yield Picture("changes", lambda: theta_intervals(self.titles, both, bounds, title=title))


def find_state(text: str, study: Study) -> State:
    """The posterior that a user names.

    Args:
        text: a study folder, a posterior file, or the name of a posterior of the study.
        study: that is asked for the name.

    Raises:
        StudyError: there is none, or it is damaged.
    """
    path, names = Path(text), study.posteriors()
    if text in names:
        return open_state(Study(study.folder, text), text)
    if path.is_dir():
        return open_state(Study(path), text)
    if path.is_file():
        return State(name=text, posterior=load_posterior(path), titles={}, hashes={})
    known = f", or choose of {study.folder} {', '.join(names)}" if names else ""
    raise StudyError(
        f"there is no study folder, posterior file or posterior called {text}; make it by "
        f"`femupdate calibrate FILE --name {text}`{known}"
    )


def open_state(study: Study, name: str = "") -> State:
    """The chosen posterior of a study.

    Args:
        name: what to call it; default the folder.

    Raises:
        StudyError: there is none, or it is damaged.
    """
    file = study.require("posterior", "calibrate")
    building, recorded = study.path(BUILDING_FILE), study.artefact("posterior")
    assert recorded is not None
    return State(
        name=name or str(study.folder),
        posterior=load_posterior(file),
        titles=factor_titles(load_building(building)) if building.exists() else {},
        hashes=recorded.made_from,
        summary=study.summary(),
    )


def compare_states(before: State, after: State) -> CompareReport:
    """Find the factors that changed.

    Raises:
        InferenceError: the posteriors are of different factors, or from the same data.
    """
    states = before, after
    first, second = (state.posterior.of("stiffness") for state in states)
    if first.names != second.names or not first.names:
        raise InferenceError(
            f"{before.name} and {after.name} have other stiffness factors "
            f"({', '.join(first.names)}; {', '.join(second.names)}); compare posteriors of one "
            "building"
        )
    files = [
        {value for key, value in state.hashes.items() if key.startswith("observation")}
        for state in states
    ]
    seen, other = (state.posterior.observation for state in states)
    same = seen.floors == other.floors and bool(seen.valid.any())
    if files[0] & files[1] or (
        same and np.array_equal(seen.log_frf, other.log_frf, equal_nan=True)
    ):
        raise InferenceError(
            f"{before.name} and {after.name} come from the same measurement; compare posteriors of "
            "two measurements"
        )
    notes = []
    ways = [state.posterior.drawn.likelihood for state in states]
    if ways[0] != ways[1]:
        notes.append(
            f"One posterior is {ways[0]}, the other {ways[1]}: errors of the model that cancel "
            "between two of one kind do not cancel here."
        )
    hashes = [state.hashes.get("building") for state in states]
    if None not in hashes and hashes[0] != hashes[1]:
        notes.append(
            "The two building files differ: each factor is relative to its own file, so a "
            "difference between the files shows as a change."
        )
    if set(seen.floors) != set(other.floors):
        notes.append("The floors measured differ, which can move factors where the model errs.")
    worst = max(state.summary.get("misfit") or 0.0 for state in states)
    if worst > 1.5:
        notes.append(
            f"The model misses the data by {worst**0.5:.2g} times their noise: the probabilities "
            "are surer than they should be. `femupdate diagnose` looks for what is missing."
        )
    return CompareReport(
        before=before,
        after=after,
        names=first.names,
        changes=changes(np.log(first.samples), np.log(second.samples)),
        notes=tuple(notes),
    )


def _share(value: float) -> str:
    """A probability, never rounded to certainty."""
    if value > 0.999:
        return "over 99.9 %"
    return "under 0.1 %" if value < 0.001 else f"{100.0 * value:.3g} %"


def _change(log: float, sd: float) -> str:
    """A change of ln theta as a percentage with its standard deviation."""
    percent, spread = 100.0 * float(np.expm1(log)), 100.0 * float(np.exp(log)) * sd
    return f"{'+' if percent > 0.0 else ''}{with_unit(percent, spread, '%')}"
