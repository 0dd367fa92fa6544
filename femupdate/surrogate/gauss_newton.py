"""Minimisation in standard normal coordinates, as of the latent space, from many starts at once."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.maximise import Search, maximise

# Number of starts whose derivatives are held in memory at a time.
_CHUNK = 16


@dataclass(frozen=True)
class LatentData:
    """An observation on all floors of the decoder.

    Attributes:
        log_frf: (f, k), all floors of the decoder; zero where the weight is zero.
        weight: (f, k) inverse variance of what is not explained; zero where nothing is observed.
    """

    log_frf: Tensor
    weight: Tensor


@dataclass(frozen=True)
class Descent:
    """Where the minimisation ended.

    Attributes:
        z: (s, z).
        nats: (s,) -ln p(x|z) p(z), up to a constant.
        information: (s, z, z) Gauss-Newton curvature of -ln p(x|z).
        pull: (s, z) gradient of ln p(x|z).
    """

    z: Tensor
    nats: Tensor
    information: Tensor
    pull: Tensor

    def __getitem__(self, rows: list[int]) -> "Descent":
        parts = (self.z, self.nats, self.information, self.pull)
        return Descent(*(part[rows] for part in parts))

    @property
    def precision(self) -> Tensor:
        """(s, z, z) of the posterior about each point, in double precision on the processor."""
        information = self.information.double().cpu()
        return information + torch.eye(information.shape[-1]).to(information)

    @property
    def log_mass(self) -> Tensor:
        """Log share (s,) of the posterior about each point, but for a constant (Laplace)."""
        return -self.nats.double().cpu() - 0.5 * torch.linalg.slogdet(self.precision)[1]


@dataclass(frozen=True)
class DescentSettings:
    """When to stop.

    Attributes:
        small_gain: gain of a step, nats, below which a start is finished.
        most_damping: damping beyond which a start is finished.
    """

    iterations: int = 40
    small_gain: float = 1e-3
    most_damping: float = 1e6


class Residuals:
    """Whitened residuals as a function of standard normal coordinates.

    Args:
        residuals: z (s, z) to residuals (s, m).
        step: of finite differences in z.
    """

    def __init__(self, residuals: Callable[[Tensor], Tensor], step: float) -> None:
        self._residuals, self._step = residuals, step
        self.responses = 0

    def __call__(self, z: Tensor) -> Tensor:
        """Residuals (s, m) at z (s, z)."""
        self.responses += len(z)
        return self._residuals(z)

    def derivative(self, z: Tensor, residual: Tensor) -> Tensor:
        """Derivatives (s, m, z) of the response, whitened, where the residuals are `residual`.

        Finite differences go towards the middle of the prior: beyond the edge of the allowed
        range nothing may change.
        """
        size = z.shape[1]
        step = torch.where(z > 0.0, -self._step, self._step)
        moved = self((z[:, None] + torch.diag_embed(step)).flatten(0, 1)).view(len(z), size, -1)
        return (residual[:, None] - moved).transpose(1, 2) / step[:, None]


class Misfit(Residuals):
    """Whitened misfit of a model of ln|H|.

    Args:
        respond: z (n, z) to ln|H| (n, f, k).
        step: of finite differences in z.
    """

    def __init__(self, respond: Callable[[Tensor], Tensor], data: LatentData, step: float) -> None:
        root, target = data.weight.sqrt(), data.log_frf

        def residuals(z: Tensor) -> Tensor:
            return (root * (target - respond(z.to(target.device)))).flatten(1).to(z.device)

        super().__init__(residuals, step)


@dataclass(frozen=True, eq=False)
class _InNormal:
    """Residuals of standard normal coordinates, which have no limits."""

    misfit: Residuals
    lower: Tensor
    upper: Tensor
    mean: Tensor
    precision: Tensor

    def raw(self, z: Tensor) -> Tensor:
        return self.misfit(z)

    def whitened(self, raw: Tensor) -> Tensor:
        return raw

    def derivative(self, z: Tensor, residual: Tensor, first: int) -> Tensor:
        parts = zip(z.split(_CHUNK), residual.split(_CHUNK), strict=True)
        return torch.cat([self.misfit.derivative(*both)[:, :, first:] for both in parts])


def descend(misfit: Residuals, starts: Tensor, settings: DescentSettings | None = None) -> Descent:
    """Minimise the misfit from every start (s, z)."""
    settings, size = settings or DescentSettings(), starts.shape[1]
    far, one = starts.new_full((size,), torch.inf), torch.eye(size).to(starts)
    found = maximise(
        _InNormal(misfit, -far, far, torch.zeros_like(far), one),
        starts,
        Search(
            iterations=settings.iterations,
            small_nats=settings.small_gain,
            most_damping=settings.most_damping,
        ),
    )
    jacobian, residual = found.jacobian, found.residual
    pull = (jacobian.mT @ residual[:, :, None])[:, :, 0]
    return Descent(found.z, 0.5 * found.objective, jacobian.mT @ jacobian, pull)


def nats_of(residual: Tensor, z: Tensor) -> Tensor:
    """-ln p(x|z) p(z) (s,), up to a constant, from residuals (s, m) at z (s, z)."""
    return 0.5 * (residual.square().sum(1) + z.square().sum(1))


@dataclass(frozen=True)
class Kept:
    """Which points of a descent are kept.

    Attributes:
        nats: that one may be lighter than the heaviest.
        count: at most.
        apart: posterior standard deviations within which two are one.
    """

    nats: float
    count: int
    apart: float = 1.0


def distinct(descent: Descent, log_mass: Tensor, kept: Kept) -> Descent:
    """Different end points that count, the heaviest (log masses (s,)) first."""
    z, precision = descent.z.double().cpu(), descent.precision
    rows: list[int] = []
    for row in torch.argsort(log_mass, descending=True).tolist():
        if log_mass[row] < log_mass.max() - kept.nats or len(rows) == kept.count:
            break
        offsets = z[rows] - z[row]
        distance = torch.einsum("ci,cij,cj->c", offsets, precision[rows], offsets)
        if bool((distance > kept.apart**2).all()):
            rows.append(row)
    return descent[rows]
