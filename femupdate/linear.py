"""Linear algebra that gives the same digits in every run."""

import torch
from torch import Tensor


def least_squares(matrix: Tensor, right: Tensor) -> Tensor:
    """The shortest x (d,) that minimises |matrix x - right|, for (n, d) and (n,), by the SVD.

    The driver that torch takes by default (gelsy) rounds otherwise as its arguments happen to lie
    in memory (MKL 2024.2): fits that stop by a threshold then differ from run to run.
    """
    return torch.linalg.lstsq(matrix, right[:, None], driver="gelsd").solution[:, 0]
