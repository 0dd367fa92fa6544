"""report: everything that a study says, on one page to hand on."""

import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from femupdate import __version__
from femupdate.errors import StudyError
from femupdate.progress import SILENT, Progress
from femupdate.report.page import Image, added_section, write_page
from femupdate.result import Note, Notes, Told
from femupdate.study import BUILDING_FILE, Study, study_of
from femupdate.workflow.calibration_report import kept_calibration
from femupdate.workflow.model import open_study
from femupdate.workflow.page import PageStudy, appendix, page_sections
from femupdate.workflow.predict import kept_prediction
from femupdate.workflow.status import DAMAGED, MISSING, PAGE, STALE, study_status


def write_report(
    study: Study | Path | str,
    path: Path | str | None = None,
    *,
    title: str | None = None,
    author: str | None = None,
    client: str | None = None,
    logo: Path | str | None = None,
    add: Sequence[Path | str] = (),
    progress: Progress = SILENT,
) -> Told:
    """Write everything that a study says on one HTML page; nothing else in it changes.

    Args:
        study: with a building at least.
        path: of the page; by default `report.html` in the study.
        title: of the page; by default that of the building.
        author, client: who stand below the title.
        logo: PNG or JPEG file beside it.
        add: pictures (PNG, JPEG) and texts (.md, .txt), a section of the page each.

    Raises:
        StudyError: the study holds no building, or what the page shows is damaged.
        ReportError: the page cannot be written or is too large, or a file cannot stand on it.
    """
    started, study = time.monotonic(), study_of(study)
    if not study.path(BUILDING_FILE).exists():
        raise StudyError(
            f"the study {study.folder} holds no building; run `{study.made_by('calibrate')}` first"
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
    picture = None if logo is None else Image.of(Path(logo))
    extra = [added_section(Path(file), f"added-{k}") for k, file in enumerate(add, 1)]
    progress.start("Writing the page", 2)
    sections = (*page_sections(page), *extra, appendix(page))
    progress.advance()
    building = model.building
    written = write_page(
        Path(path or study.result(PAGE)),
        sections,
        title=title or building.title or building.name,
        subtitle="Stiffness from measured vibration, with its uncertainty",
        made=f"femupdate {__version__}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        credits=credits,
        logo=picture,
    )
    size, seconds = written.stat().st_size, time.monotonic() - started
    shown = tuple(section.title for section in sections if section.blocks)
    stale = tuple(f"{held.name}: {held.state}" for held in status.holds if held.state == STALE)
    text = f"Report of {len(shown)} sections, {size / 1e6:.1f} MB, {seconds:.1f} s"
    return Told(
        (
            Note(text, {"bytes": size, "sections": shown, "seconds": seconds}),
            Notes(stale, key="stale"),
            Note(f"  {written}", {"report": written}),
        )
    )
