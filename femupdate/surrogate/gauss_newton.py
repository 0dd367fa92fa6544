"""Levenberg-Marquardt minimisation in the latent space, from many starts at once."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

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
        iterations: largest number of steps.
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

    Attributes:
        responses: number computed so far.
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
        data: the observation.
        step: of finite differences in z.
    """

    def __init__(self, respond: Callable[[Tensor], Tensor], data: LatentData, step: float) -> None:
        root, target = data.weight.sqrt(), data.log_frf

        def residuals(z: Tensor) -> Tensor:
            return (root * (target - respond(z.to(target.device)))).flatten(1).to(z.device)

        super().__init__(residuals, step)


def descend(misfit: Residuals, starts: Tensor, settings: DescentSettings | None = None) -> Descent:
    """Minimise the misfit from every start (s, z) (Marquardt 1963, J. SIAM 11, 431)."""
    settings = settings or DescentSettings()
    z = starts.clone()
    damping = torch.full((len(z),), 1e-2).to(z)
    residual = misfit(z)
    nats = nats_of(residual, z)
    identity = torch.eye(z.shape[1]).to(z)
    active = torch.ones(len(z), dtype=torch.bool, device=z.device)
    for _ in range(settings.iterations):
        rows = active.nonzero()[:, 0]
        information, pull = expanded(misfit, z[rows], residual[rows])
        stiff = information + identity
        stiff = stiff + torch.diag_embed(damping[rows, None] * stiff.diagonal(dim1=1, dim2=2))
        step = torch.linalg.solve(stiff.double(), (pull - z[rows]).double()).to(z)
        # Where the response is no number, a start stays where it is.
        trial = z[rows] + step.nan_to_num(0.0, 0.0, 0.0)
        new_residual = misfit(trial)
        new_nats = nats_of(new_residual, trial)
        gain = nats[rows] - new_nats
        better = gain > 0.0
        moved = rows[better]
        z[moved], residual[moved] = trial[better], new_residual[better]
        nats[moved] = new_nats[better]
        damping[rows] = damping[rows] * torch.where(better, 0.2, 6.0)
        # A start is finished where a full step gains nothing, or no shorter one does.
        small = better & (gain < settings.small_gain)
        active[rows] = ~(small | (damping[rows] > settings.most_damping))
        if not active.any():
            break
    return Descent(z, nats, *expanded(misfit, z, residual))


def nats_of(residual: Tensor, z: Tensor) -> Tensor:
    """-ln p(x|z) p(z) (s,), up to a constant, from residuals (s, m) at z (s, z)."""
    return 0.5 * (residual.square().sum(1) + z.square().sum(1))


def expanded(misfit: Residuals, z: Tensor, residual: Tensor) -> tuple[Tensor, Tensor]:
    """Information (s, z, z) and pull J^T r (s, z) at z (s, z) with residuals (s, m)."""
    information, pull = [], []
    for some, left in zip(z.split(_CHUNK), residual.split(_CHUNK), strict=True):
        jacobian = misfit.derivative(some, left)
        information.append(torch.bmm(jacobian.transpose(1, 2), jacobian))
        pull.append(torch.bmm(left[:, None], jacobian)[:, 0])
    return torch.cat(information), torch.cat(pull)


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
