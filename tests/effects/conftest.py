"""Two buildings small enough for their full equations."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from scipy.linalg import eigh

from femupdate.building import from_document, load_building
from femupdate.dynamics import ConstantDamping, ReducedStructure, System, lumped, reduced_on
from femupdate.effects import CATALOGUE, Placed, structure_of
from tests import documents
from tests.effects.equations import Equations, chain_equations, frame_equations


@dataclass(frozen=True)
class Case:
    """A building with its exact reduction and its equations by hand."""

    # structure, reduced: of femupdate
    structure: object
    reduced: ReducedStructure
    theta: np.ndarray  # (p,) factors, no two alike
    frequency_hz: np.ndarray  # (k,)
    equations: Equations  # at theta

    @property
    def building(self):
        return self.structure.building

    @property
    def mesh(self):
        return self.structure.mesh

    def equations_of(self, model):
        """Equations of another model on the same nodes."""
        return frame_equations(self.mesh, model, self.theta)

    def placed(self, *labels):
        return tuple(
            Placed(CATALOGUE[name], place) for name, place in (one.split("@") for one in labels)
        )

    def system(self, *labels, law=None):
        placed = self.placed(*labels)
        terms = tuple(self.reduced.terms(one) for one in placed)
        return System(self.reduced.model, law or ConstantDamping(), placed, terms)

    def frf(self, *labels, sizes=(), zeta=0.03, law=None):
        """(f, k) of the program."""
        tensors = [torch.from_numpy(np.array([v], dtype=float)) for v in (self.theta, zeta, sizes)]
        grid = torch.from_numpy(self.frequency_hz)
        return self.system(*labels, law=law).frf(*tensors, grid)[0].numpy()


def _exact(structure, theta, frequency_hz, equations):
    """The structure on a complete mass-orthonormal basis: nothing is left out."""
    if structure.is_stick:
        reduced = lumped(structure)
    else:
        mass = structure.mass.toarray()
        basis = eigh(structure.stiffness(np.ones(len(theta))).toarray(), mass)[1]
        reduced = reduced_on(structure, basis)
    return Case(structure, reduced, np.asarray(theta), frequency_hz, equations)


@pytest.fixture(scope="session")
def frame_document():
    """Two unequal stories, a wall off the centre, a wall opposite that only weighs."""
    gable = {"along": "P", "from": "B", "to": "C", "thickness": 0.1, "role": "non_structural"}
    return documents.frame(
        {"A": 0.0, "B": 5.0, "C": 9.0},
        {"P": 0.0, "Q": 6.0},
        {"low": 3.4, "high": 2.9},
        size=5.0,
        walls=[
            {"along": "Q", "from": "A", "to": "B", "thickness": 0.15},
            gable | {"stiffness": False},
        ],
        slabs=[{"x": ["A", "C"], "y": ["P", "Q"], "thickness": 0.15}],
        floor_mass=[{"total": 90e3, "floors": ["2F"]}, {"total": 70e3, "floors": ["RF"]}],
        sensors={"direction": "x", "points": ["A-P", "C-Q"]},
    )


@pytest.fixture(scope="session")
def stick():
    building = load_building("shear_4dof")
    theta = np.array([0.7, 1.4, 1.1, 0.5])
    grid = np.linspace(0.3, 20.0, 60)
    return _exact(structure_of(building), theta, grid, chain_equations(building, theta))


@pytest.fixture(scope="session")
def frame(frame_document):
    infill = {"along": "P", "from": "A", "to": "B", "thickness": 0.15, "formula": "EN 1998-1"}
    brace = {"along": "Q", "from": "B", "to": "C", "section": "beam"}
    more = {"infills": [infill], "braces": [brace]}
    structure = structure_of(from_document(frame_document | more))
    theta = np.array([0.8, 1.3])
    grid = np.linspace(0.5, 30.0, 60)
    equations = frame_equations(structure.mesh, structure.mesh.model, theta)
    return _exact(structure, theta, grid, equations)


@pytest.fixture(scope="session", params=["stick", "frame"])
def case(request):
    return request.getfixturevalue(request.param)
