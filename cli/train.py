"""femupdate train."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import study_options
from .parameters import BuildingName


@click.command("train")
@click.option("--building", type=BuildingName(), help="Shipped name or TOML file, for a new study.")
@click.option(
    "--samples",
    type=click.IntRange(min=100),
    default=100_000,
    show_default=True,
    help="Simulated buildings in the data set.",
)
@click.option(
    "--epochs",
    type=click.IntRange(min=1),
    default=45,
    show_default=True,
    help="Passes over the data set.",
)
@click.option(
    "--batch",
    type=click.IntRange(min=8),
    default=512,
    show_default=True,
    help="Samples per step.",
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
@study_options(draws=False)
def command(
    building: str | None,
    samples: int,
    start: Path | None,
    fresh: bool,
    study: Study,
    bars: Bars,
    **settings: Any,
) -> Answer:
    """Train the surrogate of the study's building.

    It also learns the effects that the building lists, over the range of their prior.

    After an interruption the same command resumes. It does nothing where a trained surrogate (the
    study's own or a shipped one) fits the building.
    """
    from femupdate.workflow.checks import check_training
    from femupdate.workflow.model import open_study
    from femupdate.workflow.train import default_settings, train_study

    check_training(study, samples, settings["batch"], start, building)
    model = open_study(study, building, bars)
    chosen = default_settings(model, **settings)
    report = train_study(study, model, samples, chosen, fresh=fresh, start=start, progress=bars)
    return Answer(report, more={"study": study.folder})
