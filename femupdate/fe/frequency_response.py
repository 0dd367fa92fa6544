"""Harmonic response of the full model, solved directly: an oracle for reduced models."""

import numpy as np
from scipy.sparse import csc_matrix

from femupdate.arrays import Complexes, Floats
from femupdate.errors import ModelError
from femupdate.fe.assembly import AffineOperators
from femupdate.fe.factorization import SingularMatrixError, factorize


def harmonic_displacement(
    operators: AffineOperators,
    theta: Floats,
    frequency_hz: Floats,
    load: Floats,
    damping: csc_matrix,
) -> Complexes:
    """Displacement amplitudes (K + i w C - w^2 M)^-1 f, one factorisation a frequency.

    Args:
        operators: the assembled model.
        theta: (p,) stiffness parameters.
        frequency_hz: (m,) Hz.
        load: (6N,) N and N m, real or complex amplitudes of exp(i w t).
        damping: (n_free, n_free) N s/m, such as `rayleigh_damping`.

    Returns:
        (m, 6N) m and rad, zero at the supports.

    Raises:
        ModelError: a frequency meets an undamped resonance.
    """
    stiffness, force = operators.stiffness(theta), operators.gather(load).astype(complex)
    response = np.zeros((len(frequency_hz), operators.dof), dtype=complex)
    for row, omega in zip(response, 2.0 * np.pi * np.asarray(frequency_hz), strict=True):
        dynamic = stiffness + 1j * omega * damping - omega**2 * operators.mass
        try:
            row[:] = operators.expand(factorize(dynamic.tocsc()).solve(force))
        except SingularMatrixError as error:
            raise ModelError(
                f"the response at {omega / (2.0 * np.pi):g} Hz has no finite value; add damping or "
                "choose another frequency"
            ) from error
    return response


def rayleigh_damping(
    operators: AffineOperators, theta: Floats, of_mass: float, of_stiffness: float
) -> csc_matrix:
    """C = of_mass M + of_stiffness K, that is zeta = (of_mass / w + of_stiffness w) / 2."""
    return (of_mass * operators.mass + of_stiffness * operators.stiffness(theta)).tocsc()


def rayleigh_coefficients(frequency_hz: tuple[float, float], zeta: float) -> tuple[float, float]:
    """Factors of mass (1/s) and stiffness (s) that give zeta at two frequencies.

    Raises:
        ModelError: the frequencies are equal or not positive.
    """
    first, second = sorted(2.0 * np.pi * value for value in frequency_hz)
    if not 0.0 < first < second:
        raise ModelError("Rayleigh damping needs two different positive frequencies")
    return 2.0 * zeta * first * second / (first + second), 2.0 * zeta / (first + second)
