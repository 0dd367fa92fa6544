"""identify: modes of a record of floors alone, as the table that `calibrate` reads."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femupdate.measurement.ambient import ORDER, AmbientModes, identify_modes
from femupdate.measurement.histories import motions_in
from femupdate.measurement.modes import mode_findings
from femupdate.measurement.names import BASE
from femupdate.measurement.quantity import si_factor
from femupdate.measurement.reader import read_measured
from femupdate.measurement.write import write_modes
from femupdate.report.scale import with_unit
from femupdate.result import Item, Note, Notes, Result
from femupdate.tables import Column, Table

_LARGEST = 1e9  # of any unit, that a channel may hold


@dataclass(frozen=True)
class Identified(Result):
    """Modes of a record, written.

    Attributes:
        ambient: the modes and what they were chosen from.
        source: name of the record.
        output: table of the modes.
        findings: sentences on what looks wrong in them.
    """

    ambient: AmbientModes
    source: str
    output: Path
    findings: tuple[str, ...]

    def items(self) -> Iterator[Item]:
        """Every mode, what was left out, and the next command."""
        names = ("name", "frequency_hz", "frequency_sd_hz", "damping", "damping_sd", "shape")
        modes, notes = self.ambient.modes, self.ambient.notes
        yield Note(f"Modes of {self.source}, to {self.output}:", {"output": self.output})
        values = {name: [getattr(mode, name) for mode in modes] for name in names}
        told = {
            "frequency_hz": [
                with_unit(mode.frequency_hz, mode.frequency_sd_hz or 0.0, "Hz") for mode in modes
            ],
            "damping": [
                with_unit(100.0 * (mode.damping or 0.0), 100.0 * (mode.damping_sd or 0.0), "%")
                for mode in modes
            ],
        }
        heads = {"name": "mode", "frequency_hz": "frequency", "damping": "damping ratio"}
        columns = [
            Column(values[name], heads.get(name), told.get(name), key=name) for name in names
        ]
        yield Table(name="modes", key="modes", columns=tuple(columns))
        yield Notes((*notes, *self.findings))
        content = {"band_hz": self.ambient.band_hz, "notes": notes, "findings": self.findings}
        following = f"femupdate calibrate {self.output}"
        yield Note(f"Next: {following}", {**content, "next": following})


def identify(
    path: Path,
    output: Path,
    *,
    columns: Mapping[str, str] | None = None,
    band_hz: tuple[float, float] | None = None,
    order: int = ORDER,
) -> Identified:
    """Identify the modes of a record of floors and write them as a table.

    Args:
        output: CSV file.
        columns: our column name to the file's column or channel.
        band_hz: in which modes are looked for; by default about the first peaks of the spectra.
        order: the largest of the models.
    """
    recording = read_measured(path)
    floors = {
        ours: channel
        for ours, channel in motions_in(recording, columns).items()
        if ours.floor != BASE and ours.direction != "z" and not channel.vertical
    }
    if not floors:
        raise recording.file.error(
            "there is no horizontal motion of a floor; add columns 2F ... RF"
        )
    file, channels = recording.file, list(floors.values())
    units, kinds = ({getattr(c, name) for c in channels} for name in ("unit", "quantity"))
    if len(kinds) > 1:
        raise file.error(
            f"the channels hold {' and '.join(sorted(kinds))}; take channels of one quantity by the"
            " columns option"
        )
    for channel in channels:
        if np.ptp(channel.values) == 0.0:
            raise file.error(
                f"channel {channel.name!r} is dead: all its values are the same; leave it out"
            )
        if np.abs(channel.values).max() > _LARGEST:
            raise file.error(
                f"channel {channel.name!r} holds values above {_LARGEST:g}; remove the spikes"
            )
    if None in units and len(units) > 1:
        raise file.error("some channels have a unit and some have none; give every one its unit")
    values = np.array([channel.values for channel in channels])
    if len(units) > 1:  # one that all have need not be known
        factors = [si_factor(file, channel.unit or "", channel.quantity) for channel in channels]
        values *= np.array(factors)[:, None]
    names = tuple(ours.name for ours in floors)
    found = identify_modes(values, channels[0].time_step, names, band_hz, order)
    said = [f"modes of {path.name} by femupdate identify", *found.notes]
    written = write_modes(output, found.modes, said)
    return Identified(found, path.name, written, mode_findings(found.modes))


def draw_identified(found: Identified, path: Path) -> Path:
    """Draw spectra, poles of every order, and the modes' shapes."""
    from femupdate.report.figure import save_figure
    from femupdate.report.plot_poles import stabilisation

    return save_figure(stabilisation(found.ambient, f"Modes identified from {found.source}"), path)
