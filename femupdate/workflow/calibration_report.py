"""What a calibration gives, and what it says of itself."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.inference.identifiability import Identifiability
from femupdate.inference.posterior import Posterior
from femupdate.inference.predictive_check import PredictiveCheck
from femupdate.report.scale import plus_minus
from femupdate.study import Study, write_text
from femupdate.tables import first_notes, table
from femupdate.workflow.model import StudyModel
from femupdate.workflow.summary import SUMMARY, identifiability_record, parameter_titles

POSTERIOR = "posterior"


@dataclass(frozen=True, kw_only=True)
class CalibrationReport:
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

    @property
    def quantiles(self) -> tuple[Floats, Floats]:
        """(p,) 5 % and 95 % quantiles of the parameters."""
        low, high = np.quantile(self.posterior.samples, [0.05, 0.95], axis=0)
        return low, high

    def as_dict(self) -> dict[str, Any]:
        """What `--json` holds."""
        posterior, draws = self.posterior, self.posterior.samples
        low, high = self.quantiles
        zeta, drawn = posterior.zeta_samples, posterior.drawn
        content: dict[str, Any] = {
            "posterior": self.path,
            "likelihood": drawn.likelihood,
            "drawn_by": asdict(drawn),
            "parameters": posterior.names,
            "mean": draws.mean(axis=0),
            "sd": draws.std(axis=0),
            "q05": low,
            "q95": high,
            "r_hat": self.r_hat,
            "misfit": self.misfit,
            "posterior_predictive_p": None if self.check is None else self.check.as_dict(),
            "identifiability": identifiability_record(self.identified),
            "particles": len(draws),
            "evaluations": drawn.evaluations,
            "invalid": self.invalid,
            "files": self.files,
            "floors": posterior.observation.floors,
            "notes": self.notes,
            "seconds": self.seconds,
        }
        if zeta is not None:
            content["zeta"] = {"mean": zeta.mean(), "sd": zeta.std()}
        if drawn.log_evidence is not None:
            content["log_evidence"] = drawn.log_evidence
            content["log_evidence_error"] = drawn.log_evidence_error
        return content

    def write_summary(self, study: Study) -> None:
        """Write means, standard deviations, quantiles, combinations and modes as JSON."""
        posterior, draws = self.posterior, self.posterior.samples
        low, median, high = np.quantile(draws, [0.05, 0.5, 0.95], axis=0)
        sd = draws.std(axis=0, ddof=1)
        head = ("name", "mean", "sd", "q05", "median", "q95")
        columns = (one.tolist() for one in (draws.mean(axis=0), sd, low, median, high))
        rows = zip(posterior.names, *columns, strict=True)
        content = {
            "drawn_by": asdict(posterior.drawn),
            "floors": posterior.observation.floors,
            "source": posterior.observation.source,
            "draws": len(draws),
            "parameters": [dict(zip(head, row, strict=True)) for row in rows],
            "misfit": self.misfit,
            "posterior_predictive_p": None if self.check is None else self.check.as_dict(),
            "identifiability": identifiability_record(self.identified),
            "notes": self.notes,
        }
        write_text(study.result(SUMMARY), json.dumps(content, indent=1) + "\n")

    def lines(self) -> tuple[str, ...]:
        """The posterior in a table, and notes, for people."""
        posterior, draws = self.posterior, self.posterior.samples
        columns = (draws.mean(axis=0), draws.std(axis=0), *self.quantiles)
        head: tuple[str, ...] = ("", "mean", "sd", "5 %", "95 %")
        titles = parameter_titles(self.model.building, posterior.names)
        rows: list[tuple[str, ...]] = [
            (name, *(f"{v:.4f}" for v in values))
            for name, *values in zip(posterior.names, *columns, strict=True)
        ]
        if self.r_hat is not None:
            head = (*head, "r-hat")
            rows = [(*row, f"{hat:.3f}") for row, hat in zip(rows, self.r_hat, strict=True)]
        head = (*head, "of")
        rows = [(*row, titles[name]) for row, name in zip(rows, posterior.names, strict=True)]
        lines = [
            f"{posterior.drawn.likelihood.capitalize()} posterior of {self.model.building.name} "
            f"from {', '.join(posterior.observation.floors) or 'frequencies'} of "
            f"{posterior.observation.source}: "
            f"{len(draws)} draws, {self.seconds:.1f} s",
            table(head, rows, words_last=True),
        ]
        zeta = posterior.zeta_samples
        if zeta is not None:
            lines.append(f"  damping ratio {plus_minus(zeta.mean(), zeta.std())}")
        lines += [f"  {sentence}" for sentence in posterior.drawn.sentences()]
        if self.check is not None:
            lines.append(f"  {self.check.sentence()}")
        lines += first_notes(self.notes, f"{SUMMARY} in the study")
        return (*lines, f"  {self.path}")
