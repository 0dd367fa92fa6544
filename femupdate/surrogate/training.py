"""Training of the MVAE: one cycle of learning rates, averaged weights, early stop.

The training set are parameter samples with their modes, which take a fortieth of the space of FRFs
and give FRFs for any damping and any grid.
"""

import copy
import logging
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from femupdate.dynamics.modes import ModalData, joined
from femupdate.dynamics.system import System
from femupdate.errors import SurrogateError
from femupdate.progress import SILENT, Percent, Progress
from femupdate.seeds import TRAINING, Seed, stream, torch_generator
from femupdate.surrogate.network import (
    EARLIEST_END,
    LATEST_START,
    Box,
    Mvae,
    NetworkSizes,
    Visibility,
)
from femupdate.surrogate.soap import Soap
from femupdate.workers import in_threads

_PIECE = 2500  # samples that are solved together


@dataclass(frozen=True)
class ModalDataset:
    """Parameter samples and their modes.

    Attributes:
        theta: (N, p) float64.
        modal: float32 modal data of the N samples.
    """

    theta: Tensor
    modal: ModalData

    def __len__(self) -> int:
        return len(self.theta)


def compute_dataset(
    system: System,
    box: Box,
    *,
    samples: int,
    modes: int,
    top_hz: float,
    seed: Seed,
    progress: Progress = SILENT,
) -> ModalDataset:
    """Solve the modes of all samples, in pieces of one thread each.

    Small eigenproblems gain nothing from threads of their own.

    Args:
        box: of the parameters, filled evenly.
        samples: how many, a Sobol sequence over the box.
        modes: kept for each sample, at most.
        top_hz: top of the frequency grid.
        progress: of so many pieces.
    """
    scramble = torch_generator(seed).initial_seed()
    engine = torch.quasirandom.SobolEngine(len(box.lower), scramble=True, seed=scramble)
    unit = engine.draw(samples, dtype=torch.float64)
    theta = box.lower + (box.upper - box.lower) * unit
    kept = modes_kept(system, modes)

    def solved(rows: Tensor) -> ModalData:
        return system.modal_data(rows, modes=kept, top_frequency_hz=top_hz).to("cpu", torch.float32)

    pieces = theta.split(_PIECE)
    progress.start("Solving modes of parameter samples", len(pieces))
    return ModalDataset(theta, joined(in_threads(solved, pieces, progress)))


def modes_kept(system: System, most: int) -> int:
    """Modes kept a sample: `most`, or as many as the structure on a rigid base has."""
    return min(most, system.model.size)


@dataclass
class TrainingRun:
    """The state of a training.

    Attributes:
        average: running average of their weights; the best one, once the training is over.
        best: state of the average at the lowest validation loss.
        best_epoch: epoch after which it was found.
        seconds: spent so far.
    """

    mvae: Mvae
    average: Mvae
    best: dict[str, Tensor]
    optimizer: Soap
    epoch: int = 0
    step: int = 0
    best_loss: float = float("inf")
    best_epoch: int = 0
    seconds: float = 0.0

    @property
    def metrics(self) -> dict[str, float]:
        """Losses and times, for records."""
        return {
            "validation_loss": self.best_loss,
            "best_epoch": float(self.best_epoch),
            "epochs": float(self.epoch),
            "seconds": self.seconds,
        }


# Rows whose noise is generated at a time, so that they stay in the cache.
_ROWS = 64


def proposal(
    mvae: Mvae,
    z: Tensor,
    log_frf: Tensor,
    visibility: Visibility,
    settings: "TrainingSettings",
    generator: torch.Generator,
) -> Tensor:
    """-ln q(z|x) for noisy, partly observed x (B, f, k); mean over the first rows of the batch.

    The observation encoder learns which z belongs to an observation, by the forward divergence.
    That covers every solution that an observation admits.
    """
    count = min(settings.proposal_rows, len(log_frf))
    floors, points = log_frf.shape[1:]
    device = mvae.x_mean.device
    exponent = 2.0 * torch.rand(count, 1, 1, generator=generator, device=device) - 1.0
    noise_sd = settings.noise_sd * 2.0 ** (settings.noise_octaves * exponent)
    x = torch.empty(count, floors, points, device=device)
    for start in range(0, count, _ROWS):
        rows = slice(start, min(start + _ROWS, count))
        part = x[rows].normal_(generator=generator)
        part.mul_(noise_sd[rows]).add_(log_frf[rows]).sub_(mvae.x_mean).div_(mvae.x_scale)
        part.mul_(visibility[rows].weights(points))
    # Products in half precision are good enough for a proposal, and several times faster, where the
    # device has instructions for them.
    fast = device.type == "cuda" and torch.cuda.is_bf16_supported()
    if device.type == "cpu":
        fast = torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()
    with torch.autocast(device.type, torch.bfloat16, enabled=fast):
        q_x = mvae.observation_encoder(x, visibility[:count])
    return -q_x.log_density(z[:count]).mean()


def reconstruction(
    mvae: Mvae, z: Tensor, log_frf: Tensor, settings: "TrainingSettings", generator: torch.Generator
) -> Tensor:
    """-ln p(x'|z) summed over floors and frequencies, mean over the batch.

    Only `points` frequencies are decoded; the sum is scaled up, an unbiased estimate. The target x'
    carries noise; since the decoder is Gaussian its expectation over that noise is known, and is
    used in place of a draw: (x' - m)^2 becomes (x - m)^2 + noise_sd^2.
    """
    total = log_frf.shape[-1]
    points = min(settings.points, total)
    chosen = torch.randperm(total, generator=generator, device=generator.device)[:points]
    target = log_frf[..., chosen].to(z.dtype)
    variance = settings.noise_sd**2 + mvae.decoder.excess_variance(chosen)
    misfit = (target - mvae.decode(z, chosen)) ** 2 + settings.noise_sd**2
    nats = 0.5 * (misfit / variance + torch.log(2.0 * math.pi * variance))
    return nats.sum() * (total / points) / len(log_frf)


logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of the training.

    Attributes:
        epochs: largest number; the one cycle of the learning rate spans them.
        patience: epochs without a lower validation loss after which training stops.
        validation: share of the samples held out.
        average: decay of the running average of the weights, which are kept.
        redraw_zeta_every: epochs after which the damping of all samples is drawn again.
        roof_share: share of rows in which the top floor alone is observed.
        full_share: share of rows in which all floors are observed; the rest see a random subset.
        full_band_share: share of rows observed over the whole grid; the rest lose up to its lowest
            tenth and its upper seven tenths.
        noise_sd: standard deviation of the noise on ln|H|.
        noise_octaves: the observation encoder is trained with noise from this many octaves below
            to as many above `noise_sd`.
        points: number of frequencies, drawn anew at every step, for the reconstruction.
        proposal_rows: rows of a batch for the observation encoder. Few are enough: its proposals
            are refined later, and new noise and gaps make every row a new one.
    """

    epochs: int = 16
    batch: int = 512
    learning_rate: float = 3e-3
    patience: int = 20
    validation: float = 0.05
    average: float = 0.998
    redraw_zeta_every: int = 10
    roof_share: float = 0.4
    full_share: float = 0.3
    full_band_share: float = 0.75
    seed: int = 0
    noise_sd: float = 0.2
    noise_octaves: float = 1.0
    points: int = 128
    proposal_rows: int = 160


@dataclass(frozen=True)
class TrainingTask:
    """What is learned.

    Attributes:
        frequency_hz: (k,) grid.
        zeta_bounds: range of the damping ratio, a nuisance.
    """

    dataset: ModalDataset
    frequency_hz: Tensor
    system: System
    zeta_bounds: tuple[float, float]
    box: Box
    sizes: NetworkSizes
    device: str = "cpu"


@dataclass(frozen=True)
class _Samples:
    """Parameters (n, p) and damping ratios (n,), float32, and ln|H| (n, f, k), float16."""

    theta: Tensor
    zeta: Tensor
    log_frf: Tensor

    def __len__(self) -> int:
        return len(self.theta)


def train_mvae(
    task: TrainingTask, settings: TrainingSettings, progress: Progress = SILENT
) -> TrainingRun:
    """Train epoch by epoch until nothing more is gained.

    Every epoch's random numbers come from the seed and the epoch's number.

    Raises:
        SurrogateError: too few samples, or the training diverged.
    """
    count = len(task.dataset)
    check_samples(count, settings)
    run = _start(task, settings)
    order = torch.randperm(count, generator=_generator(settings.seed, 0))
    held_out = _held_out(settings, count)
    # The damping of the held-out samples is drawn once, so that losses of epochs are comparable.
    validation = _draw_samples(task, settings, 0, order[:held_out])
    training: _Samples | None = None
    validation_loss = math.nan
    progress.start("Training the surrogate", 100 * settings.epochs)
    shown = Percent(progress)
    while run.epoch < settings.epochs and run.epoch - run.best_epoch < settings.patience:
        started = time.monotonic()
        if training is None or run.epoch % settings.redraw_zeta_every == 0:
            draw = run.epoch // settings.redraw_zeta_every
            training = _draw_samples(task, settings, draw, order[held_out:])
        note = f"epoch {run.epoch + 1}, validation loss {validation_loss:.1f}"
        for share in _epoch(run, settings, training, task.device):
            shown.reached(run.epoch + share, note)
        run.epoch += 1
        # The held-out samples have the same noise and masks every time.
        generator, total = _generator(settings.seed, 2_000_000, task.device), 0.0
        with torch.no_grad():
            for rows in torch.arange(held_out, device=task.device).split(settings.batch):
                loss = _loss(run.average, settings, validation, rows, generator)
                total += float(loss) * len(rows)
        validation_loss = total / held_out
        run.seconds += time.monotonic() - started
        if not math.isfinite(validation_loss):
            raise SurrogateError(
                f"the training diverged in epoch {run.epoch}; train again with a lower learning"
                " rate"
            )
        if validation_loss < run.best_loss:
            run.best_loss, run.best_epoch = validation_loss, run.epoch
            run.best = {name: value.clone() for name, value in run.average.state_dict().items()}
        logger.info("epoch %d: validation loss %.3f", run.epoch, validation_loss)
    run.average.load_state_dict(run.best)
    run.average.to("cpu").eval()
    return run


def check_samples(samples: int, settings: TrainingSettings) -> None:
    """Make sure that the samples not held out fill a batch."""
    if samples - _held_out(settings, samples) < settings.batch:
        raise SurrogateError(
            f"{samples} samples are too few for batches of {settings.batch}; ask for more samples "
            "or smaller batches"
        )


def _held_out(settings: TrainingSettings, count: int) -> int:
    return max(1, round(settings.validation * count))


def draw_visibility(
    count: int, floors: int, settings: TrainingSettings, generator: torch.Generator
) -> Visibility:
    """Random observed floors and bands, as in later calibrations."""
    where = generator.device
    kind, forced, band = torch.rand(3, count, generator=generator, device=where)
    chosen = torch.rand(count, floors, generator=generator, device=where) < 0.5
    # Every subset has at least one floor.
    chosen[torch.arange(count, device=where), (forced * floors).long().clamp_max(floors - 1)] = True
    masks = chosen.float()
    masks[kind < settings.roof_share + settings.full_share] = 1.0
    masks[kind < settings.roof_share, :-1] = 0.0
    low, high = torch.rand(2, count, generator=generator, device=where)
    cut = band >= settings.full_band_share
    start = torch.where(cut, LATEST_START * low**2, 0.0)
    end = torch.where(cut, 1.0 - (1.0 - EARLIEST_END) * high, 1.0)
    return Visibility(masks, torch.stack([start, end], dim=1))


def _start(task: TrainingTask, settings: TrainingSettings) -> TrainingRun:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        mvae = Mvae(task.sizes)
    # Enough samples for the mean and the scale of ln|H|.
    first = torch.arange(min(4000, len(task.dataset)))
    pool = _draw_samples(task, settings, 0, first).log_frf.float().cpu()
    mvae.x_mean.copy_(pool.mean(0))
    mvae.x_scale.copy_(pool.std(0).clamp_min(settings.noise_sd))
    mvae.lower.copy_(task.box.lower)
    mvae.upper.copy_(task.box.upper)
    # Frequencies and bounds of the damping; the decoder starts from modes of some samples.
    frequency = task.frequency_hz.float()
    mvae.decoder.frequency.copy_(frequency / frequency[-1])
    mvae.decoder.damping_bounds.copy_(torch.tensor(task.zeta_bounds))
    modal = task.dataset.modal[: len(first)]
    omega = modal.omega.float()
    zeta = torch.full((len(modal),), sum(task.zeta_bounds) / 2.0)
    mvae.decoder.standardise(
        omega,
        task.system.ratio(omega, zeta, omega.new_zeros(len(omega), 0)) / zeta[:, None],
        modal.effect.float(),
        modal.residual.float(),
        2.0 * math.pi * float(frequency[-1]),
    )
    mvae.to(task.device)
    average = copy.deepcopy(mvae)
    best = {name: value.clone() for name, value in average.state_dict().items()}
    return TrainingRun(mvae, average, best, _optimizer(mvae, settings))


def _optimizer(mvae: Mvae, settings: TrainingSettings) -> Soap:
    """SOAP for the regression from theta to ln|H|, Adam for the rest."""
    variance = mvae.decoder.log_excess
    model = [*mvae.bend.parameters(), *mvae.decoder.parameters()]
    matrices = [value for value in model if value.ndim == 2 and value is not variance]
    vectors = [value for value in model if value.ndim == 1]
    # The decoder's variance learns faster, and the observation encoder's weights, which see noise,
    # decay; `betas` are those of gradients in the eigenbasis.
    groups = [
        {"params": matrices, "faster": 1.0, "rotate": True, "betas": (0.95, 0.95)},
        {"params": vectors, "faster": 1.0},
        {"params": [variance], "faster": 10.0},
        {
            "params": list(mvae.observation_encoder.parameters()),
            "faster": 1.0,
            "weight_decay": 1e-4,
        },
    ]
    return Soap(groups, lr=settings.learning_rate)


def _draw_samples(
    task: TrainingTask, settings: TrainingSettings, draw: int, rows: Tensor
) -> _Samples:
    """Some of the samples, with damping drawn for the `draw`-th time.

    ln|H| is kept in half precision: its rounding, .002, is far below the noise.
    """
    generator, (low, high) = _generator(settings.seed, 1_000_000 + draw), task.zeta_bounds
    zeta = (low + (high - low) * torch.rand(len(task.dataset), generator=generator))[rows]
    theta = task.dataset.theta[rows].to(task.device, torch.float32)
    modal, zeta = task.dataset.modal[rows].to(task.device), zeta.to(task.device, torch.float32)
    parts = task.system.log_frf_batches(modal, theta, zeta, task.frequency_hz)
    return _Samples(theta, zeta, torch.cat([part.to(torch.float16) for part in parts]))


def _epoch(
    run: TrainingRun, settings: TrainingSettings, samples: _Samples, device: str
) -> Iterator[float]:
    """Train for one epoch; yield the finished share of it after each step."""
    generator = _generator(settings.seed, 1 + run.epoch, device)
    shuffled = torch.randperm(len(samples), generator=generator, device=device)
    steps = len(samples) // settings.batch
    proposal = list(run.mvae.observation_encoder.parameters())
    model = [*run.mvae.bend.parameters(), *run.mvae.decoder.parameters()]
    for step in range(steps):
        rows = shuffled[step * settings.batch : (step + 1) * settings.batch]
        # One cycle (Smith & Topin 2019): up over a tenth of the training, down by half a cosine.
        progress, warm = run.step / (settings.epochs * steps), 0.1
        share = 0.04 + 0.96 * progress / warm
        if progress >= warm:
            share = 0.5 * (1.0 + math.cos(math.pi * (progress - warm) / (1.0 - warm))) + 1e-4
        for group in run.optimizer.param_groups:
            group["lr"] = settings.learning_rate * share * group["faster"]
        loss = _loss(run.mvae, settings, samples, rows, generator)
        run.optimizer.zero_grad()
        loss.backward()
        # The first misfits can be thousands of sigma. The observation encoder, whose
        # gradients are a thousandth of the others', is not scaled down with them.
        for part in (model, proposal):
            torch.nn.utils.clip_grad_norm_(part, 200.0)
        run.optimizer.step()
        run.step += 1
        decay = min(settings.average, (run.step + 1) / (run.step + 10))
        with torch.no_grad():
            pairs = zip(run.average.parameters(), run.mvae.parameters(), strict=True)
            for average, current in pairs:
                average.lerp_(current, 1.0 - decay)
        yield (step + 1) / steps


def _loss(
    mvae: Mvae,
    settings: TrainingSettings,
    samples: _Samples,
    rows: Tensor,
    generator: torch.Generator,
) -> Tensor:
    """Nats a sample; the proposal shares no weights with the reconstruction."""
    log_frf = samples.log_frf[rows]
    seen = draw_visibility(len(rows), log_frf.shape[1], settings, generator)
    known = mvae.encode_parameters(samples.theta[rows])
    z = torch.cat([known, mvae.decoder.damping_coordinate(samples.zeta[rows])], dim=1)
    model = reconstruction(mvae, z, log_frf, settings, generator)
    return model + proposal(mvae, z, log_frf, seen, settings, generator)


def _generator(seed: int, number: int, device: str = "cpu") -> torch.Generator:
    return torch_generator(stream(seed, TRAINING, number), device)
