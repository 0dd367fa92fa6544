"""Two channels that stand in each other's place."""

from itertools import combinations

from torch import Tensor

from femupdate.effects.families import ChannelEffect
from femupdate.effects.structure import Structure


class SwappedChannels(ChannelEffect):
    """The FRFs of two floors exchanged."""

    name = "swapped_channels"
    title = "Swapped channels"
    sentence = "The channels of two floors are exchanged: cables or column names were mixed up."
    clause = "The channels of {place} are exchanged"
    settled_by = "the labels of the cables, or a tap beside each sensor"
    parameters = ()

    def places(self, structure: Structure) -> tuple[str, ...]:
        """Every pair of floors."""
        return tuple(",".join(pair) for pair in combinations(structure.floors, 2))

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """The two rows exchanged."""
        order = list(range(frf.shape[1]))
        half = len(rows) // 2
        for first, second in zip(rows[:half], rows[half:], strict=True):
            order[first], order[second] = second, first
        return frf[:, order]
