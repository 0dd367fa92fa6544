"""Numbers by which the effect finder decides."""

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, kw_only=True)
class DiagnosisSettings:
    """How much is asked of the data before an effect gets a name.

    What no source is named for was fixed by 310 trials on four-story sticks, without a false alarm
    in 100, or is a choice that decides no name.

    Attributes:
        fitted: leading candidates of the score test that are fitted.
        over_none: log evidence over the model without effects that a name needs.
        over_next: over the runner-up (Kass and Raftery 1995).
        own_error: share of its own log evidence that a name needs beyond that: a model of an
            effect errs too.
        close: share of the first log evidence within which another gets a basis for itself.
        alike: cosine from which two effects count as the same to these sensors.
        least_strength: D per prior sd below which an effect cannot be seen.
        false_share: of names that may be false, the usual rate of false discoveries.
        least_frequency: share of a natural frequency below which a change is of no consequence.
        least_response: of a response below which a change or an error is of no consequence.
    """

    fitted: int = 10
    over_none: float = 6.0
    over_next: float = 3.0
    own_error: float = 0.01
    close: float = 0.05
    alike: float = 0.97
    least_strength: float = 1.0
    false_share: float = 0.05
    least_frequency: float = 0.01
    least_response: float = 0.02
    seed: int = 0

    def margin(self, log_evidence: float) -> float:
        """Log evidence over the runner-up that a name of so much of it needs."""
        return self.over_next + self.own_error * max(log_evidence, 0.0)


class VERDICT:
    """What else decides a verdict."""

    # Effects not told from the first, compared by other data.
    compared = 3
    # Log density of the data by which a fit must exceed another to take its place.
    clearly = 6.0
    # Log evidence of the data themselves that an effect needs which data kept out certify (Kass and
    # Raftery 1995).
    positive = 1.0
    # Share of the misfit beyond noise, below which a second cause is sought, or a name is told with
    # doubt: 28 right names of fresh cases removed .98 or more.
    most = 0.9
    # And below which a name is told as a candidate alone. Of five ties outside the catalogue wrong
    # names removed .34 to .74; joints of a bench frame remove .80 by a fit by hand.
    least = 0.75
    # Share of its log evidence that an effect keeps beside another with which it does not compete.
    beside = 0.5


class MESH_ERROR:
    """How the error of a mesh is learned from a finer one."""

    # The finder's mesh size over the building's.
    finer = 2.0 / 3.0
    # Share of natural frequencies (rms), from which a mesh whose halving moves them gives no name.
    # Clean buildings, truths of meshes a quarter or an eighth as wide: 6 false names of 8 at .066
    # and .043; none of 8 at .031, .020 and .019.
    coarse = 0.035
    # Sets of factors of the whole prior at which a finer mesh is solved. Rms of ln|H| at seven
    # others, six-story and two-story frame: .0081 and .0025; .0083 and .0027 with 8, where
    # posterior means differ by .35 sd; .023 and .0028 with 6.
    carried = 12
    # Standard deviation of the distance from what is corrected to the finer mesh and to the limit,
    # over that: the correction is in the middle of both (Richardson 1911).
    distance_sd = 0.6
    # Rms of what shells of OpenSees (ASDShellQ4, ShellMITC4; half the mesh size) do in 13 random
    # frames of two and three stories: to all members of a kind, and to those of one story beside.
    # Over those with .01 of all kinds and .008, errors of factors are .5 in seven other frames and
    # 1.2 in 24 more, .71 of their sd there (.50).
    of_kinds: ClassVar = {
        "wall_stiffness": 0.032,
        "slab_participation": 0.04,
        "flexible_diaphragm": 0.02,
        "cracked_beams": 0.013,
        "cracked_columns": 0.004,
    }
    formulation = 0.003
    # And in all members alike. In 40 of these factors err alike by .05 to .14 %, with ShellMITC4 by
    # .45 %; .21 % rms.
    of_all = 0.0025
