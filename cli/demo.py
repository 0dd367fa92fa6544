"""femupdate demo."""

import click

from femupdate.study import Study

from .common import Bars, print_json, print_pictures, study_options, table


@click.command("demo")
@study_options()
def command(study: Study, seed: int, as_json: bool) -> None:
    """Run the whole chain on a shipped synthetic observation and a real ground motion."""
    from femupdate.workflow.demo import run_demo

    with Bars() as bars:
        report = run_demo(study, seed, bars)
    posterior, roof = report.all_floors.posterior, report.roof_alone.posterior
    if as_json:
        print_json(
            {
                "study": study.folder,
                "posterior": report.all_floors.path,
                "prediction": report.predicted.path,
                "parameters": posterior.names,
                "truth": report.truth,
                "mean": posterior.samples.mean(axis=0),
                "sd": posterior.samples.std(axis=0),
                "roof_alone_mean": roof.samples.mean(axis=0),
                "roof_alone_sd": roof.samples.std(axis=0),
                "pictures": report.pictures,
                "seconds": report.seconds,
            }
        )
        return
    rows = [
        (name, f"{true:.2f}", f"{mean:.3f} +- {sd:.3f}", f"{roof_mean:.3f} +- {roof_sd:.3f}")
        for name, true, mean, sd, roof_mean, roof_sd in zip(
            posterior.names,
            report.truth,
            posterior.samples.mean(axis=0),
            posterior.samples.std(axis=0),
            roof.samples.mean(axis=0),
            roof.samples.std(axis=0),
            strict=True,
        )
    ]
    click.echo("\nStiffness factors, mean +- sd (the observation is synthetic, so truth is known)")
    click.echo(table(("", "truth", "all six floors", "roof alone"), rows))
    peaks = report.predicted.peak_acceleration
    rows = [
        (floor, f"{mean:.3f}", f"{low:.3f}", f"{high:.3f}")
        for floor, mean, low, high in zip(
            report.predicted.summary.floors, peaks.mean, peaks.q05, peaks.q95, strict=True
        )
    ]
    click.echo("\nPeak floor acceleration under a tenth of the Ridgecrest record, m/s2")
    click.echo(table(("", "mean", "5 %", "95 %"), rows))
    click.echo(f"\nDone in {report.seconds:.0f} s. Everything is in {study.folder}; pictures:")
    print_pictures(report.pictures)
