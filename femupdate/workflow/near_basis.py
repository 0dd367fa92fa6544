"""The last basis in which every effect may act, as a study keeps it."""

from dataclasses import dataclass

from femupdate.array_archive import write_arrays
from femupdate.arrays import Floats
from femupdate.building.schema import Building
from femupdate.effects.structure import Structure
from femupdate.study import Study
from femupdate.workflow.effects import finder_origin, read_basis

NEAR_BASIS = "finder's basis"
_FILE = "finder_basis.npz"


@dataclass(frozen=True)
class StudyBases:
    """Keeps the last basis that was made for a building.

    Attributes:
        study: that keeps it.
        building: whose full model it reduces.
    """

    study: Study
    building: Building

    def find(self, structure: Structure, theta: Floats, zeta: float) -> Floats | None:
        """The basis (n, r) kept for theta (p,) and zeta, or None.

        Raises:
            StudyError: its file is damaged.
        """
        kept = self.study.find(NEAR_BASIS, self._origin(theta, zeta))
        return None if kept is None else read_basis(kept, structure)

    def keep(self, theta: Floats, zeta: float, basis: Floats) -> None:
        """Keep a basis (n, r) for theta (p,) and zeta."""
        write_arrays(self.study.path(_FILE), basis=basis)
        settings, origin = {"size": basis.shape[1]}, self._origin(theta, zeta)
        self.study.record(NEAR_BASIS, _FILE, "diagnose", origin, settings)

    def _origin(self, theta: Floats, zeta: float) -> dict[str, str]:
        return {
            **finder_origin(self.building),
            "theta": " ".join(f"{factor:.4g}" for factor in theta),
            "zeta": f"{zeta:.4g}",
        }
