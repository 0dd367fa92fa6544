"""Every number with a meaning that the effect finder decides by, in one table."""

from dataclasses import dataclass
from typing import Any

from femupdate.thresholds import entry

_STICKS = "310 trials on four-story sticks, no false alarm in 100"
_FRAMES = "322 trials on two frames, 3.9 % false alarms in 103"


@dataclass(frozen=True, kw_only=True)
class DiagnosisSettings:
    """How much is asked of the data before an effect gets a name."""

    fitted: int = entry(10, "effects", "leading candidates of the score test that are fitted")
    sampled: int = entry(0, "effects", "of these, candidates whose evidence is sampled as well")
    draws: int = entry(200, "draws", "of each importance sample")
    over_none: float = entry(
        6.0, "log evidence", "over the model without effects that a name needs", _STICKS
    )
    over_next: float = entry(
        3.0, "log evidence", "over the runner-up that a name needs", "Kass and Raftery (1995)"
    )
    own_error: float = entry(
        0.01,
        "share",
        "of its own log evidence that a name needs beyond that: a model of an effect errs too",
        _STICKS,
    )
    alike: float = entry(
        0.97, "cosine", "from which two effects count as the same to these sensors", _STICKS
    )
    least_strength: float = entry(
        1.0, "D per prior sd", "below which an effect cannot be seen", _STICKS
    )
    false_share: float = entry(
        0.05, "share", "of names that may be false", "the usual rate of false discoveries"
    )
    least_frequency: float = entry(
        0.01, "share", "of a natural frequency below which a change is of no consequence"
    )
    least_response: float = entry(
        0.02, "share", "of a response below which a change or an error is of no consequence"
    )
    seed: int = entry(0, "", "of starts and samples")

    def margin(self, log_evidence: float) -> float:
        """Log evidence over the runner-up that a name of so much of it needs."""
        return self.over_next + self.own_error * max(log_evidence, 0.0)


@dataclass(frozen=True, kw_only=True)
class VerdictThresholds:
    """What else decides a verdict."""

    fewest_points: float = entry(
        3.0, "points", "independent, for each unknown, below which the data cannot tell"
    )
    at_limit: float = entry(1e-3, "ln", "from a limit of its prior, where a factor ends at it")
    better_exchange: float = entry(
        0.8, "share", "of the best sum of squares that an exchange of channels must stay below"
    )
    close: float = entry(
        0.05, "share", "of the first log evidence within which another finding is close to it"
    )
    close_by: float = entry(6.0, "log evidence", "within which it is close in any case")
    closest: int = entry(4, "effects", "close ones that get a basis of their own, at most")
    compared: int = entry(3, "effects", "not told from the first, compared by measurements")
    shown: int = entry(3, "measurements", "further ones that are named, at most")
    needless: float = entry(
        2.0, "sd", "of an effect's size, within which it goes out again beside what was added later"
    )
    most_rounds: int = entry(4, "effects", "added by one repair, at most")
    paired: int = entry(
        10, "effects", "tried with every other, where the first leaves most of the misfit"
    )
    repair_draws: int = entry(1000, "draws", "of the posterior before and after a repair")
    clearly: float = entry(
        6.0, "log density", "of the data by which a fit must exceed another to take its place"
    )
    positive: float = entry(
        1.0,
        "log evidence",
        "of the data themselves that an effect needs which data kept out certify",
        "Kass and Raftery (1995)",
    )
    most: float = entry(
        0.5,
        "share",
        "of the misfit beyond noise, below which a name among several causes is told with doubt",
        "113 trials of sticks: 9 of 10 wrong names removed less, all right ones more",
    )
    beside: float = entry(
        0.5,
        "share",
        "of its log evidence that an effect keeps beside another with which it does not compete",
    )
    in_tonnes: float = entry(100.0, "kg", "from which an added mass is told in tonnes")
    obvious: float = entry(
        0.5, "share", "of the coarse sum of squares that a mended channel must stay below"
    )


@dataclass(frozen=True, kw_only=True)
class FitThresholds:
    """How candidates are fitted, and which are followed."""

    difference: float = entry(1e-3, "of an unknown", "step of finite differences")
    coarse_noise: float = entry(
        0.3, "ln|H|", "noise in the first steps, so that peaks that do not meet show a distance"
    )
    smallest_decrease: float = entry(1e-4, "share", "of the objective, below which a search ends")
    fewer_shapes: int = entry(
        140, "shapes", "of a basis in searches", "ln|H| errs by .01 rms, in a third of the time"
    )
    rounds: int = entry(4, "rows", "of the table of errors that a fit tries, at most")
    first_steps: int = entry(5, "steps", "of every leading candidate")
    steps: int = entry(15, "steps", "of a candidate that is followed, at most")
    rough_steps: int = entry(10, "steps", "of a fit as if noise were coarse, at most")
    far_steps: int = entry(25, "steps", "of a fit that begins far from the data, at most")
    most_damping: float = entry(1e6, "of the curvature", "Marquardt's, where a fit gives up")
    glance: int = entry(2, "steps", "of every other effect before a name is given")
    large: tuple[float, ...] = entry(
        (1.0, 1.5, 2.0),
        "prior sd",
        "at which effects are tried whose tests point to an impossible size",
        "six-story frame, beams of one story at .45: from 1.5 alone the first steps lead there",
    )
    ahead: int = entry(12, "effects", "of these that get the first steps")
    others: int = entry(4, "effects", "of these that are fitted to convergence")
    more: float = entry(1.5, "times the best", "misfit up to which these are fitted")
    again: int = entry(2, "effects", "from whose fits the model without them is fitted again")
    far_behind: float = entry(2.0, "times the best", "misfit beyond which one is dropped")
    behind: float = entry(200.0, "misfit", "beyond that many times the best")
    baseline_draws: int = entry(384, "draws", "of the prior from which a search starts")
    baseline_starts: int = entry(8, "draws", "of these that are fitted")
    baseline_again: int = entry(
        3,
        "searches",
        "more, at most, where factors alone leave much",
        "sticks, earthquakes: 1 of 48 searches ended beside the maximum, 2 of 5 at worst; now none",
    )
    same_maximum: float = entry(1.0, "nats", "by which two searches that end alike differ")
    listed_draws: int = entry(192, "draws", "of theta with the effects that a building lists")
    listed_starts: int = entry(4, "draws", "of these that are fitted")
    rough_shapes: int = entry(100, "shapes", "with which stiffness factors are searched for")
    most_bases: int = entry(4, "bases", "one after the other, while theta moves on")
    tunings: int = entry(
        40,
        "ratios",
        "of an appendage's frequency to the first, at which it is tested: what it does is narrow",
        "an appendage of 2.7 % of a floor was missed by twelve, found by forty",
    )
    tuned: tuple[float, float] = entry((0.5, 7.0), "of the first frequency", "their ends")
    tuned_top: float = entry(0.6, "of the top of the grid", "above which none is tested")
    theta_spacing: float = entry(
        0.1, "ln", "of theta at which bases are made", "a basis serves .2 to both sides"
    )
    zeta_spacing: float = entry(0.3, "ln", "of the damping ratio at which bases are made")


@dataclass(frozen=True, kw_only=True)
class EvidenceThresholds:
    """How evidence is sampled."""

    freedom: int = entry(5, "degrees", "of freedom of the Student that evidence is drawn from")
    widen: float = entry(1.2, "factor", "on the covariance of the fit, for that Student")
    ridge: float = entry(
        1e-12, "of the mean variance", "so that rounding cannot make a covariance indefinite"
    )


@dataclass(frozen=True, kw_only=True)
class FollowThresholds:
    """Whether a model without an effect can follow what the effect changes."""

    nothing: float = entry(1e-9, "D squared", "below which an effect changes nothing")
    absorbed: float = entry(
        0.3, "share", "of the change that factors make up for, up to which straight lines will do"
    )
    step: float = entry(
        0.1, "of the score test's step", "small enough for one Jacobian to serve all rounds"
    )
    rounds: int = entry(6, "steps", "of Gauss-Newton with one Jacobian, at most")


@dataclass(frozen=True, kw_only=True)
class SearchThresholds:
    """The search over the whole prior, for effects far from the model as it is."""

    draws: int = entry(192, "draws", "of leading effects and places")
    few_draws: int = entry(32, "draws", "of the other places of an effect")
    leading: int = entry(4, "effects", "fitted from the base that get all draws")
    cheap: int = entry(60, "shapes", "up to which every place gets all draws")
    searched: int = entry(6, "effects", "that are fitted")
    starts: int = entry(2, "draws", "from which each of them is")
    many_draws: int = entry(512, "draws", "of theta with the effect that explains most")
    many_starts: int = entry(6, "draws", "of these that are fitted")
    wider: float = entry(1.5, "prior sd", "of the sizes that are drawn")
    better: float = entry(
        0.5, "share", "of the coarse sum of squares that an effect must stay below"
    )
    right: float = entry(
        0.1,
        "ln|H| rms",
        "left by factors alone, below which a basis is made about them as they are",
    )
    exchange_draws: int = entry(384, "draws", "of the prior for exchanged channels")
    exchanges: int = entry(3, "exchanges", "that are fitted coarsely")


@dataclass(frozen=True, kw_only=True)
class MeshErrorThresholds:
    """How the error of a mesh is learned from a finer one."""

    finer: float = entry(2.0 / 3.0, "of the mesh size", "of the finder's mesh")
    half: float = entry(0.5, "of the mesh size", "of the mesh from which errors are learned")
    thetas: int = entry(8, "sets of factors", "at which meshes are compared")
    carried: int = entry(
        12,
        "sets of factors",
        "of the whole prior at which a finer mesh is solved beside these",
        "rms of ln|H| at seven others, six-story and two-story frame: .0081 and .0025; .0083 and "
        ".0027 with 8, where posterior means differ by .35 sd; .023 and .0028 with 6",
    )
    inner: float = entry(1.5, "factor", "by which the ends of the prior are left out")
    distance_sd: float = entry(
        0.6,
        "of the distance",
        "from what is corrected to the finer mesh and to the limit: its standard deviation",
        "the correction is in the middle of both (Richardson 1911)",
    )
    open_factor: float = entry(
        1.5,
        "factor",
        "by which a finer mesh may be off further than learned",
        "theta of clean buildings off by 1.5 sd without it",
    )
    formulation: float = entry(
        0.008,
        "of the stiffness",
        "by which two programs or meshes differ in members of one kind and story",
        "some hundred frames of OpenSees and of other meshes; with .005 a clean one got a name",
    )
    of_all: float = entry(
        0.0025,
        "of the stiffness",
        "by which they differ in all members alike",
        "40 of these: factors err alike by .05 to .14 %, with ShellMITC4 by .45 %; .21 % rms",
    )
    part: float = entry(0.02, "of a step", "along which responses are differentiated")
    shown: float = entry(0.003, "of the largest", "effect of a mode below which it is left out")
    step: float = entry(0.01, "of what the floors show of a mode", "step of differences")
    same_frequency: float = entry(0.06, "ln f", "within which modes of two meshes are one")
    same_effect: float = entry(0.4, "ln", "of the size shown, likewise")
    same_shape: float = entry(0.05, "1 - cosine", "of the shapes shown, likewise")
    prior: float = entry(0.1, "of the stiffness", "prior standard deviation of the mean factors")
    rounds: int = entry(100, "rounds", "of the EM method")
    alike: float = entry(2.0, "modes", "of one theta that err alike")
    beyond_top: float = entry(
        1.25, "of the top", "of the grid up to which modes show in the responses"
    )
    left_factor: float = entry(
        2.0, "factor", "on what the mean correction leaves where it was learned"
    )


@dataclass(frozen=True, kw_only=True)
class ScreenThresholds:
    """What the channels say of themselves before any model is believed."""

    low: float = entry(0.35, "of f1", "below which a floor follows the base but for (f / f1)^2")
    fewest: int = entry(4, "points", "below which nothing is said")
    clear: float = entry(3.0, "sd", "from which a gain or a delay is told")
    lever: float = entry(2.0, "ratio", "of frequencies that an intercept needs")
    least_gain: float = entry(0.02, "ln", "gain that is told")
    wrong_unit: float = entry(
        0.6931471805599453, "ln", "gain that is a wrong unit: g, gal and m/s2 differ by more"
    )
    turned: float = entry(0.5, "rad", "about half a turn, that is a reversed sensor")
    least_delay_s: float = entry(5e-4, "s", "delay that is told")


@dataclass(frozen=True, kw_only=True)
class LevelThresholds:
    """Levels of motion, in doublings of the amplitude."""

    alike: float = entry(0.25, "doublings", "within which two records have one level")
    exact: float = entry(0.005, "doublings", "to which the level of a prediction is found")
    steps: int = entry(30, "steps", "of that search, at most")
    beyond: float = entry(0.5, "doublings", "outside of the records that are worth a word")


VERDICT = VerdictThresholds()
FIT = FitThresholds()
EVIDENCE = EvidenceThresholds()
FOLLOW = FollowThresholds()
SEARCH = SearchThresholds()
MESH_ERROR = MeshErrorThresholds()
SCREEN = ScreenThresholds()
LEVEL = LevelThresholds()

GROUPS: tuple[Any, ...] = (
    DiagnosisSettings(),
    VERDICT,
    FIT,
    EVIDENCE,
    FOLLOW,
    SEARCH,
    MESH_ERROR,
    SCREEN,
    LEVEL,
)
