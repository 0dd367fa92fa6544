"""All stiffness vectors of a shear building that its roof cannot tell apart.

With the masses known, the undamped transfer function from base to roof is
H = prod(omega_j^2) / prod(omega_j^2 - omega^2): a chain has no zeros at its far end, so equal
natural frequencies mean an equal roof response, and for n stories up to n! stiffness vectors share
them (Katafygiotis & Beck 1998, J. Eng. Mech. 124, 463; Katafygiotis & Lam 2002, Earthquake Eng.
Struct. Dyn. 31, 791). A damping law that depends on the frequency alone changes nothing: the
residues are those of the undamped function. The frequencies are equal where the elementary
symmetric functions of the omega_j^2 are, and by the Cauchy-Binet formula those are
    e_j = sum over sets S of j stories of det(B_S^T M^-1 B_S) prod_{i in S} k_i,
B the drift matrix of K = B diag(k) B^T. This is a system of n polynomials of degrees 1 to n, all of
whose roots are followed from those of a system that is solved by hand (total-degree homotopy with
a random complex factor; Sommese & Wampler 2005, The Numerical Solution of Systems of Polynomials).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from femupdate.arrays import Complexes, Flags, Floats, Integers
from femupdate.errors import InferenceError

# n! roots are followed: 24 for four stories take .2 s, 720 for six about twenty.
MOST_STORIES = 6
# Roots at a time: their arrays stay in the processor's cache.
_BATCH = 48
_FIRST_STEP, _LEAST_STEP = 0.02, 1e-7
_FAR = 1e6  # a root this far out, in units of the given stiffness, goes to infinity


@dataclass(frozen=True)
class _System:
    """f_j(k) = sum over sets of weight times product, j = 1 .. n."""

    members: Flags  # (s, n) which stories each set holds
    weight: Floats  # (s,) its determinant
    order: Integers  # (s,) its size

    def value_and_slope(self, k: Complexes) -> tuple[Complexes, Complexes]:
        """f (b, n) and its derivatives (b, n, n) at k (b, n)."""
        count, size = k.shape
        factors = np.where(self.members, k[:, None, :], 1.0)
        # Products of all factors but one, without division: the roots may hold zeros.
        before = np.cumprod(factors, axis=2)
        after = np.cumprod(factors[:, :, ::-1], axis=2)[:, :, ::-1]
        ones = np.ones((count, len(self.weight), 1))
        others = np.concatenate([ones, before[:, :, :-1]], 2) * np.concatenate(
            [after[:, :, 1:], ones], 2
        )
        weighted = self.weight[:, None] * others * self.members
        gather = (self.order[None, :] == np.arange(1, size + 1)[:, None]).astype(float)
        value = (self.weight * before[:, :, -1]) @ gather.T
        return value, np.einsum("js,bsi->bji", gather, weighted)


def equivalent_stiffness(stiffness: Floats, mass: Floats, seed: int = 0) -> Floats:
    """Return all positive stiffness vectors (m, n) that the roof cannot tell apart.

    Returns:
        Sorted by the first story's stiffness; one row is `stiffness` itself.
    """
    stiffness, mass = np.asarray(stiffness, float), np.asarray(mass, float)
    count = len(stiffness)
    if count > MOST_STORIES:
        raise InferenceError(
            f"equivalent solutions of {count} stories would take {count}! paths; at most "
            f"{MOST_STORIES} stories are followed"
        )
    # In units of the given stiffness the wanted root is (1, ..., 1), and all equations are of the
    # order of one.
    system = _system(stiffness, mass)
    roots = _follow(system, np.random.default_rng(seed))
    real = roots[(np.abs(roots.imag) < 1e-7 * (1.0 + np.abs(roots))).all(axis=1)].real
    positive = _distinct(real[(real > 0.0).all(axis=1)])
    if not (np.abs(positive - 1.0).max(axis=1) < 1e-6).any():
        raise InferenceError(
            "the given stiffness was not found among its own equivalents; two solutions probably "
            "coincide there, so move it a little"
        )
    found = positive * stiffness
    return found[np.lexsort(found.T[::-1])]


def _system(stiffness: Floats, mass: Floats) -> _System:
    """The equations in k / stiffness, each divided by its value at (1, ..., 1)."""
    count = len(stiffness)
    drift = np.eye(count) - np.eye(count, k=1)  # column i: story i pulls floors i and i - 1
    gram = drift.T @ np.diag(1.0 / mass) @ drift * np.sqrt(np.outer(stiffness, stiffness))
    sets = [s for size in range(1, count + 1) for s in combinations(range(count), size)]
    members = np.array([[i in s for i in range(count)] for s in sets])
    order = members.sum(axis=1)
    weight = np.array([np.linalg.det(gram[np.ix_(s, s)]) for s in sets])
    total = np.bincount(order, weights=weight)
    return _System(members, weight / total[order], order)


def _follow(system: _System, rng: np.random.Generator) -> Complexes:
    """All finite complex roots (r, n) of f_j = 1, from those of k_j^j = 1."""
    degrees = np.arange(1, system.members.shape[1] + 1)
    circles = [np.exp(2j * np.pi * np.arange(d) / d) for d in degrees]
    starts = np.stack([c.ravel() for c in np.meshgrid(*circles, indexing="ij")], axis=1)
    homotopy = _Homotopy(system, degrees, np.exp(2j * np.pi * rng.random()))
    parts = [_track(homotopy, starts[i : i + _BATCH]) for i in range(0, len(starts), _BATCH)]
    return np.concatenate(parts)


@dataclass(frozen=True)
class _Homotopy:
    """h(k, t) = (1 - t) factor (k_j^j - 1) + t (f_j(k) - 1)."""

    system: _System
    degrees: Integers
    factor: complex

    def __call__(self, k: Complexes, t: Floats) -> tuple[Complexes, Complexes, Complexes]:
        """h (b, n), dh/dk (b, n, n) and dh/dt (b, n) at k (b, n) and t (b,)."""
        value, slope = self.system.value_and_slope(k)
        powers = k ** (self.degrees - 1)
        start, share = self.factor * (k * powers - 1.0), t[:, None]
        jacobian = share[..., None] * slope
        np.einsum("bii->bi", jacobian)[...] += (1.0 - share) * self.factor * self.degrees * powers
        return (1.0 - share) * start + share * (value - 1.0), jacobian, value - 1.0 - start


def _track(homotopy: _Homotopy, k: Complexes) -> Complexes:
    """Follow roots (b, n) from t = 0 to 1 by Euler steps and Newton's; infinite ones are lost."""
    ended = np.full(k.shape, np.nan, dtype=complex)
    rows, t, step = np.arange(len(k)), np.zeros(len(k)), np.full(len(k), _FIRST_STEP)
    while len(rows):
        ahead = np.minimum(t + step, 1.0)
        _, jacobian, change = homotopy(k, t)
        trial = k - (ahead - t)[:, None] * _solve(jacobian, change)
        for _ in range(3):
            value, jacobian, _ = homotopy(trial, ahead)
            move = _solve(jacobian, value)
            trial = trial - move
        last = np.abs(move).max(axis=1) / (1.0 + np.abs(trial).max(axis=1))
        good = last < 1e-9
        k, t = np.where(good[:, None], trial, k), np.where(good, ahead, t)
        step = np.where(good, np.minimum(1.6 * step, 0.1), 0.5 * step)
        ended[rows[t >= 1.0]] = k[t >= 1.0]
        alive = (t < 1.0) & (step > _LEAST_STEP) & (np.abs(k).max(axis=1) < _FAR)
        rows, k, t, step = rows[alive], k[alive], t[alive], step[alive]
    return ended[np.isfinite(ended).all(axis=1)]


def _solve(matrix: Complexes, right: Complexes) -> Complexes:
    """Solutions (b, n) of matrix (b, n, n) for right (b, n), ridged where one is singular."""
    column = right[..., None]
    try:
        solved = np.linalg.solve(matrix, column)
    except np.linalg.LinAlgError:
        solved = np.linalg.solve(matrix + 1e-14 * np.eye(matrix.shape[-1]), column)
    return solved[..., 0].astype(np.complex128, copy=False)


def _distinct(rows: Floats) -> Floats:
    kept: list[Floats] = []
    for row in rows:
        if all(np.abs(row - other).max() > 1e-6 for other in kept):
            kept.append(row)
    return np.array(kept).reshape(-1, rows.shape[1])
