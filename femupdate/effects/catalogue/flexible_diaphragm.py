"""Floors that deform in their plane."""

from femupdate.effects.diaphragm import membrane_terms
from femupdate.effects.drawn_building import DrawnBuilding, Glyph
from femupdate.effects.effect import Effect, Parameter, Stiffness, Terms
from femupdate.effects.structure import Structure
from femupdate.fe.elements.shell import Shells

_ALL, _SLAB = "all", "slab"


class FlexibleDiaphragm(Effect):
    """A factor on the in-plane stiffness of the slabs of one floor or of all."""

    name = "flexible_diaphragm"
    title = "Flexible diaphragm"
    sentence = (
        "The slabs are softer in their plane than modelled (openings, precast joints, cracks), so "
        "that the frames of one floor move apart; best seen with several sensors on a floor."
    )
    confused_with = ("slab_participation", "cracked_beams")
    settled_by = "sensors at the ends and in the middle of one floor, kept apart"
    parameters = (
        Parameter("size", "1", 0.3, lower=-0.95, upper=0.0, text="change of in-plane stiffness"),
    )

    def places(self, structure: Structure) -> tuple[str, ...]:
        """All floors together, and the slab above every story, named after the story."""
        if structure.mesh is None:
            return ()
        shells = structure.mesh.model.elements_of(Shells)
        groups = {int(group) for group in shells.group[shells.kind == _SLAB]}
        own = tuple(structure.building.story_names[group] for group in sorted(groups))
        return (_ALL, *own) if len(own) > 1 else own

    def where(self, place: str) -> str:
        """As `Effect.where`."""
        return "in all stories" if place == _ALL else f"in {place}"

    def said(self, place: str, size: float) -> str:
        """As `Effect.said`."""
        return f"The slabs are {-100.0 * size:.3g} % softer in their plane {self.where(place)}"

    def glyphs(self, drawn: DrawnBuilding, place: str) -> tuple[Glyph, ...]:
        """The slabs themselves."""
        return drawn.members((_SLAB,), place)

    def terms(self, structure: Structure, place: str) -> Terms:
        """The membrane stiffness of the slabs, scaled by the factor of their story."""
        mesh, operators = structure.mesh, structure.operators
        if mesh is None or operators is None:
            raise ValueError("a shear building has no slabs")
        matrices = structure.once(
            ("membrane", _SLAB), lambda: membrane_terms(mesh.model, operators, _SLAB)
        )
        names = structure.building.story_names
        chosen = range(len(names)) if place == _ALL else [names.index(place)]
        own = (Stiffness(k, matrices[k]) for k in chosen if matrices[k].nnz)
        return Terms(stiffness=tuple(own))
