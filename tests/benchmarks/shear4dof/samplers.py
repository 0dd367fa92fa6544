"""The published table of samplers, for two samplers and two likelihoods, with the floor."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.inference.importance import LogLikelihood, draws_about_particles
from femupdate.inference.smc import SmcSettings, TemperedSmc

from .case import Case, Shear4dof, case_modes, data_likelihood
from .metrics import MmdReference, total_variation

# Ten moves of random walk a level, b = .2, 80 % effective.
_PUBLISHED = SmcSettings(ess_target=0.8, independence_moves=0, unmoved=0.0)
SAMPLERS = {"random walk (paper)": _PUBLISHED, "mixture": SmcSettings()}

# Table 2 of the paper: particles, evaluations, MMD, its sd over ten runs, seconds on a GPU.
PUBLISHED = (
    ("SMC", 500, 91_000, 0.086, 0.038, 0.8),
    ("SMC", 1000, 182_000, 0.077, 0.034, 0.8),
    ("SMC", 2000, 362_000, 0.051, 0.019, 0.8),
    ("SMC", 4000, 724_000, 0.040, 0.015, 0.8),
    ("NUTS, one chain of 60,000", 0, 558_871, 0.629, 0.159, 1782.0),
)


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation over runs."""

    mean: float
    sd: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Of some values; the sd of one is no number."""
        sd = float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
        return cls(float(np.mean(values)), sd)


@dataclass(frozen=True, kw_only=True)
class SamplerRow:
    """Several runs of one sampler with one number of particles."""

    likelihood: str  # "latent" or "data"
    sampler: str  # its name; "independent draws" for the floor
    particles: int  # a run
    evaluations: float  # of the likelihood, mean
    mmd_own: Spread  # to many draws of the same posterior
    mmd_exact: Spread  # to the exact posterior
    weight_distance: Spread  # total variation of the mode weights from those of the same posterior
    log_evidence: Spread  # of the data likelihood; no number for the latent one, which has none
    unique: float  # share of different particles at the end, mean
    seconds: float  # mean


@dataclass(frozen=True, kw_only=True)
class SamplerTarget:
    """A posterior that samplers are judged by."""

    label: str  # of its likelihood, "latent" or "data"
    log_likelihood: LogLikelihood  # with gradients
    own: MmdReference  # draws of it
    weight: Floats  # (m,) share of each mode in them
    exact: MmdReference  # draws of the exact posterior

    def figures(self, case: Case, theta: Floats) -> dict[str, float]:
        """How far draws (n, p) are from it."""
        weight = case_modes(case, theta).weight
        return {
            "mmd_own": self.own(theta),
            "mmd_exact": self.exact(theta),
            "weight_distance": total_variation(weight, self.weight),
        }


def sampler_targets(
    problem: Shear4dof, draws: int, seed: int
) -> tuple[SamplerTarget, SamplerTarget]:
    """The latent posterior, by three importance draws for every two wanted, and the exact one."""
    prior, case, latent = problem.model.prior, problem.case, problem.latent()
    exact = MmdReference(problem.exact.theta)
    found = TemperedSmc(prior, latent).run(min(4000, draws), seed)
    own = draws_about_particles(prior, latent, found.theta, draws + draws // 2, seed + 1)
    theta = own.resampled(draws, seed).theta.numpy()
    return (
        SamplerTarget(
            label="latent",
            log_likelihood=latent,
            own=MmdReference(theta),
            weight=case_modes(case, theta).weight,
            exact=exact,
        ),
        SamplerTarget(
            label="data",
            log_likelihood=data_likelihood(problem.model, case),
            own=exact,
            weight=problem.exact.modes.weight,
            exact=exact,
        ),
    )


def sampler_row(
    problem: Shear4dof, target: SamplerTarget, name: str, size: int, runs: int
) -> SamplerRow:
    """Several runs of the sampler of a name, each of `size` particles."""
    sampler = TemperedSmc(problem.model.prior, target.log_likelihood, settings=SAMPLERS[name])
    found = []
    for run in range(runs):
        started = time.monotonic()
        result = sampler.run(size, 1000 * size + run)
        figures = {
            "seconds": time.monotonic() - started,
            "evaluations": float(result.evaluations),
            "log_evidence": result.log_evidence if target.label == "data" else float("nan"),
            "unique": len(torch.unique(result.theta[:, 0])) / len(result.theta),
        }
        found.append(figures | target.figures(problem.case, result.theta.numpy()))
    return row_of_runs(target.label, name, size, found)


def floor_rows(
    problem: Shear4dof, target: SamplerTarget, sizes: Sequence[int], runs: int, seed: int
) -> list[SamplerRow]:
    """Independent draws of the exact posterior, which no sampler can beat but by design.

    They are none of those that the target holds.
    """
    start = problem.exact.weighted.resampled(2000, seed).theta
    likelihood = data_likelihood(problem.model, problem.case)
    fresh = draws_about_particles(problem.model.prior, likelihood, start, 20_000, seed + 1)
    rng = np.random.default_rng(2)
    # By rejection each is kept once; the largest weight seen is taken as the largest possible.
    chance = (fresh.log_weight - fresh.log_weight.max()).exp().numpy()
    draws = fresh.points.numpy()[rng.random(len(chance)) < chance]
    rows = []
    for size in sizes:
        none = {"log_evidence": float("nan"), "seconds": float("nan")}
        found = []
        for _ in range(runs):
            theta = draws[rng.choice(len(draws), size, replace=len(draws) < size)]
            figures = target.figures(problem.case, theta)
            found.append({"evaluations": float(size), "unique": 1.0, **none, **figures})
        rows.append(row_of_runs("data", "independent draws", size, found))
    return rows


def row_of_runs(
    likelihood: str, sampler: str, particles: int, found: Sequence[dict[str, float]]
) -> SamplerRow:
    """A row from the figures of every run, by the names of the row's attributes."""
    values = {name: [one[name] for one in found] for name in found[0]}
    return SamplerRow(
        likelihood=likelihood,
        sampler=sampler,
        particles=particles,
        evaluations=float(np.mean(values["evaluations"])),
        mmd_own=Spread.of(values["mmd_own"]),
        mmd_exact=Spread.of(values["mmd_exact"]),
        weight_distance=Spread.of(values["weight_distance"]),
        log_evidence=Spread.of(values["log_evidence"]),
        unique=float(np.mean(values["unique"])),
        seconds=float(np.mean(values["seconds"])),
    )
