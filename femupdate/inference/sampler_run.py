"""What one run of a sampler has drawn."""

import math
from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True)
class Level:
    """What happened at one tempering level.

    Attributes:
        beta: power reached.
        ess: effective sample size of all particles before they were resampled.
        acceptance: mean, of each kind of move in their order; NaN where none was made.
        unique: share of the particles that are different.
    """

    beta: float
    ess: float
    acceptance: tuple[float, ...]
    unique: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SamplerRun:
    """Equally weighted draws of prior times likelihood.

    Attributes:
        theta: (n, p) parameters.
        log_likelihood: (n,).
        log_evidence: relative to the base's, where the likelihood has one; NaN where there is none.
        evaluations: of the likelihood, all in all.
        log_evidence_error: its standard error by weights; NaN where the draws had none.
        effective: effective sample size of weighted draws that these were chosen from; zero
            likewise.
        effective_share: of those; zero likewise.
        levels: of tempering; none likewise.
        invalid: evaluations that gave no finite number; all count as impossible.
    """

    theta: Tensor
    log_likelihood: Tensor
    log_evidence: float
    evaluations: int
    log_evidence_error: float = math.nan
    effective: float = 0.0
    effective_share: float = 0.0
    levels: tuple[Level, ...] = ()
    invalid: int = 0
