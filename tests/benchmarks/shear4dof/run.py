"""The benchmark `shear4dof`: the published tables, beside the truth."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from femupdate.inference.bridge import Start, bridge
from femupdate.inference.likelihood import LatentLikelihood
from femupdate.inference.smc import LogLikelihood, TemperedSmc
from femupdate.progress import Progress, Silent
from femupdate.surrogate.storage import TrainedSurrogate
from femupdate.workflow.model import StudyModel
from femupdate.workflow.surrogates import shipped_surrogate

from ..calibration.log import surrogate_mark
from ..kept_parts import KeptParts
from ..machine import Machine, this_machine
from ..result import ResultFiles, markdown_table, plain, write_result
from .case import (
    PUBLISHED_SOLUTIONS,
    Case,
    ExactPosterior,
    authors_case,
    benchmark_model,
    case_modes,
    data_likelihood,
    exact_posterior,
)
from .metrics import MmdReference
from .nuts import (
    nuts_chain,
    nuts_row,
    require_pyro,
)
from .observations import (
    ObservationResult,
    observation_results,
    summary_rows,
)
from .pictures import draw_benchmark
from .samplers import (
    PUBLISHED,
    References,
    SamplerRow,
    Spread,
    floor_rows,
    fresh_exact,
    own_posterior,
    row_back,
    sampler_rows,
)

NAME = "shear4dof"


@dataclass(frozen=True)
class Plan:
    """How much of the benchmark is run.

    Attributes:
        sizes: particles of the sampler table.
        runs: of each sampler at each size.
        reference_draws: of the posteriors that others are compared with.
        observations: that latent posterior and bridge are judged on.
        nuts: iterations of the No-U-Turn sampler on each likelihood; 0 for none.
    """

    sizes: tuple[int, ...] = (500, 1000, 2000, 4000)
    runs: int = 10
    reference_draws: int = 50_000
    observations: int = 20
    nuts: int = 0


QUICK = Plan((200,), 2, 3000, 2)


@dataclass(frozen=True)
class Shear4dofReport:
    """What the benchmark found.

    Attributes:
        machine: it ran on.
        case: the authors' observation.
        exact: its data-space posterior.
        samplers: the published sampler table and its kin.
        observations: latent posterior and bridge, case by case.
        text: all tables in Markdown.
        files: written.
        pictures: drawn.
    """

    machine: Machine
    case: Case
    exact: ExactPosterior
    samplers: tuple[SamplerRow, ...]
    observations: tuple[ObservationResult, ...]
    text: str
    files: ResultFiles
    pictures: tuple[Path, ...]


def run_shear4dof(
    folder: Path, seed: int = 0, plan: Plan | None = None, progress: Progress | None = None
) -> Shear4dofReport:
    """Run the benchmark and write its results.

    Rows of the sampler table and observations are written when they are done, beside the results: a
    run of the same plan that was cut off goes on from them.

    Raises:
        SurrogateError: the shipped surrogate does not fit the shipped building.
        InferenceError: scikit-learn, or Pyro where it is asked for, is not installed.
        StudyError, ReportError: a file cannot be written.
    """
    plan, show = plan or Plan(), progress or Silent()
    machine = this_machine("scikit-learn")
    if plan.nuts:
        require_pyro()
    model = benchmark_model()
    surrogate = shipped_surrogate(model.building)
    case = authors_case(model)
    whole = json.dumps([model.hash, surrogate_mark(surrogate), seed, plain(replace(plan, nuts=0))])
    kept = KeptParts(folder / f"{NAME}_parts.jsonl", whole)
    show.start("Exact posterior", 1)
    exact = exact_posterior(model, case, plan.reference_draws, seed)
    show.advance()
    samplers = _samplers(model, surrogate, case, exact, plan, seed, show, kept)
    show.start("Latent posterior and bridge", plan.observations)
    observations = observation_results(
        model,
        surrogate,
        exact,
        plan.observations,
        seed,
        show.advance,
        reference_draws=min(20_000, plan.reference_draws),
        kept=kept,
    )
    text = "\n\n".join(
        (
            "## Equivalent solutions (Table 1)",
            solutions_table(case),
            "## Exact posterior",
            exact_table(exact),
            f"Log evidence {exact.weighted.log_evidence:.3f} ± "
            f"{exact.weighted.log_evidence_error:.3f}.",
            "## Samplers (Table 2)",
            sampler_table(samplers),
            f"## Latent posterior and bridge over {len(observations)} observations",
            observation_table(observations),
        )
    )
    content = {
        "solutions": case.solutions,
        "exact_weight": exact.modes.weight,
        "exact_sd": exact.modes.sd,
        "log_evidence": exact.weighted.log_evidence,
        "log_evidence_error": exact.weighted.log_evidence_error,
        "samplers": samplers,
        "observations": observations,
    }
    files = write_result(folder, NAME, machine, seed, content, text)
    pictures = _draw(folder, model, surrogate, case, exact, seed)
    return Shear4dofReport(
        machine, case, exact, tuple(samplers), tuple(observations), text, files, pictures
    )


def _samplers(
    model: StudyModel,
    surrogate: TrainedSurrogate,
    case: Case,
    exact: ExactPosterior,
    plan: Plan,
    seed: int,
    show: Progress,
    kept: KeptParts,
) -> list[SamplerRow]:
    to_exact = MmdReference(exact.theta)
    latent = LatentLikelihood(surrogate, model.reduced, model.law, case.observation)
    own = own_posterior(model, latent, plan.reference_draws, seed)
    own_theta = own.resample(plan.reference_draws, seed)[0].numpy()
    latent_reference = References(
        MmdReference(own_theta), case_modes(case, own_theta).weight, to_exact
    )
    data_reference = References(to_exact, exact.modes.weight, to_exact)
    data = data_likelihood(model, case)
    both = ((("latent", latent), latent_reference), (("data", data), data_reference))
    rows = []
    for likelihood, references in both:
        show.start(f"Samplers, {likelihood[0]} likelihood", 2 * len(plan.sizes))
        rows += sampler_rows(
            model, case, likelihood, references, plan.sizes, plan.runs, show.advance, kept
        )
        if plan.nuts:
            show.start(f"NUTS, {likelihood[0]} likelihood", plan.nuts)
            smooth = likelihood[1]

            def row(
                label: str = likelihood[0],
                smooth: LogLikelihood = smooth,
                references: References = references,
            ) -> SamplerRow:
                chain = nuts_chain(model.prior, smooth, plan.nuts, seed, show.advance)
                return nuts_row(label, case, chain, references)

            rows.append(kept(f"{likelihood[0]}, NUTS, {plan.nuts}", row, row_back))
    fresh = fresh_exact(model, case, exact, seed + 17)
    return rows + floor_rows(case, exact, fresh, to_exact, plan.sizes, plan.runs)


def _draw(
    folder: Path,
    model: StudyModel,
    surrogate: TrainedSurrogate,
    case: Case,
    exact: ExactPosterior,
    seed: int,
) -> tuple[Path, ...]:
    latent = LatentLikelihood(surrogate, model.reduced, model.law, case.observation)
    start = TemperedSmc(model.prior, latent).run(4000, seed)
    best = bridge(model.prior, data_likelihood(model, case), Start(start, latent), seed)
    draws = {
        "latent": start.theta.numpy(),
        "exact": exact.theta[:4000],
        "bridge": best.theta.numpy(),
    }
    return draw_benchmark(folder, model, surrogate, case, draws)


def solutions_table(case: Case) -> str:
    """Table 1: ours and the published one."""
    head = ("", *(f"theta_{k + 1}" for k in range(4)), "published")
    rows = []
    for k, row in enumerate(case.solutions):
        known = k < len(PUBLISHED_SOLUTIONS)
        published = ", ".join(f"{v:.5f}" for v in PUBLISHED_SOLUTIONS[k]) if known else "-"
        rows.append((f"solution {k + 1}", *(f"{value:.5f}" for value in row), published))
    return markdown_table(head, rows)


def exact_table(exact: ExactPosterior) -> str:
    """Weight and standard deviations of every mode."""
    modes = exact.modes
    rows = [
        (f"mode {k + 1}", f"{modes.weight[k]:.4f}", *(f"{value:.4f}" for value in modes.sd[k]))
        for k in range(len(modes.weight))
    ]
    return markdown_table(("", "weight", *(f"sd theta_{k + 1}" for k in range(4))), rows)


SAMPLER_HEAD = (
    "sampler",
    "N",
    "evaluations",
    "MMD to its own posterior",
    "MMD to the exact one",
    "weights, total variation",
    "log evidence",
    "unique",
    "s",
)


def sampler_text(rows: Sequence[SamplerRow]) -> list[tuple[str, ...]]:
    """Cells of the sampler table."""
    return [
        (
            f"{row.likelihood}, {row.sampler}",
            str(row.particles),
            f"{row.evaluations:.0f}",
            _pm(row.mmd_own, 4),
            _pm(row.mmd_exact, 4),
            _pm(row.weight_distance, 3),
            _pm(row.log_evidence, 2),
            f"{row.unique:.2f}",
            "-" if np.isnan(row.seconds) else f"{row.seconds:.2f}",
        )
        for row in rows
    ]


def sampler_table(rows: Sequence[SamplerRow]) -> str:
    """Table 2: the published rows and ours, each a mean ± sd over the runs."""
    published = [
        (f"published, {name}", str(n or "-"), str(calls), f"{mmd:.3f} ± {sd:.3f}", *"----", f"{s}")
        for name, n, calls, mmd, sd, s in PUBLISHED
    ]
    return markdown_table(SAMPLER_HEAD, [*published, *sampler_text(rows)])


def observation_table(results: Sequence[ObservationResult]) -> str:
    """Median (worst) of every figure, and what was asked for."""
    rows = list(summary_rows(results))
    errors = np.abs([result.evidence_error for result in results])
    rows.append(
        (
            "log evidence, difference from the exact one",
            "-",
            f"{np.median(errors):.3f} ({errors.max():.3f})",
            "-",
            "<= .1",
        )
    )
    rows.append(
        (
            "responses of the building",
            f"{np.mean([r.latent_responses for r in results]):.0f}",
            f"{np.mean([r.responses for r in results]):.0f}",
            "-",
            "-",
        )
    )
    rows.append(
        (
            "latent likelihoods",
            f"{np.mean([r.latent_evaluations for r in results]):.0f}",
            "-",
            "-",
            "-",
        )
    )
    rows.append(
        (
            "seconds",
            f"{np.median([r.latent_seconds for r in results]):.2f}",
            f"{np.median([r.bridge_seconds for r in results]):.2f}",
            "-",
            "-",
        )
    )
    head = ("median (worst)", "latent", "bridge", "asked of the latent", "asked of the bridge")
    return markdown_table(head, rows)


def _pm(spread: Spread, digits: int) -> str:
    if np.isnan(spread.mean):
        return "-"
    if np.isnan(spread.sd):
        return f"{spread.mean:.{digits}f}"
    return f"{spread.mean:.{digits}f} ± {spread.sd:.{digits}f}"
