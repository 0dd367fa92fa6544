"""Responses of modes at many frequencies, against the sum over all modes at each of them."""

import numpy as np
import pytest
import torch

from femupdate.dynamics import Modes, response


def modes(frequency_hz: np.ndarray, rows: int = 3, samples: int = 2, seed: int = 1) -> Modes:
    """Modes whose frequencies differ by a tenth between samples, with random shapes."""
    random = np.random.default_rng(seed)
    scale = 1.0 + 0.1 * np.arange(samples)[:, None]
    inverse = (2.0 * np.pi * frequency_hz * scale) ** -2.0
    shapes = random.standard_normal((samples, rows, len(frequency_hz))) * inverse[:, None] ** 0.5
    part = random.standard_normal((samples, 2, len(frequency_hz))) * inverse[:, None] ** 0.5
    parts = inverse, shapes, part, np.ones((samples, rows, 2))
    return Modes(*(torch.from_numpy(np.ascontiguousarray(one)) for one in parts))


def one_by_one(known: Modes, ratio: torch.Tensor, omega: torch.Tensor) -> np.ndarray:
    """Receptance (N, o, m, k) of every mode, times its rows."""
    inverse, w = known.inverse.numpy()[:, :, None], omega.numpy()
    share = 1.0 / (1.0 - inverse * w**2 + 2j * ratio.numpy()[:, :, None] * inverse**0.5 * w)
    return known.rows.numpy()[..., None] * share[:, None]


GRIDS = {
    "one frequency": np.array([3.0]),
    "a few": np.linspace(0.5, 30.0, 20),
    "one band": np.linspace(4.0, 6.0, 300),
    "several bands": np.linspace(0.05, 50.0, 3001),
    "down to zero": np.linspace(0.0, 50.0, 1200),
    "not in order": np.random.default_rng(2).permutation(np.linspace(0.05, 50.0, 1300)),
    "by octaves": np.geomspace(0.1, 80.0, 1700),
}


@pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS)
@pytest.mark.parametrize("zeta", [0.002, 0.05, 0.6])
def test_modes_far_from_a_band_are_interpolated_exactly_enough(grid, zeta):
    """All bands, modes in, below and above them: errors of 2.6^-20 of what far modes add."""
    known = modes(np.geomspace(0.4, 4000.0, 90))
    omega = torch.from_numpy(2.0 * np.pi * grid)
    ratio = torch.full_like(known.inverse, zeta)
    found = response(known, ratio, omega, [], columns=2).numpy()
    each = one_by_one(known, ratio, omega)
    sums = np.einsum("nomk,nem->noek", each, known.participation.numpy())
    expected = 1.0 + omega.numpy() ** 2 * sums
    terms = np.abs(known.participation.numpy())
    largest = np.einsum("nomk,nem->noek", np.abs(each), terms)
    allowed = 3.0 * 2.6**-20 * omega.numpy() ** 2 * largest + 1e-12
    assert np.all(np.abs(found - expected) < allowed)


def test_an_impossible_structure_gives_no_number_and_leaves_the_others_alone():
    known = modes(np.geomspace(0.4, 400.0, 30))
    known.inverse[1] = torch.nan
    omega = torch.from_numpy(2.0 * np.pi * np.linspace(0.05, 50.0, 1100))
    ratio = torch.full_like(known.inverse, 0.02)
    found = response(known, ratio, omega, [])
    assert found[1].isnan().all()
    alone = Modes(
        *(part[:1] for part in (known.inverse, known.rows, known.participation, known.direct))
    )
    torch.testing.assert_close(
        found[:1], response(alone, ratio[:1], omega, []), rtol=1e-7, atol=1e-9
    )
