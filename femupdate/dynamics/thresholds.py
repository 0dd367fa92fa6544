"""Numbers with a meaning that reduced models and histories are made by."""

from femupdate.thresholds import entry, table


@table
class REDUCTION:
    """How a reduced model is made and judged."""

    sizes: tuple[int, ...] = entry(
        (40, 60, 80, 100, 120, 140, 160, 180, 200, 230, 260, 300), "shapes", "that are tried"
    )
    samples: int = entry(
        32,
        "samples",
        "from which the basis is taken, at least",
        "six-story frame: 200 shapes err by .0041 rms, and by .0036 with 48 samples",
    )
    samples_each: int = entry(2, "samples", "for every parameter, at least")
    choose: int = entry(4, "samples", "that the basis has not seen, by which its size is chosen")
    certify: int = entry(
        29,
        "samples",
        "by which the choice is judged: 90 % of the box with the confidence below",
        "Wilks (1941)",
    )
    rounds: int = entry(3, "rounds", "of a basis that fails, at most")
    join: int = entry(8, "samples", "where it fails, whose responses join it")
    confidence: float = entry(0.95, "probability", "with which the judged share of the box is told")


@table
class LOCAL_BASIS:
    """How a basis near one theta is made, on which effects are tried."""

    spread: float = entry(0.2, "ln theta", "to both sides, that it serves")
    size: int = entry(220, "shapes", "of it")
    neighbours: int = entry(8, "samples", "of theta near the middle, solved beside it")
    changed: float = entry(0.2, "of its size", "by which an effect that is present is changed")
    least: float = entry(
        1e-7,
        "of the largest energy",
        "of the shapes of one question that count",
        "two-story frame with a brace as stiff as itself: .0047 rms of ln|H|, .0050 with 1e-6",
    )


@table
class LEVEL:
    """How strong a motion is."""

    strong: tuple[float, float] = entry(
        (0.05, 0.95),
        "of the energy",
        "between which a motion is strong",
        "Trifunac and Brady (1975)",
    )
    periods: float = entry(
        4.0, "periods", "of the strongest mode, over which the level of a moment is taken"
    )
    span: float = entry(
        1.0, "doublings", "to both sides of the mean level, to which laws of the level are known"
    )
    parts: int = entry(7, "parts", "of a run, of equal energy of the base, that have a level each")
    segment_s: float = entry(20.0, "s", "of the spectrum that tells the strongest mode")


@table
class CHANGING:
    """How a structure that softens in a run is followed."""

    step: float = entry(0.05, "doublings", "between the levels that are told apart")
    window: float = entry(0.5, "periods", "of the first mode, in which the structure stays")
    rounds: int = entry(
        8,
        "rounds",
        "of response and level, at most",
        "a swelling oscillator: off by a tenth with four, by a fourteenth with eight",
    )
    last_rounds: int = entry(2, "rounds", "of every sample, from the level of one of them")
