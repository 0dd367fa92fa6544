"""What a coarse mesh makes too stiff, learned from a finer one of the same building.

A coarse mesh does to natural frequencies what stiffer members do: factors on the members of each
kind and story that give the coarse model the frequencies of the finer one are found at some theta
of the prior. A factor changes the square of a frequency by the share that its members have in the
mode's strain energy. The mean factors, carried on towards an infinitely fine mesh (Richardson
1911), correct the model; how they scatter from theta to theta is what the correction leaves open:
errors that all points share. They widen the intervals and weaken the evidence for whatever they
could pass for, or else the finder would name effects that only make up for a mesh. The members of
every kind and story are a little stiffer or softer than the mean correction has them, every natural
frequency is a little off by itself, and so is what each floor shows of a mode. Without the last the
ratios of floors are trusted where frequencies are not: stiffness factors of an unsymmetrical frame
were off by 2.4 of their standard deviations (rms).

The finer mesh has an error of its own, a third of the one seen (errors fall as the square of the
mesh size). Where the finer mesh itself is the model, that is what is corrected and left open.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from femupdate.arrays import Floats
from femupdate.discrepancy.findings import NAMED, PARTLY, UNKNOWN, Diagnosis
from femupdate.discrepancy.thresholds import MESH_ERROR
from femupdate.dynamics.reduced import ReducedModel, ReducedStructure
from femupdate.dynamics.system import System
from femupdate.effects.effect import UNSCALED, Placed, Terms
from femupdate.effects.registry import CATALOGUE
from femupdate.errors import StructureError
from femupdate.inference.likelihood import Data
from femupdate.inference.parameters import Values
from femupdate.units import percent
from femupdate.workers import in_threads

_MEMBERS = (
    "wall_stiffness",
    "slab_participation",
    "flexible_diaphragm",
    "cracked_beams",
    "cracked_columns",
)
_NUMBERS = ("left", "effect", "shape", "share", "moved")
# Beyond which two modes are not the same: ln f, ln of the size shown, 1 - cosine of the shapes.
_SAME_FREQUENCY, _SAME_EFFECT, _SAME_SHAPE = 0.15, 0.4, 0.05
_LEFT_FACTOR = 2.0  # on what the mean correction leaves where it was learned


@dataclass(frozen=True)
class MeshError:
    """Changes of stiffness that stand for refining a mesh.

    Attributes:
        labels: (q,) of the effects that change the members of one kind in one story.
        mean: (q,) what the finer mesh does, as sizes of those effects.
        sd: (q,) scatter of it from theta to theta.
        left: relative error of frequencies that the mean change leaves, of the worst mode (rms
            over theta).
        effect: rms of the relative error of the size with which the floors show a mode, of what
            is shown most above all.
        shape: what is left then on each floor, as a share of what all of them show (mean of the
            modes' rms: two near ones that mix differently must not decide).
        share: of the mean that is corrected.
        moved: relative changes of frequencies by halving the building's mesh (rms).
    """

    labels: tuple[str, ...]
    mean: tuple[float, ...]
    sd: tuple[float, ...]
    left: float
    effect: float
    shape: float
    share: float = 1.0
    moved: float = 0.0

    @staticmethod
    def of(content: Mapping[str, Any]) -> "MeshError":
        """From plain values, as `dataclasses.asdict` gives them.

        Raises:
            KeyError, ValueError, TypeError: they are no such values.
        """
        labels, mean, sd = (tuple(content[name]) for name in ("labels", "mean", "sd"))
        return MeshError(labels, mean, sd, *(float(content[name]) for name in _NUMBERS))

    @property
    def placed(self) -> tuple[Placed, ...]:
        """The effects."""
        parts = (label.split("@") for label in self.labels)
        return tuple(Placed(CATALOGUE[name], place) for name, place in parts)

    @property
    def too_coarse(self) -> str:
        """What to do about a mesh that is too coarse for names; empty of another."""
        if self.moved < MESH_ERROR.coarse:
            return ""
        return (
            f"Halving the mesh moves frequencies by {percent(self.moved, 1)} (rms): what members "
            "seem to have may be the mesh's. Write split = 1 in [mesh] of one that was read, else "
            "a smaller size."
        )

    @property
    def share_sd(self) -> float:
        """Standard deviation of the share; of what lies beyond the finer mesh."""
        return MESH_ERROR.distance_sd * (self.share % 1.0)

    @property
    def steps(self) -> Floats:
        """(c, q) one standard deviation of every error of the corrected model, as sizes.

        Each member's own, what another program would do to all of them alike and to all of a kind,
        and how far off the limit is to which the model is corrected.
        """
        common = self.share_sd * np.asarray(self.mean)
        alike = np.full(len(self.labels), MESH_ERROR.of_all)
        kinds = np.array([label.partition("@")[0] for label in self.labels])
        sizes = np.array([MESH_ERROR.of_kinds[kind] for kind in kinds])
        of_kind = (np.unique(kinds)[:, None] == kinds) * sizes
        each = np.diag(np.hypot(self.sd, MESH_ERROR.formulation))
        return np.vstack([each, alike, common, of_kind])

    def of_mesh(self, ratio: float) -> "MeshError":
        """Of the coarse mesh, `ratio` times the building's own, whose half was the finer one.

        Corrected is the middle between the finer mesh and an infinitely fine one.
        """
        return replace(self, share=1.0 + 0.125 / (ratio**2 - 0.25))

    def of_half(self) -> "MeshError":
        """Of the finer mesh itself, half as wide as the coarse one: a third of what was seen."""
        left = 1.0 / 3.0
        return replace(
            self,
            sd=tuple(left * value for value in self.sd),
            left=left * self.left,
            effect=left * self.effect,
            shape=left * self.shape,
            share=0.5 * left,
        )


Lesson = tuple[Floats, Floats, Floats, Floats]
"""Of the m modes of one theta: shares (m, q) of the kinds of members in their strain energy,
relative change (m,) of their squared frequencies, weights (m,), and how far (m,) each is the same
mode on both meshes."""


def learn_mesh_error(
    coarse: ReducedModel, fine: ReducedStructure, thetas: Floats, top_hz: float
) -> MeshError:
    """Compare a model with that of a finer mesh.

    Args:
        thetas: (n, p) at which they are compared.
        top_hz: up to which modes are.

    Raises:
        StructureError: no mode is the same on both meshes.
    """
    structure = fine.structure
    names = structure.building.story_names
    # The effects on the members of one kind in one story.
    placed = tuple(
        Placed(CATALOGUE[name], place)
        for name in _MEMBERS
        for place in CATALOGUE[name].places(structure)
        if place in names
    )
    for name in _MEMBERS:
        fresh = [e for e in placed if e.effect.name == name and e.label not in fine.known]
        for effect in fresh:
            fine.terms(effect)
        if fresh:  # hundreds of long matrices fill gigabytes, of which short ones are left
            structure.known.clear()
    ours, theirs = (
        [modes_shown(model, theta, top_hz) for theta in thetas] for model in (coarse, fine.model)
    )
    lessons = list[Lesson]()
    for mine, other, theta in zip(ours, theirs, thetas, strict=True):
        rows, columns, same = _matched(mine, other)
        vectors, squared, shares = other.vectors[:, columns], other.squared[columns], []
        for effect in placed:
            energy = np.zeros(len(columns))
            for story, matrix, _ in fine.terms(effect).stiffness:
                factor = 1.0 if story == UNSCALED else theta[story]
                energy = energy + factor * ((matrix.numpy() @ vectors) * vectors).sum(axis=0)
            shares.append(energy / squared)
        # What the floors show most of must be right above all.
        weight = same * _prominence(mine)[rows]
        change = squared / mine.squared[rows] - 1.0
        lessons.append((np.stack(shares, axis=1), change, weight, same))
    if not any(same.any() for *_, same in lessons):
        raise StructureError(
            f"{structure.building.name}: no mode below {top_hz:g} Hz can be followed from the mesh "
            "to a finer one, so the error of the mesh is unknown; write a smaller mesh.size"
        )
    mean, sd, left = _estimate(lessons, [effect.effect.name for effect in placed])
    labels = tuple(effect.label for effect in placed)
    learned = MeshError(labels, tuple(mean.tolist()), tuple(sd.tolist()), left, 0.0, 0.0)
    _, changes, weights, _ = zip(*lessons, strict=True)
    change, weight = np.concatenate(changes), np.concatenate(weights)
    moved = 0.5 * float(np.sqrt(weight @ change**2 / weight.sum()))
    # The coarse model as the mean factors have it: what they leave is what it misses the true one.
    undone = corrected(fine, replace(learned, share=-1.0)).model
    shown = []
    for mine, theta in zip(ours, thetas, strict=True):
        other = modes_shown(undone, theta, top_hz)
        rows, columns, same = _matched(mine, other)
        effects, right = mine.effect[:, rows], other.effect[:, columns]
        square = (effects**2).sum(axis=0)
        ratio = (effects * right).sum(axis=0) / square
        left_over = np.sqrt(((right - ratio * effects) ** 2).mean(axis=0) / square)
        shown.append((ratio - 1.0, left_over, same * _prominence(other)[columns]))
    sizes, shapes, weight = (np.concatenate(parts) for parts in zip(*shown, strict=True))
    total = max(float(weight.sum()), 1e-300)
    return replace(
        learned,
        effect=float(np.sqrt(weight @ sizes**2 / total)),
        shape=float(weight @ shapes / total),
        moved=moved,
    )


def corrected(reduced: ReducedStructure, mesh: MeshError) -> ReducedStructure:
    """The reduced structure with the stiffness that a fine mesh would give it."""
    terms = in_threads(reduced.terms, mesh.placed)
    return replace(reduced, model=corrected_model(reduced.model, mesh, terms))


def corrected_model(model: ReducedModel, mesh: MeshError, terms: Sequence[Terms]) -> ReducedModel:
    """The same of a reduced model, from what the effects of the error add to it."""
    sizes = mesh.share * np.asarray(mesh.mean)
    return replace(model, stiffness_terms=with_sizes(model.stiffness_terms, sizes, terms))


def with_sizes(stiffness: Floats, sizes: Floats, terms: Sequence[Terms]) -> Floats:
    """The stiffness (t, r, r) of the terms of a model with effects on members of sizes (q,)."""
    changed = stiffness.copy()
    for size, added in zip(sizes, terms, strict=True):
        for story, matrix, _ in added.stiffness:
            changed[story] += size * matrix.numpy()
    return changed


@dataclass(frozen=True, eq=False)
class MeshModes:
    """Modes of the structure on one mesh that the floors show.

    Attributes:
        squared: (m,) squares of the circular frequencies.
        vectors: (r, m) of unit modal mass.
        effect: (f, m) of the floors.
    """

    squared: Floats
    vectors: Floats
    effect: Floats


def modes_shown(model: ReducedModel, theta: Floats, top_hz: float) -> MeshModes:
    """Modes of a structure below a frequency that its floors show."""
    squared, vectors = np.linalg.eigh(model.stiffness(theta))
    effect = (model.floor_shapes @ vectors) * (model.excitation @ vectors)
    size = np.abs(effect).max(axis=0)
    shown = (squared < (2.0 * np.pi * top_hz) ** 2) & (size > 0.003 * size.max())
    return MeshModes(squared[shown], vectors[:, shown], effect[:, shown])


def _prominence(modes: MeshModes) -> Floats:
    """How much (m,) the floors show of each mode, over that of the one they show most."""
    size = np.linalg.norm(modes.effect, axis=0)
    return np.asarray(size / size.max(initial=1e-300))


def _matched(
    ours: MeshModes, theirs: MeshModes
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """Pairs of modes, near in frequency with the same effect on the floors, and how far each is.

    That is 1 of equal modes, and falls smoothly to 0 where any quantity is too far apart (Tukey's
    biweight): at a limit, neighbours that mix as theta or a mesh moves would come and go.
    """
    from scipy.optimize import linear_sum_assignment

    shift = 0.5 * np.abs(np.log(ours.squared[:, None] / theirs.squared))
    sizes = [np.linalg.norm(side.effect, axis=0) for side in (ours, theirs)]
    change = np.abs(np.log(sizes[0][:, None] / sizes[1]))
    alike = np.abs(ours.effect.T @ theirs.effect) / (sizes[0][:, None] * sizes[1])
    apart = [shift / _SAME_FREQUENCY, change / _SAME_EFFECT, (1.0 - alike) / _SAME_SHAPE]
    rows, columns = linear_sum_assignment(sum(apart))
    return rows, columns, (1.0 - np.max(apart, axis=0)[rows, columns].clip(max=1.0) ** 2) ** 2


def _estimate(lessons: list[Lesson], kinds: list[str]) -> tuple[Floats, Floats, float]:
    """Mean factors (q,) and their scatter (q,), alike within a kind, and what is left.

    Factors are normal about their mean; mean, scatter and noise by the EM method (Laird and Ware,
    Biometrics 38, 1982).
    """
    size, groups = len(kinds), np.unique(kinds, return_inverse=True)[1]
    member = np.eye(groups.max() + 1)[groups]  # (q, kinds)
    variance, noise = np.full(size, 0.01**2), 0.01**2
    sums, total_weight = [], 0.0  # weighted products: shares by themselves and by what is sought
    for shares, sought, weight, _ in lessons:
        weighted = weight[:, None] * shares
        sums.append((weighted.T @ shares, weighted.T @ sought, float(weight @ sought**2)))
        total_weight += weight.sum()
    for _ in range(100):
        each = 2.0 * noise  # two modes of one theta err alike
        inside = [np.linalg.inv(products / each + np.diag(1.0 / variance)) for products, *_ in sums]
        # A prior standard deviation of a tenth on the mean factors.
        normal, right = np.eye(member.shape[1]) / 0.1**2, np.zeros(member.shape[1])
        for (products, sought, _), inner in zip(sums, inside, strict=True):
            weight = np.eye(size) - products @ inner / each
            normal += member.T @ weight @ products @ member / each
            right += member.T @ weight @ sought / each
        mean = member @ np.linalg.solve(normal, right)
        spread, squares = np.zeros(size), np.zeros(())
        for (products, sought, square), inner in zip(sums, inside, strict=True):
            deviation = inner @ (sought - products @ mean) / each
            spread += deviation**2 + inner.diagonal()
            total = mean + deviation
            squares = squares + square - 2.0 * total @ sought + total @ products @ total
            squares = squares + np.trace(inner @ products)
        alike = np.bincount(groups, spread) / np.bincount(groups) / len(lessons)
        variance, noise = alike[groups], max(float(squares) / total_weight, 1e-10)
    # Not of all modes: of a building that twists as it sways, one kind errs more than the others.
    missed = (same * np.abs(sought - shares @ mean) for shares, sought, _, same in lessons)
    worst = [miss.max(initial=0.0) for miss in missed]
    # A frequency changes by half of what its square does.
    return mean, np.sqrt(variance), 0.5 * float(np.sqrt(np.mean(np.square(worst))))


@dataclass(frozen=True, eq=False)
class OpenMesh:
    """The errors that a corrected mesh leaves open, as `inference.likelihood.KnownErrors`.

    Attributes:
        terms: of the effects that stand for it, on the basis of the corrected model.
        of_members: the errors of members that the system holds, in standard deviations; none where
            it is empty.
    """

    mesh: MeshError
    terms: tuple[Terms, ...]
    of_members: tuple[float, ...] = ()

    @property
    def likeliest(self) -> Tensor:
        """(m,) errors of the members that the system holds, in standard deviations."""
        return torch.tensor(self.of_members or [0.0] * len(self.mesh.steps), dtype=torch.float64)

    def held(self, likeliest: Tensor, system: System) -> "tuple[OpenMesh, System]":
        """The same, and the system, with other errors (m,) of the members in it."""
        sizes = (likeliest - self.likeliest).numpy() @ self.mesh.steps
        model = system.model
        stiffness = with_sizes(model.stiffness_terms, sizes, self.terms)
        moved = replace(system, model=replace(model, stiffness_terms=stiffness))
        return replace(self, of_members=tuple(likeliest.tolist())), moved

    def freed(self, system: System) -> tuple[System, Callable[[Tensor], Tensor]]:
        """The system with effects that stand for the errors, and their sizes by errors (n, m)."""
        placed, terms = (*system.placed, *self.mesh.placed), (*system.terms, *self.terms)
        steps = torch.from_numpy(self.mesh.steps)
        free = replace(system, placed=placed, terms=terms)
        return free, lambda errors: (errors - self.likeliest) @ steps

    def __call__(self, data: Sequence[Data], system: System, values: Values) -> Tensor:
        """One standard deviation of every error (c, n) about one set of parameters.

        In the unit of the residuals; the system is the corrected model with its effects.
        """
        # On the whole basis: what it left out of members, factors would still have.
        top_hz = 1.25 * max(kind.top_hz for kind in data)
        modes = modes_shown(system.model, values.theta[0].numpy(), top_hz)
        # By one error of the members after the other, along tangents: a whole step bends at peaks,
        # and data would tell it from stiffness factors.
        part = 0.02  # of an error, along which responses are differentiated
        wide, sizes = self.freed(system)
        moved = torch.cat(
            [0.0 * self.likeliest[None], part * torch.eye(len(self.likeliest)).double()]
        )
        steps, count = sizes(self.likeliest + moved), len(moved)
        both = Values(
            values.theta.expand(count, -1),
            values.zeta.expand(count),
            torch.cat([values.sizes.expand(count, -1), steps], dim=1),
        )
        found = _predicted(data, wide, both)
        parts = zip(data, found, strict=True)
        of_members = [member.moved(all_[:1], all_[1:]) / part for member, all_ in parts]
        of_modes = self._of_modes(data, system, values, modes)
        return torch.cat([torch.cat(of_members, dim=1), *of_modes])

    def _of_modes(
        self, data: Sequence[Data], system: System, values: Values, modes: MeshModes
    ) -> Iterator[Tensor]:
        """Errors (c, n) of one mode after the other: of its frequency, and of what floors show.

        A frequency is off by what is left. What all floors show errs alike, and what each does by
        itself: of several kinds of data, in each.
        """
        model, here = system.model, _predicted(data, system, values)

        def moved(other: ReducedModel) -> list[Tensor]:
            there = _predicted(data, replace(system, model=other), values)
            return [kind.moved(*both) for kind, *both in zip(data, here, there, strict=True)]

        more, part = 2.0 * _LEFT_FACTOR * self.mesh.left, 0.01  # of what the floors show of a mode
        for squared, vector in zip(modes.squared, modes.vectors.T, strict=True):
            stiffer = model.stiffness_constant + more * squared * np.outer(vector, vector)
            yield torch.cat(moved(replace(model, stiffness_constant=stiffer)), dim=1)
            shown = model.floor_shapes @ vector
            size = np.linalg.norm(shown)
            shapes = model.floor_shapes + part * size * vector
            changed = moved(replace(model, floor_shapes=shapes))
            alone = [
                _LEFT_FACTOR / part * kind.by_floor(changes[0])
                for kind, changes in zip(data, changed, strict=True)
            ]
            share = torch.from_numpy(shown / size)
            alike = [share[list(kind.rows)] @ all_ for kind, all_ in zip(data, alone, strict=True)]
            yield self.mesh.effect * torch.cat(alike)[None]
            yield self.mesh.shape * torch.block_diag(*alone)


def judged_by_mesh(found: Diagnosis, mesh: MeshError | None) -> Diagnosis:
    """The diagnosis, without a name that a coarse mesh may have made; an instrument's stays."""
    first = found.leading
    if first is None or found.verdict not in (NAMED, PARTLY) or first.placed.effect.instrument:
        return found
    if mesh is None or not mesh.too_coarse:
        return found
    text = f"{first.in_words}, or so the coarse mesh says. {mesh.too_coarse}"
    return replace(found, verdict=UNKNOWN, sentence=text)


def left_open(mesh: MeshError, reduced: ReducedStructure) -> OpenMesh:
    """What is left open of a structure that is `corrected`."""
    return OpenMesh(mesh, tuple(reduced.terms(effect) for effect in mesh.placed))


def _predicted(data: Sequence[Data], system: System, values: Values) -> list[Tensor]:
    return [kind.predicted(system, values.theta, values.zeta, values.sizes) for kind in data]
