"""The learned error of a model against dense covariance matrices and simulated errors."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import multivariate_normal

from femupdate.inference.model_error import ErrorTable, LearnedError

FREQUENCY = torch.linspace(0.5, 12.0, 40, dtype=torch.float64)
FEW = ErrorTable(sizes=(0.05, 0.3), lengths=(1 / 20, 1 / 5), noise=(1.0, 2.0))
SHAPE = (2, len(FREQUENCY))


def weight(seed=0):
    rng = np.random.default_rng(seed)
    values = rng.uniform(5.0, 30.0, SHAPE) ** 2
    values[0, 7:9] = 0.0
    return torch.from_numpy(values)


def covariance(error, row, known=None, cancelled=1.0, everywhere=False):
    """Dense covariance of ln|H|, the noise of the table's row included, where there are points."""
    level, seen = error.levels[row], (error_weight := weight()).flatten() > 0
    values = error.harmonics.at(FREQUENCY)
    one = values @ torch.diag(error.harmonics.spread(level.length_hz) ** 2) @ values.T
    floors = level.own**2 * torch.eye(2).double() + level.common**2
    whole = torch.kron(floors, one)
    if level.common == level.own == 0.0 and not everywhere:
        cancelled = 1.0
    noise = (level.noise * cancelled) ** 2 / error_weight.flatten().clamp_min(1e-30)
    whole = whole + torch.diag(noise)
    if known is not None:
        whole = whole + torch.einsum("ci,cj->ij", known.flatten(1), known.flatten(1))
    return whole[seen][:, seen].numpy(), seen.numpy()


def known_beforehand(wanted, seed):
    known = torch.from_numpy(np.random.default_rng(seed).normal(0.0, 0.1, (3, *SHAPE)))
    return (known, (known * weight().sqrt()).flatten(1)) if wanted else (None, None)


def residuals(count=3, seed=1):
    away = np.random.default_rng(seed).normal(0.0, 0.2, (count, *SHAPE))
    return torch.from_numpy(away), (torch.from_numpy(away) * weight().sqrt()).flatten(1)


def test_a_phase_is_a_second_part_that_only_known_errors_tie_to_the_first():
    """The density of both parts is that of the dense covariance of twice as many floors."""
    rng = np.random.default_rng(7)
    there = (weight() > 0).flatten().repeat(2)
    steps = torch.from_numpy(rng.normal(0.0, 1.0, (3, len(there)))) * there
    error = LearnedError(weight(), FREQUENCY, known=steps, table=FEW, parts=2)
    both = torch.cat([residuals(seed=1)[1], residuals(seed=2)[1]], 1)
    root = weight().sqrt().flatten().repeat(2)
    for row in range(0, len(error.levels), 7):
        one, seen = torch.zeros(len(root), len(root)).double(), (root > 0).numpy()
        dense = torch.from_numpy(covariance(error, row)[0])
        one[np.ix_(seen, seen)] = torch.block_diag(dense, dense)
        cover = root[:, None] * one * root + steps.T @ steps
        cover = cover[seen][:, seen].numpy()
        expected = multivariate_normal(cov=cover).logpdf(both.numpy()[:, seen])
        stated = 0.5 * seen.sum() * np.log(2.0 * np.pi)
        found = error.log_densities(both)[:, row] - error.levels[row].log_weight - stated
        np.testing.assert_allclose(found, expected, rtol=1e-8)
        white = error.whiten(both, row).square().sum(1)
        flat = both.numpy()[:, seen]
        squares = np.einsum("ni,ij,nj->n", flat, np.linalg.inv(cover), flat)
        np.testing.assert_allclose(white, squares, rtol=1e-7)


@pytest.mark.parametrize("with_known", [False, True])
@pytest.mark.parametrize("names", [[], ["cancelled"], ["leaking"], ["cancelled", "leaking"]])
def test_where_parts_cancel_or_leak_rows_with_an_error_have_more_noise(names, with_known):
    """And where an error is known beforehand so has every row."""
    rng = np.random.default_rng(11)
    cancelled = torch.from_numpy(rng.uniform(1.0, 8.0, SHAPE)) ** bool(names)
    of_each = dict.fromkeys(names, cancelled ** (1.0 / max(len(names), 1)))
    known, steps = known_beforehand(with_known, 12)
    error = LearnedError(weight(), FREQUENCY, known=steps, table=FEW, **of_each)
    plain, whitened = residuals()
    seen = (weight() > 0).flatten()
    stated = 0.5 * (weight().flatten()[seen].log() - np.log(2.0 * np.pi)).sum()
    # Rows that count may come in any order.
    kept = error.kept([len(error.levels) - 1, 0, 7, 1])
    found = kept.log_densities(whitened)
    for row, level in enumerate(kept.levels):
        cover, _ = covariance(kept, row, known, cancelled.flatten(), with_known)
        flat = plain.flatten(1)[:, seen].numpy()
        expected = multivariate_normal(cov=cover).logpdf(flat) - float(stated)
        np.testing.assert_allclose(found[:, row] - level.log_weight, expected, rtol=1e-8)
        squares = np.einsum("ni,ij,nj->n", flat, np.linalg.inv(cover), flat)
        np.testing.assert_allclose(kept.whiten(whitened, row).square().sum(1), squares, rtol=1e-7)
        floors, wild = kept.floor_squares(whitened, torch.full((len(flat),), row))
        assert not wild.any()
        np.testing.assert_allclose(floors.sum(1), squares, rtol=1e-7)


@pytest.mark.parametrize("with_known", [False, True])
def test_noise_that_floors_share_ties_them_and_counts_whole_beside_an_error(with_known):
    """Beside an error every floor has noise that is nowhere less than that which ties them."""
    rng = np.random.default_rng(13)
    seen = (weight() > 0).flatten().numpy()
    shared = torch.from_numpy(rng.uniform(0.2, 0.95, SHAPE)) * (weight() > 0)
    known, steps = known_beforehand(with_known, 14)
    error = LearnedError(weight(), FREQUENCY, known=steps, table=FEW, shared=shared)
    plain, whitened = residuals()
    wider = (1.0 - shared**2 + shared * shared.sum(0)).sqrt().flatten()
    both = (shared / weight().clamp_min(1e-30).sqrt()).numpy()
    across = np.diag(both[0] * both[1])
    tied = np.block([[np.zeros_like(across), across], [across, np.zeros_like(across)]])
    tied = tied[np.ix_(seen, seen)]
    noise = 1.0 / weight().flatten().numpy()[seen]
    more = np.diag(noise * (wider.numpy()[seen] ** 2 - 1.0)) - tied
    assert np.linalg.eigvalsh(more).min() > -1e-9
    stated = 0.5 * (weight().flatten()[seen].log() - np.log(2.0 * np.pi)).sum()
    flat, found = plain.flatten(1)[:, seen].numpy(), error.log_densities(whitened)
    for row in (0, 1, 7, len(error.levels) - 1):
        level = error.levels[row]
        cover, _ = covariance(error, row, known, wider)
        if level.common + level.own == 0.0:
            cover = cover + level.noise**2 * tied
        expected = multivariate_normal(cov=cover).logpdf(flat) - float(stated)
        np.testing.assert_allclose(found[:, row] - level.log_weight, expected, rtol=1e-8)
        squares = np.einsum("ni,ij,nj->n", flat, np.linalg.inv(cover), flat)
        np.testing.assert_allclose(error.whiten(whitened, row).square().sum(1), squares, rtol=1e-7)


def test_errors_known_beforehand_that_are_lost_in_the_noise_are_left_out():
    """Of sixty errors most are like the first few: densities are those of all of them."""
    there = (weight() > 0).flatten()
    few = np.random.default_rng(3).normal(0.0, 1.0, (60, 8)) * 0.3 ** np.arange(8)
    many = few @ np.random.default_rng(4).normal(0.0, 1.0, (8, len(there)))
    steps = torch.from_numpy(many) * there
    error = LearnedError(weight(), FREQUENCY, known=steps, table=FEW)
    white = residuals()[1]
    none = LearnedError(weight(), FREQUENCY, table=FEW)
    more = error.whiten(white, 0).shape[1] - none.whiten(white, 0).shape[1]
    assert 3 <= more <= 8
    seen = there.numpy()
    cover = (torch.eye(len(there)).double() + steps.T @ steps)[seen][:, seen].numpy()
    expected = multivariate_normal(cov=cover).logpdf(white.numpy()[:, seen])
    stated = 0.5 * seen.sum() * np.log(2.0 * np.pi)
    # Half of the variances left out, each below .001 of the noise.
    np.testing.assert_allclose(error.log_densities(white)[:, 0] - stated, expected, atol=0.01)


def test_what_errors_known_beforehand_make_up_for_is_no_misfit():
    steps = known_beforehand(True, 2)[1]
    error = LearnedError(weight(), FREQUENCY, known=steps, table=FEW)
    kept, along = error.kept([5, 7]), 2.0 * steps[:1]
    met = kept.by_noise_alone(along).square().sum()
    assert float(met) == pytest.approx(4.0, rel=0.05)  # two standard deviations of one of them
    white = error.whiten(along, 0).square().sum()
    assert float(met) == pytest.approx(float(white), rel=1e-9)


def test_what_all_floors_share_is_no_larger_than_as_much_of_one_alone():
    error = LearnedError(weight(), FREQUENCY, table=FEW)
    for row, level in enumerate(error.levels):
        other = replace(level, common=level.own, own=level.common)
        assert error.levels.index(other) in error.no_larger(row)


def test_residuals_that_are_cut_change_the_density_of_no_others():
    """Each alone, or all together with one that is cut."""
    error = LearnedError(weight(), FREQUENCY, table=FEW, wild=8.0)
    whole = LearnedError(weight(), FREQUENCY, table=FEW)
    calm = residuals()[1].clamp(-7.0, 7.0)
    far = calm[:1].clone()
    far[0, 20] = 500.0
    found = error.log_densities(torch.cat([calm, far]))
    np.testing.assert_allclose(error.log_densities(calm), whole.log_densities(calm), rtol=1e-12)
    np.testing.assert_allclose(found[:-1], whole.log_densities(calm), rtol=1e-12)
    for row in range(0, len(error.levels), 7):
        cut = whole.log_densities(error.tame(far, row))[0, row]
        assert float(found[-1, row]) == pytest.approx(float(cut), rel=1e-12)


def test_the_likeliest_error_is_the_conditional_mean():
    error = LearnedError(weight(), FREQUENCY, table=FEW)
    (plain, whitened), row = residuals(), len(error.levels) - 1
    dense, seen = covariance(error, row)
    noise = error.levels[row].noise ** 2 / weight().flatten().numpy()[seen]
    expected = plain.flatten(1).numpy()[:, seen] @ np.linalg.solve(dense, dense - np.diag(noise))
    values = error.harmonics.at(FREQUENCY)
    found = torch.einsum("nfj,kj->nfk", error.likeliest(whitened, row), values).flatten(1)
    np.testing.assert_allclose(found[:, seen], expected, atol=1e-9)


@pytest.mark.parametrize(("common", "own"), [(0.5, 0.0), (0.0, 0.5), (0.18, 0.18)])
def test_sizes_are_learned_from_errors_of_known_size(common, own):
    """Median over twenty realisations within a third of a truth that the table holds."""
    error = LearnedError(
        torch.full((3, 200), 400.0).double(), torch.linspace(0.5, 20.5, 200).double()
    )
    generator = torch.Generator().manual_seed(4)
    values = error.harmonics.at(torch.linspace(0.5, 20.5, 200).double())
    spread = error.harmonics.spread(1.0)
    found = []
    for _ in range(20):
        c, o = (torch.randn(k, len(spread), generator=generator).double() for k in (1, 3))
        delta = (spread * (common * c + own * o)) @ values.T
        noise = 0.05 * torch.randn(3, 200, generator=generator).double()
        p = torch.softmax(error.log_densities(((delta + noise) * 20.0).flatten()[None]), 1)[0]
        sizes = torch.tensor([[one.common**2, one.own**2] for one in error.levels]).double()
        found.append((p[:, None] * sizes).sum(0).sqrt())
    middle = torch.stack(found).median(0).values
    total = float((middle**2).sum().sqrt())
    assert total == pytest.approx(np.hypot(common, own), rel=0.35)
    assert (middle[0] > middle[1]) == (common > own) or common == own
