"""What a calibration gives, and what it says of itself."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import default_rng

from femupdate.arrays import Floats
from femupdate.building.parameters import factor_titles
from femupdate.inference.diagnostics import Identifiability, PredictiveCheck, r_hat
from femupdate.inference.next_event import drawn_error
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import on_all_floors
from femupdate.report.curves import Curve, response_curves
from femupdate.report.quantities import DrawnQuantity, floor_table, tidy_table
from femupdate.report.scale import range_text
from femupdate.result import Item, Note, Notes, Picture, Result, first_lines, plain, took
from femupdate.seeds import spawn
from femupdate.study import Study, as_written, on_files, typed, write_text
from femupdate.tables import Table
from femupdate.units import percent
from femupdate.workflow.calibrate_draws import predictive_log_frf
from femupdate.workflow.mesh_error import open_system
from femupdate.workflow.model import StudyModel
from femupdate.workflow.summary import (
    SUMMARY,
    identifiability_record,
    identified,
    kept_posterior,
    kept_summary,
    parameter_table,
    parameter_titles,
    short_name,
)

POSTERIOR = "posterior"
_LISTED = 8  # parameters whose intervals stand in a line


@dataclass(frozen=True, kw_only=True)
class CalibrationReport(Result):
    """A posterior and what to make of it.

    Attributes:
        model: whose parameters they are.
        posterior: the draws.
        path: where they are stored.
        r_hat: (p,) of the independent runs; None where no runs can be compared.
        identified: which combinations of the parameters the data have determined.
        misfit: mean squared whitened residual of ln|H| at the posterior draw that fits best; 1
            when the model explains the data to within their noise.
        check: posterior predictive p-values; None where theta carries errors of the model, with
            which no draw of it meets the data.
        notes: what the user should know, in sentences.
        seconds: all the time taken.
        invalid: evaluations without a number.
        files: the observations.
        details: those notes that few ask for.
    """

    model: StudyModel
    posterior: Posterior
    path: Path
    r_hat: Floats | None
    identified: Identifiability
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
        model, posterior = self.model, self.posterior
        predicted = predictive_log_frf(model.system, model, posterior)
        seen = on_all_floors(posterior.observation, model.building.floors)
        return response_curves(predicted, seen, _with_errors(model, posterior, predicted))

    @property
    def first(self) -> tuple[str, str]:
        """The verdict, and the interval of every parameter unless they are many."""
        posterior, building = self.posterior, self.model.building
        wrong, seen = bool(posterior.warnings), posterior.observation
        shares = seen.valid.mean(axis=1) if seen.valid.any() else np.ones(len(seen.floors))
        floors = [
            floor if share >= 0.5 else f"{floor} ({percent(share)} of its points)"
            for floor, share in zip(seen.floors, shares, strict=True)
        ]
        verdict = "to be used with care" if wrong else "the data are explained"
        of = f"{building.name}, {', '.join(floors) or 'frequencies'} of {seen.source}"
        titles = parameter_titles(building, posterior.names)
        draws = dict(zip(map(titles.get, posterior.names), posterior.samples.T, strict=True))
        if posterior.zeta_samples is not None:
            draws["damping ratio"] = posterior.zeta_samples
        told = f"factors of {len(draws)} parameters"
        if not self._many:
            told = ", ".join(f"{name} {range_text(own)}" for name, own in draws.items())
        return f"Verdict: {verdict} ({of}).", f"Intervals (90 %): {told}."

    @property
    def _many(self) -> bool:
        return len(self.posterior.names) > _LISTED

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
        yield Note(content={"parameters": posterior.names, **figures, "r_hat": self.r_hat})
        table = parameter_table(self.model.building, posterior, self.r_hat)
        yield replace(table, detail=not self._many)
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
        return {
            "drawn_by": asdict(self.posterior.drawn),
            "misfit": self.misfit,
            "posterior_predictive_p": None if self.check is None else self.check.as_dict(),
            "identifiability": identifiability_record(self.identified),
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
        from femupdate.report.plot_posterior import SampleSet, posterior_pairs, theta_intervals

        posterior, factors = self.posterior, self.posterior.of("stiffness")
        floors = ", ".join(posterior.observation.floors)
        label = f"{floors} ({posterior.drawn.likelihood} likelihood)"
        names = [short_name(name) for name in posterior.names]
        titles = factor_titles(self.model.building)
        yield Picture("frf_fit", lambda: frf_fit(self.curves))
        yield Picture(
            "posterior",
            lambda: posterior_pairs([SampleSet(label, posterior.samples)], names, posterior.bounds),
        )
        yield Picture(
            "stiffness_factors",
            lambda: theta_intervals(
                [titles[name] for name in factors.names],
                [SampleSet(label, factors.samples)],
                factors.bounds,
            ),
        )

    def write_summary(self, study: Study) -> None:
        """Keep in a study as JSON what is read again of the posterior without its draws."""
        posterior = self.posterior
        head, rows = parameter_table(self.model.building, posterior, self.r_hat).sheet()
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


def kept_calibration(study: Study, model: StudyModel) -> CalibrationReport:
    """What a study keeps of a calibration, as the calibration told it.

    Raises:
        StudyError: there is none, or what is kept is damaged.
    """
    posterior, kept = kept_posterior(study, model.building), kept_summary(study)
    with as_written(study.result(SUMMARY)):
        check = kept.get("posterior_predictive_p")
        if check is not None:
            names, floors = zip(*check["floors"].items(), strict=True)
            values = tuple(np.nan if value is None else float(value) for value in floors)
            over = float(check["over_allowed"]) ** 2
            check = PredictiveCheck(float(check["whole"]), values, names, over)
        # A repair and older versions keep theirs with the posterior.
        notes = [*kept.get("notes", ()), *posterior.warnings]
        notes += [*posterior.settings.get("notes", ()), *posterior.observation.notes]
        return CalibrationReport(
            model=replace(model, system=open_system(study, model)),
            posterior=posterior,
            path=study.result("posterior.nc"),
            r_hat=r_hat(posterior.theta),
            identified=identified(posterior),
            misfit=kept.get("misfit", np.nan),
            check=check,
            notes=tuple(dict.fromkeys(map(str, notes))),
            seconds=np.nan,
            invalid=0,
            files=(),
        )


def _with_errors(
    model: StudyModel, posterior: Posterior, predicted: Floats
) -> tuple[Floats, Floats] | None:
    """(f, k) 5 and 95 % of ln|H| with errors of the model as large as learned, and elsewhere."""
    errors = posterior.model_error
    if errors is None:
        return None
    rows, frequency = posterior.rows(len(predicted), 0), model.frequency_hz.numpy()
    floors = predicted.shape[1]
    streams = spawn(0, len(rows))
    moved = [
        values + drawn_error(errors.amplitude, row, errors, floors, frequency, default_rng(stream))
        for values, row, stream in zip(predicted, rows, streams, strict=True)
    ]
    low, high = np.quantile(moved, [0.05, 0.95], axis=0)
    return low, high
