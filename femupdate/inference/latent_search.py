"""From the observation encoder's proposals to q(z|x), by Gauss-Newton.

The encoder says roughly where in z an observation may lie. A few Gauss-Newton steps on the
decoder's misfit lead from there to the best points, and the curvature there gives the width, for
the noise and the gaps that this very observation has (iterative amortised inference: Marino, Yue &
Mandt 2018, ICML; Laplace's method: MacKay 2003, ch. 27). The last steps are taken with responses of
the building itself in place of the decoder's, some hundreds of them: what the decoder has learned
wrongly would move the points by a part of their width, and the shares of separate solutions by
several nats.

Where two solutions merge, the misfit is flat to the second order in one direction, and a Gaussian
with the curvature there is far too wide. From such a point steps to both sides, each put right
across the direction by Gauss-Newton, follow the ridge of the posterior density until it has fallen;
Gaussians side by side, as heavy as the ridge is high, then stand for it.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from femupdate.maximise import (
    Descent,
    LatentData,
    Residuals,
    Search,
    descend,
    distinct,
    misfit_of,
    nats_of,
)
from femupdate.surrogate.network import LatentMixture, Mvae

_RESPONSE_STEP = 1e-4  # of z, of finite differences; posteriors are some hundredths wide
_PROPOSAL_DRAWS, _PRIOR_DRAWS = 24, 4096  # of the observation encoder and of the prior
_SHORTEST, _LONGEST = 2e-3, 0.15  # steps along a ridge, of z


@dataclass(frozen=True)
class FoundLatent:
    """q(z|x) of one observation: a mixture of c Gaussians around the z that explain it.

    Attributes:
        log_weight: (c,) normalised.
        mean: (c, z).
        information: (c, z, z) information of the data. The precision of each Gaussian is this
            plus the prior's, which is the identity.
        misfit: mean squared misfit, whitened, at the likeliest point: about one.
        responses: of the building that it took to find it.
    """

    log_weight: Tensor
    mean: Tensor
    information: Tensor
    misfit: float = float("nan")
    responses: int = 0

    @property
    def precision(self) -> Tensor:
        """Precision of each Gaussian, (c, z, z)."""
        return self.information + torch.eye(self.mean.shape[1]).to(self.information)


def latent_quadratics(observed: FoundLatent, covariance: Tensor) -> Callable[[Tensor], Tensor]:
    """ln of the integral of q(z|x) q(z|theta) / p(z) over z, p(z) the standard normal, by means.

    q(z|theta) is N(m, D) with one D for all theta. With d = m - m_c and F_c the
    information of component c, its share of the integral is a quadratic of d,
    a_c + d^T (I + F_c D)^-1 m_c - d^T (I + F_c D)^-1 F_c d / 2: finite for every theta, since the
    precision of q(z|x) is never below the prior's.

    Args:
        observed: q(z|x).
        covariance: D (z, z); one on the diagonal where theta gives no information.
    """
    mean, information = observed.mean.double(), observed.information.double()
    identity, spread = torch.eye(mean.shape[1]).to(mean), covariance.double()
    mixed = identity + information @ spread
    curvature = torch.linalg.solve(mixed, information)
    values, vectors = torch.linalg.eigh(0.5 * (curvature + curvature.transpose(1, 2)))
    root = values.clamp_min(0.0).sqrt()[:, :, None] * vectors.transpose(1, 2)
    # P^-1 with P = F + D^-1, written without D^-1.
    narrow = spread @ torch.linalg.inv(mixed)
    level = (
        observed.log_weight.double()
        + 0.5 * torch.linalg.slogdet(observed.precision.double())[1]
        - 0.5 * torch.linalg.slogdet(mixed)[1]
        + 0.5 * (mean**2).sum(1)
        + 0.5 * torch.einsum("ci,cij,cj->c", mean, narrow, mean)
    )
    tilt = torch.linalg.solve(mixed, mean[:, :, None])
    kept = (part.float() for part in (mean, root.transpose(1, 2), tilt, level))
    middles, roots, slopes, levels = kept

    def log_likelihood(mean_theta: Tensor) -> Tensor:
        offset = mean_theta[None] - middles[:, None]
        squares = torch.bmm(offset, roots).square().sum(-1)
        slope = torch.bmm(offset, slopes)[..., 0]
        return torch.logsumexp(levels[:, None] + slope - 0.5 * squares, dim=0)

    return log_likelihood


@torch.no_grad()
def find_latent(
    mvae: Mvae,
    data: LatentData,
    proposal: LatentMixture,
    reduced: tuple[LatentData, Callable[[Tensor, Tensor], Tensor]],
    generator: torch.Generator,
    settle: Callable[[Tensor], tuple[Tensor, Callable[[Tensor], Tensor]]] | None = None,
) -> FoundLatent:
    """q(z|x) of an observation, from the proposal of one row.

    Args:
        data: the observation with the variance of noise and decoder.
        reduced: the observation with the variance of its noise alone, and the building's own
            responses: theta (n, p) and damping ratios (n,) to ln|H| (n, f, k) of the decoder's
            floors. What they give for floors that are not observed does not matter.
        settle: parameters (s, p) with the damping ratio last, from the decoder, to those of the
            building's own maxima and to residuals that allow for its errors; None where the noise
            is all there is.
    """
    starts = _starts(mvae, data, proposal, generator)
    points = (data.weight > 0).any(0).nonzero()[:, 0]
    seen = LatentData(data.log_frf[:, points], data.weight[:, points])
    by_decoder = misfit_of(lambda z: mvae.decode(z, points), seen, 1e-3)
    # A decoder's misfit may be wrong by some nats.
    near = _distinct(mvae, descend(by_decoder, starts), nats=30.0, count=24)
    # In double precision: differences of responses are taken.
    precise = copy.deepcopy(mvae).double()

    misfit, starts = _own_misfit(precise, reduced, near.z.double(), settle)
    ended = descend(misfit, starts, Search(iterations=8, small_nats=0.02, most_damping=100.0))
    # Points from which much is still to be gained are at the edge of what can be asked: what they
    # say of the inside is not to be trusted where something better is at hand.
    rows = torch.nonzero(_expansion(ended)[1] < 1.0)[:, 0].tolist()
    arrived = _distinct(mvae, ended[rows] if rows else ended, nats=14.0, count=16)
    # A Gaussian for each solution, a row of them where a Gaussian does not describe it.
    arrived, reach = _in_double(arrived), precise.reach().double()
    followed = bent(misfit, arrived, reach)
    others = arrived[(~followed).nonzero()[:, 0].tolist()]
    # Beyond the edge of what has a theta, the expansion's minimum is the only way to it.
    step, gain = _expansion(others)
    completed = Descent(
        others.z + step, others.nats - gain, others.information, torch.zeros_like(others.z)
    )
    found = along_ridges(misfit, arrived[followed.nonzero()[:, 0].tolist()], completed, reach)
    log_weight = found.log_mass
    best = int(log_weight.argmax())
    squares = 2.0 * float(found.nats[best]) - float(found.z[best].square().sum())
    return FoundLatent(
        log_weight.log_softmax(0),
        found.z.double(),
        found.information.double(),
        squares / int((reduced[0].weight > 0).sum()),
        misfit.responses,
    )


def _own_misfit(
    mvae: Mvae,
    reduced: tuple[LatentData, Callable[[Tensor, Tensor], Tensor]],
    near: Tensor,
    settle: Callable[[Tensor], tuple[Tensor, Callable[[Tensor], Tensor]]] | None,
) -> tuple[Residuals, Tensor]:
    """The misfit of the building's own responses, and where (s, z) to minimise it from."""
    # Not every z has a theta in the prior's box: those that come nearest.
    known = mvae.encode_parameters(mvae.parameters_at(near))
    reached = torch.cat([known, near[:, mvae.sizes.parameters :]], dim=1)

    def parameters(z: Tensor) -> tuple[Tensor, Tensor]:
        return mvae.parameters_at(z), mvae.decoder.damping(z)

    if settle is None:
        data, respond = reduced
        return misfit_of(lambda z: respond(*parameters(z)), data, _RESPONSE_STEP), reached

    def joined(z: Tensor) -> Tensor:
        theta, zeta = parameters(z)
        return torch.cat([theta, zeta[:, None]], dim=1)

    maxima, residuals = settle(joined(reached))
    places = mvae.encode_parameters(maxima[:, :-1])
    turned = mvae.decoder.damping_coordinate(maxima[:, -1])
    starts = torch.cat([places, turned], dim=1)
    return Residuals(lambda z: residuals(joined(z)), _RESPONSE_STEP), starts


def _starts(
    mvae: Mvae, data: LatentData, proposal: LatentMixture, generator: torch.Generator
) -> Tensor:
    """Means and draws of the proposal, and the best of many draws from the prior, (s, z)."""
    component = torch.multinomial(
        proposal.log_weight[0].exp(), _PROPOSAL_DRAWS, replacement=True, generator=generator
    )
    noise = torch.randn(_PROPOSAL_DRAWS, proposal.mean.shape[-1], generator=generator)
    sd = (0.5 * proposal.log_variance[0, component]).exp()
    drawn = proposal.mean[0, component] + sd * noise.to(sd)
    unit = torch.rand(_PRIOR_DRAWS, mvae.sizes.parameters, generator=generator).to(mvae.lower)
    mean = mvae.encode_parameters(mvae.lower + (mvae.upper - mvae.lower) * unit)
    free = torch.randn(_PRIOR_DRAWS, int(mvae.sizes.free_damping), generator=generator)
    prior = torch.cat([mean, free.to(mean)], dim=1)
    chosen = slice(0, None, 8)
    target, weight = data.log_frf[:, chosen], data.weight[:, chosen]
    misfits = [weight * (target - mvae.decode(z, chosen)) ** 2 for z in prior.split(256)]
    nats = torch.cat([misfit.sum((1, 2)) for misfit in misfits])
    best = prior[nats.topk(24, largest=False).indices]
    return torch.cat([proposal.mean[0], drawn, best])


def _in_double(descent: Descent) -> Descent:
    parts = (descent.z, descent.nats, descent.information, descent.pull)
    return Descent(*(part.double() for part in parts))


def _expansion(descent: Descent) -> tuple[Tensor, Tensor]:
    """Step (s, z) to the minimum of the second-order expansion, and what it gains (s,), nats."""
    descent = _in_double(descent)
    slope = descent.pull - descent.z
    step = torch.linalg.solve(descent.precision, slope[:, :, None])[..., 0]
    return step, 0.5 * (step * slope).sum(1)


def _distinct(mvae: Mvae, descent: Descent, *, nats: float, count: int) -> Descent:
    """Different end points that count, the heaviest first."""
    # The prior of z cancels from the likelihood of theta: it must not decide what counts.
    squares = descent.z.double()[:, : mvae.sizes.parameters].square().sum(1)
    return distinct(descent, descent.log_mass + 0.5 * squares, nats=nats, count=count)


def bent(misfit: Residuals, points: Descent, reach: Tensor) -> Tensor:
    """Which solutions (s,) a Gaussian of the curvature there does not describe.

    Args:
        misfit: of the building's own responses.
        reach: (z,) largest |z| that can be asked for.
    """
    mass = points.log_mass
    found = torch.zeros(len(points.z), dtype=torch.bool)
    for row in torch.nonzero(mass > mass.amax() - 6.0)[:, 0].tolist():
        axis, sd = _widest(points[[row]])
        away = min(2.0 * sd, 0.3)
        for offset in (-away * axis, away * axis):
            tried = points.z[row : row + 1] + offset
            if bool((tried.abs() < reach).all()):
                rise = float(nats_of(misfit(tried), tried)[0] - points.nats[row])
                found[row] |= abs(rise - 0.5 * (away / sd) ** 2) > 0.5
    return found


def along_ridges(misfit: Residuals, points: Descent, solutions: Descent, reach: Tensor) -> Descent:
    """Gaussians along the ridges through bent solutions, each centre a point of the descent.

    A ridge ends where it comes to one of the solutions, which stand for themselves.

    Args:
        misfit: of the building's own responses.
        points: bent ones, the heaviest first.
        reach: (z,) largest |z| that can be asked for.
    """
    kept = solutions
    for row in range(len(points.z)):
        if not _belongs(kept, points.z[row : row + 1])[0]:
            ridge = _followed(misfit, points[[row]], kept, reach)
            short = len(ridge.z) < 3
            more = points[[row]] if short else _kernels(ridge)
            kept = Descent(
                torch.cat([kept.z, more.z]),
                torch.cat([kept.nats, more.nats]),
                torch.cat([kept.information, more.information]),
                torch.cat([kept.pull, more.pull]),
            )
    return kept


def _followed(misfit: Residuals, point: Descent, solutions: Descent, reach: Tensor) -> Descent:
    """The ridge to both sides of a point, in order; the point alone where there is none."""
    axis, sd = _widest(point)
    best = min([float(point.nats[0]), *solutions.nats.tolist()])
    step = min(0.5 * sd, _LONGEST)
    sides = [
        _side(misfit, point, (sign * axis, step), best, solutions, reach) for sign in (-1.0, 1.0)
    ]
    if sides[0] is None or sides[1] is None:
        return point
    back = [side.flip(0) for side in sides[0]]
    start = (point.z, point.nats, point.information)
    z, nats, information = (torch.cat(parts) for parts in zip(back, start, sides[1], strict=True))
    return Descent(z, nats, information, z)


def _side(
    misfit: Residuals,
    point: Descent,
    start: tuple[Tensor, float],
    best: float,
    solutions: Descent,
    reach: Tensor,
) -> tuple[Tensor, Tensor, Tensor] | None:
    """Points, nats and information on one side of a point, itself left out.

    None where the way comes back: about as wide in two directions, a maximum has no ridge.
    """
    found: list[tuple[Tensor, Tensor, Tensor]] = []
    here, nats, (direction, step) = point.z, float(point.nats[0]), start
    most = 1.2  # nats, above which a step is halved; below a quarter of it steps grow
    for _ in range(40):
        ahead = here + step * direction
        if bool((ahead.abs() > reach).any()):
            break
        ahead, there, information = _pulled_back(misfit, ahead, direction)
        change = abs(float(there) - nats)
        if change > most and step > _SHORTEST:
            step = max(0.5 * step, _SHORTEST)
            continue
        if _belongs(solutions, ahead)[0]:
            break
        if (ahead - point.z).norm() < (here - point.z).norm():
            return None
        found.append((ahead, there, information))
        moved = (ahead - here)[0]
        here, nats, direction = ahead, float(there), moved / moved.norm()
        best = min(best, nats)
        if nats > best + 8.0:
            break
        if change < 0.25 * most:
            step = min(1.5 * step, _LONGEST)
    if not found:
        empty = point.z.new_zeros(0)
        return point.z[:0], empty, point.information[:0]
    z, levels, informations = zip(*found, strict=True)
    return torch.cat(z), torch.cat(levels), torch.cat(informations)


def _pulled_back(misfit: Residuals, z: Tensor, direction: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The best point near z (1, z) across a direction, its nats (1,) and information (1, z, z)."""
    identity = torch.eye(z.shape[1]).to(z)
    along = torch.outer(direction, direction)
    across = identity - along
    residual = misfit(z)
    jacobian = misfit.derivative(z, residual)[0]
    information = jacobian.T @ jacobian
    stiff = across @ (information + identity) @ across + along
    for _ in range(2):
        slope = across @ (jacobian.T @ residual[0] - z[0])
        z = z + across @ torch.linalg.solve(stiff, slope)
        residual = misfit(z)
    return z, nats_of(residual, z), information[None]


def _widest(point: Descent) -> tuple[Tensor, float]:
    """Direction (z,) in which the density at a point is widest, and its standard deviation."""
    precision = point.information[0] + torch.eye(point.z.shape[1]).to(point.z)
    values, vectors = torch.linalg.eigh(precision)
    return vectors[:, 0], float(values[0]) ** -0.5


def _kernels(ridge: Descent) -> Descent:
    """Gaussians side by side along a ridge, from splines through its points."""
    from scipy.interpolate import CubicSpline

    place = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ridge.z, axis=0), axis=1))])
    curve = CubicSpline(place, ridge.z.numpy())
    height = CubicSpline(place, ridge.nats.numpy())
    ups_and_downs = float(np.abs(np.diff(ridge.nats)).sum())
    count = min(int(np.ceil(2.0 * ups_and_downs)) + 1, 128)
    spacing = place[-1] / count
    middles = spacing * (np.arange(count) + 0.5)
    tangent = curve(middles, 1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    nearest = np.abs(place[:, None] - middles).argmin(axis=0)
    sd = min(0.7 * spacing, 1.0)
    # Of the information the part along the tangent gives that standard deviation.
    along = torch.from_numpy(tangent[:, :, None] * tangent[:, None])
    across = torch.eye(tangent.shape[1]).to(along) - along
    information = across @ ridge.information[nearest] @ across + (sd**-2 - 1.0) * along
    # The mass of a Gaussian is that of its stretch of the ridge.
    nats = torch.from_numpy(height(middles)) + np.log(np.sqrt(2.0 * np.pi) * sd / spacing)
    z = torch.from_numpy(curve(middles))
    return Descent(z, nats, information, z.clone())


def _belongs(solutions: Descent, z: Tensor) -> Tensor:
    """Which of the points (n, z) are near a solution."""
    if len(solutions.z) == 0:
        return torch.zeros(len(z), dtype=torch.bool)
    identity = torch.eye(z.shape[1]).to(z)
    offset = z[:, None] - solutions.z
    squares = torch.einsum("nci,cij,ncj->nc", offset, solutions.information + identity, offset)
    return (squares < 4.0**2).any(dim=1)
