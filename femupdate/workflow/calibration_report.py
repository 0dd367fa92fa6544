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
from femupdate.dynamics.system import System
from femupdate.inference.diagnostics import Identifiability, PredictiveCheck
from femupdate.inference.next_event import drawn_error
from femupdate.inference.posterior import Posterior
from femupdate.measurement.observation import on_all_floors
from femupdate.report.curves import Curve, response_curves
from femupdate.report.scale import plus_minus
from femupdate.result import Item, Note, Notes, Picture, Result, plain
from femupdate.seeds import spawn
from femupdate.study import Study, write_text
from femupdate.tables import Column, Table
from femupdate.workflow.calibrate_draws import predictive_log_frf
from femupdate.workflow.model import StudyModel
from femupdate.workflow.prediction_quantities import DrawnQuantity, floor_table, tidy_table
from femupdate.workflow.summary import (
    SUMMARY,
    identifiability_record,
    parameter_table,
    parameter_titles,
    short_name,
)

POSTERIOR = "posterior"


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

    def with_settings(self, more: Mapping[str, Any]) -> "CalibrationReport":
        """The same, whose posterior keeps more settings."""
        settings = {**self.posterior.settings, **more}
        return replace(self, posterior=replace(self.posterior, settings=settings))

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """|H| of every floor, the top floor first, measured and predicted."""
        return fitted_curves(self.model.system, self.model, self.posterior)

    def items(self) -> Iterator[Item]:
        """The posterior in a table, what it is worth, notes and tables."""
        posterior, seen = self.posterior, self.posterior.observation
        drawn, zeta = posterior.drawn, self.posterior.zeta_samples
        yield Note(
            f"{drawn.likelihood.capitalize()} posterior of {self.model.building.name} "
            f"from {', '.join(seen.floors) or 'frequencies'} of {seen.source}: "
            f"{len(posterior.samples)} draws, {self.seconds:.1f} s",
            {"likelihood": drawn.likelihood, "floors": seen.floors, "seconds": self.seconds},
        )
        yield self._parameters()
        if zeta is not None:
            ratio = {"zeta": {"mean": zeta.mean(), "sd": zeta.std()}}
            yield Note(f"  damping ratio {plus_minus(zeta.mean(), zeta.std())}", ratio)
        content: dict[str, Any] = {"evaluations": drawn.evaluations, "invalid": self.invalid}
        if drawn.log_evidence is not None:
            content["log_evidence"] = drawn.log_evidence
            content["log_evidence_error"] = drawn.log_evidence_error
        told = "\n".join(f"  {sentence}" for sentence in drawn.sentences())
        yield Note(told, {**content, "particles": len(posterior.samples)})
        yield Note(content=self._worth())
        if self.check is not None:
            yield Note(f"  {self.check.sentence()}")
        yield Notes(self.notes, f"{SUMMARY} in the study", key="notes")
        yield Note(f"  {self.path}", {"posterior": self.path, "files": self.files})
        yield parameter_table(self.model.building, posterior)
        yield from self._stiffness()
        yield self._responses()

    def _worth(self) -> dict[str, Any]:
        """What the posterior is worth, for JSON and the summary."""
        return {
            "drawn_by": asdict(self.posterior.drawn),
            "misfit": self.misfit,
            "posterior_predictive_p": None if self.check is None else self.check.as_dict(),
            "identifiability": identifiability_record(self.identified),
        }

    def _parameters(self) -> Table:
        """For people, with the agreement of the runs."""
        draws, names = self.posterior.samples, self.posterior.names
        low, high = np.quantile(draws, [0.05, 0.95], axis=0)
        values = {"mean": draws.mean(axis=0), "sd": draws.std(axis=0), "q05": low, "q95": high}
        heads = {"q05": "5 %", "q95": "95 %"}
        titles = parameter_titles(self.model.building, names)
        columns = [
            Column(own, heads.get(key, key), [f"{v:.4f}" for v in own], key=key)
            for key, own in values.items()
        ]
        hats = None if self.r_hat is None else [f"{hat:.3f}" for hat in self.r_hat]
        return Table(
            name="parameters",
            columns=(
                Column(names, "", key="parameters"),
                *columns,
                Column(self.r_hat, None if hats is None else "r-hat", hats, key="r_hat"),
                Column([titles[name] for name in names], "of"),
            ),
            words_last=True,
        )

    def _stiffness(self) -> Iterator[Table]:
        """Stiffness of the stories, where the file gives it; of a frame, `predict` computes it."""
        building, factors = self.model.building, self.posterior.of("stiffness").samples
        known = [getattr(story, "stiffness", None) for story in building.stories]
        if None not in known:
            values = 1e-6 * factors * np.array(known, dtype=float)
            places = tuple(building.story_names)
            yield tidy_table(
                "story_stiffness", [DrawnQuantity("stiffness", "kN/mm", places, values)]
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
        head, rows = parameter_table(self.model.building, posterior).sheet()
        kept = rows[: len(posterior.names)]
        content = {
            **self._worth(),
            "floors": posterior.observation.floors,
            "source": posterior.observation.source,
            "draws": len(posterior.samples),
            "parameters": [dict(zip(("name", *head[1:]), row, strict=True)) for row in kept],
            "notes": self.notes,
        }
        write_text(study.result(SUMMARY), json.dumps(plain(content), indent=1) + "\n")


def fitted_curves(system: System, model: StudyModel, posterior: Posterior) -> tuple[Curve, ...]:
    """|H| of every floor, the top floor first, measured and predicted."""
    predicted = predictive_log_frf(system, model, posterior)
    seen = on_all_floors(posterior.observation, model.building.floors)
    return response_curves(predicted, seen, _with_errors(model, posterior, predicted))


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
        own + drawn_error(errors.amplitude, row, errors, floors, frequency, default_rng(stream))
        for own, row, stream in zip(predicted, rows, streams, strict=True)
    ]
    low, high = np.quantile(moved, [0.05, 0.95], axis=0)
    return low, high
