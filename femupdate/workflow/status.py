"""status: what a study holds, what is stale, and what to do next. Reads only, and fast."""

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from femupdate.building.document import Building, mechanics_hash, without_effects
from femupdate.building.files import load_building
from femupdate.result import Item, Note, Notes, Result, wrapped
from femupdate.study import (
    BESIDE,
    BUILDING_FILE,
    MAIN_POSTERIOR,
    MANIFEST,
    REPAIRED,
    Artefact,
    Study,
    as_written,
    file_hash,
    owner_of,
    typed,
)
from femupdate.tables import Table
from femupdate.units import capital

PAGE = "report.html"
CURRENT, STALE, DAMAGED, MISSING = "current", "stale", "changed by hand", "missing"
# Commands that need no files. Others do their work on the way, and so much more as well.
_ALONE = ("build-model", "train")
_REPAIRED_POSTERIOR = (MAIN_POSTERIOR, "repair", REPAIRED)  # its name, command and folder


@dataclass(frozen=True, kw_only=True)
class Holding:
    """One thing that a study holds.

    Attributes:
        state: "current", "stale", "changed by hand" or "missing".
        created: UTC time, ISO 8601.
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
        building: name and title; None where there is none yet.
        holds: things, in the order in which they were made.
        stale: sentences on what no longer holds, with the command that makes it again.
        first: lines that `calibrate`, the page and this begin with.
        warnings: what the posterior says of itself.
        studies: folders of studies inside this one.
        next: commands to run, each with its reason.
    """

    folder: Path
    building: str | None
    holds: tuple[Holding, ...]
    stale: tuple[str, ...]
    first: tuple[str, ...]
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
                "unfinished": (),  # what is half done is made anew
                "stale": self.stale,
                "first": self.first,
                "warnings": self.warnings,
                "studies": self.studies,
                "next": [{"command": command, "because": reason} for command, reason in self.next],
            },
        )
        yield from map(Note, map(wrapped, (*self.stale, *self.first)))
        if self.holds:
            states = [
                f"{thing.state}{': ' if thing.reason else ''}{thing.reason}" for thing in self.holds
            ]
            width = max(map(len, states))
            rows = [
                (thing.name, state.ljust(width), thing.created[:19])
                for thing, state in zip(self.holds, states, strict=True)
            ]
            yield Table.of(("holds", "state".ljust(width), "made (UTC)"), rows)
        yield Notes(self.warnings)
        yield from (Note(f"  also a study: {folder}") for folder in self.studies)
        yield Note("Next" if self.next else "Everything is current, and the page is written.")
        yield from (Note(f"  {command}\n      {reason}") for command, reason in self.next)


def study_status(study: Study) -> StatusReport:
    """Look at everything that a study holds; changes nothing.

    Raises:
        StudyError: the record of the study cannot be read.
        BuildingError: its building file cannot be used.
    """
    artefacts, path = study.artefacts(), study.path(BUILDING_FILE)
    building = load_building(path) if path.exists() else None
    name = None if building is None else f"{building.name} ({building.title or building.name})"
    # In the order in which they were made.
    made = sorted(artefacts.items(), key=lambda pair: pair[1].created)
    holds = tuple(_holding(study, building, artefacts, *pair) for pair in made)
    kept = study.summary() if study.key("posterior") in artefacts else {}
    studies = tuple(path.parent for path in sorted(study.folder.glob("*/study.json")))
    stale, again = list[str](), dict[str, str]()
    for item in holds:
        if item.state != CURRENT:
            command = _typed(study, item.again, item)
            reason = f" {capital(item.reason)}." if item.reason else ""
            again[command] = f"The {item.name} is {item.state}.{reason or ' '}"
            stale.append(
                f"The {item.name} is {item.state}{': ' if item.reason else ''}{item.reason}. What "
                f"is said of it does not hold; `{command}` makes it again."
            )
    following = tuple(again.items()) or _next(study, artefacts, studies)
    if building is None:
        reason = "The study has no building yet; NAME is a file or one of `femupdate list`."
        following = ((_typed(study, "build-model NAME"), reason),)
        if study.folder.name == REPAIRED:
            reason = "It adds what the model lacks, and nothing was added yet."
            following = ((study.made_by("repair"), reason),)
    return StatusReport(
        folder=study.folder,
        building=name,
        holds=holds,
        stale=tuple(stale),
        first=(*kept.get("first", ()), *lacking(study)),
        warnings=tuple(
            f"{capital(study.key('posterior'))}: {text}" for text in kept.get("warnings", ())
        ),
        studies=studies,
        next=following,
    )


@contextmanager
def found(study: Study, name: str) -> Iterator[tuple[Path, dict[str, Any]]]:
    """What a diagnosis or a repair has kept, empty where there is none, to be used, and its file.

    A repaired study without one of its own has that which made it.
    """
    path = study.path(f"{name}.json")
    if study.folder.name == REPAIRED and not path.exists():
        path = study.folder.parent / path.name
    with as_written(path):
        yield path, dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def lacking(study: Study) -> Iterator[str]:
    """The verdict of a diagnosis on the model as it was, and the repair that followed."""

    def data(path: Path) -> str:  # which may be others than those of the posterior
        artefact = Study(path.parent).artefacts().get(path.stem)
        return ", ".join(Path(file).name for file in sources_of(artefact)) if artefact else "data"

    with found(study, "diagnosis") as (path, kept):
        if kept:
            lacks = "lacks" if path.parent == study.folder else "lacked"
            yield f"What the model {lacks} by {data(path)}: {kept['verdict']}. {kept['sentence']}"
    with found(study, "repair") as (path, kept):
        if kept and (names := "; ".join(added["in_words"] for added in kept["rounds"])):
            here = path.parent == study.folder
            which = "A repaired model has a page of its own" if here else "This model was repaired"
            yield (
                f"{which}. Added to it: {names}. Residuals of {data(path)} fell from "
                f"{kept['chi2_before']:.0f} to {kept['chi2_after']:.0f} over "
                f"{kept['independent_points']:.0f} independent points."
            )
        elif kept:
            yield f"A repair by {data(path)} added nothing ({kept['verdict']}). {kept['sentence']}"


def _holding(
    study: Study,
    building: Building | None,
    artefacts: Mapping[str, Artefact],
    name: str,
    artefact: Artefact,
) -> Holding:
    """The state of an item, and the command that makes it again, as far as it is known."""
    sources, beside = sources_of(artefact), files_beside_of(artefact)
    words = artefact.settings.get("words", ())
    if not words or (words[0] != artefact.command and artefact.command in _ALONE):
        words = [artefact.command, *["--record"] * (artefact.command == "predict"), *sources]
        words += [word for option, file in beside.items() for word in (f"--{option}", file)]
        if owner_of(name) != MAIN_POSTERIOR:
            option = "--name" if artefact.command == "calibrate" else "--posterior"
            words += [option, owner_of(name)]
    path, state, reason = study.path(artefact.file), CURRENT, ""
    if not path.exists():
        state = MISSING
    elif file_hash(path) != artefact.sha256:
        state = DAMAGED
    else:
        seen, changed = Study(study.folder, owner_of(name)), []
        for key, value in artefact.made_from.items():
            other = artefacts.get(seen.key(key))
            if key != "building":
                differs = other is not None and other.sha256 != value
            else:
                # The finder's basis is made from the building without its effects.
                both = [] if building is None else [building, without_effects(building)]
                differs = bool(both) and value not in map(mechanics_hash, both)
            changed += [key] if differs else []
        # Sources that are still where they were but have another content.
        hashes = set(artefact.made_from.values())
        there = [file for file in map(Path, (*sources, *beside.values())) if file.is_file()]
        changed += [f"file {file.name}" for file in there if file_hash(file) not in hashes]
        if changed:
            state, reason = STALE, f"the {' and the '.join(dict.fromkeys(changed))} changed since"
    return Holding(
        name=name,
        file=artefact.file,
        state=state,
        reason=reason,
        command=artefact.command,
        version=artefact.version,
        created=artefact.created,
        sources=sources,
        again=shlex.join(words),
    )


def _next(
    study: Study, artefacts: Mapping[str, Artefact], studies: Sequence[Path]
) -> tuple[tuple[str, str], ...]:
    """What to run where all is current, and why, in the order of the work."""
    have = study.posteriors()
    if not have:
        reason = "Nothing is calibrated yet; OBSERVATION is a measured file."
        return ((_typed(study, "calibrate OBSERVATION"), reason),)
    # The chosen posterior, or the first that there is.
    shown = study if study.posterior in have else Study(study.folder, have[0])
    option = "" if shown.posterior == MAIN_POSTERIOR else f" --posterior {shown.posterior}"
    if shown.summary().get("warnings") and not {"diagnosis", "repair"} & {*artefacts}:
        files = shlex.join(sources_of(artefacts[shown.key("posterior")]))
        reason = "The posterior is to be used with care; this looks for what is missing."
        return ((_typed(study, f"diagnose {files}"), reason),)
    repaired = study.path(REPAIRED)
    with found(study, "diagnosis") as (_, kept):
        named = "diagnosis" in artefacts and kept["verdict"] in ("named", "partly")
    tried = [sources_of(artefacts[name]) for name in ("diagnosis", "repair") if name in artefacts]
    if named and tried[:1] != tried[1:] and repaired not in studies:
        reason = "The diagnosis names what is missing; this adds it to the model."
        return ((_typed(study, f"repair {shlex.join(tried[0])}"), reason),)
    known = artefacts
    if repaired in studies:
        shown, option = Study(repaired), ""
        known = shown.artefacts()
    if shown.key("prediction") not in known:
        reason = "Nothing is predicted yet; RECORD is a ground motion."
        return ((_typed(shown, f"predict --record RECORD{option}"), reason),)
    reason = "Everything is current; this writes the page to hand on."
    pages = [(_typed(shown, f"report{option}"), reason, shown)]
    if shown.folder != study.folder:
        pages += [(_typed(study, "report"), "The same of the building before `repair`.", study)]
    # But for those that are written, and nothing was recorded since.
    return tuple(
        (command, why)
        for command, why, of in pages
        for page, record in [(of.result(PAGE), of.path(MANIFEST))]
        if not page.exists() or page.stat().st_mtime < record.stat().st_mtime
    )


def _typed(study: Study, command: str, item: Holding | None = None) -> str:
    """A command as it is typed, with the study where it is not the usual one."""
    where = study.folder
    # A repair is asked of the study of the building as it was, and writes into one inside it.
    if item is not None and (item.name, item.command, where.name) == _REPAIRED_POSTERIOR:
        where = where.parent
    return typed(command, where / BUILDING_FILE)


def sources_of(artefact: Artefact) -> tuple[str, ...]:
    """Files outside the study that an artefact was made from, as they were named."""
    settings: Mapping[str, Any] = artefact.settings
    first = settings.get("file")
    return () if first is None else (str(first), *map(str, settings.get("further", ())))


def files_beside_of(artefact: Artefact) -> Mapping[str, str]:
    """Files beside those, by the option that named them."""
    return {key: str(artefact.settings[key]) for key in BESIDE if key in artefact.settings}
