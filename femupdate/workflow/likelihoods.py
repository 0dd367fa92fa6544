"""The likelihood of all that was measured of a building, and where it is highest."""

from dataclasses import replace

import torch
from torch import Tensor

from femupdate.errors import MeasurementError
from femupdate.inference.data import Data
from femupdate.inference.frf_data import AT_ITS_WORD, base_logs, forced_logs
from femupdate.inference.learned import Settled, settled
from femupdate.inference.likelihood import Likelihood, cost_of_scatter, likelihood_of
from femupdate.inference.mode_data import ModeData, mode_data
from femupdate.inference.thresholds import DRAWS
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed
from femupdate.units import percent
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.kinds import Measured
from femupdate.workflow.model import StudyModel

LEAST_EXPLAINED = 0.25
"""Share of the measured variation below which a model explains nothing."""


def smooth_likelihood(
    model: StudyModel, measured: Measured, device: str = "cpu", least_noise: float = 0.0
) -> Likelihood:
    """The likelihood of all that was measured, the errors of the model not yet known.

    By all modes in double precision, which makes it smooth in the parameters.

    Args:
        least_noise: standard deviation of ln|H| below which the noise of FRFs under base motion is
            not believed, where that is more than the model's own (see `StudyModel.least_noise`).
    """
    others = data_of_others(model, measured)
    if not measured.has_base:
        return likelihood_of(others, model.system, model.parameters)
    base = base_logs(measured.base, model.system, device=device, modes=None)
    base = base.with_least_noise(max(least_noise, model.least_noise))
    cost = cost_of_scatter(measured.base, base)
    return likelihood_of((base, *others), model.system, model.parameters, cost)


def stated_likelihood(model: StudyModel, observation: Observation) -> Likelihood:
    """That of FRFs under base motion as if the model were right and the noise as stated."""
    data = base_logs(observation, model.system, believed=AT_ITS_WORD)
    cost = cost_of_scatter(observation, data)
    return likelihood_of((data,), model.system, model.parameters, cost)


def on_fewer_modes(likelihood: Likelihood) -> Likelihood:
    """The same with responses under base motion in single precision, by the modes that count."""
    base = likelihood.base
    if base is None or base.logs is None:
        return likelihood
    modes = None if likelihood.system.placed else DRAWS.modes
    fast = replace(base.logs, modes=modes, precision=torch.float32)
    return replace(likelihood, data=(replace(base, logs=fast), *likelihood.data[1:]))


def data_of_others(model: StudyModel, measured: Measured) -> tuple[Data, ...]:
    """All that is no FRF under base motion, taken at its word."""
    floors = model.system.floors
    forced = [forced_logs(one, floors, measured.rest) for one in measured.forced]
    return (*forced, *data_of_modes(model, measured))


def data_of_modes(model: StudyModel, measured: Measured) -> tuple[ModeData, ...]:
    """Every file of identified modes, taken at its word."""
    several = len(measured.modes) > 1
    return tuple(
        mode_data(
            one,
            model.system,
            measured.errors,
            damping=model.damping.free,
            at_its_word=True,
            source=one.source if several else "",
        )
        for one in measured.modes
    )


def settled_likelihood(
    model: StudyModel,
    measured: Measured,
    settings: CalibrationSettings,
    starts: Tensor | None = None,
    seed: Seed = 0,
) -> Settled:
    """The maxima of the likelihood, and the errors of the model that count there.

    Args:
        starts: (s, p) parameters, one at least near every maximum; by default likely points of
            the prior.
        seed: of those.

    Raises:
        MeasurementError: the observation is unlike anything that the building can do.
    """
    likelihood = smooth_likelihood(model, measured, settings.device)
    found = settled(likelihood, seed, starts=starts, shared=model.shared, observation=measured.base)
    points = likelihood.prior.from_normal(found.found.z)
    require_own_building(model, found.likelihood, points, anyway=settings.anyway)
    return found


def require_own_building(
    model: StudyModel, likelihood: Likelihood, points: Tensor, *, anyway: bool
) -> None:
    """Refuse an observation that says nothing of its building.

    Args:
        likelihood: of it.
        points: (n, p) parameters that explain it best.
        anyway: refuse nothing.

    Raises:
        MeasurementError: the best response has next to nothing of what was measured.
    """
    if anyway or likelihood.base is None:
        return
    explained = likelihood.explained(points)
    assert explained is not None
    if not explained >= LEAST_EXPLAINED:  # which no number is not
        best = 0.0 if explained != explained else max(explained, 0.0)
        raise MeasurementError(
            f"the observation is unlike anything that {model.building.name} can do: its best "
            f"response has {percent(best)} of the measured variation over frequency; "
            "check that the file belongs to the building, its units and directions, or add --anyway"
        )
