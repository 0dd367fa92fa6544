"""The posterior that a study keeps, held against its building."""

from femupdate.building.parameters import factor_ranges
from femupdate.building.schema import Building
from femupdate.errors import StudyError
from femupdate.inference.posterior import Posterior, load_posterior
from femupdate.study import Study


def kept_posterior(study: Study, building: Building) -> Posterior:
    """Read the posterior of a study.

    The study's record says of which building it is; here the draws themselves are looked at, for a
    record can be wrong.

    Raises:
        StudyError: there is none, it is damaged, or its factors or floors are not the building's.
    """
    posterior = load_posterior(study.require("posterior", "calibrate"))
    factors = tuple(factor_ranges(building))
    own = posterior.names[: len(factors)] == factors
    if not own or not set(posterior.observation.floors) <= set(building.floors):
        raise StudyError(
            f"the {study.key('posterior')} in {study.folder} is not of {building.name}: its factors"
            f" are {', '.join(posterior.names)}, measured at"
            f" {', '.join(posterior.observation.floors)}; run `femupdate calibrate` again"
        )
    return posterior
