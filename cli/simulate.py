"""femupdate simulate."""

from pathlib import Path
from typing import Any

import click

from femupdate.bars import Bars
from femupdate.study import Study

from .common import (
    Answer,
    channel_option,
    check_free,
    option,
    output_option,
    overwrite_option,
    scale_option,
    study_options,
    unit_option,
)
from .group import GroupedCommand
from .parameters import BAND, BUILDING_NAME, INPUT_FILE, NUMBERS, SIZED_EFFECT


@click.command("simulate", cls=GroupedCommand)
@output_option("CSV file to write; the truth goes beside it as .truth.json.")
@option("--building", "Shipped name or TOML file; default: that of the study.", BUILDING_NAME)
@option("--theta", "Stiffness factors; default: random.", NUMBERS)
@option("--zeta", "Damping ratio of all modes.", click.FloatRange(0.0, 1.0))
@option("--mesh-size", "Mesh size, m; default: .4 of the building's own.", float)
@option("--duration duration_s", "Length, s.", float, 80.0)
@option("--sampling sampling_hz", "Samples per second.", float, 200.0)
@option("--rms rms_m_s2", "Rms acceleration of the base, m/s2.", float, 0.3)
@option("--band band_hz", "Frequency range of the base motion, Hz.", BAND, "0.5,50")
@option(
    "--rotation rotation_rms",
    "Rms rotation of the base, rad/s2, which two vertical sensors record.",
    float,
)
@option("--across across_rms", "Rms acceleration of the base across, m/s2.", float)
@option("--vertical-at", "Places of these sensors along the motion, m.", NUMBERS, "-2,2")
@option("--record", "Ground motion to use instead of noise.", INPUT_FILE)
@channel_option
@unit_option
@scale_option
@option(
    "--effect effects",
    "Hidden effect and its size, such as added_mass@3F=0.1; may be given several times.",
    SIZED_EFFECT,
    multiple=True,
)
@overwrite_option
@option("--sensor-noise sensor_noise_m_s2", "Rms noise of every sensor, m/s2.", float, 0.003)
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
    from femupdate.simulation.simulate import (
        SimulationSettings,
        simulate_observation,
        write_simulation,
    )
    from femupdate.workflow.model import choose_building, say_building
    from femupdate.workflow.predict import RecordSource

    if record is not None:
        motion = RecordSource(record, unit, channel, scale).motion()
        settings.update(base_motion=motion, sampling_hz=1.0 / motion.time_step)
    chosen = choose_building(study, building)
    say_building(chosen, bars)
    made = simulate_observation(chosen, SimulationSettings(**settings), bars)
    return Answer(write_simulation(made, output))
