"""Every number with a meaning that the commands decide by, in one table."""

from femupdate.thresholds import entry, table


@table
class CALIBRATION:
    """How a calibration is sampled, and what is said of it."""

    chains: int = entry(4, "runs", "apart, so that their agreement can be judged")
    least_particles: int = entry(50, "particles", "of a run at least")
    few: int = entry(
        10, "parameters", "up to which particles of the prior find all modes; beyond, populations"
    )
    zeta_grid: int = entry(25, "ratios", "at which a free damping ratio is looked at")
    zeta_samples: int = entry(48, "draws", "of theta at which it is")
    predictive: int = entry(200, "draws", "whose responses are compared with the measured ones")
    checked: int = entry(100, "draws", "at which the errors of the approximations are looked at")
    decoder_may_miss: float = entry(
        0.25, "noise sd", "by which a corrected decoder may miss the building at its draws"
    )
    much_less: float = entry(
        0.75,
        "of the allowed noise",
        "below which the noise of the data is worth a word",
        "two runs together have .71 of it",
    )
    explained: float = entry(
        0.25, "share", "of the measured variation below which the model explains nothing"
    )
    overstated: float = entry(
        0.5, "of the stated noise", "that the best draw misses, below which that is worth a word"
    )
    near: float = entry(0.02, "of the prior", "to either limit within which a draw is at it")
    pressed: float = entry(0.3, "share", "of the draws at a limit that is worth a word")
    unusual: float = entry(
        0.01, "p-value", "posterior predictive, below which something is missing"
    )
    beyond: float = entry(
        1.2, "of what is allowed for", "that data miss, above which that is worth a word"
    )
    few_wild: float = entry(
        0.005, "share", "of points too far off to count, above which that is worth a word"
    )


@table
class RUNS:
    """How much a building differs between the runs of one calibration."""

    stiffness: float = entry(0.4, "ln", "to either side of the posterior's mean that is tried")
    damping: float = entry(1.5, "ln", "likewise, of the damping ratio")
    points: int = entry(17, "points", "of a grid between them, of each")
    best: int = entry(9, "points", "of a grid, the best, that tell which errors of a model count")
    rounds: int = entry(4, "grids", "each about what the one before found")
    reach: float = entry(4.0, "sd", "to either side that the next one reaches")


@table
class UNITS:
    """When responses look like another unit or quantity."""

    probes: int = entry(256, "draws", "of the prior that are held against the level")
    force_level: float = entry(
        2.0,
        "factor",
        "by which responses to a force may miss all of them",
        "the masses are known, and give the level",
    )
    base_level: float = entry(
        6.0,
        "factor",
        "by which floor over base acceleration may miss all of them",
        "it is one at zero frequency whatever the building is",
    )
    largest_motion: float = entry(1e9, "of any unit", "that a channel may hold")
    least_frequencies: int = entry(10, "points", "that an observation needs in the grid")
