"""femupdate build-model and train: what is made of a building before anything is measured."""

from pathlib import Path
from typing import Any

import click

from femupdate import Study
from femupdate.bars import Bars

from .common import (
    NEW_FILE,
    Answer,
    building_option,
    check_free,
    flag,
    option,
    overwrite_option,
    study_options,
)
from .group import GroupedCommand
from .parameters import BUILDING_NAME


@click.command("build-model", cls=GroupedCommand)
@click.argument("building", type=BUILDING_NAME, required=False)
@option(
    "--units --unit",
    "Units of another program's model, such as N,mm, where it does not tell them.",
    metavar="FORCE,LENGTH",
)
@option(
    "--draft",
    "Write a building file for a model, to add sensors and priors to; build that.",
    NEW_FILE,
)
@option(
    "--export",
    "Also write the model for another program: a script for OpenSeesPy, or bulk data.",
    click.Choice(["opensees", "nastran"]),
)
@overwrite_option
@study_options()
def build_model(
    building: str | None,
    units: str | None,
    draft: Path | None,
    export: str | None,
    overwrite: bool,
    study: Study,
    seed: int,
    bars: Bars,
) -> Answer:
    """Build the model of BUILDING: mesh, checks, modes, pictures, reduced model.

    With -v it lists effective masses, their sums, and how many modes move 90 %.

    BUILDING is a TOML file, a model of Nastran (.bdf), OpenSees (.json), SAP2000 (.s2k) or
    ETABS (.e2k), or the name of a shipped building. The default is the building of the
    study, or six_story_wall_frame in a new study.

    \b
    Examples:
      femupdate build-model six_story_wall_frame
      femupdate build-model my_building.toml --study mine
      femupdate build-model tower.bdf --units N,mm --draft tower.toml --study tower
    """
    from femupdate.workflow.build import EXPORTS
    from femupdate.workflow.build import build_model as build

    files = []
    if draft is not None:
        check_free(draft, overwrite)
        files.append(draft)
    if export is not None:
        files.append(study.path(EXPORTS[export]))
    how: dict[str, Any] = {"units": units, "draft": draft, "export": export}
    report = build(study, building, progress=bars, **how)
    return Answer(report, {"exported": files, "study": study.folder}, files=tuple(files))


@click.command("train", cls=GroupedCommand)
@building_option
@option(
    "--samples",
    "Simulated responses to learn from: more make the surrogate more precise.",
    click.IntRange(100),
    50000,
)
@option(
    "--epochs",
    "Passes of the training over all samples (epochs).",
    click.IntRange(1),
    16,
)
@option("--batch", "Samples in one step of the training.", click.IntRange(8), 512)
@flag("--fresh", "Train even where a fitting surrogate exists.")
@option("--device", "Device for torch: cpu, cuda, ...", default="cpu")
@study_options(draws=False)
def train(study: Study, bars: Bars, **asked: Any) -> Answer:
    """Train the surrogate of the study's building.

    It takes some minutes. A longer training, with more samples and epochs, reduces the number of
    responses that a calibration needs afterwards.

    It does nothing where a trained surrogate (the study's own or a shipped one) fits the building.

    \b
    Examples:
      femupdate train --study mine
      femupdate train --building my_building.toml --study mine --samples 100000 --epochs 45
    """
    from femupdate import interface

    return Answer(interface.train(study, progress=bars, **asked), {"study": study.folder})
