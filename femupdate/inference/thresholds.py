"""Every number with a meaning that samplers and posteriors decide by, in one table."""

from dataclasses import dataclass
from typing import Any

from femupdate.thresholds import entry

_HOTEL = "six earthquakes of one hotel: bands hold 95 % of the samples"


@dataclass(frozen=True, kw_only=True)
class DrawThresholds:
    """Which draws are trusted, and what they are drawn with."""

    edge: float = entry(
        8.0, "prior sd", "standard normal coordinate from which a parameter is at its bound"
    )
    modes: int = entry(
        100,
        "modes",
        "kept for a response",
        "six-story building, noise .01: 40 move the log likelihood by hundreds, 100 by .03",
    )
    least_share: float = entry(
        0.1, "share", "effective, of importance draws below which they are not trusted"
    )
    distinct: int = entry(
        25, "draws", "distinct, that a Gaussian needs, for every coordinate and its weight"
    )
    agreeing: float = entry(
        1.05,
        "r-hat",
        "above which independent runs disagree",
        "Vehtari et al. (2021) ask for 1.01 of long chains; some hundred particles scatter more",
    )


@dataclass(frozen=True, kw_only=True)
class PriorSearchThresholds:
    """Starts from the prior alone."""

    probes: int = entry(128, "points", "of the prior that are tried, for every parameter")
    most_probes: int = entry(2048, "points", "that are tried, at most")
    starts: int = entry(4, "points", "of these that are kept, for every parameter")
    apart: float = entry(
        0.12,
        "of the root of p",
        "distance in the unit cube within which two starts are likely to end at one maximum",
    )


@dataclass(frozen=True, kw_only=True)
class MaximaThresholds:
    """How maxima of a posterior are found and drawn about."""

    step: float = entry(
        1e-5,
        "prior sd",
        "of finite differences",
        "posteriors of long records are some ten-thousandths wide",
    )
    steps: int = entry(25, "steps", "of Gauss-Newton, at most")
    small_gain: float = entry(0.02, "nats", "gain of a step below which the search ends")
    nats: float = entry(14.0, "nats", "by which a maximum that counts may be the lighter one")
    most: int = entry(16, "maxima", "that count, at most")
    trusted: float = entry(
        0.5,
        "share",
        "effective, of draws about maxima below which particles take their place",
        "force at 16 frequencies: at .44 sd were .91 of the exact ones, by particles .98",
    )


@dataclass(frozen=True, kw_only=True)
class LatentSearchThresholds:
    """The search for solutions with the decoder, then with the building's own responses."""

    prior_draws: int = entry(4096, "draws", "of the prior that are tried")
    followed: int = entry(24, "draws", "of these that are followed")
    proposal_draws: int = entry(24, "draws", "of the observation encoder that are followed")
    coarse: int = entry(8, "frequencies", "one of which tells what draws of the prior are worth")
    decoder_step: float = entry(
        1e-3,
        "of z",
        "of finite differences, in single precision",
        "posteriors are some hundredths wide",
    )
    response_step: float = entry(
        1e-4,
        "of z",
        "of finite differences, in double precision",
        "posteriors are some hundredths wide",
    )
    little: float = entry(
        1.0, "nats", "below which the gain that the expansion promises ends a search"
    )
    response_steps: int = entry(8, "steps", "with the building's own responses, at most")
    small_gain: float = entry(0.02, "nats", "gain of such a step below which the search ends")
    most_damping: float = entry(100.0, "of the curvature", "damping of a step that ends it")
    decoder_nats: float = entry(
        30.0,
        "nats",
        "by which a solution that counts may be the lighter one, by the decoder",
        "its misfit may be wrong by some nats",
    )
    decoder_most: int = entry(24, "solutions", "that count by the decoder, at most")
    response_nats: float = entry(
        14.0, "nats", "by which one may be the lighter one, by the building's own responses"
    )
    response_most: int = entry(16, "solutions", "that count by these, at most")


@dataclass(frozen=True, kw_only=True)
class RidgeThresholds:
    """Solutions that no Gaussian describes, and the row of Gaussians that does."""

    tried: float = entry(2.0, "sd", "out along the widest direction, where the misfit is tried")
    furthest: float = entry(0.3, "of z", "that is tried")
    tolerance: float = entry(
        0.5, "nats", "by which a Gaussian may be wrong there; else the ridge is followed"
    )
    light: float = entry(6.0, "nats", "below the heaviest, of solutions left as they are")
    fallen: float = entry(8.0, "nats", "by which a ridge has fallen where it ends")
    steps: int = entry(40, "steps", "to either side, at most")
    first: float = entry(0.5, "sd", "first step")
    shortest: float = entry(2e-3, "of z", "shortest step")
    longest: float = entry(0.15, "of z", "longest step")
    change: float = entry(
        1.2, "nats", "change above which a step is halved; below a quarter of it steps grow"
    )
    pull_backs: int = entry(2, "steps", "of Gauss-Newton across the ridge")
    fewest: int = entry(3, "points", "of a ridge; with less there was no room to follow it")
    kernels: float = entry(
        2.0, "Gaussians", "for each nat of rise and fall", "one for a quarter of an sd at most"
    )
    most_kernels: int = entry(128, "Gaussians", "at most")
    kernel_width: float = entry(
        0.7, "of the distance", "width of a Gaussian", "their row is then even to a thousandth"
    )
    near: float = entry(4.0, "sd", "of a solution within which a point belongs to it")


@dataclass(frozen=True, kw_only=True)
class DecoderThresholds:
    """What an encoder is asked."""

    least_share: float = entry(
        0.5, "of the band", "seen, that a floor needs to be shown to the encoder"
    )
    worst_noise: float = entry(
        0.7, "ln|H|", "noise that the encoder is shown rather than a straight line in its place"
    )
    usual: float = entry(0.995, "share", "of observations whose misfit is usual")


@dataclass(frozen=True, kw_only=True)
class ModeThresholds:
    """Which separate modes the draws of a posterior lie in."""

    components: int = entry(8, "Gaussians", "that are fitted, at most")
    fitted: int = entry(4000, "draws", "to which they are, at most")
    places: int = entry(21, "points", "between two of them at which the density is looked at")
    saddle: float = entry(0.1, "of the lower peak", "that the density between two modes is below")
    dip: float = entry(0.5, "of the lower peak", "that the projected draws are below as well")
    bandwidth: float = entry(0.3, "sd", "of the narrower mode by which these are smoothed")
    least_weight: float = entry(0.01, "share", "of the draws, below which a mode joins its nearest")
    least_draws: int = entry(20, "draws", "below which it does so too")


@dataclass(frozen=True, kw_only=True)
class IdentifiabilityThresholds:
    """What the data have left open."""

    undetermined: float = entry(
        0.5, "of the prior sd", "left, above which a combination counts as not determined"
    )
    left_alone: float = entry(
        0.1, "of its square", "in determined combinations, below which a parameter is left alone"
    )
    as_before: float = entry(
        0.85, "of the prior sd", "left, from which such a parameter is as before"
    )
    named: float = entry(0.35, "of the largest weight", "from which a parameter is named")
    most_names: int = entry(6, "parameters", "named in one combination")
    most_told: int = entry(3, "combinations", "told")
    all_told: int = entry(10, "parameters", "beyond which modes are told by those that differ most")


@dataclass(frozen=True, kw_only=True)
class LearnedErrorThresholds:
    """How the error of a model is learned together with its parameters."""

    rounds: int = entry(6, "fits", "at a row of the table, each followed by the choice of another")
    tried: int = entry(
        200, "draws", "at which the error is looked at", "it hardly differs between draws"
    )
    worth_saying: float = entry(0.01, "ln|H|", "error below which none is told")
    noise_alone: tuple[float, ...] = entry(
        (1.0, 2.0, 4.0, 8.0, 16.0, 32.0),
        "of the stated noise",
        "that figures without a frequency axis may have",
        "a model may miss a frequency that is known to 1 % by a third",
    )
    noise_alone_start: float = entry(8.0, "of the stated noise", "from which such fits start")


@dataclass(frozen=True, kw_only=True)
class JudgedThresholds:
    """How data are judged."""

    wild: float = entry(8.0, "sd", "of error and noise beyond which a residual counts no more")
    cell_points: float = entry(3.0, "points", "independent, that a cell of the map needs")


@dataclass(frozen=True, kw_only=True)
class EventThresholds:
    """What changes from one event to the next."""

    prior_sd: float = entry(
        1.0,
        "ln",
        "standard deviation of the scatter about its default",
        "a third to three times of it are nothing unusual",
    )
    least_scatter: float = entry(0.05, "of the default", "scatter that is tried")
    most_scatter: float = entry(20.0, "of the default", "scatter that is tried")
    scatters: int = entry(241, "values", "between them that are tried")
    not_leakage: float = entry(
        0.4,
        "share",
        "of the part that does not follow the base; the rest is leakage of a short record",
        _HOTEL,
    )
    most_apart: float = entry(0.5, "of |H|", "largest standard deviation of that part")
    smooth: int = entry(9, "points", "over which differences of runs are averaged")
    fading: float = entry(
        0.25,
        "of the lowest frequency",
        "below which errors of the model fade",
        "a building moves as its base does at zero frequency",
    )
    silence_s: float = entry(
        20.0, "s", "behind a record, so that delayed errors do not come round to its beginning"
    )


@dataclass(frozen=True, kw_only=True)
class ChangeThresholds:
    """Which factors changed between two posteriors."""

    scale: float = entry(
        0.2, "ln", "prior standard deviation of a change", "damage of a tenth to a third"
    )
    none: float = entry(0.5, "probability", "that nothing changed, before the data")
    named: float = entry(0.95, "probability", "from which a factor counts as changed")
    likely_none: float = entry(0.8, "probability", "from which nothing counts as changed")
    alike: float = entry(0.5, "probability", "from which all changed alike")
    all_sets: int = entry(
        10, "factors", "up to which every set of them is tried; of more, sets of three at most"
    )
    misfit: float = entry(
        1.5, "noise variances", "mean squared residual from which a posterior is too narrow"
    )


DRAWS = DrawThresholds()
PRIOR_SEARCH = PriorSearchThresholds()
MAXIMA = MaximaThresholds()
LATENT_SEARCH = LatentSearchThresholds()
RIDGE = RidgeThresholds()
DECODER = DecoderThresholds()
MODES = ModeThresholds()
IDENTIFIABILITY = IdentifiabilityThresholds()
LEARNED_ERROR = LearnedErrorThresholds()
JUDGED = JudgedThresholds()
EVENT = EventThresholds()
CHANGE = ChangeThresholds()

GROUPS: tuple[Any, ...] = (
    DRAWS,
    PRIOR_SEARCH,
    MAXIMA,
    LATENT_SEARCH,
    RIDGE,
    DECODER,
    MODES,
    IDENTIFIABILITY,
    LEARNED_ERROR,
    JUDGED,
    EVENT,
    CHANGE,
)
