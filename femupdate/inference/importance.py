"""Importance sampling: proposals about maxima or about particles, fitted to their own draws.

A mixture of Students covers a posterior so well that most of its draws count; their weights repair
what it has wrong (adaptive importance sampling: Cappe et al. 2008, Stat. Comput. 18, 447; about
maxima: Geweke 1989, Econometrica 57, 1317).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from femupdate.errors import InferenceError
from femupdate.inference.parameters import Parameters
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, spawn, torch_generator

EDGE = 8.0  # standard normal coordinate from which a parameter is at its bound

LogLikelihood = Callable[[Tensor], Tensor]
"""Log likelihood (n,) of parameters (n, p)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SamplerRun:
    """Equally weighted draws of prior times likelihood.

    Attributes:
        theta: (n, p) parameters.
        log_likelihood: (n,).
        log_evidence: log of the mean likelihood under the prior.
        evaluations: of the likelihood, all in all.
        log_evidence_error: its standard error by weights; NaN where the draws had none.
        effective: effective sample size of weighted draws that these were chosen from; zero
            likewise.
        effective_share: of those; zero likewise.
        invalid: evaluations that gave no finite number; all count as impossible.
        acceptance: mean share of moves accepted while draws were kept; NaN where none were.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: float
    evaluations: int
    log_evidence_error: float = math.nan
    effective: float = 0.0
    effective_share: float = 0.0
    levels: int = 0
    invalid: int = 0
    acceptance: float = math.nan


def effective_sample_size(log_weight: Tensor) -> float:
    """(sum w)^2 / sum w^2 of log weights (n,) (Kish 1965), between 1 and n."""
    return float(
        torch.exp(2.0 * torch.logsumexp(log_weight, 0) - torch.logsumexp(2.0 * log_weight, 0))
    )


def next_increment(gain: Tensor, most: float, ess_target: float) -> float:
    """Largest step of beta, up to `most`, that keeps the share `ess_target` of the particles.

    Found by bisection, to a thousandth. At least 1e-12, so that the sampler goes on where fewer
    particles than that are possible at all.

    Args:
        gain: (n,) log likelihood gained per unit of beta, minus infinity where impossible.
        most: what is left up to beta = 1.
        ess_target: share of the particles, 0 to 1.
    """
    wanted = ess_target * len(gain)
    if effective_sample_size(most * gain) >= wanted:
        return most
    low, high = 0.0, most
    while high - low > 1e-3 * high and high > 1e-12:
        middle = 0.5 * (low + high)
        if effective_sample_size(middle * gain) < wanted:
            high = middle
        else:
            low = middle
    return max(low, 1e-12)


def systematic_rows(weight: Tensor, generator: torch.Generator, count: int | None = None) -> Tensor:
    """Systematic resampling (Kitagawa 1996): row indices for weights (n,) that sum to one.

    As many as there are weights, or `count`. Row i comes floor(count w_i) or ceil(count w_i) times,
    count w_i times on average; weight zero never comes.
    """
    count = count or len(weight)
    uniform = torch.rand(1, generator=generator, dtype=weight.dtype)
    # Points in (0, 1] and edges that end at exactly 1: rounding cannot reach a row of weight zero.
    points = (torch.arange(1, count + 1, dtype=weight.dtype) - uniform) / count
    edges = weight.cumsum(0)
    return torch.searchsorted(edges / edges[-1], points)


@dataclass(frozen=True)
class Mixture:
    """A mixture of k Gaussians in p dimensions, or of multivariate Students.

    The tails of Students reach beyond the points that they were fitted to: as a proposal they do
    not lag behind a distribution that moves, and importance weights stay bounded wherever the
    target is lighter.

    Attributes:
        log_weight: (k,).
        mean: (k, p).
        cholesky: (k, p, p) lower factors of the covariances, or of the Students' scale matrices.
        freedom: degrees of freedom of Students; zero for Gaussians.
    """

    log_weight: Tensor
    mean: Tensor
    cholesky: Tensor
    freedom: int = 0

    def joined(self, other: "Mixture", share: float) -> "Mixture":
        """Both mixtures as one, of which another has a share."""
        weights = self.log_weight + math.log1p(-share), other.log_weight + math.log(share)
        return Mixture(
            torch.cat(weights),
            torch.cat([self.mean, other.mean]),
            torch.cat([self.cholesky, other.cholesky]),
            self.freedom,
        )

    def widened(self, factor: float, freedom: int) -> "Mixture":
        """Students with all covariances multiplied."""
        return Mixture(self.log_weight, self.mean, math.sqrt(factor) * self.cholesky, freedom)

    def component_log_density(self, x: Tensor) -> Tensor:
        """Log of weight times density, (n, k), for x (n, p) (Kotz & Nadarajah 2004, eq. 1.1)."""
        size, freedom = x.shape[1], self.freedom
        difference = (x[None] - self.mean[:, None]).transpose(1, 2)
        scaled = torch.linalg.solve_triangular(self.cholesky, difference, upper=False)
        squares = scaled.square().sum(1)
        constant = self.log_weight - self.cholesky.diagonal(dim1=1, dim2=2).log().sum(-1)
        if freedom:
            constant = constant + math.lgamma(0.5 * (freedom + size)) - math.lgamma(0.5 * freedom)
            constant = constant - 0.5 * size * math.log(freedom * math.pi)
            tail = -0.5 * (freedom + size) * torch.log1p(squares / freedom)
        else:
            constant = constant - 0.5 * size * math.log(2.0 * math.pi)
            tail = -0.5 * squares
        return (constant[:, None] + tail).T

    def log_density(self, x: Tensor) -> Tensor:
        """Log density (n,) of x (n, p)."""
        return torch.logsumexp(self.component_log_density(x), dim=1)

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw (count, p)."""
        component = torch.multinomial(
            self.log_weight.exp(), count, replacement=True, generator=generator
        )
        size = self.mean.shape[1]
        normal = torch.randn(
            count,
            size + self.freedom,
            generator=generator,
            dtype=self.mean.dtype,
        )
        offset = (self.cholesky[component] @ normal[:, :size, None])[..., 0]
        if self.freedom:
            stretch = (self.freedom / normal[:, size:].square().sum(1)).sqrt()
            offset = offset * stretch[:, None]
        return self.mean[component] + offset


def fit_mixture(
    x: Tensor, components: int, generator: torch.Generator, iterations: int = 40
) -> Mixture:
    """Fit a mixture to x (n, p) by expectation-maximisation (Dempster, Laird & Rubin 1977).

    Starts from k-means++ seeds (Arthur & Vassilvitskii 2007). Covariances get a ridge of 1e-6 of
    the pooled variance, so that a component on a few particles stays invertible.
    """
    centre, scale = x.mean(dim=0), x.std(dim=0).clamp_min(1e-12)
    standard = (x - centre) / scale
    size, ridge = x.shape[1], 1e-6 * torch.eye(x.shape[1]).to(x)
    # With their products both steps are one matrix product each. Of points of variance one the
    # squares lose ten of sixteen digits at most, in the narrowest component that the ridge admits.
    products = (standard[:, :, None] * standard[:, None]).flatten(1)
    features = torch.cat([torch.ones_like(x[:, :1]), standard, products], dim=1)

    def maximised(share: Tensor) -> Mixture:
        """By the shares (n, k) of the components in the points."""
        sums = share.T @ features
        mass = sums[:, :1].clamp_min(1e-9)  # of a component that has lost all particles
        mean = sums[:, 1 : 1 + size] / mass
        square = (sums[:, 1 + size :] / mass).unflatten(1, (size, size))
        root = torch.linalg.cholesky(square - mean[:, :, None] * mean[:, None] + ridge)
        return Mixture((mass / mass.sum()).log()[:, 0], mean, root)

    def joint_log_density(mixture: Mixture) -> Tensor:
        """(n, k)."""
        precision = torch.cholesky_inverse(mixture.cholesky)
        linear = (precision @ mixture.mean[:, :, None])[..., 0]
        constant = mixture.log_weight - mixture.cholesky.diagonal(dim1=1, dim2=2).log().sum(-1)
        constant = constant - 0.5 * (linear * mixture.mean).sum(-1)
        constant = constant - 0.5 * size * math.log(2.0 * math.pi)
        return features @ torch.cat([constant[:, None], linear, -0.5 * precision.flatten(1)], 1).T

    # Each seed is drawn with odds that go with its squared distance from those before.
    seeds = [int(torch.randint(len(x), (1,), generator=generator))]
    nearest = ((standard - standard[seeds[0]]) ** 2).sum(1)
    for _ in range(components - 1):
        seeds.append(int(torch.multinomial(nearest + 1e-12, 1, generator=generator)))
        nearest = torch.minimum(nearest, ((standard - standard[seeds[-1]]) ** 2).sum(1))
    closest = torch.cdist(standard, standard[seeds]).argmin(1)
    mixture = maximised(torch.nn.functional.one_hot(closest, components).to(x))
    previous = -math.inf
    for _ in range(iterations):
        joint = joint_log_density(mixture)
        total = torch.logsumexp(joint, dim=1, keepdim=True)
        mixture = maximised((joint - total).exp_())
        gain, previous = float(total.mean()) - previous, float(total.mean())
        if abs(gain) < 1e-3:
            break
    return Mixture(
        mixture.log_weight, centre + scale * mixture.mean, scale[:, None] * mixture.cholesky
    )


def students(mean: Tensor, covariance: Tensor, log_mass: Tensor) -> Mixture:
    """Students about k points (k, p), of these covariances (k, p, p) and log masses (k,).

    Every one has a hundredth of the weight at least: a curvature may understate its mass.

    Raises:
        InferenceError: a covariance is not positive definite.
    """
    weight = log_mass.softmax(0).clamp_min(0.01)
    root, failed = torch.linalg.cholesky_ex(1.2 * covariance)
    if bool((failed > 0).any()) or not bool(root.isfinite().all()):
        raise InferenceError("the curvature at a maximum has no inverse; use particles")
    return Mixture((weight / weight.sum()).log(), mean, root, freedom=8)


def students_of(points: Tensor, generator: torch.Generator) -> Mixture:
    """Students fitted to points (n, d), fewer where few of them are distinct."""
    fitted = fit_mixture(points, min(12, max(1, _fitting(points))), generator, iterations=100)
    return fitted.widened(1.2, freedom=8)


def _fitting(points: Tensor) -> int:
    """How many Gaussians some points (n, d) suffice for: 25 for every coordinate and its weight."""
    return len(torch.unique(points[:, 0])) // (25 * (points.shape[1] + 1))


def _refitted(first: Mixture, points: Tensor, generator: torch.Generator) -> Mixture:
    """Students fitted to points (n, d) about each solution alone, so that none is lost."""
    member = replace(first, freedom=0).component_log_density(points).argmax(dim=1)
    weight, mean, root = [], [], []
    for k in range(len(first.mean)):
        inside = points[member == k]
        share = max(0.01, len(inside) / len(points))
        fitted = Mixture(first.log_weight.new_zeros(1), first.mean[[k]], first.cholesky[[k]])
        if _fitting(inside):
            fitted = students_of(inside, generator)
        weight.append(fitted.log_weight + math.log(share))
        mean.append(fitted.mean)
        root.append(fitted.cholesky)
    weights = torch.cat(weight).log_softmax(0)
    return Mixture(weights, torch.cat(mean), torch.cat(root), first.freedom)


@dataclass(frozen=True)
class WeightedDraws:
    """Independent draws from a proposal, weighted to the posterior.

    Attributes:
        points: (n, d) in the target's coordinates, or the parameters of those.
        log_likelihood: (n,).
        log_weight: (n,) prior times likelihood over proposal.
        evaluations: likelihoods evaluated to get here.
    """

    points: Tensor
    log_likelihood: Tensor
    log_weight: Tensor
    evaluations: int

    @property
    def effective(self) -> float:
        """Effective sample size."""
        return effective_sample_size(self.log_weight)

    @property
    def effective_share(self) -> float:
        """Of the draws."""
        return self.effective / len(self.points)

    @property
    def log_evidence(self) -> float:
        """Log of the mean likelihood under the prior."""
        return float(torch.logsumexp(self.log_weight, 0)) - math.log(len(self.log_weight))

    @property
    def log_evidence_error(self) -> float:
        """Standard error of `log_evidence`, by the delta method."""
        return math.sqrt(max(0.0, 1.0 / self.effective - 1.0 / len(self.log_weight)))

    def resampled(self, count: int, seed: Seed) -> SamplerRun:
        """So many equally weighted draws.

        Systematic, in the order of the first coordinate: the shares of well separated modes are
        kept to one draw. Fewer than the effective size repeat few draws.
        """
        generator = torch_generator(seed)
        order = self.points[:, 0].argsort()
        weight = torch.softmax(self.log_weight[order], dim=0)
        rows = order[systematic_rows(weight, generator, count)]
        rows = rows[torch.randperm(count, generator=generator)]
        return SamplerRun(
            theta=self.points[rows],
            log_likelihood=self.log_likelihood[rows],
            log_evidence=self.log_evidence,
            evaluations=self.evaluations,
            log_evidence_error=self.log_evidence_error,
            effective=self.effective,
            effective_share=self.effective_share,
        )


class Counted:
    """A likelihood that counts its evaluations and tells of them as they are made."""

    def __init__(self, target: LogLikelihood, progress: Progress = SILENT, rows: int = 256) -> None:
        self._target, self._progress, self._rows = target, progress, rows
        self.count = 0

    def __call__(self, parameters: Tensor) -> Tensor:
        """Log likelihood (n,) of parameters (n, p)."""
        values = []
        for some in parameters.split(self._rows):
            values.append(self._target(some))
            self.count += len(some)
            self._progress.advance(len(some))
        return torch.cat(values)


def importance_sample(
    prior: Parameters,
    log_likelihood: LogLikelihood,
    proposal: Mixture,
    count: int,
    seed: Seed,
    *,
    least_round: int = 200,
    apart: bool = True,
    in_logs: bool = False,
) -> WeightedDraws:
    """`count` weighted parameters, after rounds in which the proposal is fitted to its own draws.

    The draws of all rounds count, as draws of the mixture of all proposals (Cornuet et al. 2012,
    Scand. J. Stat. 39, 798): the wide first ones bound the weights in the tails of the last. Fits
    use tempered weights (Koblents & Miguez 2015, Stat. Comput. 25, 407), each solution of the first
    proposal apart: none is lost however few the draws are. Others are missed.

    Args:
        proposal: in the prior's normal coordinates, or in logs, one Student for every solution.
        count: draws of the last round.
        least_round: draws of a round of fitting, at least; a hundred for every parameter of up to
            four solutions.
        apart: whether each Student stands for a solution of its own, and is fitted alone.
        in_logs: whether to draw in logs (`Parameters.to_logs`).

    Raises:
        InferenceError: no draw has a finite likelihood.
    """
    generator = torch_generator(seed)
    first, solutions = proposal, len(proposal.mean) if apart else 1
    size = max(least_round, 100 * prior.size * min(4, solutions))
    proposals: list[Mixture] = []
    rounds: list[tuple[Tensor, Tensor, Tensor]] = []

    def placed(points: Tensor) -> tuple[Tensor, Tensor]:
        """Parameters of points, and the log prior density there."""
        if in_logs:
            return prior.from_logs(points)
        return prior.from_normal(points), prior.log_density_normal(points)

    def drawn(proposal: Mixture, some: int) -> WeightedDraws:
        """Those of all rounds, one more included, as the proposals draw them."""
        points = proposal.sample(some, generator)
        parameters, log_prior = placed(points)
        value = log_likelihood(parameters).to(torch.float64)
        value = torch.where(torch.isfinite(value), value, -torch.inf)
        proposals.append(proposal)
        rounds.append((points, value, log_prior))
        points, values, priors = (torch.cat(each) for each in zip(*rounds, strict=True))
        density = torch.stack([each.log_density(points) for each in proposals], dim=1)
        shares = density.new_tensor([len(each[0]) / len(points) for each in rounds]).log()
        log_weight = values + priors - torch.logsumexp(density + shares, dim=1)
        if not bool(torch.isfinite(log_weight).any()):
            raise InferenceError(
                "no draw around the particles has a finite likelihood; use more particles"
            )
        return WeightedDraws(points, values, log_weight, len(points))

    def refitted(tried: WeightedDraws, turn: int) -> Mixture:
        target = 0.4 * min(1.0, size / len(tried.points))
        power = next_increment(tried.log_weight, 1.0, target)
        weight = torch.softmax(power * tried.log_weight, 0)
        points = tried.points[systematic_rows(weight, generator)]
        if solutions > 1 and turn % 2 == 0:
            return _refitted(first, points, generator)
        whole = students_of(points, generator)
        # What was taken for several solutions may be one, or bent; but none may be lost.
        return whole if solutions == 1 else whole.joined(first, 0.1)

    for turn in range(8):
        tried = drawn(proposal, size)
        proposal = refitted(tried, turn)
        # The last round by itself fits; or, after some, all together say more than was asked for.
        last = effective_sample_size(tried.log_weight[-size:])
        if last > 0.5 * size or (turn > 3 and tried.effective > 2.0 * count):
            break
    found = drawn(proposal, count)
    return replace(found, points=placed(found.points)[0])


def draws_about_particles(
    prior: Parameters, log_likelihood: LogLikelihood, particles: Tensor, count: int, seed: Seed
) -> WeightedDraws:
    """`count` weighted parameters around particles (n, p) of every posterior mode.

    Modes that hold no particle are missed: the particles must come from a sampler that finds them.

    Raises:
        InferenceError: no draw has a finite likelihood.
    """
    fitting, drawing = spawn(seed, 2)
    xi = prior.to_normal(particles).clamp(-EDGE, EDGE)
    proposal = students_of(xi, torch_generator(fitting))
    return importance_sample(
        prior, log_likelihood, proposal, count, drawing, least_round=len(particles), apart=False
    )
