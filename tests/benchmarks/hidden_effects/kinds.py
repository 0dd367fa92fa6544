"""What trials measure other than records of base motion: identified modes, and a hammer test."""

import numpy as np
import torch
from torch import Tensor

from femupdate.building.document import Building
from femupdate.dynamics import Excitation
from femupdate.effects import Effect
from femupdate.inference.mode_data import ModalErrors, modes_as_read
from femupdate.measurement import IdentifiedModes, Observation
from femupdate.simulation.truth import Truth
from femupdate.workflow.kinds import Measured, no_base_motion

BASE, MODES, FORCE = "base", "modes", "force"
DATA = (BASE, MODES, FORCE)

_FREQUENCY, _SHAPE, _DAMPING = 0.002, 0.01, 0.1  # errors, of a shape over its largest component
_MODEL = ModalErrors(model_frequency=0.003)  # as the guide advises for simple structures
_ACCELERANCE, _FIRST_HZ, _SPACING_HZ = 0.05, 0.3, 0.1
# Whatever their size; dampers and appendages leave no real modes that could be identified.
_UNSEEN = {
    BASE: (),
    FORCE: ("base_gain", "table_pitch"),
    MODES: (
        "base_gain",
        "table_pitch",
        "channel_delay",
        "drifting_clock",
        "roll_off",
        "story_damper",
        "tuned_appendage",
    ),
}
DESCRIBED = {
    MODES: f"Identified modes, one for each floor: errors of frequencies {_FREQUENCY:g}, of damping"
    f" ratios {_DAMPING:g}, of shapes {_SHAPE:g} of the largest component; --mode-error"
    f" {_MODEL.model_frequency:g}",
    FORCE: "Amplitude of the accelerance of all floors to a hammer on one of them, every"
    f" {_SPACING_HZ:g} Hz, error of each point {_ACCELERANCE:g}",
}


def shown(effect: Effect, data: str) -> bool:
    """Whether trials of a kind of data hide an effect: some size of it shows."""
    if effect.name in _UNSEEN[data]:
        return False
    phase = {BASE: True, MODES: True, FORCE: False}  # shapes have a sign
    return phase[data] or not effect.needs_phase


def given(
    data: str, truth: Truth, building: Building, zeta: float, rng: np.random.Generator
) -> Measured:
    """What a table of modes, or a hammer test, shows of a stick."""
    known = (
        torch.from_numpy(truth.theta)[None],
        torch.tensor([zeta], dtype=torch.float64),
        torch.tensor([truth.values], dtype=torch.float64).reshape(1, -1),
    )
    modes = (_modes(truth, known, rng),) if data == MODES else ()
    forced = (_hammer(truth, known, building, rng),) if data == FORCE else ()
    base = no_base_motion(building, modes, forced)
    return Measured(base=base, modes=modes, forced=forced, errors=_MODEL)


def _modes(
    truth: Truth, known: tuple[Tensor, Tensor, Tensor], rng: np.random.Generator
) -> IdentifiedModes:
    found = modes_as_read(truth.system, *known)[0]
    count = len(truth.system.floors)
    shape = found[2:, :count].T.numpy()
    shape = shape / np.abs(shape).max(axis=1, keepdims=True)
    hertz = found[0, :count].exp().numpy() / (2.0 * np.pi)
    ratio = found[1, :count].numpy()
    return IdentifiedModes(
        names=tuple(str(k + 1) for k in range(count)),
        frequency_hz=hertz * np.exp(_FREQUENCY * rng.standard_normal(count)),
        frequency_sd_hz=_FREQUENCY * hertz,
        damping=ratio * np.exp(_DAMPING * rng.standard_normal(count)),
        damping_sd=_DAMPING * ratio,
        floors=truth.system.floors,
        shape=shape + _SHAPE * rng.standard_normal(shape.shape),
        shape_sd=np.full(shape.shape, _SHAPE),
        source="trial",
    )


def _hammer(
    truth: Truth, known: tuple[Tensor, Tensor, Tensor], building: Building, rng: np.random.Generator
) -> Observation:
    grid = np.arange(_FIRST_HZ, building.frequency_grid.stop, _SPACING_HZ)
    floors = truth.system.floors
    force = Excitation(floors[int(rng.integers(len(floors)))])
    frf = truth.system.respond(force, *known, torch.from_numpy(grid))[0, :, 0]
    exact = frf.abs().log().numpy()
    noise = np.full(exact.shape, _ACCELERANCE)
    return Observation(
        frequency_hz=grid,
        floors=floors,
        log_frf=exact + noise * rng.standard_normal(exact.shape),
        noise_sd=noise,
        valid=np.ones(exact.shape, dtype=bool),
        source="trial",
        excitation=force,
    )
