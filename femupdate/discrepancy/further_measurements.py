"""Which further measurement would tell effects apart that these data do not.

Two fitted models differ in what they predict elsewhere. A sensor on another floor (or the phase,
where only |H| was measured) is worth the part of that difference which the parameters of the second
model could not make up for, given all that was measured already: D standard deviations of the noise
are a log evidence of D^2 / 2.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Flags
from femupdate.discrepancy.fit import DIFFERENCE, Fit
from femupdate.inference.frf_data import FrfData
from femupdate.inference.likelihood import Data, Likelihood
from femupdate.inference.model_error import WILD
from femupdate.linear import least_squares

PHASE = "the phase of the floors measured"


MeasurementValue = tuple[str, float]
"""A floor that was not measured, or `PHASE`, and the log evidence to be expected with it, between
the two models that are hardest to tell apart."""


def measurement_values(
    problem: Likelihood, first: Fit, others: Sequence[Fit]
) -> tuple[MeasurementValue, ...]:
    """What further measurements would tell a model from others, the best first.

    A floor's noise is taken to be that of the floors measured.
    """
    seen = next((kind for kind in problem.data if isinstance(kind, FrfData)), None)
    if seen is None or not others:
        return ()
    # What (amplitude and phase, by floor) is there with each further measurement.
    count, rows = len(seen.floors), list(seen.rows)
    has = np.zeros((2, count), dtype=bool)
    has[0, rows] = True
    has[1] = has[0] & (seen.phase is not None)
    options = {}
    for row, floor in enumerate(seen.floors):
        if row not in rows:
            options[floor] = has.copy()
            options[floor][:, row] = has.any(axis=1)
    if seen.phase is None:
        options[PHASE] = np.stack([has[0], has[0]])
    if not options:
        return ()
    # As if every floor had been measured, with its phase.
    precision = torch.where(torch.isfinite(seen.sd), seen.sd**-2, 0.0)
    valid = (precision > 0.0).sum(dim=0)
    typical = (precision.sum(dim=0) / valid.clamp_min(1)) ** -0.5  # infinite where nothing is
    sd = typical.expand(count, -1).clone()
    sd[rows] = seen.sd
    zero = torch.zeros_like(sd)
    whole = replace(seen, rows=tuple(range(count)), sd=sd, log_frf=zero, phase=zero)
    data = (whole, *(kind for kind in problem.data if kind is not seen))
    worth = np.array([_expected(data, first, other, options) for other in others]).min(axis=0)
    return tuple(sorted(zip(options, worth.tolist(), strict=True), key=lambda value: -value[1]))


def _expected(
    data: Sequence[Data], first: Fit, other: Fit, options: Mapping[str, Flags]
) -> list[float]:
    """Log evidence (o,) with each further measurement, as if the first model were the truth.

    The first of the data are the FRFs of all floors, of which options leave some out. The other
    model follows by steps of Gauss and Newton with the derivatives where it is.
    """
    where = other.steps

    def predicted(fitted: Fit, z: Tensor) -> list[Tensor]:
        known = fitted.steps.split(z)
        return [kind.predicted(fitted.system, *known) for kind in data]

    def moved(from_: list[Tensor], to: list[Tensor]) -> list[Tensor]:
        return [kind.moved(*both) for kind, *both in zip(data, from_, to, strict=True)]

    here, there = (predicted(model, model.z[None]) for model in (other, first))
    steps = torch.where(other.z + DIFFERENCE <= where.upper, DIFFERENCE, -DIFFERENCE)
    changes = moved(here, predicted(other, other.z + torch.diag(steps)))
    columns = [change / steps[:, None] for change in changes]
    prior = torch.diag(where.precision.diagonal().sqrt())
    has_all = next(iter(options.values()))
    shape = (-1, *has_all.shape, changes[0].shape[1] // has_all.size)
    found = []
    for has in options.values():
        seen = torch.from_numpy(has)

        def kept(parts: list[Tensor], seen: Tensor = seen) -> Tensor:
            return torch.cat([parts[0].reshape(shape)[:, seen].flatten(1), *parts[1:]], dim=1)

        matrix = torch.cat([kept(columns).T, prior])
        z, least = other.z, np.inf
        for _ in range(6):
            missed = kept(moved(predicted(other, z[None]), there))[0]
            # One point where an anti-resonance is off must not decide.
            left = torch.cat([missed.clamp(-WILD, WILD), prior @ (other.z - z)])
            least = min(least, 0.5 * float(left @ left))
            better = z + least_squares(matrix, left)
            z = torch.minimum(torch.maximum(better, where.lower), where.upper)
        found.append(least)
    return found
