"""report: everything that a study says, on one page to hand on."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from femupdate import __version__
from femupdate.errors import StudyError
from femupdate.progress import SILENT, Progress
from femupdate.report.page import Page, added_section, require_picture, write_page
from femupdate.result import Item, Note, Notes, Result
from femupdate.study import BUILDING_FILE, Study
from femupdate.workflow.calibration_report import kept_calibration
from femupdate.workflow.model import open_study
from femupdate.workflow.page import PageStudy, appendix, page_sections
from femupdate.workflow.predict import kept_prediction
from femupdate.workflow.status import DAMAGED, MISSING, STALE, study_status

PAGE = "report.html"


@dataclass(frozen=True, kw_only=True)
class ReportReport(Result):
    """The page that was written, of `size` bytes; `stale` things on it no longer hold."""

    path: Path
    size: int
    sections: tuple[str, ...]
    stale: tuple[str, ...]
    seconds: float

    def items(self) -> Iterator[Item]:
        """What the page holds, and where it is."""
        yield Note(
            f"Report of {len(self.sections)} sections, {self.size / 1e6:.1f} MB, "
            f"{self.seconds:.1f} s",
            {"bytes": self.size, "sections": self.sections, "seconds": self.seconds},
        )
        yield Notes(self.stale, key="stale")
        yield Note(f"  {self.path}", {"report": self.path})


def report_study(
    study: Study,
    path: Path | None = None,
    progress: Progress = SILENT,
    *,
    title: str | None = None,
    author: str | None = None,
    client: str | None = None,
    logo: Path | None = None,
    added: Sequence[Path] = (),
) -> ReportReport:
    """Write the page of a study; changes nothing else in it.

    Args:
        study: with a building at least.
        path: of the page; default `report.html` in the study.
        title: of the page; default that of the building.
        author, client: who stand below the title.
        logo: a picture beside it.
        added: pictures and texts, a section of the page each.

    Raises:
        StudyError: the study holds no building, or what the page shows is damaged.
        ReportError: the page cannot be written or is too large, or a file cannot stand on it.
    """
    started = time.monotonic()
    if not study.path(BUILDING_FILE).exists():
        raise StudyError(
            f"the study {study.folder} holds no building; run `femupdate calibrate` first"
        )
    status = study_status(study)
    model = open_study(study, None, progress)
    whole = status.state(study.key("posterior")) not in (None, MISSING, DAMAGED)
    page = PageStudy(
        study,
        model,
        status,
        kept_calibration(study, model) if whole else None,
        None if status.state(study.key("prediction")) is None else kept_prediction(study, model),
    )
    names = {"Client": client, "Author": author}
    credits = tuple(f"{role}: {name}" for role, name in names.items() if name)
    picture = None if logo is None else require_picture(logo)
    extra = [added_section(file, f"added-{k}") for k, file in enumerate(added, 1)]
    progress.start("Writing the page", 2)
    sections = (*page_sections(page), *extra, appendix(page))
    progress.advance()
    building = model.building
    written = write_page(
        Page(
            title=title or building.title or building.name,
            subtitle="Stiffness from measured vibration, with its uncertainty",
            made=f"femupdate {__version__}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
            credits=credits,
            logo=picture,
            sections=sections,
        ),
        path or study.result(PAGE),
    )
    return ReportReport(
        path=written,
        size=written.stat().st_size,
        sections=tuple(section.title for section in sections if section.blocks),
        stale=tuple(f"{held.name}: {held.state}" for held in status.holds if held.state == STALE),
        seconds=time.monotonic() - started,
    )
