"""What is sampled, and draws of it about its maxima."""

from dataclasses import dataclass, replace

from femupdate.errors import InferenceError
from femupdate.inference.importance import Counted
from femupdate.inference.likelihood import Likelihood
from femupdate.inference.maxima import draws_about
from femupdate.inference.parameters import Parameters
from femupdate.inference.thresholds import MAXIMA
from femupdate.progress import SILENT, Progress
from femupdate.seeds import Seed, spawn
from femupdate.surrogate.gauss_newton import Descent
from femupdate.units import percent
from femupdate.workflow.calibrate_settings import Sampled, drawn_by

FROM_FIT = "the fit"
ABOUT_MAXIMA = "importance sampling about the maxima"
_FEW_COUNT = "Few importance draws count: the posterior may be wider, or of several pieces."


@dataclass(frozen=True, eq=False)
class Target:
    """What is sampled.

    Attributes:
        likelihood: of all that was measured, with its prior.
        maxima: of the posterior, in standard normal coordinates; None where they were not sought.
        origin: what they were found from, in words.
        local: whether the model serves about them alone.
        tried: points of the prior that were judged to find them.
    """

    likelihood: Likelihood
    maxima: Descent | None
    origin: str
    local: bool = False
    tried: int = 0

    @property
    def prior(self) -> Parameters:
        """Of all parameters."""
        return self.likelihood.prior


def sampled_about_maxima(
    target: Target, count: int, seed: Seed, show: Progress = SILENT
) -> Sampled | None:
    """Equally weighted draws, by importance draws about the maxima; None where too few count.

    For a posterior with one mode this costs some thousand responses where tempering costs fifty
    thousand. Of a local model they are all that there is, however few of them count.

    Raises:
        InferenceError: no draw about the fit of a local model is possible.
    """
    assert target.maxima is not None
    # Rounds of fitting take some hundred draws a parameter.
    expected = count + 200 * target.prior.size
    show.start("Importance sampling (data-space likelihood)", expected)
    drawing, choosing = spawn(seed, 2)
    # A thousand at a time: all processors start and end together.
    counted = Counted(target.likelihood, show, rows=1024)
    least = 0.0 if target.local else MAXIMA.trusted
    found = draws_about(target.prior, counted, target.maxima, count, drawing, least)
    if found is None:
        if target.local:
            raise InferenceError("no draw about the fit is possible; the data say too little")
        return None
    found = replace(found, evaluations=found.evaluations + target.tried)
    note = (
        f"From {target.origin} to the data-space posterior took {found.evaluations:,} responses; "
        f"{percent(found.effective_share)} of the importance draws are effective."
    )
    runs = [found.resampled(count, choosing)]
    return Sampled(
        runs,
        target.prior,
        drawn_by("exact", ABOUT_MAXIMA, runs),
        (note,),
        target.likelihood,
        warnings=(_FEW_COUNT,) * (found.effective_share < MAXIMA.trusted),
    )
