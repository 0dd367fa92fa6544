"""femupdate simulate."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

from .answer import Answer
from .bars import Bars
from .common import (
    channel_option,
    check_free,
    output_option,
    overwrite_option,
    scale_option,
    study_options,
    unit_option,
)
from .group import GroupedCommand
from .parameters import Band, BuildingName, InputFile, Numbers, SizedEffect


@click.command("simulate", cls=GroupedCommand)
@output_option("CSV file to write; the truth goes beside it as .truth.json.")
@click.option(
    "--building", type=BuildingName(), help="Shipped name or TOML file; default: that of the study."
)
@click.option("--theta", type=Numbers(), help="Stiffness factors; default: random.")
@click.option("--zeta", type=click.FloatRange(0.0, 1.0), help="Damping ratio of all modes.")
@click.option("--mesh-size", type=float, help="Mesh size, m; default: .4 of the building's own.")
@click.option(
    "--duration", "duration_s", type=float, default=80.0, show_default=True, help="Length, s."
)
@click.option(
    "--sampling",
    "sampling_hz",
    type=float,
    default=200.0,
    show_default=True,
    help="Samples per second.",
)
@click.option(
    "--rms",
    "rms_m_s2",
    type=float,
    default=0.3,
    show_default=True,
    help="Rms acceleration of the base, m/s2.",
)
@click.option(
    "--band",
    "band_hz",
    type=Band(),
    default="0.5,50",
    show_default=True,
    help="Frequency range of the base motion, Hz.",
)
@click.option(
    "--rotation",
    "rotation_rms",
    type=float,
    help="Rms rotation of the base, rad/s2, which two vertical sensors record.",
)
@click.option(
    "--vertical-at",
    type=Numbers(),
    default="-2,2",
    show_default=True,
    help="Places of these sensors along the motion, m.",
)
@click.option("--record", type=InputFile(), help="Ground motion to use instead of noise.")
@channel_option
@unit_option
@scale_option
@click.option(
    "--effect",
    "effects",
    multiple=True,
    type=SizedEffect(),
    help="Hidden effect and its size, such as added_mass@3F=0.1; may be given several times.",
)
@overwrite_option
@click.option(
    "--sensor-noise",
    "sensor_noise_m_s2",
    type=float,
    default=0.003,
    show_default=True,
    help="Rms noise of every sensor, m/s2.",
)
@study_options(writes=False, draws=False)
def command(
    output: Path,
    building: str | None,
    record: Path | None,
    channel: int | str | None,
    unit: str | None,
    scale: float,
    overwrite: bool,
    study: Study,
    bars: Bars,
    **settings: Any,
) -> Answer:
    """Make a synthetic observation file of a building with known stiffness factors.

    Band-limited white noise (or a record) shakes the full model, on a finer mesh than calibrations
    use. Single accelerometers with their own noise record it.

    \b
    Example:
      femupdate simulate -o obs.csv --building shear_4dof --effect added_mass@3F=0.1
    """
    check_free(output, overwrite)
    from femupdate.measurement.record import read_record
    from femupdate.simulation.simulate import (
        SimulationSettings,
        simulate_observation,
        write_simulation,
    )
    from femupdate.workflow.model import choose_building, require_named, say_building

    if record is not None:
        motion = read_record(record, unit, channel).scaled(scale)
        settings.update(base_motion=motion, sampling_hz=1.0 / motion.time_step)
    require_named(study, building)
    chosen = choose_building(study, building)
    say_building(study, building, chosen, bars)
    simulation = simulate_observation(chosen, SimulationSettings(**settings), bars)
    return Answer(write_simulation(simulation, output))
