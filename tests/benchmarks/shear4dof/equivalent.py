"""All stiffness vectors of a shear building that its roof cannot tell apart.

With the masses known, the undamped transfer function from base to roof is
H = prod(omega_j^2) / prod(omega_j^2 - omega^2): a chain has no zeros at its far end, so equal
natural frequencies mean an equal roof response, and for n stories up to n! stiffness vectors share
them (Katafygiotis & Beck 1998, J. Eng. Mech. 124, 463; Katafygiotis & Lam 2002, Earthquake Eng.
Struct. Dyn. 31, 791). A damping law that depends on the frequency alone changes nothing: the
residues are those of the undamped function.
"""

import numpy as np

from femupdate.arrays import Floats
from femupdate.errors import InferenceError

# Enough for all that the roots of polynomials give, in a hundred buildings of up to four stories.
_STARTS, _STEPS = 1000, 40


def equivalent_stiffness(stiffness: Floats, mass: Floats, seed: int = 0) -> Floats:
    """Return all positive stiffness vectors (m, n) that the roof cannot tell apart.

    By Newton's method in ln k on ln omega^2, from many random starts.

    Returns:
        Sorted by the first story's stiffness; one row is `stiffness` itself.
    """
    stiffness, mass = np.asarray(stiffness, float), np.asarray(mass, float)
    count = len(stiffness)
    drift = np.eye(count) - np.eye(count, k=1)  # column i: story i pulls floors i and i - 1
    root = drift / np.sqrt(mass)[:, None] * np.sqrt(stiffness)

    def frequencies(x: Floats) -> tuple[Floats, Floats]:
        """ln omega^2 (s, n) at stiffness over the given one, exp(x) (s, n), and its derivatives."""
        squared, shapes = np.linalg.eigh((root * np.exp(x)[:, None, :]) @ root.T)
        share = (shapes.mT @ root) ** 2 * np.exp(x)[:, None, :] / squared[..., None]
        return np.log(squared), share

    wanted = frequencies(np.zeros((1, count)))[0]
    x = np.random.default_rng(seed).normal(scale=1.5, size=(_STARTS, count))
    for _ in range(_STEPS):
        found, share = frequencies(x)
        step = np.linalg.solve(share + 1e-12 * np.eye(count), (wanted - found)[..., None])[..., 0]
        x = (x + step.clip(-0.5, 0.5)).clip(-12.0, 12.0)
    ended = x[np.abs(frequencies(x)[0] - wanted).max(axis=1) < 1e-9]
    kept: list[Floats] = [np.zeros(count)]
    for row in ended:
        if all(np.abs(row - other).max() > 1e-6 for other in kept):
            kept.append(row)
    if np.linalg.cond(frequencies(np.zeros((1, count)))[1][0]) > 1e6:
        raise InferenceError("two solutions nearly coincide; move the stiffness a little")
    solutions = np.exp(kept) * stiffness
    return solutions[np.lexsort(solutions.T[::-1])]
