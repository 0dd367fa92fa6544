"""Every number with a meaning that measured files are judged by, in one table."""

from femupdate.thresholds import entry, table


@table
class FILES:
    """How large a file may be, whatever its header says."""

    text_mb: int = entry(300, "MB", "of a text", "its table takes some three times that in memory")
    arrays_mb: int = entry(
        400, "MB", "of all arrays of a file", "a table of them takes some three times that"
    )
    archive_mb: int = entry(500, "MB", "of all files of an archive, unpacked")
    members: int = entry(2000, "files", "of an archive")
    packed: float = entry(200.0, "factor", "by which an archive may be packed")
    nested: int = entry(50, "levels", "of parts within parts of a MATLAB file")
    longest_cell: int = entry(
        80,
        "characters",
        "of a cell that may be a complex number",
        "the pattern takes very long to refuse a long one",
    )


@table
class TIMES:
    """Which times are a record's."""

    shortest_s: float = entry(1e-6, "s", "shortest step", "an impact on a model")
    longest_s: float = entry(10.0, "s", "longest step", "the slowest monitoring of a tower")
    jitter: float = entry(
        0.01,
        "of a step",
        "by which a time may be off",
        "turns the phase at half the Nyquist frequency by less than a degree",
    )
    coarsest: float = entry(
        0.3,
        "of a step",
        "to which times may be rounded",
        "a lost sample shifts them by half a step",
    )
    decimals: int = entry(9, "decimals", "of times that are looked at, at most")
    fewest: int = entry(3, "times", "of a column from which a step is told")
    apart: float = entry(
        0.1, "of a step", "from which traces that begin at other times are worth a word"
    )


@table
class RECORD:
    """Which accelerations can be, and how motions of the ground are resampled."""

    fewest: int = entry(10, "samples", "of a motion of the ground")
    fewest_of_spectrum: int = entry(
        64, "samples", "of histories", "four segments of 32 samples: less is no spectrum"
    )
    smallest_g: float = entry(1e-6, "g", "peak", "below the resolution of an accelerograph")
    largest_g: float = entry(
        5.0, "g", "peak of the ground", "the largest recorded is about 4 g (2008, Iwate)"
    )
    largest_scaled_g: float = entry(100.0, "g", "peak of a record that a user scales")
    largest_floor: float = entry(
        40.0, "of the largest peak", "of the ground, that a floor feels", "else a spike or a unit"
    )
    offset: float = entry(0.05, "of the largest swing", "mean from which a warning is given")
    filter_periods: int = entry(32, "periods", "of the lower rate, to either side of the filter")
    filter_beta: float = entry(8.0, "", "of the filter's Kaiser window", "stopband 80 dB down")
    largest_ratio: int = entry(1000, "ratio", "of two rates, in whole numbers")


@table
class CHANNEL:
    """From where on something in one history is worth a word."""

    slowest_hz: float = entry(5.0, "Hz", "sampling rate of measurements on buildings, at least")
    fastest_hz: float = entry(100_000.0, "Hz", "sampling rate, at most")
    offset: float = entry(0.05, "of the largest swing", "mean")
    clipped: int = entry(
        4, "samples", "equal, in a row, at the largest or smallest value", "smooth signals have two"
    )
    steps: float = entry(
        50.0, "steps", "of quantisation that a peak needs to be called clipped, a spike or stuck"
    )
    spike: float = entry(
        10.0,
        "of the rms around",
        "distance of a sample from the median of five",
        "Gaussian noise exceeds it once in 1e8 samples",
    )
    spike_share: float = entry(0.1, "of the peak", "the same distance")
    neighbours: int = entry(10, "samples", "to either side, that the rms is of")
    stuck_s: float = entry(1.0, "s", "without any change, between parts that move")
    peak: float = entry(
        0.01, "of the peak stated", "by which the peak differs", "headers round to three digits"
    )


@table
class PAIR:
    """From where on something between channels is worth a word."""

    segments: int = entry(12, "segments", "of Welch's method, half overlapping")
    least_samples: int = entry(1024, "samples", "of a record that is long enough")
    ambient_s: float = entry(120.0, "s", "of a record without a base that shows the first mode")
    amplified: float = entry(1.25, "of the base", "from which a peak is a mode")
    resonant: float = entry(2.0, "of the base", "from which floors must be in order")
    coherence: float = entry(0.8, "coherence", "of frequencies that are compared")
    least_bins: int = entry(3, "frequencies", "of these, at least")
    out_of_order: float = entry(
        1.6, "of a higher floor", "amplitude of a floor in the first mode, that is out of order"
    )
    late: float = entry(0.03, "of the first period", "delay", "damping alone makes a fifth of it")
    sure: float = entry(5.0, "sd", "of a delay or a drift")
    scatter_rad: float = entry(0.15, "rad", "of the phase that may be left beside a drift")


@table
class SPECTRUM:
    """How FRFs are estimated, and which of their points are used."""

    averages: float = entry(5.0, "segments", "independent, that the default length leaves")
    fewest_averages: float = entry(
        2.0, "segments", "independent, below which the coherence says nothing"
    )
    shortest: int = entry(16, "samples", "of a segment")
    padding: int = entry(
        4, "bins", "for each independent one", "the FRF is then nearly straight between them"
    )
    default_noise: float = entry(0.2, "ln|H|", "where neither the file nor the coherence says")
    least_noise: float = entry(
        0.01, "ln|H|", "that is stated", "accelerometers are calibrated to about 1 %"
    )
    largest_noise: float = entry(
        0.5,
        "ln|H|",
        "of a point that is used",
        "above it the first-order relation with the coherence no longer holds",
    )
    coherence: float = entry(
        0.5,
        "coherence",
        "of a point that is used",
        "below it, noise in the base could bias H1 as much as noise in the floor scatters it",
    )
    chance: float = entry(
        0.01, "probability", "of coherences that unrelated signals exceed: they count as zero"
    )
    power_nearby: float = entry(
        1e-3,
        "of the power nearby",
        "below which the base shows leakage",
        "far side lobes of the Hann window fall as k^-6",
    )
    nearby: int = entry(10, "independent bins", "to either side that are nearby")
    power_anywhere: float = entry(1e-7, "of the largest power", "below which it does so too")
    noise_bins: int = entry(
        3,
        "independent bins",
        "to either side over which the noise is averaged",
        "with seven segments, mean square of error over noise falls from 1.2 to 1.05",
    )
    reach: float = entry(
        4.0, "of 1 / T", "beyond which the spectrum of a Hann window of length T is negligible"
    )
    dense: float = entry(
        3.0, "in 1 / T", "FRFs that an estimate is made of, at least", "cubics lie between them"
    )
    leaked: float = entry(
        0.2,
        "of the power",
        "of a bin from beyond there, from which its means are not believed",
        ".03 in white noise and earthquakes above a third of a hertz, at most",
    )
    bands: int = entry(10, "bands", "in which floors are compared")


@table
class RESPONSE:
    """Which response functions and forces can be."""

    fewest: int = entry(3, "frequencies", "of a table")
    least: float = entry(1e-9, "|H|", "smallest", "two modes may cancel, but only so far")
    largest: float = entry(1e5, "|H|", "largest", "a damping ratio of 1e-4 amplifies 5,000 times")
    least_sd: float = entry(1e-5, "ln|H|", "smallest standard deviation")
    largest_sd: float = entry(100.0, "ln|H|", "largest standard deviation")
    fewest_of_force: int = entry(10, "frequencies", "of a test with forces that can be used")
    least_accelerance: float = entry(1e-18, "1/kg", "smallest", "of a tower below its modes")
    largest_accelerance: float = entry(1e6, "1/kg", "largest", "of a toy at a mode")
    largest_force_n: float = entry(1e10, "N", "force", "the weight of a million tonnes")


@table
class RECORDED_MODE:
    """Which tables of modes can be, and what of them is worth a word."""

    largest_damping: float = entry(
        0.5, "ratio", "damping", "no building loses more: such a figure is in percent"
    )
    much_damping: float = entry(
        0.1, "ratio", "damping from which a word is said", "buildings have .005 to .1"
    )
    in_phase: float = entry(
        0.9, "collinearity", "of the parts of a shape, below which they do not move in phase"
    )
    same_shape: float = entry(0.95, "MAC", "from which two shapes are one")
    same_frequency: float = entry(0.02, "ln f", "within which two such modes are one")
    wide: float = entry(0.1, "of the frequency", "its standard deviation, worth a word")


@table
class AMBIENT:
    """How modes are found in ambient records, and which poles are modes."""

    order: int = entry(40, "poles", "of the largest model")
    largest_damping: float = entry(0.2, "ratio", "of a pole that may be a mode")
    same_frequency: float = entry(
        0.02,
        "of the frequency",
        "within which poles of two orders are one mode",
        "those of one mode differ by a tenth of it, those of noise by several times it",
    )
    same_shape: float = entry(0.1, "1 - MAC", "within which they are, likewise")
    share: float = entry(0.5, "of the orders", "from its first one on, that have a mode")
    share_of_all: float = entry(0.4, "of all orders", "that have it")
    told: float = entry(0.15, "of all orders", "from which a doubtful group is worth a word")
    in_phase: float = entry(0.7, "collinearity", "of the shape of a mode, at least")
    tried: int = entry(4, "orders", "at which standard deviations of a mode are looked at")
    undamped_sd: float = entry(
        2.0, "sd", "from no damping within which a pole may be a machine", "a dwell looks undamped"
    )
    undamped: float = entry(
        5e-4, "ratio", "damping below which it may, too", "a tenth of what buildings have"
    )
    vague: float = entry(0.02, "of the frequency", "its standard deviation, of no mode")
    bottom: float = entry(0.4, "of the first frequency", "from which modes are looked for")
    top: float = entry(
        12.0,
        "of the first frequency",
        "up to which they are",
        "buildings have some six modes below",
    )
    rate: float = entry(2.5, "samples", "in a period of the highest frequency")
    peak: float = entry(8.0, "of the octave around", "power of the first mode")
    longest: int = entry(240, "rows", "of blocks times channels, at most")
    periods: int = entry(
        32,
        "periods",
        "of the first mode in a block",
        "twice the memory of a mode of 1 % damping, 1 / (2 pi zeta)",
    )
    fewest_blocks: int = entry(5, "blocks", "at least")
    most_blocks: int = entry(50, "blocks", "at most")
    least_sd: float = entry(1e-4, "of the largest component", "standard deviation of a shape")


@table
class AGREEMENT:
    """When runs on one building differ."""

    chance: float = entry(1e-3, "probability", "with which runs that agree are said to differ")
    ratio: float = entry(
        1.3,
        "of the noise",
        "difference below which nothing is said",
        "the noise is an estimate itself",
    )
    fewest: float = entry(3.0, "points", "independent, of a comparison")


@table
class ROTATION:
    """What vertical sensors tell of a base that turns."""

    apart_m: float = entry(0.01, "m", "between sensors, below which they stand at one place")
    height_m: float = entry(10.0, "m", "at which the rotation is compared with the translation")
    most: float = entry(
        3.0,
        "of the translation",
        "from which the rotation is doubted there",
        "a table that pitches by .3 rad/m",
    )
    rounding: float = entry(
        1e-9,
        "of its power",
        "from which a rotation is more than what goes with the translation",
        "sums of spectra in double precision",
    )


@table
class PROPOSAL:
    """What is guessed of a file."""

    along_deg: float = entry(10.0, "degrees", "by which azimuths of one direction may differ")
    components: int = entry(3, "channels", "of a record of one place, at most")
    ambient_s: float = entry(
        120.0, "s", "from which a record is ambient", "those of earthquakes end sooner"
    )
