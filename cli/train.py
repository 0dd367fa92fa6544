"""femupdate train."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import study_options
from .help import GroupedCommand
from .parameters import BuildingName


@click.command("train", cls=GroupedCommand)
@click.option("--building", type=BuildingName(), help="Shipped name or TOML file, for a new study.")
@click.option(
    "--thorough",
    is_flag=True,
    help="Twice the samples and three times the epochs: some six times as long.",
)
@click.option(
    "--samples",
    type=click.IntRange(min=100),
    show_default="50000; 100000 with --thorough",
    help="Simulated responses to learn from: more make the surrogate more precise.",
)
@click.option(
    "--epochs",
    type=click.IntRange(min=1),
    show_default="16; 45 with --thorough",
    help="Passes of the training over all samples (epochs).",
)
@click.option(
    "--batch",
    type=click.IntRange(min=8),
    default=512,
    show_default=True,
    help="Samples in one step of the training.",
)
@click.option(
    "--learning-rate",
    type=click.FloatRange(min=1e-7),
    default=3e-3,
    show_default=True,
    help="Largest learning rate.",
)
@click.option(
    "--roof-share",
    type=click.FloatRange(0.0, 1.0),
    default=0.4,
    show_default=True,
    help="Share of the samples for which only the roof is observed.",
)
@click.option("--start", type=click.Path(path_type=Path), help="Weights to start from.")
@click.option("--fresh", is_flag=True, help="Train even where a fitting surrogate exists.")
@study_options(draws=False, shares=True)
def command(
    building: str | None,
    thorough: bool,
    samples: int | None,
    epochs: int | None,
    start: Path | None,
    fresh: bool,
    study: Study,
    bars: Bars,
    **settings: Any,
) -> Answer:
    """Train the surrogate of the study's building.

    The usual training takes some minutes. A longer one, by --thorough, reduces the number of
    responses that a calibration needs afterwards.

    After an interruption the same command resumes. It does nothing where a trained surrogate (the
    study's own or a shipped one) fits the building.

    \b
    Examples:
      femupdate train --study mine
      femupdate train --building my_building.toml --study mine --thorough
      femupdate train --study mine --dask tcp://10.0.0.1:8786
    """
    from femupdate.workflow.checks import check_training
    from femupdate.workflow.model import open_study
    from femupdate.workflow.train import THOROUGH, USUAL, default_settings, train_study

    effort = THOROUGH if thorough else USUAL
    count = samples or effort.samples
    check_training(study, count, settings["batch"], start, building)
    model = open_study(study, building, bars)
    chosen = default_settings(model, epochs=epochs or effort.epochs, **settings)
    report = train_study(study, model, count, chosen, fresh=fresh, start=start, progress=bars)
    return Answer(report, more={"study": study.folder})
