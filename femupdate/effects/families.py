"""What effects of one family share: those of channels, and those of one kind of member."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from scipy.sparse import csc_matrix
from torch import Tensor

from femupdate.effects.bars import bending_terms
from femupdate.effects.effect import DrawnBuilding, Effect, Glyph, Stiffness, Terms
from femupdate.effects.structure import Structure, numbers_of, ranges_of
from femupdate.fe.model import Elements


class ChannelEffect(Effect):
    """A fault of one floor's channel, where `sits` does not say otherwise."""

    instrument = True
    sits = "every floor"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The sensors of the place."""
        return drawn.sensors(place)

    def factor(self, omega: Tensor, sizes: Tensor) -> Tensor:
        """What the FRFs of the place are multiplied by, (N, k) at omega (k,), rad/s."""
        raise NotImplementedError

    def observe(self, frf: Tensor, omega: Tensor, sizes: Tensor, rows: tuple[int, ...]) -> Tensor:
        """The factor on the rows of the place."""
        channels, changed = list(rows), frf.clone()
        changed[:, channels] = frf[:, channels] * self.factor(omega, sizes)[:, None, :]
        return changed


ALL = "all"


class MemberStiffness(Effect):
    """A change of the stiffness of some kinds of members, in one story or in all."""

    kinds: ClassVar[tuple[str, ...]]  # of shells and beams in the mesh
    elements: ClassVar[type] = Elements  # of which such members are; others are left alone
    bending_only: ClassVar[bool] = False  # of beams and columns, the second moments of area alone
    at = "in"
    words = ("stiffer", "softer")

    def places(self, structure: Structure) -> tuple[str, ...]:
        """All stories together, and every story, where there are such members."""
        if structure.mesh is None:
            return ()
        parts = [
            block for block in structure.mesh.model.elements if isinstance(block, self.elements)
        ]
        groups = {
            k for block in parts for k in block.group[np.isin(block.kind, self.kinds)].tolist()
        }
        stories = tuple(structure.building.story_names[k] for k in sorted(groups))
        return (ALL, *stories) if len(stories) > 1 else stories

    def points(self, structure: Structure) -> tuple[str, ...]:
        """Ranges of stories that have such members, where all of them are neighbours."""
        stories = [place for place in self.places(structure) if place != ALL]
        names = structure.building.story_names
        between = numbers_of(f"{stories[0]} to {stories[-1]}", names) if stories else []
        if len(between) != len(stories):
            return ()
        first = between[0] if between else 0  # numbers of stories from the first of these on
        return ranges_of(stories, [k - first for k in structure.building.below[first:]])

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The members themselves, of the kinds or of that which the place names."""
        return drawn.members(self.kinds or (place,), place)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The stiffness of the members, scaled by the factor of their story."""
        names = structure.building.story_names
        chosen = numbers_of(place, names)
        if not self.bending_only:
            matrices = self.stiffness(structure)
            scaled = (Stiffness(k, matrices[k]) for k in chosen if matrices[k].nnz)
            return Terms(stiffness=tuple(scaled))
        mesh, operators = structure.meshed
        bending = structure.once(
            ("bending", self.kinds), lambda: bending_terms(mesh.model, operators, self.kinds)
        )
        return Terms(stiffness=tuple(term for term in bending if term.story in chosen))

    def stiffness(self, structure: Structure) -> Sequence[csc_matrix]:
        """That of the members of every story, (n, n)."""
        return structure.member_stiffness(self.kinds)
