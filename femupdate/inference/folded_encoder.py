"""The parameter encoder for one observation, rewritten so that many theta cost little.

What is observed is the same for all theta, so its columns go into the first bias. Whatever reads
the residual stream normalises it first: the mean over its features is taken off once, in the
weights that write the stream, and scale and shift of every normalisation go into the weights that
follow it. What is left of a normalisation is one root mean square a row. The result is that of
the module but for rounding.
"""

from collections.abc import Callable, Iterable
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from femupdate.surrogate.network import (
    LatentGaussian,
    Mvae,
    ParameterEncoder,
    ResidualBlock,
    Visibility,
    parameter_features,
)

_Layer = Callable[[Tensor], Tensor]


class FoldedEncoder:
    """q(z|theta) of a surrogate for one observation.

    Args:
        mvae: on the device where it is to be evaluated; not in training.
        visibility: (1, ...) of the observation.
    """

    def __init__(self, mvae: Mvae, visibility: Visibility) -> None:
        encoder: ParameterEncoder = mvae.parameter_encoder
        blocks = cast(Iterable[ResidualBlock], encoder.blocks)
        self._lower, self._upper = mvae.lower, mvae.upper
        with torch.no_grad():
            weight, seen = encoder.join.weight, visibility.features()
            count = weight.shape[1] - seen.shape[1]
            bias = encoder.join.bias + (seen @ weight[:, count:].T)[0]
            self._join = _layer(_centred(weight[:, :count]), _centred(bias), "none")
            self._blocks = [
                (
                    block.norm.eps,
                    _layer(*_behind(block.norm, block.inner), "swish"),
                    _layer(_centred(block.outer.weight), _centred(block.outer.bias), "none"),
                )
                for block in blocks
            ]
            head = encoder.head
            both = [_behind(head.norm, part) for part in (head.mean, head.log_odds)]
            weights, biases = zip(*both, strict=True)
            self._head_eps = head.norm.eps
            self._head = _layer(torch.cat(weights), torch.cat(biases), "none")

    def __call__(self, theta: Tensor) -> LatentGaussian:
        """theta (n, p), float32, to a Gaussian over (n, z)."""
        stream = self._join(parameter_features(theta, self._lower, self._upper))
        for eps, inner, outer in self._blocks:
            stream = stream + outer(inner(_scaled(stream, eps)))
        mean, log_odds = self._head(_scaled(stream, self._head_eps)).chunk(2, dim=1)
        return LatentGaussian(mean, torch.sigmoid(log_odds.clamp_min(-18.0)))


def _scaled(centred: Tensor, eps: float) -> Tensor:
    """Rows (n, w) of mean zero at variance one."""
    square = torch.linalg.vector_norm(centred, dim=1, keepdim=True) ** 2
    return centred * torch.rsqrt(square / centred.shape[1] + eps)


def _centred(values: Tensor) -> Tensor:
    """Weights (w, n) or bias (w,) of a layer whose outputs get a mean of zero."""
    return values - values.mean(dim=0, keepdim=True)


def _behind(norm: nn.LayerNorm, linear: nn.Linear) -> tuple[Tensor, Tensor]:
    """Weight and bias of a linear layer with the scale and shift of the norm before it."""
    return linear.weight * norm.weight, linear.bias + linear.weight @ norm.bias


def _layer(weight: Tensor, bias: Tensor, after: str) -> _Layer:
    """The fastest linear layer at hand, followed by SiLU where `after` is "swish".

    oneDNN's product is twice as fast as the default on AMD processors; torch has it for its
    compiler alone.
    """
    weight, bias = weight.contiguous(), bias.contiguous()
    try:
        fused = torch.ops.mkldnn._linear_pointwise
        fused(weight.new_zeros(2, weight.shape[1]), weight, bias, after, [], "")
    except (AttributeError, RuntimeError):  # another torch, or weights that are not on a CPU
        return lambda x: _plain(x, weight, bias, after)
    return lambda x: fused(x, weight, bias, after, [], "")


def _plain(x: Tensor, weight: Tensor, bias: Tensor, after: str) -> Tensor:
    linear = functional.linear(x, weight, bias)
    return functional.silu(linear, inplace=True) if after == "swish" else linear
