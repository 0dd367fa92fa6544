"""The benchmark `training`: our MVAE and the published layout, trained side by side."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from femupdate.dynamics.modal import ModalData
from femupdate.errors import SurrogateError
from femupdate.report.figure import save_figure
from femupdate.surrogate.dataset import DatasetPlan, ModalDataset, compute_dataset, log_frf_pool
from femupdate.surrogate.training import TrainingSettings, TrainingTask, watched_training
from femupdate.workflow.model import StudyModel
from femupdate.workflow.train import default_settings, training_task

from ..result import Job, Report, markdown_table
from ..shipped import benchmark_model
from .plot_race import race_figure
from .published_network import PUBLISHED_PARAMETERS, parameter_counts
from .published_training import published_training, start_published
from .race import HeldOut, Point, Runner, first_to, race, turn_ends

NAME = "training"
OURS, PUBLISHED = "femupdate", "published layout"

_VALIDATION = 0.1
# Of the samples held out so many are looked at, so often.
_JUDGED = 500
_STANDARDISING = 4000
_PUBLISHED_PARTS = ("parameter_encoder", "observation_encoder", "decoder")
_OUR_PARTS = ("bend", "observation_encoder", "decoder")


@dataclass(frozen=True)
class TrainingPlan:
    """How long is trained, on what.

    Attributes:
        samples: simulations; a tenth is held out.
        minutes: of the processor for each.
        turn: longest turn of either, s.
    """

    samples: int = 100_000
    minutes: float = 10.0
    turn: float = 30.0


@dataclass(frozen=True)
class Reached:
    """How long both took to one loss.

    Attributes:
        loss: the lowest of the published layout, nats a sample.
        published, ours: where they first had it; ours None where it never had.
    """

    loss: float
    published: Point
    ours: Point | None

    @property
    def cpu_ratio(self) -> float | None:
        """How many times less processor time ours took."""
        return None if self.ours is None else self.published.cpu_seconds / self.ours.cpu_seconds

    @property
    def clock_ratio(self) -> float | None:
        """The same on the clock."""
        return None if self.ours is None else self.published.clock_seconds / self.ours.clock_seconds


def run_training(job: Job, plan: TrainingPlan, model: StudyModel | None = None) -> Report:
    """Run the benchmark and write its results.

    Args:
        job: its seed is that of samples, weights and noise.
        plan: how long, on what.
        model: of the building; default the four-story benchmark.

    Raises:
        SurrogateError: too few samples.
        StudyError, ReportError: a file cannot be written.
    """
    model = model or benchmark_model()
    settings = default_settings(model, seed=job.seed)
    if (1.0 - _VALIDATION) * plan.samples < settings.batch:
        raise SurrogateError(
            f"{plan.samples} samples are too few for batches of {settings.batch}; ask for more"
        )
    job.progress.start("Solving modes of parameter samples", plan.samples)
    task = _task(model, plan.samples, job)
    ends = turn_ends(60.0 * plan.minutes, plan.turn)
    job.progress.start("Training in turns", 2 * len(ends))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(job.seed)  # of dropout
        entries, held_out = _prepared(task, settings)
        runners = [entry.runner for entry in entries]
        race(runners, held_out, ends, lambda note: job.progress.advance(1, note))
    return _report(job, plan, entries, held_out.limit)


@dataclass(frozen=True)
class _Entry:
    """A training with the sizes of its networks."""

    runner: Runner
    parameters: dict[str, int]


def _task(model: StudyModel, samples: int, job: Job) -> TrainingTask:
    top = float(model.frequency_hz[-1])
    plan = DatasetPlan(samples, model.reduced.size, top, job.seed + 1)
    with tempfile.TemporaryDirectory() as shards:
        dataset = compute_dataset(model.system, model.prior, plan, Path(shards), job.progress)
    return training_task(model, dataset)


def _prepared(
    task: TrainingTask, settings: TrainingSettings
) -> tuple[tuple[_Entry, _Entry], HeldOut]:
    """Both trainings, ready for their first step, on the same samples; and what is held out."""
    generator = torch.Generator().manual_seed(settings.seed)
    order = torch.randperm(len(task.dataset), generator=generator)
    held, rows = order.tensor_split([round(_VALIDATION * len(order))])
    noise_sd = settings.loss.noise_sd
    theta, log_frf = _roof(task, held[:_JUDGED])
    entries = _published(task, rows, noise_sd, settings.seed), _ours(task, settings, rows)
    return entries, HeldOut(theta, log_frf, noise_sd)


def _ours(task: TrainingTask, settings: TrainingSettings, rows: Tensor) -> _Entry:
    training = watched_training(task, settings, rows)
    mvae = next(training)
    zeta = task.zeta_bounds[0]

    def emulate(theta: Tensor) -> tuple[Tensor, Tensor]:
        known = mvae.encode_parameters(theta)
        damping = mvae.decoder.damping_coordinate(theta.new_full((len(theta),), zeta))
        mean = mvae.decode(torch.cat([known, damping], dim=1))[:, -1]
        variance = settings.loss.noise_sd**2 + mvae.decoder.excess_variance()[-1]
        return mean, variance.expand_as(mean)

    return _Entry(Runner(OURS, training, emulate), parameter_counts(mvae, _OUR_PARTS))


def _published(task: TrainingTask, rows: Tensor, noise_sd: float, seed: int) -> _Entry:
    theta, log_frf = _roof(task, rows)
    network = start_published(task.box, log_frf[:_STANDARDISING], noise_sd, seed)
    training = published_training(network, theta, log_frf, noise_sd, seed)

    def emulate(theta: Tensor) -> tuple[Tensor, Tensor]:
        network.eval()
        found = network.decode(network.encode_parameters(theta).mean)
        network.train()
        return found.mean, found.variance

    return _Entry(Runner(PUBLISHED, training, emulate), parameter_counts(network, _PUBLISHED_PARTS))


def _roof(task: TrainingTask, rows: Tensor) -> tuple[Tensor, Tensor]:
    """theta (n, p) float32 and ln|H| (n, k) float16 of the roof, for a known damping ratio."""
    modal = task.dataset.modal[rows]
    roof = ModalData(modal.omega, modal.effect[:, -1:], modal.residual[:, -1:])
    theta = task.dataset.theta[rows]
    zeta = torch.full((len(rows),), task.zeta_bounds[0])
    pool = log_frf_pool(ModalDataset(theta, roof), task.frequency_hz, task.system, zeta)
    return theta.float(), pool[:, 0]


def _report(job: Job, plan: TrainingPlan, entries: tuple[_Entry, _Entry], limit: float) -> Report:
    published, ours = (entry.runner.points for entry in entries)
    best = min(published, key=lambda point: point.loss)
    reached = Reached(best.loss, best, first_to(ours, best.loss))
    curves = {entry.runner.name: tuple(entry.runner.points) for entry in entries}
    answer = {
        "limit": limit,
        "cpu_ratio": reached.cpu_ratio,
        "clock_ratio": reached.clock_ratio,
    }
    content = {
        "plan": plan,
        "threads": torch.get_num_threads(),
        "parameters": {entry.runner.name: entry.parameters for entry in entries},
        "published_parameters": PUBLISHED_PARAMETERS,
        "reached": reached,
        "curves": curves,
        **answer,
    }
    figure = race_figure(curves, limit, reached.loss)
    return job.write(
        NAME,
        content,
        training_markdown(entries, plan, reached, limit),
        pictures=[save_figure(figure, job.folder / f"{NAME}.png")],
        answer={"loss": reached.loss, **answer},
    )


def training_markdown(
    entries: Sequence[_Entry], plan: TrainingPlan, reached: Reached, limit: float
) -> str:
    """What was trained, what came of it, and how soon, in tables."""
    threads = torch.get_num_threads()
    intro = (
        f"{plan.samples:,} simulations of the four-story building, a tenth held out, "
        f"at most {plan.minutes:g} minutes of processor time each, {threads} thread"
        f"{'s' if threads > 1 else ''}, in turns of at most {plan.turn:g} s. "
        "Loss: -ln p(x'|theta) of a noisy roof FRF, nats a sample."
    )
    return "\n\n".join([intro, _trained_markdown(entries, limit), _reached_markdown(reached)])


def _trained_markdown(entries: Sequence[_Entry], limit: float) -> str:
    names = [entry.runner.name for entry in entries]
    counts = [[f"{n:,}" for n in entry.parameters.values()] for entry in entries]
    last = [entry.runner.points[-1] for entry in entries]
    best = [min(entry.runner.points, key=lambda point: point.loss) for entry in entries]
    parts = zip(entries[0].parameters, *counts, strict=True)
    rows = [
        *((f"parameters, {part}", *count) for part, *count in parts),
        ("processor seconds", *(f"{point.cpu_seconds:.0f}" for point in last)),
        ("seconds on the clock", *(f"{point.clock_seconds:.0f}" for point in last)),
        ("steps", *(f"{point.steps:,}" for point in last)),
        (f"lowest loss (limit {limit:.1f})", *(f"{point.loss:.1f}" for point in best)),
        ("rms error of ln\\|H\\| there", *(f"{point.rms:.4f}" for point in best)),
    ]
    return markdown_table(["", *names], rows)


def _reached_markdown(reached: Reached) -> str:
    pairs = [
        ("processor seconds", "cpu_seconds", reached.cpu_ratio),
        ("seconds on the clock", "clock_seconds", reached.clock_ratio),
        ("steps", "steps", None),
    ]
    rows = []
    for name, key, ratio in pairs:
        ours = "-" if reached.ours is None else f"{getattr(reached.ours, key):.4g}"
        times = "-" if ratio is None else f"{ratio:.1f}"
        rows.append((name, f"{getattr(reached.published, key):.4g}", ours, times))
    head = [f"until a loss of {reached.loss:.1f}", PUBLISHED, OURS, "times less"]
    return markdown_table(head, rows)
