"""The state of a training, and its file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from femupdate.errors import SurrogateError
from femupdate.storage import write_bytes
from femupdate.surrogate.network import Mvae
from femupdate.surrogate.soap import Soap


@dataclass
class TrainingRun:
    """The state of a training, which a checkpoint holds completely.

    Attributes:
        average: running average of their weights.
        best: state of the average at the lowest validation loss.
        best_epoch: epoch after which it was found.
        seconds: spent so far, all runs together.
    """

    mvae: Mvae
    average: Mvae
    best: dict[str, Tensor]
    optimizer: Soap
    epoch: int = 0
    step: int = 0
    best_loss: float = float("inf")
    best_epoch: int = 0
    seconds: float = 0.0

    @property
    def numbers(self) -> dict[str, float]:
        """Everything but the weights and what the optimiser remembers."""
        return {name: getattr(self, name) for name in _NUMBERS}


_NUMBERS = ("epoch", "step", "best_loss", "best_epoch", "seconds")


def tensors_of(run: TrainingRun) -> dict[str, Tensor]:
    """Weights and what the optimiser remembers, copied to the processor."""
    tensors: dict[str, Tensor] = {}
    for prefix, state in (
        ("mvae", run.mvae.state_dict()),
        ("average", run.average.state_dict()),
        ("best", run.best),
    ):
        tensors |= {f"{prefix}/{name}": value for name, value in state.items()}
    for index, state in run.optimizer.state_dict().items():
        tensors |= {f"adam/{index}/{name}": value for name, value in state.items()}
    return {name: value.to("cpu", copy=True).contiguous() for name, value in tensors.items()}


def restore(run: TrainingRun, tensors: Mapping[str, Tensor], numbers: Mapping[str, float]) -> None:
    """Put a training into the state that `tensors_of` and `numbers` gave."""
    run.mvae.load_state_dict(_part(tensors, "mvae"))
    run.average.load_state_dict(_part(tensors, "average"))
    run.best = _part(tensors, "best")
    adam: dict[int, dict[str, Tensor]] = {}
    for name, value in _part(tensors, "adam").items():
        index, key = name.split("/")
        adam.setdefault(int(index), {})[key] = value
    run.optimizer.load_state_dict(adam)
    for name, number in numbers.items():
        setattr(run, name, number)


def save_checkpoint(run: TrainingRun, path: Path, fingerprint: str) -> None:
    """Write a training, atomically.

    Args:
        fingerprint: settings that a training must share to resume from it.

    Raises:
        StudyError: the file cannot be written.
    """
    metadata = {"numbers": json.dumps(run.numbers), "fingerprint": fingerprint}
    write_bytes(path, save(tensors_of(run), metadata=metadata))


def load_checkpoint(run: TrainingRun, path: Path, fingerprint: str) -> None:
    """Restore the state of a checkpoint into a training that was just set up.

    Raises:
        SurrogateError: the file cannot be read, or is of a training with other settings or data.
    """
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise SurrogateError(
            f"the checkpoint {path} cannot be read ({error}); delete it to train from the start"
        ) from error
    if metadata.get("fingerprint") != fingerprint:
        raise SurrogateError(
            f"the checkpoint {path} belongs to a training with other settings; delete it to train "
            "from the start"
        )
    _check_data(run, _part(tensors, "mvae"), path)
    restore(run, tensors, json.loads(metadata["numbers"]))


def _part(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    start = len(prefix) + 1
    return {k[start:]: v for k, v in tensors.items() if k.startswith(prefix + "/")}


def _check_data(run: TrainingRun, state: dict[str, Tensor], path: Path) -> None:
    """Refuse other data: the buffers hold prior box, mean and scale of the data."""
    for name, now in run.mvae.named_buffers():
        # The order of summation may differ between runs, so rounding may differ.
        if not torch.allclose(state[name], now.cpu(), rtol=1e-4, atol=1e-4):
            raise SurrogateError(
                f"the checkpoint {path} belongs to a training on other data; delete it to train "
                "from the start"
            )
