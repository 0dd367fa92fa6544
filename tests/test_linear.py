"""The same digits wherever numbers happen to lie in memory."""

import numpy as np
import pytest
import torch

from femupdate.linear import least_squares


def shifted(tensor, places):
    """The same numbers so many places further in a larger piece of memory."""
    room = torch.empty(tensor.numel() + 16, dtype=tensor.dtype)
    view = room[places : places + tensor.numel()].view(tensor.shape)
    return view.copy_(tensor)


@pytest.mark.parametrize(("rows", "columns"), [(3, 3), (7, 7), (123, 7), (40, 1)])
def test_least_squares_do_not_depend_on_the_place_in_memory(rows, columns):
    generator = torch.Generator().manual_seed(rows)
    matrix = torch.randn(rows, columns, generator=generator, dtype=torch.float64)
    right = torch.randn(rows, generator=generator, dtype=torch.float64)
    found = {
        least_squares(shifted(matrix, j), shifted(right, k)).numpy().tobytes()
        for j in range(8)
        for k in range(8)
    }
    assert len(found) == 1
    expected = np.linalg.lstsq(matrix.numpy(), right.numpy(), rcond=None)[0]
    np.testing.assert_allclose(least_squares(matrix, right).numpy(), expected, rtol=1e-9)
