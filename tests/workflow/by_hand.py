"""What the steps are held against: the tower as a chain of masses and springs."""

import numpy as np

from tests.chains import Chain

GRID = 0.2 * np.arange(1, 61)
TOWER = Chain(np.array([3000.0, 2000.0]), np.array([4e6, 2.5e6]))


def tower_modes(theta):
    """Natural frequencies (2,), Hz, and mass-orthonormal modes (2, 2) of the tower at theta."""
    omega, modes = TOWER.at(theta).modes
    return omega / (2 * np.pi), modes


def tower_frf(theta, zeta, frequency_hz):
    """Floor over base acceleration (2, k) of the tower, complex, by its modes."""
    own, modes = tower_modes(theta)
    share = modes * (TOWER.masses @ modes)  # (floor, mode)
    ratio = np.asarray(frequency_hz)[:, None] / own
    # Absolute acceleration: base plus relative, of each mode r^2 / (1 - r^2 + 2 i zeta r).
    return share @ (1.0 + ratio**2 / (1.0 - ratio**2 + 2j * zeta * ratio)).T


def grid_about(draws):
    """Points (n, 3) six sd to either side of draws (s, 3) of theta and zeta, and ln of the prior
    mass of each of the tower.

    Sums over steps of .6 sd are right to exp(-2 pi^2 / .6^2), were the posterior a Gaussian.
    """
    mean, sd = draws.mean(axis=0), draws.std(axis=0)
    axes = np.linspace(mean - 6.0 * sd, mean + 6.0 * sd, 21).T
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, float(np.log(np.prod(0.6 * sd) / (1.5 * 1.5 * 0.09)))


def write_table(path, log_frf, sd, floors=("2F", "RF"), grid=GRID):
    """|H| of some floors with the noise of every point."""
    head = ",".join(["frequency_hz", *floors, *(f"{name}_sd" for name in floors)])
    noise = np.broadcast_to(sd, log_frf.shape)
    rows = np.column_stack([grid, np.exp(log_frf).T, noise.T])
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.12g")
    return path
