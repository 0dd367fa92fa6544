"""What all sections of the page are made from, with the sections on steps, files and warnings."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from femupdate.building.parameters import factor_titles
from femupdate.dynamics.system import System
from femupdate.errors import StudyError
from femupdate.inference.posterior import Posterior
from femupdate.report.page import Block, Remarks, Section, Text
from femupdate.report.page_finder import diagnosis_blocks, repair_blocks
from femupdate.storage import read_tree
from femupdate.study import BUILDING_FILE, REPAIRED, Artefact, Study, as_written, file_hash
from femupdate.tables import Table
from femupdate.workflow.mesh_error import open_system
from femupdate.workflow.model import StudyModel
from femupdate.workflow.modes import StudyMode, find_modes, posterior_modes
from femupdate.workflow.status import CURRENT, Holding, StatusReport, files_beside_of, sources_of
from femupdate.workflow.summary import kept_summary, parameter_titles

_MODES = 6


@dataclass(frozen=True, eq=False)
class PageStudy:
    """A study as the page sees it.

    Attributes:
        study: the folder.
        model: of the study.
        status: what it holds.
        posterior: None where there is none that fits the building.
    """

    study: Study
    model: StudyModel
    status: StatusReport
    posterior: Posterior | None

    @cached_property
    def system(self) -> System:
        """The model with its effects."""
        return open_system(self.study, self.model)

    @cached_property
    def modes(self) -> tuple[StudyMode, ...]:
        """Some modes over the posterior, those that matter most to the data first."""
        if self.posterior is None:
            return ()
        full = find_modes(self.study, self.model)
        return posterior_modes(self.model, self.posterior, full, _MODES)

    @cached_property
    def prediction(self) -> Any:
        """What `predict` kept, as an xarray tree; None where there is nothing.

        Raises:
            StudyError: the file is missing or damaged.
        """
        if self.state("prediction") is None:
            return None
        path = self.study.require("prediction", "predict --record FILE")
        try:
            return read_tree(path)
        except Exception as error:
            raise StudyError(
                f"{path} cannot be read; run `femupdate predict --record FILE` again"
            ) from error

    @cached_property
    def titles(self) -> Mapping[str, str]:
        """What every parameter of the posterior is of."""
        names = () if self.posterior is None else self.posterior.names
        return parameter_titles(self.model.building, names)

    def state(self, name: str) -> str | None:
        """State of a thing that the study may hold, of the posterior that the page shows."""
        return self.status.state(self.study.key(name))

    def recorded(self, name: str) -> Artefact:
        """What the study has recorded of a thing that it holds."""
        return self.study.artefacts()[self.study.key(name)]


def searched(page: PageStudy) -> Study:
    """The study whose diagnosis and repair the page shows."""
    own = page.study
    if own.folder.name == REPAIRED and not own.path("repair.json").exists():
        return Study(own.folder.parent)
    return own


_SHORT = 16  # figures of a hash that are shown


def done_section(page: PageStudy) -> Section:
    """Steps with version, time and files."""
    blocks: list[Block] = []
    rows = tuple(_row(page.study, item) for item in page.status.holds)
    blocks.append(
        Table.of(
            name="what_was_done",
            caption="Steps, in the order in which they were made",
            head=("result", "by", "version", "time (UTC)", "state", "file", "SHA-256"),
            rows=rows,
            note=f"The first {_SHORT} figures of each hash; the whole ones are in study.json.",
        )
    )
    building = (BUILDING_FILE, file_hash(page.study.path(BUILDING_FILE))[:_SHORT])
    used: dict[tuple[str, str], list[str]] = {building: ["the building, as the study keeps it"]}
    for item in page.status.holds:
        for key in _sources(page.study.artefacts()[item.name], item.sources):
            used.setdefault(key, []).append(item.name)
    for key, name in _of_repair(page):
        used.setdefault(key, []).append(name)
    blocks.append(
        Table.of(
            name="files_used",
            caption="Files that were used",
            head=("file", "for", "SHA-256 when used"),
            rows=tuple((file, ", ".join(names), hash_) for (file, hash_), names in used.items()),
        )
    )
    return Section("done", "What was done", tuple(blocks))


def bad_items(page: PageStudy) -> tuple[str, ...]:
    """What is stale, damaged or missing, in sentences."""
    return tuple(_bad(item) for item in page.status.holds if item.state != CURRENT)


def _bad(item: Holding) -> str:
    reason = f": {item.reason}" if item.reason else ""
    return f"The {item.name} is {item.state}{reason}. What this page shows of it does not hold."


def _row(study: Study, item: Holding) -> tuple[str, ...]:
    digest = study.artefacts()[item.name].sha256[:_SHORT]
    command = f"femupdate {item.command}"
    time = item.created.replace("T", " ")[:16]
    return (item.name, command, item.version, time, item.state, item.file, digest)


def _of_repair(page: PageStudy) -> list[tuple[tuple[str, str], str]]:
    """Files of the diagnosis and the repair that made the building of a repaired study."""
    folder = searched(page)
    if folder.folder == page.study.folder:
        return []
    recorded = folder.artefacts()
    return [
        (key, f"{name} that made this model")
        for name in ("diagnosis", "repair")
        if name in recorded
        for key in _sources(recorded[name], sources_of(recorded[name]))
    ]


def _sources(artefact: Artefact, sources: Sequence[str]) -> list[tuple[str, str]]:
    """Files outside the study, each with the hash that it had."""
    recorded = artefact.made_from
    hashes = [recorded[key] for key in recorded if key.startswith(("observation", "record"))]
    hashes += [""] * (len(sources) - len(hashes))
    beside = files_beside_of(artefact)
    hashes += [recorded.get(option, "") for option in beside]
    pairs = zip((*sources, *beside.values()), hashes, strict=True)
    return [(Path(name).name, digest[:_SHORT]) for name, digest in pairs]


def finder_section(page: PageStudy) -> Section:
    """Diagnosis and repair of this study; of a repaired one, the repair that made it."""
    folder = searched(page)
    blocks: list[Block] = []
    with as_written(path := folder.path("diagnosis.json")):
        if diagnosis := read_json(path):
            blocks += diagnosis_blocks(diagnosis)
    with as_written(path := folder.path("repair.json")):
        if repair := read_json(path):
            blocks += repair_blocks(repair, list(factor_titles(page.model.building).values()))
    if not blocks:
        text = "Nobody has looked for effects that the model lacks; femupdate diagnose does."
        blocks = [Text((text,))]
    return Section("finder", "What the model lacks", tuple(blocks))


def warnings_section(page: PageStudy) -> Section:
    """What the posterior says of itself, unfinished work, and how to read the page."""
    told = () if page.posterior is None else page.posterior.observation.notes
    notes = tuple(note for note in posterior_notes(page) if note not in told)
    blocks: list[Block] = []
    if notes:
        blocks.append(Text(("Stored with the posterior:",)))
        blocks.append(Remarks(notes))
    if page.status.unfinished:
        blocks.append(Remarks(page.status.unfinished, warning=True))
    blocks.append(
        Text(
            (
                "Intervals are those of the posterior: with the model, the priors and the noise "
                "as stated, the value lies inside with the probability given. They do not cover "
                "errors that the notes name and that nothing on this page accounts for.",
            )
        )
    )
    return Section("notes", "Notes and warnings", tuple(blocks))


def posterior_notes(page: PageStudy) -> tuple[str, ...]:
    """Every note and warning kept with the posterior, in its summary or in its file."""
    kept = kept_summary(page.study)
    found = [str(note) for key in ("notes", "warnings") for note in kept.get(key) or ()]
    settings = {} if page.posterior is None else page.posterior.settings
    found += [str(note) for key in ("notes", "warnings") for note in settings.get(key) or ()]
    return tuple(dict.fromkeys(found))


def read_json(path: Path) -> dict[str, Any]:
    """A JSON object of the study; empty where the file is missing."""
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}
