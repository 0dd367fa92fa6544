"""Responses to forces: what a reduced model lacks for them, and the check of their unit."""

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from femupdate.building.frame import FrameBuilding
from femupdate.dynamics.force_response import RestFlexibility, rest_flexibility
from femupdate.dynamics.reduced import ReducedModel
from femupdate.effects.structure import Structure, structure_of
from femupdate.errors import MeasurementError
from femupdate.inference.frf_data import FrfData, base_logs, log_responses
from femupdate.measurement.observation import Observation
from femupdate.progress import Progress
from femupdate.storage import check_shapes, read_arrays, write_arrays
from femupdate.study import Study, StudyPart
from femupdate.units import STANDARD_GRAVITY
from femupdate.workflow.finer_mesh import FINER, half_mesh_size
from femupdate.workflow.model import REDUCED, StudyModel

_PROBES = 256  # draws of the prior that are held against the level of what was measured
# Factors by which responses may miss all of them: to a force, where the masses tell the level; and
# floor over base acceleration, which is one at zero frequency whatever the building is.
_FORCE_LEVEL, _BASE_LEVEL = 2.0, 6.0

# What files are wrong by: factors, and powers of omega of another quantity.
_FACTORS = {
    "in m/s2, not in g": STANDARD_GRAVITY,
    "a thousand times too large (mm, or per kN)": 1e3,
    "a thousand times too small": 1e-3,
    "in g, not in m/s2": 1.0 / STANDARD_GRAVITY,
}
_QUANTITIES = ("receptance", "mobility", "accelerance")


def open_rest(study: Study, model: StudyModel, progress: Progress) -> RestFlexibility | None:
    """What a study's reduced model lacks under forces, learned once; None for a stick."""
    if model.building.kind == "shear":
        return None

    def make() -> RestFlexibility:
        structure, reduced = _full_and_reduced(model)
        lower, upper = model.prior.lower.numpy(), model.prior.upper.numpy()
        return rest_flexibility(structure, reduced, lower, upper, progress)

    kept = study.artefacts()
    by = {name: kept[name].sha256 for name in (REDUCED.name, FINER) if name in kept}
    return study.cached(REST, {**model.made_from(), **by}, make)


def read_rest(path: Path) -> RestFlexibility:
    """What a study keeps."""
    data = read_arrays(path)
    check_shapes(data, {"terms": "pff", "numbers": "n"})
    return RestFlexibility(data["terms"], *data["numbers"].tolist())


REST = StudyPart(
    "flexibility under forces",
    "force_flexibility.npz",
    "calibrate",
    lambda rest, path: write_arrays(
        path, terms=rest.terms, numbers=np.array([rest.error, rest.lacked])
    ),
    read_rest,
    lambda rest: {"error": rest.error, "lacked": rest.lacked},
)


def _full_and_reduced(model: StudyModel) -> tuple[Structure, ReducedModel]:
    """The full model behind the reduced one, and this without what corrects its mesh."""
    building, finer = model.building, model.finer
    if finer is None:
        return structure_of(building), model.reduced
    assert isinstance(building, FrameBuilding)
    return structure_of(building, half_mesh_size(building)), finer.model


def check_level(model: StudyModel, data: FrfData, one: Observation) -> None:
    """Refuse responses in another unit or quantity than their file says.

    The masses of the building are known, so that no stiffness of the prior moves the level of the
    accelerance by much: it is the mass line that tells the unit.

    Raises:
        MeasurementError: no parameters of the prior come near the level; another unit or quantity
            would, and is named.
    """
    away = _away(model, data)
    omega = (2.0 * torch.pi * data.frequency_hz).log()
    level, spread = _level(away, omega, 0)
    if level <= math.log(_FORCE_LEVEL):
        return
    raise MeasurementError(_sentence(one, away, omega, spread))


def check_base_level(model: StudyModel, base: Observation) -> None:
    """Refuse a table of FRFs that cannot be floor over base acceleration.

    Responses to a hammer without units look like it, and are smaller by the masses of the building.

    Raises:
        MeasurementError: no parameters of the prior come near |H|.
    """
    if base.coherence is not None or not base.valid.any():
        return  # estimated here, from histories of the base and the floors
    away = _away(model, base_logs(base, model.system))
    level, scatter = _level(away, torch.zeros(()), 0)
    if level + scatter <= math.log(_BASE_LEVEL):
        return
    raise MeasurementError(
        f"{base.source}: |H| of {', '.join(base.floors)} is {math.exp(level + scatter):.3g} times"
        " away from all that floor over base acceleration can be in this building; if a hammer or"
        " a shaker excited it, say so by --force FLOOR and --unit m/s2/N"
    )


def _away(model: StudyModel, data: FrfData) -> Tensor:
    """(n, f, k) measured less predicted ln|H| at draws of the prior; NaN where not valid."""
    generator = torch.Generator().manual_seed(0)
    draws = model.parameters.split(model.parameters.sample(_PROBES, generator))
    predicted = log_responses(data, model.system, draws.of_structure, draws.zeta)
    return torch.where(data.valid, data.log_frf - predicted, torch.nan)


def _level(away: Tensor, omega: Tensor, power: int) -> tuple[float, float]:
    """How far the nearest draw misses the level, and how much it scatters about it, in ln.

    Args:
        away: (n, f, k) measured less predicted ln|A|, NaN where not valid.
        omega: (k,) ln of rad/s.
        power: of omega that is taken off.
    """
    left = (away - power * omega).flatten(1)
    middle = left.nanmedian(dim=1).values
    scatter = (left - middle[:, None]).abs().nanmedian(dim=1).values
    nearest = int((middle.abs() + scatter).argmin())
    return float(middle[nearest].abs()), float(scatter[nearest])


def _sentence(one: Observation, away: Tensor, omega: Tensor, spread: float) -> str:
    """What looks wrong, and what would be right."""
    floors = ", ".join(one.floors)
    said = f"{one.source}: the {one.quantity} of {floors} under a {one.excitation.name}"
    level, _ = _level(away, omega, 0)
    best, guess = math.inf, ""
    power = _QUANTITIES.index(one.quantity)
    for shift in range(-power, 3 - power):
        for words, factor in {"": 1.0, **_FACTORS}.items():
            if shift == 0 and factor == 1.0:
                continue
            level, scatter = _level(away - math.log(factor), omega, shift)
            told = f"{_QUANTITIES[power + shift]} " if shift else ""
            if level + scatter < best:
                best, guess = level + scatter, f"{told}{words}".strip()
    hint = f"; it fits if it is {guess}" if best < math.log(_FORCE_LEVEL) + spread else ""
    return (
        f"{said} is {math.exp(level):.3g} times away from all that the building's masses allow"
        f"{hint}; correct its unit, or the masses of the building"
    )
