"""status: what a study holds, what is stale, and what to do next. Reads only, and fast."""

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from femupdate.building.document import Building, mechanics_hash, without_effects
from femupdate.building.files import load_building
from femupdate.result import Item, Note, Notes, Result
from femupdate.study import (
    BESIDE,
    BUILDING_FILE,
    MAIN_POSTERIOR,
    REPAIRED,
    Artefact,
    Study,
    file_hash,
    owner_of,
)
from femupdate.tables import Table
from femupdate.units import capital
from femupdate.workflow.summary import kept_summary

CURRENT, STALE, DAMAGED, MISSING = "current", "stale", "changed by hand", "missing"
# Commands that need no files. Others do their work on the way, and so much more as well.
_ALONE = ("build-model", "train")
_REPAIRED_POSTERIOR = (MAIN_POSTERIOR, "repair", REPAIRED)  # its name, command and folder


@dataclass(frozen=True, kw_only=True)
class Holding:
    """One thing that a study holds.

    Attributes:
        name: such as "posterior".
        file: inside the study.
        state: "current", "stale", "changed by hand" or "missing".
        reason: why it is stale.
        command: what made it.
        version: of femupdate.
        created: UTC time, ISO 8601.
        sources: files that it was made from.
        again: the command, with all it needs, that makes it again.
    """

    name: str
    file: str
    state: str
    reason: str
    command: str
    version: str
    created: str
    sources: tuple[str, ...]
    again: str


@dataclass(frozen=True, kw_only=True)
class StatusReport(Result):
    """What a study holds.

    Attributes:
        folder: of the study.
        building: name and title; None where there is none yet.
        holds: things, in the order in which they were made.
        unfinished: computations that can be resumed, in sentences.
        warnings: what the posterior says of itself.
        studies: folders of studies inside this one.
        next: commands to run, each with its reason.
    """

    folder: Path
    building: str | None
    holds: tuple[Holding, ...]
    unfinished: tuple[str, ...]
    warnings: tuple[str, ...]
    studies: tuple[Path, ...]
    next: tuple[tuple[str, str], ...]

    def state(self, name: str) -> str | None:
        """State of an item; None where the study has none of the name."""
        return next((item.state for item in self.holds if item.name == name), None)

    def items(self) -> Iterator[Item]:
        """What it holds in a table, warnings and the next commands."""
        yield Note(
            f"Study {self.folder}: {self.building or 'no building yet'}",
            {
                "study": self.folder,
                "building": self.building,
                "items": [asdict(thing) for thing in self.holds],
                "unfinished": self.unfinished,
                "warnings": self.warnings,
                "studies": self.studies,
                "next": [{"command": command, "because": reason} for command, reason in self.next],
            },
        )
        if self.holds:
            states = [
                f"{thing.state}{': ' if thing.reason else ''}{thing.reason}" for thing in self.holds
            ]
            width = max(map(len, states))
            rows = [
                (thing.name, state.ljust(width), thing.created)
                for thing, state in zip(self.holds, states, strict=True)
            ]
            yield Table.of(("holds", "state".ljust(width), "made (UTC)"), rows)
        yield Notes((*self.unfinished, *self.warnings))
        yield from (Note(f"  also a study: {folder}") for folder in self.studies)
        if self.next:
            yield Note("Next")
        yield from (Note(f"  {command}\n      {reason}") for command, reason in self.next)


def study_status(study: Study) -> StatusReport:
    """Look at everything that a study holds; changes nothing.

    Raises:
        StudyError: the record of the study cannot be read.
        BuildingError: its building file cannot be used.
    """
    return _Look(study).report()


class _Look:
    """One look at a study.

    Args:
        study: to look at.
    """

    def __init__(self, study: Study) -> None:
        self.study = study
        self.artefacts = study.artefacts()
        path = study.path(BUILDING_FILE)
        self.building: Building | None = load_building(path) if path.exists() else None

    def report(self) -> StatusReport:
        """Everything."""
        known = self.building
        return StatusReport(
            folder=self.study.folder,
            building=None if known is None else f"{known.name} ({known.title or known.name})",
            holds=self.holds,
            unfinished=self._unfinished(),
            warnings=self._warnings(),
            studies=self._studies(),
            next=self._next(),
        )

    @cached_property
    def holds(self) -> tuple[Holding, ...]:
        """All that is recorded, in the order in which it was made."""
        made = sorted(self.artefacts.items(), key=lambda pair: pair[1].created)
        return tuple(self._item(name, artefact) for name, artefact in made)

    def _item(self, name: str, artefact: Artefact) -> Holding:
        state, reason = self._state(name, artefact)
        return Holding(
            name=name,
            file=artefact.file,
            state=state,
            reason=reason,
            command=artefact.command,
            version=artefact.version,
            created=artefact.created,
            sources=sources_of(artefact),
            again=self._again(name, artefact),
        )

    def _again(self, name: str, artefact: Artefact) -> str:
        """The command that makes an item again: as it was called, else as far as it is known."""
        words = artefact.settings.get("words", ())
        if words and (words[0] == artefact.command or artefact.command not in _ALONE):
            return shlex.join(words)
        words = [artefact.command, *sources_of(artefact)]
        if artefact.command == "predict":
            words.insert(1, "--record")
        for option, file in files_beside_of(artefact).items():
            words += [f"--{option}", file]
        if owner_of(name) != MAIN_POSTERIOR:
            option = "--name" if artefact.command == "calibrate" else "--posterior"
            words += [option, owner_of(name)]
        return shlex.join(words)

    def _state(self, name: str, artefact: Artefact) -> tuple[str, str]:
        path = self.study.path(artefact.file)
        if not path.exists():
            return MISSING, ""
        if file_hash(path) != artefact.sha256:
            return DAMAGED, ""
        seen = Study(self.study.folder, owner_of(name))
        changed = [
            key for key, value in artefact.made_from.items() if self._differs(seen.key(key), value)
        ]
        changed += self._changed_files(artefact)
        if changed:
            return STALE, f"the {' and the '.join(dict.fromkeys(changed))} changed since"
        return CURRENT, ""

    def _differs(self, key: str, value: str) -> bool:
        """Whether what an artefact was made from is another thing now."""
        if key == "building":
            return bool(self.hashes) and value not in self.hashes
        other = self.artefacts.get(key)
        return other is not None and other.sha256 != value

    @cached_property
    def hashes(self) -> tuple[str, ...]:
        """Of the building, and of it without its effects, from which the finder's basis is made."""
        if self.building is None:
            return ()
        return mechanics_hash(self.building), mechanics_hash(without_effects(self.building))

    def _changed_files(self, artefact: Artefact) -> list[str]:
        """Sources that are still where they were but have another content."""
        hashes = set(artefact.made_from.values())
        names = (*sources_of(artefact), *files_beside_of(artefact).values())
        there = [Path(name) for name in names if Path(name).is_file()]
        return [f"file {path.name}" for path in there if file_hash(path) not in hashes]

    def _unfinished(self) -> tuple[str, ...]:
        told = []
        if "surrogate" not in self.artefacts and self.study.path("dataset").exists():
            told.append("A training was interrupted; `femupdate train` goes on where it stopped.")
        return tuple(told)

    def _warnings(self) -> tuple[str, ...]:
        """Notes of the calibration, kept beside the chosen posterior."""
        name = self.study.key("posterior")
        if name not in self.artefacts:
            return ()
        notes = kept_summary(self.study).get("notes", ())
        return tuple(f"{capital(name)}: {note}" for note in notes)

    def _studies(self) -> tuple[Path, ...]:
        return tuple(path.parent for path in sorted(self.study.folder.glob("*/study.json")))

    def _next(self) -> tuple[tuple[str, str], ...]:
        """What to run, and why, in the order of the work."""
        if self.building is None:
            reason = "The study has no building yet; NAME is a file or one of `femupdate list`."
            return ((self._say("build-model NAME"), reason),)
        again = [
            (
                self._say(item.again, item),
                f"The {item.name} is {item.state}. {_sentence(item.reason)}",
            )
            for item in self.holds
            if item.state != CURRENT
        ]
        if again:
            return tuple(dict(again).items())
        if not self.study.posteriors():
            reason = "Nothing is calibrated yet; OBSERVATION is a measured file."
            return ((self._say("calibrate OBSERVATION"), reason),)
        shown = self._shown()
        option = "" if shown.posterior == MAIN_POSTERIOR else f" --posterior {shown.posterior}"
        if shown.key("prediction") not in self.artefacts:
            reason = "Nothing is predicted yet; RECORD is a ground motion."
            return ((self._say(f"predict --record RECORD{option}"), reason),)
        reason = "Everything is current; this writes the page to hand on."
        report = (self._say(f"report{option}"), reason)
        repaired = self.study.path(REPAIRED)
        if repaired not in self._studies():
            return (report,)
        command = f"femupdate report --study {shlex.quote(str(repaired))}"
        return (report, (command, "The same of the building that `repair` made."))

    def _shown(self) -> Study:
        """The study with the chosen posterior, or the first that it holds."""
        have = self.study.posteriors()
        if self.study.posterior in have:
            return self.study
        return Study(self.study.folder, have[0])

    def _say(self, command: str, item: Holding | None = None) -> str:
        where = self.study.folder
        # A repair is asked of the study of the building as it was, and writes into one inside it.
        if item is not None and (item.name, item.command, where.name) == _REPAIRED_POSTERIOR:
            where = where.parent
        folder = shlex.quote(str(where))
        return f"femupdate {command}" + ("" if folder == "study" else f" --study {folder}")


def sources_of(artefact: Artefact) -> tuple[str, ...]:
    """Files outside the study that an artefact was made from, as they were named."""
    settings: Mapping[str, Any] = artefact.settings
    first = settings.get("file")
    return () if first is None else (str(first), *map(str, settings.get("further", ())))


def files_beside_of(artefact: Artefact) -> Mapping[str, str]:
    """Files beside those, by the option that named them."""
    return {key: str(artefact.settings[key]) for key in BESIDE if key in artefact.settings}


def _sentence(reason: str) -> str:
    return f"{capital(reason)}." if reason else ""
