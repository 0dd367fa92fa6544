"""The modes of a study under the numbers of its full model."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from femupdate.arrays import Floats
from femupdate.dynamics.tracking import (
    FullModes,
    ReducedModes,
    TrackedMode,
    driven_modes,
    mesh_modes,
    modes_at_one,
    reduced_modes,
    stick_modes,
    track_mode,
)
from femupdate.effects.structure import structure_of
from femupdate.inference.posterior import Posterior
from femupdate.storage import read_arrays, write_arrays
from femupdate.study import Study, StudyPart
from femupdate.tables import Column, Table
from femupdate.units import percent
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import direction_of


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyMode:
    """A mode over draws of the posterior, or at factors 1.

    Attributes:
        number: in the full model at factors 1; None of one that lies above all that are numbered.
        direction: "X", "Y", "X+Y", "torsion" or "floors", which moves most; empty without a number.
        effective_mass: share of the mass that the base motion moves in it, in the mean.
    """

    number: int | None
    direction: str
    effective_mass: float
    tracked: TrackedMode

    @property
    def name(self) -> str:
        """Such as "mode 3 (X)"."""
        return f"mode {self.label}" + (f" ({self.direction})" if self.direction else "")

    @property
    def label(self) -> str:
        """The number as text; where there is none, the frequency."""
        return str(self.number or f"at {self.tracked.frequency_mean:.1f} Hz")

    def at_floors(self, model: StudyModel) -> Floats:
        """(n, f) shapes at the floors of a model, a row a draw in which it is recognised."""
        return np.asarray(self.tracked.recognised @ model.reduced.floor_shapes.T)


def mode_table(modes: Sequence[StudyMode], pictures: Sequence[Path] = ()) -> Table:
    """Frequencies, directions and masses of modes of the posterior.

    Args:
        pictures: of every mode, where they are drawn.
    """
    mean, sd = ([getattr(m.tracked, f"frequency_{of}") for m in modes] for of in ("mean", "sd"))
    share, found = [m.effective_mass for m in modes], [m.tracked.found for m in modes]
    numbers = [m.number for m in modes]
    hertz = [f"{value:.3f}" for value in mean]
    masses, seen = [percent(value, 1) for value in share], [percent(value) for value in found]
    columns = [
        Column(numbers, "mode", [str(value or "-") for value in numbers], "mode", "mode"),
        Column(mean, "frequency, Hz", hertz, "frequency_hz", "frequency_hz"),
        Column(sd, "sd, Hz", [f"{v:.2g}" for v in sd], "frequency_sd_hz", "frequency_sd"),
        Column([m.direction for m in modes], "direction", None, "direction", "direction"),
        Column(share, "effective mass", masses, "effective_mass_share", "effective_mass"),
        Column(found, "recognised in draws", seen, "share_of_draws_recognised", "found"),
        *([Column(pictures, key="picture")] if pictures else []),
    ]
    return Table(
        name="modes",
        caption="Modes that the base motion excites, at the posterior",
        columns=tuple(columns),
        note="Modes have the numbers of the full model with all factors 1.",
        key="modes",
    )


def shape_table(model: StudyModel, posterior: Posterior, modes: Sequence[StudyMode]) -> Table:
    """Mass-normalised shapes at the floors, 1/sqrt(kg), as a table of modes that is read again."""
    shapes = [mode.at_floors(model) for mode in modes]
    mean, sd = (
        np.array([getattr(shape, of)(axis=0) for shape in shapes]) for of in ("mean", "std")
    )
    floors, zeta = model.reduced.floors, posterior.zeta_samples
    damping = mode_damping(model, posterior, modes)
    figures = {
        "mode": [mode.label for mode in modes],
        "frequency_hz": [mode.tracked.frequency_mean for mode in modes],
        "frequency_sd_hz": [mode.tracked.frequency_sd for mode in modes],
        "damping": damping,
        "damping_sd": [""] * len(modes) if zeta is None else damping * zeta.std() / zeta.mean(),
        **dict(zip(floors, mean.T, strict=True)),
        **{f"{floor}_sd": column for floor, column in zip(floors, sd.T, strict=True)},
    }
    return Table(name="shapes", columns=tuple(Column(v, csv=k) for k, v in figures.items()))


def mode_damping(model: StudyModel, posterior: Posterior, modes: Sequence[StudyMode]) -> Floats:
    """(m,) damping ratios by the building's law, in the mean of the posterior."""
    omega = torch.tensor([[2.0 * np.pi * mode.tracked.frequency_mean for mode in modes]])
    return model.law.ratio(omega.double(), torch.tensor([posterior.zeta.mean()]))[0].numpy()


def full_modes(model: StudyModel) -> FullModes:
    """Modes of the full model at factors 1, computed (of the six-story example in five seconds)."""
    if model.reduced.node_shapes is None:
        return stick_modes(model.reduced, "xy".index(direction_of(model.building)))
    return mesh_modes(structure_of(model.building))


def find_modes(study: Study, model: StudyModel) -> FullModes:
    """Modes of the full model as the study keeps them, or computed and not kept."""
    return study.kept(MODES, model.made_from()) or full_modes(model)


def keep_modes(study: Study, model: StudyModel, modes: FullModes) -> None:
    """Keep the modes of a mesh; those of a stick are computed at once."""
    if model.reduced.node_shapes is not None:
        study.keep(MODES, model.made_from(), modes)


def write_full_modes(modes: FullModes, path: Path) -> None:
    """Write modes as npz, atomically."""
    write_arrays(
        path,
        frequency_hz=modes.frequency_hz,
        shapes=modes.shapes.astype(np.float32),
        effective_mass=modes.effective_mass,
        direction=np.array(modes.direction),
    )


def read_full_modes(path: Path) -> FullModes:
    """Read what `write_full_modes` has written."""
    data = read_arrays(path, 4e9)
    names = tuple(str(name) for name in data["direction"])
    return FullModes(data["frequency_hz"], data["shapes"], data["effective_mass"], names)


MODES = StudyPart(
    "modes",
    "modes.npz",
    "build-model",
    write_full_modes,
    read_full_modes,
    lambda modes: {"count": len(modes.direction)},
)


def modes_of_model(model: StudyModel, full: FullModes, count: int) -> tuple[StudyMode, ...]:
    """The modes that move most of the mass, the lowest first, at factors 1."""
    found = reduced_modes(model.reduced, np.ones((1, model.reduced.parameters)))
    chosen = _heaviest(model, found, count)
    return _named(model, full, found, found, chosen, np.arange(model.reduced.size))


def _heaviest(model: StudyModel, at: ReducedModes, count: int) -> list[int]:
    """So many modes that the base motion drives: those of the largest effective mass."""
    driven = driven_modes(model.reduced, at, model.reduced.size)
    mass = (model.reduced.excitation @ at.vectors[0]) ** 2
    return sorted(sorted(driven, key=lambda k: -mass[k])[:count])


def posterior_modes(
    model: StudyModel,
    posterior: Posterior,
    full: FullModes,
    count: int,
    *,
    wanted: Sequence[int] = (),
    samples: int = 60,
    seed: int = 0,
) -> tuple[StudyMode, ...]:
    """Modes followed through draws of the posterior.

    Args:
        count: how many of those that move most of the mass at the posterior, where none is wanted.
        wanted: numbers of modes; those that the reduced model does not have are left out.
    """
    # These shapes do not show parameters of effects.
    theta = posterior.parameters.split(posterior.thinned(samples, seed)).theta.numpy()
    # The reference is the draw nearest to the mean: the mean itself can lie between modes.
    centre = ((theta - theta.mean(axis=0)) / theta.std(axis=0)) ** 2
    nearest = int(centre.sum(axis=1).argmin())
    found = reduced_modes(model.reduced, theta)
    reference = ReducedModes(found.frequency_hz[[nearest]], found.vectors[[nearest]])
    origin = modes_at_one(model.reduced, theta[nearest])
    chosen = _heaviest(model, reference, count)
    if wanted:
        numbers = _numbers(model, full, origin)
        chosen = [numbers.index(number) for number in wanted if number in numbers]
    return _named(model, full, found, reference, chosen, origin)


def _numbers(model: StudyModel, full: FullModes, origin: np.ndarray) -> list[int | None]:
    """Number of every reduced mode that comes from `origin` (r,) at factors 1."""
    at_one = reduced_modes(model.reduced, np.ones((1, model.reduced.parameters)))
    numbers = full.numbers_of(model.reduced, at_one)
    once = [n if numbers.index(n) == k else None for k, n in enumerate(numbers)]
    return [once[k] for k in origin]


def _named(
    model: StudyModel,
    full: FullModes,
    found: ReducedModes,
    reference: ReducedModes,
    chosen: Sequence[int],
    origin: np.ndarray,
) -> tuple[StudyMode, ...]:
    numbers, moved = _numbers(model, full, origin), model.reduced.excitation
    # Shares of the whole mass, as in the table of all modes: supports have some of it.
    at_one = reduced_modes(model.reduced, np.ones((1, model.reduced.parameters)))
    mass = (moved @ at_one.vectors[0]) ** 2
    heaviest = int(mass.argmax())
    number = full.numbers_of(model.reduced, at_one)[heaviest]
    axis = "xy".index(direction_of(model.building))
    share = 0.0 if number is None else full.effective_mass[number - 1, axis]
    whole = mass[heaviest] / share if share > 0.0 else moved @ moved
    return tuple(
        StudyMode(
            number=numbers[k],
            direction=full.direction_of(numbers[k]),
            effective_mass=float(((tracked.recognised @ moved) ** 2).mean() / whole),
            tracked=tracked,
        )
        for k in chosen
        for tracked in (track_mode(found, reference.vectors[0][:, k]),)
    )
