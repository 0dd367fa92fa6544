"""Numbers by which the effect finder decides, where a user may set them or a trial fixed them."""

from dataclasses import dataclass

from femupdate.thresholds import entry, table

_STICKS = "310 trials on four-story sticks, no false alarm in 100"


@dataclass(frozen=True, kw_only=True)
class DiagnosisSettings:
    """How much is asked of the data before an effect gets a name."""

    fitted: int = entry(10, "effects", "leading candidates of the score test that are fitted")
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
    close: float = entry(
        0.05, "share", "of the first log evidence within which another gets a basis for itself"
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


@table
class VERDICT:
    """What else decides a verdict."""

    compared: int = entry(3, "effects", "not told from the first, compared by other data")
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
        0.9,
        "share",
        "of the misfit beyond noise, below which a second cause is sought, or a name is told with "
        "doubt",
        "28 right names of fresh cases removed .98 or more",
    )
    least: float = entry(
        0.75,
        "share",
        "of the misfit beyond noise, below which a name is told as a candidate alone",
        "five ties outside the catalogue: wrong names removed .34 to .74; joints of a bench frame "
        "remove .80 by a fit by hand",
    )
    beside: float = entry(
        0.5,
        "share",
        "of its log evidence that an effect keeps beside another with which it does not compete",
    )


@table
class MESH_ERROR:
    """How the error of a mesh is learned from a finer one."""

    finer: float = entry(2.0 / 3.0, "of the mesh size", "of the finder's mesh")
    coarse: float = entry(
        0.035,
        "share",
        "of natural frequencies (rms), from which a mesh whose halving moves them gives no name",
        "clean buildings, truths of meshes a quarter or an eighth as wide: 6 false names of 8 at "
        ".066 and .043; none of 8 at .031, .020 and .019",
    )
    carried: int = entry(
        12,
        "sets of factors",
        "of the whole prior at which a finer mesh is solved",
        "rms of ln|H| at seven others, six-story and two-story frame: .0081 and .0025; .0083 and "
        ".0027 with 8, where posterior means differ by .35 sd; .023 and .0028 with 6",
    )
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
