"""The optimiser: Adam in the eigenbasis of Shampoo's preconditioner (SOAP), for weight matrices.

A regression accurate to four digits is badly conditioned. Adam, which scales each weight
separately, takes longer. Source: Vyas et al. 2024, arXiv:2409.11321, alg. 3.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import torch
from torch import Tensor

_EPSILON = 1e-8


class Soap:
    """SOAP for groups with `rotate`, Adam with decoupled weight decay for the others.

    It is not derived from torch's own class, which loads torch's compiler: seconds, and a library
    that ends processes in which VTK has drawn.

    Args:
        groups: of parameters, as for any optimiser; those with `rotate` hold matrices alone.

    Attributes:
        param_groups: the groups with all their settings, which may be changed between steps.
    """

    def __init__(self, groups: Sequence[dict[str, Any]], lr: float = 1e-3) -> None:
        defaults = {
            "lr": lr,
            "betas": (0.9, 0.999),
            "weight_decay": 0.0,
            "rotate": False,
            "shape_beta": 0.95,
            "every": 10,
        }
        self.param_groups = [{**defaults, **group} for group in groups]
        self._state: dict[int, dict[str, Tensor]] = {}

    def zero_grad(self) -> None:
        """Forget all gradients."""
        for _, _, weight in self._weights():
            weight.grad = None

    @torch.no_grad()
    def step(self) -> None:
        """Take one step along the gradients."""
        for number, group, weight in self._weights():
            if weight.grad is not None:
                self._step(weight, weight.grad, group, self._state.setdefault(number, {}))

    def _weights(self) -> Iterator[tuple[int, dict[str, Any], Tensor]]:
        """Every weight with its number and its group."""
        pairs = ((group, weight) for group in self.param_groups for weight in group["params"])
        for number, (group, weight) in enumerate(pairs):
            yield number, group, weight

    def _step(
        self, weight: Tensor, gradient: Tensor, group: dict[str, Any], state: dict[str, Tensor]
    ) -> None:
        first = not state
        if first:
            state["step"] = torch.zeros(())
            state["mean"], state["square"] = torch.zeros_like(weight), torch.zeros_like(weight)
        state["step"] += 1.0
        turned, rotated, bases = gradient, group["rotate"], ("rows basis", "columns basis")
        if rotated:
            # Covariances of the gradient's rows and columns, and at first their eigenbases.
            products = {"rows": gradient @ gradient.T, "columns": gradient.T @ gradient}
            for name, product in products.items():
                if first:
                    state[name] = product
                    state[f"{name} basis"] = torch.linalg.eigh(product)[1].contiguous()
                else:
                    state[name].lerp_(product, 1.0 - group["shape_beta"])
            left, right = (state[name] for name in bases)
            turned = left.T @ gradient @ right
        mean_beta, square_beta = group["betas"]
        state["mean"].lerp_(gradient, 1.0 - mean_beta)
        state["square"].mul_(square_beta).addcmul_(turned, turned, value=1.0 - square_beta)
        # Running means start from zero, so they are scaled up at first.
        count = float(state["step"])
        mean = state["mean"] / (1.0 - mean_beta**count)
        root = (state["square"] / (1.0 - square_beta**count)).sqrt() + _EPSILON
        step = left @ ((left.T @ mean @ right) / root) @ right.T if rotated else mean / root
        weight.mul_(1.0 - group["lr"] * group["weight_decay"]).sub_(step, alpha=group["lr"])
        if rotated and count % group["every"] == 0.0:
            # The eigenbases follow by one power iteration, largest eigenvalue first.
            for axis, name in enumerate(("rows", "columns")):
                basis = state[f"{name} basis"]
                image = state[name] @ basis
                order = (basis * image).sum(0).argsort(descending=True)
                state["square"] = state["square"].index_select(axis, order)
                state[f"{name} basis"] = torch.linalg.qr(image[:, order])[0].contiguous()
