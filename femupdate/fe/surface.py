"""What flat shells of three and of four nodes have in common."""

from dataclasses import dataclass

import numpy as np

from femupdate.arrays import Floats
from femupdate.fe.membrane import DRILLING_STABILISATION
from femupdate.fe.model import POISSON, Elements, column
from femupdate.fe.opensees import OpenSeesPart, OpenSeesTable, sections


@dataclass(frozen=True, kw_only=True)
class Surface(Elements):
    """Flat shells of one thickness each."""

    thickness: Floats = column()  # (n,) m
    poisson_ratio: Floats = column(POISSON)  # (n,)

    @property
    def section(self) -> Floats:
        """Thickness, (n,) m."""
        return self.thickness

    @property
    def elastic(self) -> tuple[Floats, Floats, Floats]:
        """Thickness (m), Young's modulus (Pa) and Poisson's ratio, (n,) each."""
        return self.thickness, self.youngs_modulus, self.poisson_ratio

    @classmethod
    def directions(cls, *which: int) -> np.ndarray:
        """Indices of some of the six degrees of freedom of each node, node by node."""
        return (6 * np.arange(cls.node_count())[:, None] + which).ravel()

    def inertia(self) -> Floats:
        """Mass and rotary inertia of each degree of freedom per area, (n, 6) kg/m2 and kg.

        The rotation about the normal carries as small a part of the rotary inertia as its
        stabilising stiffness is of the shear modulus: its own vibrations then stay near the
        thickness-shear frequency sqrt(12 G / rho) / t, where the plate theory ends.
        """
        translation = self.density * self.thickness
        rotation = translation * self.thickness**2 / 12.0
        drilling = DRILLING_STABILISATION * rotation
        return np.stack([translation] * 3 + [rotation] * 2 + [drilling], axis=1)

    def opensees(self, youngs_modulus: Floats) -> OpenSeesPart:
        """The first of `opensees_types`, or the one that the script's user chooses."""
        figures, which = sections(youngs_modulus, self.poisson_ratio, self.thickness, self.density)
        key = self.name.upper()
        nodes = ("node",) * self.node_count()
        head = ("E in Pa", "nu", "thickness in m", "kg/m3")
        return OpenSeesPart(
            {
                f"{key}_SECTIONS": OpenSeesTable(head, [figures]),
                f"{key}S": OpenSeesTable((*nodes, "section"), [self.nodes, which]),
            },
            _OPENSEES.format(name=self.name, key=key),
        )


_OPENSEES = """
own = [new("section") for _ in {key}_SECTIONS]
for tag, figures in zip(own, {key}_SECTIONS):
    ops.section("ElasticMembranePlateSection", tag, *figures)
for *corners, which in {key}S:
    ops.element(TYPES["{name}"], new("element"), *whole(corners), own[int(which)])
"""
