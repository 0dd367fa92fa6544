"""Posterior predictive checks: would data drawn from the posterior miss it by as much as these do?

The discrepancy of data x and parameters theta is the chi-square of the whitened residuals,
T(x, theta) = sum of ((x - h(theta)) / sd)^2 over the independent points. At every posterior draw it
is compared with that of replicated data, the response of that draw with the noise of the file; the
posterior predictive p-value is the share in which the replicate misses by more (Gelman, Meng &
Stern 1996, Statistica Sinica 6). Of replicates T is chi-square with as many degrees of freedom as
there are points, whatever theta, so that the share is the mean of its tail.

Such p-values are conservative: the same data have moved the posterior and are judged by it. Over
data of the model itself they gather about a half, and at most 2 alpha of them lie below alpha (Meng
1994, Annals of Statistics 22); where parameters are few beside the points they are nearly uniform.
The effect finder's p-value (`femupdate.discrepancy.residual_map`) takes the fitted parameters off
the degrees of freedom and is uniform instead.

Of several runs pooled into one observation it is their mean that is judged; whether they agree with
one another is another question (`femupdate.measurement.runs`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc


@dataclass(frozen=True)
class PredictiveCheck:
    """Posterior predictive p-values.

    Attributes:
        whole: of all floors together.
        floors: of each floor alone; NaN where it has no valid point.
        names: of the floors.
        ratio: of the squares to those of replicates, in the mean of the draws. A thousand points
            make a p-value small where it is hardly above one.
    """

    whole: float
    floors: tuple[float, ...]
    names: tuple[str, ...]
    ratio: float = 1.0

    def sentence(self) -> str:
        """For the user."""
        floors = ", ".join(
            f"{name} {value:.2g}" for name, value in zip(self.names, self.floors, strict=True)
        )
        return (
            f"posterior predictive p-value {self.whole:.2g} ({floors}): the data miss the model "
            f"by {self.ratio**0.5:.2f} times what is allowed for"
        )

    def as_dict(self) -> dict[str, object]:
        """Plain numbers for JSON."""
        floors = dict(zip(self.names, self.floors, strict=True))
        return {"whole": self.whole, "floors": floors, "over_allowed": self.ratio**0.5}


def predictive_check(
    squares: ArrayLike, freedom: ArrayLike, names: tuple[str, ...]
) -> PredictiveCheck:
    """p-values of the squares that posterior draws leave.

    Args:
        squares: (n, f) sum of squared whitened residuals of every floor at every draw, counted so
            that each independent point has the expectation of one.
        freedom: (f,) independent points of every floor, or (n, f) where draws differ in them.
        names: of the floors.
    """
    left = np.asarray(squares, dtype=float)
    points = np.broadcast_to(np.asarray(freedom, dtype=float), left.shape)
    seen = points > 0.0
    tails = chdtrc(np.where(seen, points, 1.0), left).mean(axis=0)
    floors = np.where(seen.all(axis=0), tails, np.nan)
    whole = chdtrc(points.sum(axis=1), left.sum(axis=1)).mean()
    ratio = float((left.sum(axis=1) / points.sum(axis=1).clip(min=1.0)).mean())
    return PredictiveCheck(float(whole), tuple(floors.tolist()), names, ratio)


__all__ = ["PredictiveCheck", "predictive_check"]
