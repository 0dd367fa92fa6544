"""Numbers by which measured files are judged in several places; others stand where they count."""

from femupdate.thresholds import entry, table


@table
class RECORD:
    """Which accelerations can be, and how motions of the ground are resampled."""

    fewest_of_spectrum: int = entry(
        64, "samples", "of histories", "four segments of 32 samples: less is no spectrum"
    )
    smallest_g: float = entry(1e-6, "g", "peak", "below the resolution of an accelerograph")
    largest_g: float = entry(
        5.0, "g", "peak of the ground", "the largest recorded is about 4 g (2008, Iwate)"
    )


@table
class SPECTRUM:
    """How FRFs are estimated, and which of their points are used."""

    default_noise: float = entry(0.2, "ln|H|", "where neither the file nor the coherence says")
    least_noise: float = entry(
        0.003, "ln|H|", "that is stated", "by trial: less gains no truth, and thins tolerances"
    )
