"""Which ground motion is predicted for, and how."""

from dataclasses import dataclass
from pathlib import Path

from femupdate.workflow.members import Place


@dataclass(frozen=True)
class RecordSource:
    """Which ground motion, and what of it.

    Attributes:
        path: the file.
        unit: where the file does not say.
        channel: name or number, where the file has several.
        scale: factor on the acceleration.
    """

    path: Path
    unit: str | None = None
    channel: str | int | None = None
    scale: float = 1.0


@dataclass(frozen=True)
class PredictionSettings:
    """How to predict.

    Attributes:
        samples: posterior draws used.
        damping: one ratio for all of them; None takes each draw's own where the posterior has it,
            else the building's.
        seed: which draws.
        spectrum_damping: damping ratio of the oscillators on the floors whose response spectra are
            asked for; None for no spectra.
        members: places in the building, m: the end forces of the beam elements nearest to them are
            found; and names of walls, such as "X2:S1": the forces through their feet are.
        member_draws: draws at which the full model is solved for these.
    """

    samples: int = 300
    damping: float | None = None
    seed: int = 0
    spectrum_damping: float | None = None
    members: tuple[Place | str, ...] = ()
    member_draws: int = 24
