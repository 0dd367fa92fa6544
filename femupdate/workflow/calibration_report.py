"""What a calibration gives and says of itself, what a study keeps of it, titles of parameters."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.random import default_rng

from femupdate.arrays import Floats
from femupdate.building.document import Building, factor_ranges, factor_titles
from femupdate.dynamics.system import System
from femupdate.effects.effect import EffectParameter, Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.tolerances import key_of
from femupdate.errors import StudyError
from femupdate.inference.diagnostics import PredictiveCheck
from femupdate.inference.next_event import drawn_error
from femupdate.inference.posterior import Posterior, load_posterior, save_posterior
from femupdate.measurement.observation import on_all_floors
from femupdate.report.curves import Curve, response_curves
from femupdate.report.quantities import DrawnQuantity, floor_table, tidy_table
from femupdate.report.scale import range_text
from femupdate.result import Item, Note, Notes, Picture, Result, first_lines, plain, took
from femupdate.seeds import spawn
from femupdate.study import SUMMARY, Study, as_written, on_files, typed, write_text
from femupdate.tables import Column, Table
from femupdate.units import listed, percent
from femupdate.workflow.effects import open_system
from femupdate.workflow.model import StudyModel
from femupdate.workflow.observed import ObservationSource


def kept_posterior(study: Study, building: Building) -> Posterior:
    """Read the posterior of a study.

    The study's record says of which building it is; here the draws themselves are looked at, for a
    record can be wrong.

    Raises:
        StudyError: there is none, it is damaged, or its factors or floors are not the building's.
    """
    posterior = load_posterior(study.require("posterior", "calibrate"))
    factors = tuple(factor_ranges(building))
    names = posterior.of("stiffness").names
    if names != factors or not set(posterior.observation.floors) <= set(building.floors):
        raise StudyError(
            f"the {study.key('posterior')} in {study.folder} is not of {building.name}: its factors"
            f" are {', '.join(posterior.names)}, measured at"
            f" {', '.join(posterior.observation.floors)}; run `femupdate calibrate` again"
        )
    return posterior


def parameter_titles(building: Building, names: Sequence[str]) -> Mapping[str, str]:
    """Titles by name, such as "story S3" or "Added mass at 3F: share of the floor's mass"."""
    known = factor_titles(building)
    return {name: known.get(name) or effect_title(name) for name in names}


def placed_effect(label: str) -> Placed | None:
    """The effect at its place that a label such as "added_mass@3F" is; None of another text."""
    name, _, place = label.partition("@")
    return Placed(CATALOGUE[name], place) if name in CATALOGUE else None


def effect_parameter(name: str) -> EffectParameter | None:
    """The parameter of the catalogue that one such as "added_mass@3F.size" is."""
    label, _, parameter_name = name.rpartition(".")
    placed = placed_effect(label)
    known = () if placed is None else placed.effect.parameters
    return next((parameter for parameter in known if parameter.name == parameter_name), None)


def effect_title(name: str) -> str:
    """What a parameter such as "added_mass@3F.size" is of; the name itself where it is another."""
    placed, known = placed_effect(name.rpartition(".")[0]), effect_parameter(name)
    if key := key_of(name):
        place = name.partition("@")[2].rpartition(".")[0]
        if key == "damping_of_modes":
            return f"damping of modes about {place}, within its tolerance"
        return f"{key} of {place}, within its tolerance"
    if placed is None:
        return name
    text = "" if known is None else f": {known.text or known.name}"
    unit = "" if known is None or known.unit == "1" else f" ({known.unit})"
    return f"{placed.in_words}{text}{unit}"


def short_name(name: str) -> str:
    """A name that stands below a panel: θ1, or an effect and which of its parameters."""
    effect, _, rest = name.partition("@")
    if not rest:
        return name.replace("theta_", "θ")
    place, _, parameter = rest.rpartition(".")
    return f"{effect.replace('_', ' ')}, {place}" + (f": {parameter}" if parameter else "")


def parameter_table(building: Building, posterior: Posterior) -> Table:
    """Every parameter with its posterior and its prior, the damping ratio last."""
    titles, names = parameter_titles(building, posterior.names), posterior.names
    agreement = posterior.r_hat
    priors = [f"{low:.3g} to {high:.3g}" for low, high in posterior.bounds]
    hats = [] if agreement is None else [f"{value:.3f}" for value in agreement]
    draws = posterior.samples.T
    if posterior.zeta_samples is not None:
        draws, names = np.vstack([draws, posterior.zeta_samples]), (*names, "zeta")
        priors.append("")
    hats += [""] * (len(names) - len(hats))
    sd = draws.std(axis=1)
    q05, median, q95 = np.quantile(draws, [0.05, 0.5, 0.95], axis=1)
    # With two figures of the standard deviation.
    decimals = [
        4 if not spread > 0.0 else int(np.clip(1 - np.floor(np.log10(spread)), 0, 8))
        for spread in sd
    ]

    def column(values: Floats, key: str, head: str | None = None) -> Column:
        cells = [f"{value:.{count}f}" for value, count in zip(values, decimals, strict=True)]
        return Column(values, head, cells, csv=key)

    of = [titles.get(name, "damping ratio") for name in names]
    return Table(
        name="posterior",
        caption="Parameters",
        note="A factor of 1 is the stiffness in the building file.",
        columns=(
            Column(names, "parameter", csv="parameter"),
            Column(of, csv="of"),
            column(draws.mean(axis=1), "mean", "mean"),
            column(sd, "sd", "sd"),
            column(q05, "q05", "5 %"),
            column(median, "median"),
            column(q95, "q95", "95 %"),
            *([] if agreement is None else [Column(hats, "r-hat")]),
            Column(priors, "prior"),
            Column(of, "of"),
        ),
        corner="",
        words_last=True,
    )


@dataclass(frozen=True, kw_only=True)
class CalibrationReport(Result):
    """A posterior and what to make of it.

    Attributes:
        misfit: mean squared whitened residual of ln|H| at the posterior draw that fits best; 1
            when the model explains the data to within their noise.
        check: posterior predictive p-values; None where theta carries errors of the model, with
            which no draw of it meets the data.
        notes: what the user should know, in sentences.
        invalid: evaluations without a number.
        details: those notes that few ask for.
    """

    model: StudyModel
    posterior: Posterior
    path: Path
    misfit: float
    check: PredictiveCheck | None
    notes: tuple[str, ...]
    seconds: float
    invalid: int
    files: tuple[Path, ...]
    details: tuple[str, ...] = ()

    def with_settings(self, more: Mapping[str, Any]) -> "CalibrationReport":
        """The same, whose posterior keeps more settings."""
        settings = {**self.posterior.settings, **more}
        return replace(self, posterior=replace(self.posterior, settings=settings))

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """|H| of every floor, the top floor first, measured and predicted."""
        model, posterior, erring = self.model, self.posterior, None
        predicted = predictive_log_frf(model.system, model, posterior)
        seen = on_all_floors(posterior.observation, model.building.floors)
        errors = posterior.model_error
        if errors is not None:
            # 5 and 95 % with errors of the model as large as learned, and elsewhere.
            rows, known = posterior.rows(len(predicted), 0), model.frequency_hz.numpy()
            size, left = errors.amplitude, np.ones((len(seen.floors), 1))
            moved = [
                values + drawn_error(size, row, left, errors.harmonics, known, default_rng(stream))
                for values, row, stream in zip(predicted, rows, spawn(0, len(rows)), strict=True)
            ]
            low, high = np.quantile(moved, [0.05, 0.95], axis=0)
            erring = low, high
        return response_curves(predicted, seen, erring)

    @property
    def first(self) -> tuple[str, str]:
        """The verdict, and the interval of every parameter unless they are many."""
        posterior, building = self.posterior, self.model.building
        wrong, seen = bool(posterior.warnings), posterior.observation
        # Beside the floor that has most: a file of a narrow band loses no floor.
        points = dict(zip(seen.floors, seen.valid.sum(axis=1), strict=True))
        few = {
            f: n / max(points.values()) for f, n in points.items() if 2 * n < max(points.values())
        }
        floors = [floor for floor in seen.floors if floor not in few] or seen.floors
        verdict = "to be used with care" if wrong else "the data are explained"
        if wrong and self.check is not None and self.check.missed:
            verdict = f"the data are not explained at {listed(self.check.missed)}"
        of = f"{building.name}, {listed(floors) or 'frequencies'} of {seen.source}"
        for floor, share in few.items():
            of += f"; {floor} has {percent(share)} of the points"
        titles, factors = parameter_titles(building, posterior.names), factor_titles(building)
        draws = dict(zip(posterior.names, posterior.samples.T, strict=True))
        draws = {name: values for name, values in draws.items() if not key_of(name)}
        if posterior.zeta_samples is not None:
            draws["damping ratio"] = posterior.zeta_samples
        many = len(draws) > 9
        told = [f"{len(factors)} stiffness factors in the table"] * many
        shown = {n: v for n, v in draws.items() if not (many and n in factors)}
        told += [f"{titles.get(name, name)} {range_text(v)}" for name, v in shown.items()]
        exact = "; masses, gains and clocks taken as exact" * (building.tolerances is None)
        return f"Verdict: {verdict} ({of}).", f"Intervals (90 %{exact}): {', '.join(told)}."

    @property
    def story_stiffness(self) -> DrawnQuantity | None:
        """Of the stories, where the file gives it; of a frame, `predict` computes it."""
        building, factors = self.model.building, self.posterior.of("stiffness").samples
        known = [getattr(story, "stiffness", None) for story in building.stories]
        if None in known:
            return None
        values = 1e-6 * factors * np.array(known, dtype=float)
        return DrawnQuantity("stiffness", "kN/mm", tuple(building.story_names), values)

    def items(self) -> Iterator[Item]:
        """Verdict, intervals, what to do, warnings; then the table, what it is worth, and notes."""
        posterior, seen = self.posterior, self.posterior.observation
        drawn, zeta, draws = posterior.drawn, posterior.zeta_samples, posterior.samples
        look = typed(on_files("diagnose", self.files), self.path)
        go, page = typed("predict --record RECORD", self.path), typed("report", self.path)
        ahead = f"`{look}` looks for what is missing"
        if not posterior.warnings:
            ahead = f"`{go}`, or `{page}` for the page"
        yield from first_lines(*self.first, ahead)
        yield Notes(posterior.warnings, f"{SUMMARY} in the study", warning=True)
        yield Note(
            f"{drawn.likelihood.capitalize()} posterior: {len(draws)} draws{took(self.seconds)}",
            {"likelihood": drawn.likelihood, "floors": seen.floors, "seconds": self.seconds},
            detail=True,
        )
        q05, q95 = np.quantile(draws, [0.05, 0.95], axis=0)
        figures = {"mean": draws.mean(axis=0), "sd": draws.std(axis=0), "q05": q05, "q95": q95}
        yield Note(content={"parameters": posterior.names, **figures, "r_hat": posterior.r_hat})
        table = parameter_table(self.model.building, posterior)
        yield replace(table, detail=len(self.posterior.names) <= 8)
        if zeta is not None:
            yield Note(content={"zeta": {"mean": zeta.mean(), "sd": zeta.std()}})
        content: dict[str, Any] = {"evaluations": drawn.evaluations, "invalid": self.invalid}
        if drawn.log_evidence is not None:
            content["log_evidence"] = drawn.log_evidence
            content["log_evidence_error"] = drawn.log_evidence_error
        ways = "\n".join(f"  {sentence}" for sentence in drawn.sentences())
        yield Note(ways, {**content, "particles": len(draws), **self._worth()}, detail=True)
        if self.check is not None:
            yield Note(f"  {self.check.sentence()}", detail=True)
        yield Note(content={"notes": self.notes})
        shown = {*posterior.warnings, *self.details}
        others = tuple(note for note in self.notes if note not in shown)
        yield Notes((*others, *self.details), detail=True)
        where = {"posterior": self.path, "files": self.files}
        yield Note(f"  {self.path}", where, detail=True, page=False)
        if seen.valid.any():
            yield self._quality()
        if (stiffness := self.story_stiffness) is not None:
            yield tidy_table("story_stiffness", [stiffness])
        yield self._responses()

    def _worth(self) -> dict[str, Any]:
        """What the posterior is worth, for JSON and the summary."""
        found = self.posterior.identified
        combinations = [
            {
                "kept": part.kept,
                "words": found.describe(part),
                "weight": dict(zip(found.names, np.asarray(part.weight).tolist(), strict=True)),
            }
            for part in found.combinations
        ]
        return {
            "drawn_by": asdict(self.posterior.drawn),
            "misfit": self.misfit,
            "posterior_predictive_p": None if self.check is None else self.check.as_dict(),
            "identifiability": {
                "undetermined": found.undetermined,
                "left_alone": list(found.left_alone),
                "combinations": combinations,
                "modes": [asdict(mode) for mode in found.modes],
            },
        }

    def _quality(self) -> Table:
        """How good the data of every floor are, for the page."""
        seen, rows = self.posterior.observation, []
        for k, (floor, used) in enumerate(zip(seen.floors, seen.valid, strict=True)):
            noise = np.median(seen.noise_sd[k][used]) if used.any() else np.nan
            coherence = "not measured"
            if seen.coherence is not None and used.any():
                coherence = f"{np.nanmedian(seen.coherence[k][used]):.3f}"
            rows.append((floor, f"{used.sum()}", f"{used.size}", f"{noise:.3f}", coherence))
        return Table.of(
            ("floor", "points used", "of", "median noise of ln|H|", "median coherence"),
            rows,
            name="data_quality",
            caption="Quality of the data by floor",
            note="Points are left out for low coherence or little power in the base motion.",
            most=0,
        )

    def _responses(self) -> Table:
        """|H| of every floor and frequency, blank where none was measured."""

        def of_curves(get: Callable[[Curve], Any]) -> Callable[[], list[Any]]:
            return lambda: [get(curve) for curve in self.curves[::-1]]

        return floor_table(
            "frf_fit",
            self.model.building.floors,
            "frequency_hz",
            self.posterior.observation.frequency_hz,
            {
                "measured_abs_h": of_curves(lambda curve: curve.measured),
                "noise_sd_of_log": of_curves(lambda curve: curve.noise),
                "used": of_curves(lambda curve: np.asarray(curve.used, dtype=int)),
                "predicted_abs_h": of_curves(lambda curve: curve.mean),
                "predicted_q05": of_curves(lambda curve: curve.bands[-1].low),
                "predicted_q95": of_curves(lambda curve: curve.bands[-1].high),
            },
        )

    def figures(self) -> Iterator[Picture]:
        """The FRF fit, pairs of parameters and intervals."""
        from femupdate.report.plot_curves import frf_fit
        from femupdate.report.plot_posterior import posterior_pairs, theta_intervals

        posterior, factors = self.posterior, self.posterior.of("stiffness")
        label = f"{listed(posterior.observation.floors)} ({posterior.drawn.likelihood} likelihood)"
        names = [short_name(name) for name in posterior.names]
        titles = factor_titles(self.model.building)
        yield Picture("frf_fit", lambda: frf_fit(self.curves))
        yield Picture(
            "posterior",
            lambda: posterior_pairs({label: posterior.samples}, names, posterior.bounds),
        )
        yield Picture(
            "stiffness_factors",
            lambda: theta_intervals(
                [titles[name] for name in factors.names], {label: factors.samples}, factors.bounds
            ),
        )

    def keep(
        self, study: Study, command: str, source: ObservationSource, made: Mapping[str, Any]
    ) -> None:
        """Write into a study the draws, and as JSON what is read again of them without these.

        Args:
            command: that makes them, from a source and with settings.
        """
        save_posterior(self.posterior, self.path)
        origin = {**self.model.made_from(), **source.made_from()}
        study.record("posterior", "posterior.nc", command, origin, made)
        posterior = self.posterior
        head, rows = parameter_table(self.model.building, posterior).sheet()
        kept = rows[: len(posterior.names)]
        content = {
            **self._worth(),
            "floors": posterior.observation.floors,
            "source": posterior.observation.source,
            "draws": len(posterior.samples),
            "parameters": [dict(zip(("name", *head[1:]), row, strict=True)) for row in kept],
            "first": self.first,
            "warnings": posterior.warnings,
            "notes": self.notes,
        }
        write_text(study.result(SUMMARY), json.dumps(plain(content), indent=1) + "\n")


def predictive_log_frf(
    system: System, model: StudyModel, posterior: Posterior, count: int = 200, seed: int = 0
) -> Floats:
    """ln|H| (n, f, k) of all floors at n posterior draws, measured or not.

    With what else of the base's motion was measured to go with its translation.
    """
    drawn = posterior.parameters.split(posterior.thinned(count, seed))
    sample = drawn.theta, drawn.zeta, drawn.sizes
    beside = posterior.observation.beside
    given = None if beside is None else torch.from_numpy(np.nan_to_num(beside))
    frf = system.frf_beside(sample, model.frequency_hz, given)
    return np.asarray(frf.abs().clamp_min(1e-12).log().numpy())


def kept_calibration(study: Study, model: StudyModel) -> CalibrationReport:
    """What a study keeps of a calibration, as the calibration told it.

    Raises:
        StudyError: there is none, or what is kept is damaged.
    """
    posterior, kept = kept_posterior(study, model.building), study.summary()
    with as_written(study.result(SUMMARY)):
        check = kept.get("posterior_predictive_p")
        if check is not None:
            names, floors = zip(*check["floors"].items(), strict=True)
            values = tuple(np.nan if value is None else float(value) for value in floors)
            over = [check["over_allowed"], *check.get("floors_over", {}).values()]
            ratios = tuple(float(ratio) ** 2 for ratio in over)
            check = PredictiveCheck(float(check["whole"]), values, names, ratios)
        # A repair keeps its own with the posterior.
        notes = [*kept.get("notes", ()), *posterior.warnings]
        notes += [*posterior.settings.get("notes", ()), *posterior.observation.notes]
        return CalibrationReport(
            model=replace(model, system=open_system(study, model)),
            posterior=posterior,
            path=study.result("posterior.nc"),
            misfit=kept.get("misfit", np.nan),
            check=check,
            notes=tuple(dict.fromkeys(map(str, notes))),
            seconds=np.nan,
            invalid=0,
            files=(),
        )
