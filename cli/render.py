"""femupdate render."""

import click

from femupdate.study import Study

from .common import Bars, print_json, print_pictures, study_options, table


@click.command("render")
@click.option(
    "--modes", type=click.IntRange(1, 12), default=3, show_default=True, help="Number of modes."
)
@click.option(
    "--samples",
    type=click.IntRange(min=5),
    default=60,
    show_default=True,
    help="Posterior draws.",
)
@study_options(needs="posterior")
def command(modes: int, samples: int, study: Study, seed: int, as_json: bool) -> None:
    """Draw the mode shapes of the posterior off screen: mean shape and its spread.

    The modes are those that the base motion excites, lowest first.
    """
    from femupdate.workflow.checks import open_calibrated
    from femupdate.workflow.render import render_study

    with Bars() as bars:
        model = open_calibrated(study, bars)
        rendered = render_study(study, model, modes, samples, seed=seed, progress=bars)
    if as_json:
        print_json(
            {
                "modes": [
                    {
                        "mode": mode.number,
                        "frequency_hz": mode.frequency_mean,
                        "frequency_sd": mode.frequency_sd,
                        "found": mode.found,
                        "picture": mode.picture,
                    }
                    for mode in rendered
                ],
                "study": study.folder,
            }
        )
        return
    rows = [
        (str(m.number), f"{m.frequency_mean:.3f}", f"{m.frequency_sd:.3f}", f"{m.found:.0%}")
        for m in rendered
    ]
    click.echo(table(("mode", "Hz", "sd", "recognised in draws"), rows))
    print_pictures(tuple(mode.picture for mode in rendered))
