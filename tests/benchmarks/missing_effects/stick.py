"""A stick in OpenSees, with whatever its file does not say."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from femupdate.arrays import Floats

STEP_S = 0.0005  # of average acceleration: the period of 10 Hz is .008 % too long


@dataclass(frozen=True, kw_only=True)
class Stick:
    """Masses on springs, from the ground up, and what is beside them.

    Attributes:
        mass: (f,) kg.
        stiffness: (f,) N/m.
        zeta: of every mode of the springs; None: of mass-proportional damping, zeta in the first.
        springs: (lower, upper, N/m) between levels; 0 is the ground.
        dashpots: (lower, upper, N s/m) likewise.
        pounding: (level, gap in m, N/m): a neighbour that moves with the ground.
        appendage: (level, kg, N/m, N s/m) that hangs on it.
        materials: of stories, in place of elastic springs: name and arguments of OpenSees.
    """

    mass: Floats
    stiffness: Floats
    zeta: float
    mass_proportional: bool = False
    springs: Sequence[tuple[int, int, float]] = ()
    dashpots: Sequence[tuple[int, int, float]] = ()
    pounding: tuple[int, float, float] | None = None
    appendage: tuple[int, float, float, float] | None = None
    materials: Mapping[int, tuple[Any, ...]] = field(default_factory=dict)

    def modes(self) -> tuple[Floats, Floats]:
        """Angular frequencies (f,) and shapes (f, f), a column each, of masses and springs."""
        ops = self._model()
        values = np.array(ops.eigen("-fullGenLapack", len(self.mass)))
        shapes = [
            [ops.nodeEigenvector(level, mode, 1) for mode in range(1, len(values) + 1)]
            for level in range(1, len(self.mass) + 1)
        ]
        return np.sqrt(values), np.array(shapes)

    def respond(self, base: Floats) -> Floats:
        """Absolute accelerations (f, n) under a motion of the base, both every `STEP_S`."""
        ops, levels = self._model(), range(1, len(self.mass) + 1)
        count = len(self.mass) + (self.appendage is not None)
        first = float(np.sqrt(ops.eigen("-fullGenLapack", count)[0]))
        if self.mass_proportional:
            ops.rayleigh(2.0 * self.zeta * first, 0.0, 0.0, 0.0)
        else:
            ops.modalDamping(self.zeta)
        ops.timeSeries("Path", 1, "-dt", STEP_S, "-values", *base.tolist(), "-useLast")
        ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
        ops.constraints("Plain")
        ops.numberer("Plain")
        ops.system("FullGeneral")
        ops.test("NormDispIncr", 1e-10, 30)
        ops.algorithm("Newton")
        ops.integrator("Newmark", 0.5, 0.25)
        ops.analysis("Transient")
        relative = np.zeros((len(self.mass), len(base)))
        for step in range(1, len(base)):
            if ops.analyze(1, STEP_S) != 0:
                raise RuntimeError(f"OpenSees does not converge at {step * STEP_S:.3f} s")
            relative[:, step] = [ops.nodeAccel(level, 1) for level in levels]
        return relative + base

    def _model(self) -> Any:
        import openseespy.opensees as ops

        ops.wipe()
        ops.model("basic", "-ndm", 1, "-ndf", 1)
        for level, kg in enumerate((0.0, *self.mass.tolist())):
            ops.node(level, 0.0)
            if level:
                ops.mass(level, kg)
        ops.fix(0, 1)
        made = 0

        def link(low: int, high: int, material: tuple[Any, ...]) -> None:
            nonlocal made
            made += 1
            name, *arguments = material
            ops.uniaxialMaterial(name, made, *arguments)
            ops.element("zeroLength", made, low, high, "-mat", made, "-dir", 1)

        for story, stiffness in enumerate(self.stiffness.tolist()):
            link(story, story + 1, self.materials.get(story, ("Elastic", stiffness)))
        for low, high, stiffness in self.springs:
            link(low, high, ("Elastic", stiffness))
        for low, high, dashpot in self.dashpots:
            link(low, high, ("Elastic", 0.0, dashpot))
        if self.pounding is not None:
            level, gap, stiffness = self.pounding
            link(0, level, ("ElasticPPGap", stiffness, 1e12, gap))
        if self.appendage is not None:
            level, kg, stiffness, dashpot = self.appendage
            ops.node(100, 0.0)
            ops.mass(100, kg)
            link(level, 100, ("Elastic", stiffness, dashpot))
        return ops
