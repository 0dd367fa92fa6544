"""The optimiser: Adam in the eigenbasis of Shampoo's preconditioner (SOAP), for weight matrices.

A regression accurate to four digits is badly conditioned. Adam, which scales each weight
separately, takes longer. Source: Vyas et al. 2024, arXiv:2409.11321, alg. 3.
"""

from collections.abc import Iterator, Mapping, Sequence
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

    def state_dict(self) -> dict[int, dict[str, Tensor]]:
        """What it remembers of each weight, by the weight's number in the groups."""
        return {number: dict(state) for number, state in self._state.items()}

    def load_state_dict(self, state: Mapping[int, Mapping[str, Tensor]]) -> None:
        """Go on from what another one of the same groups remembered."""
        devices = {number: weight.device for number, _, weight in self._weights()}
        self._state = {
            number: {name: value.to(devices[number], copy=True) for name, value in parts.items()}
            for number, parts in state.items()
        }

    def _weights(self) -> Iterator[tuple[int, dict[str, Any], Tensor]]:
        """Every weight with its number and its group."""
        pairs = ((group, weight) for group in self.param_groups for weight in group["params"])
        for number, (group, weight) in enumerate(pairs):
            yield number, group, weight

    def _step(
        self, weight: Tensor, gradient: Tensor, group: dict[str, Any], state: dict[str, Tensor]
    ) -> None:
        if not state:
            state["step"] = torch.zeros(())
            state["mean"], state["square"] = torch.zeros_like(weight), torch.zeros_like(weight)
        first = float(state["step"]) == 0.0
        state["step"] += 1.0
        if group["rotate"]:
            _accumulate(state, gradient, group["shape_beta"], first)
            turned = _turn(gradient, state)
        else:
            turned = gradient
        mean_beta, square_beta = group["betas"]
        state["mean"].lerp_(gradient, 1.0 - mean_beta)
        state["square"].mul_(square_beta).addcmul_(turned, turned, value=1.0 - square_beta)
        # Running means start from zero, so they are scaled up at first.
        count = float(state["step"])
        mean = state["mean"] / (1.0 - mean_beta**count)
        square = state["square"] / (1.0 - square_beta**count)
        if group["rotate"]:
            step = _turn_back(_turn(mean, state) / (square.sqrt() + _EPSILON), state)
        else:
            step = mean / (square.sqrt() + _EPSILON)
        weight.mul_(1.0 - group["lr"] * group["weight_decay"]).sub_(step, alpha=group["lr"])
        if group["rotate"] and count % group["every"] == 0.0:
            _follow(state)


def _accumulate(state: dict[str, Any], gradient: Tensor, beta: float, first: bool) -> None:
    """Update the covariances of the gradient's rows and columns; make the first basis."""
    for name, product in (("rows", gradient @ gradient.T), ("columns", gradient.T @ gradient)):
        if first:
            state[name], state[f"{name} basis"] = (
                product,
                torch.linalg.eigh(product)[1].contiguous(),
            )
        else:
            state[name].lerp_(product, 1.0 - beta)


def _turn(matrix: Tensor, state: dict[str, Any]) -> Tensor:
    """Rotate into the eigenbasis."""
    turned: Tensor = state["rows basis"].T @ matrix @ state["columns basis"]
    return turned


def _turn_back(matrix: Tensor, state: dict[str, Any]) -> Tensor:
    turned: Tensor = state["rows basis"] @ matrix @ state["columns basis"].T
    return turned


def _follow(state: dict[str, Any]) -> None:
    """Update the eigenbases by one power iteration, largest eigenvalue first."""
    for axis, name in enumerate(("rows", "columns")):
        basis, covariance = state[f"{name} basis"], state[name]
        image = covariance @ basis
        order = (basis * image).sum(0).argsort(descending=True)
        state["square"] = state["square"].index_select(axis, order)
        state[f"{name} basis"] = torch.linalg.qr(image[:, order])[0].contiguous()
