"""The posterior that a study keeps: its draws, what they tell, and titles of its parameters."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femupdate.arrays import Floats
from femupdate.building.document import Building
from femupdate.building.parameters import factor_ranges, factor_titles
from femupdate.effects.effect import EffectParameter, Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.effects.tolerances import key_of
from femupdate.errors import StudyError
from femupdate.inference.diagnostics import Identifiability, identifiability
from femupdate.inference.posterior import Posterior, load_posterior
from femupdate.study import Study
from femupdate.tables import Column, Table

SUMMARY = "posterior_summary.json"


def identified(posterior: Posterior) -> Identifiability:
    """What the data have told about the parameters of a posterior."""
    low, high = posterior.bounds.T
    return identifiability(posterior.samples, low, high, names=posterior.names)


def identifiability_record(found: Identifiability) -> dict[str, Any]:
    """Plain numbers and text, for JSON."""
    return {
        "undetermined": found.undetermined,
        "left_alone": list(found.left_alone),
        "combinations": [
            {
                "kept": part.kept,
                "words": found.describe(part),
                "weight": _named(found.names, part.weight),
            }
            for part in found.combinations
        ],
        "modes": [
            {key: np.asarray(value).tolist() for key, value in asdict(mode).items()}
            for mode in found.modes
        ],
    }


def _named(names: Sequence[str], values: ArrayLike) -> dict[str, float]:
    return {name: float(v) for name, v in zip(names, np.asarray(values), strict=True)}


def kept_summary(study: Study) -> dict[str, Any]:
    """What the report of a calibration wrote; empty where there is none, as after a repair.

    Raises:
        StudyError: the file cannot be read.
    """
    path = study.result(SUMMARY)
    if not path.exists():
        return {}
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise StudyError(
            f"{path} cannot be read ({error}); run `femupdate calibrate` again"
        ) from error


def kept_posterior(study: Study, building: Building) -> Posterior:
    """Read the posterior of a study.

    The study's record says of which building it is; here the draws themselves are looked at, for a
    record can be wrong.

    Raises:
        StudyError: there is none, it is damaged, or its factors or floors are not the building's.
    """
    posterior = load_posterior(study.require("posterior", "calibrate"))
    factors = tuple(factor_ranges(building))
    names = posterior.of("stiffness").names
    if names != factors or not set(posterior.observation.floors) <= set(building.floors):
        raise StudyError(
            f"the {study.key('posterior')} in {study.folder} is not of {building.name}: its factors"
            f" are {', '.join(posterior.names)}, measured at"
            f" {', '.join(posterior.observation.floors)}; run `femupdate calibrate` again"
        )
    return posterior


def parameter_titles(building: Building, names: Sequence[str]) -> Mapping[str, str]:
    """Titles by name, such as "story S3" or "Added mass at 3F: share of the floor's mass"."""
    known = factor_titles(building)
    return {name: known.get(name) or effect_title(name) for name in names}


def placed_effect(label: str) -> Placed | None:
    """The effect at its place that a label such as "added_mass@3F" is; None of another text."""
    name, _, place = label.partition("@")
    return Placed(CATALOGUE[name], place) if name in CATALOGUE else None


def effect_parameter(name: str) -> EffectParameter | None:
    """The parameter of the catalogue that one such as "added_mass@3F.size" is."""
    label, _, parameter_name = name.rpartition(".")
    placed = placed_effect(label)
    known = () if placed is None else placed.effect.parameters
    return next((parameter for parameter in known if parameter.name == parameter_name), None)


def effect_title(name: str) -> str:
    """What a parameter such as "added_mass@3F.size" is of; the name itself where it is another."""
    placed, known = placed_effect(name.rpartition(".")[0]), effect_parameter(name)
    if key := key_of(name):
        return f"{key} of {name.partition('@')[2].rpartition('.')[0]}, within its tolerance"
    if placed is None:
        return name
    text = "" if known is None else f": {known.text or known.name}"
    unit = "" if known is None or known.unit == "1" else f" ({known.unit})"
    return f"{placed.in_words}{text}{unit}"


def short_name(name: str) -> str:
    """A name that stands below a panel: θ1, or an effect and which of its parameters."""
    effect, _, rest = name.partition("@")
    if not rest:
        return name.replace("theta_", "θ")
    place, _, parameter = rest.rpartition(".")
    return f"{effect.replace('_', ' ')}, {place}" + (f": {parameter}" if parameter else "")


def parameter_table(
    building: Building, posterior: Posterior, agreement: Floats | None = None
) -> Table:
    """Every parameter with its posterior and its prior, the damping ratio last.

    Args:
        agreement: (p,) r-hat of the runs, where there are several.
    """
    titles, names = parameter_titles(building, posterior.names), posterior.names
    priors = [f"{low:.3g} to {high:.3g}" for low, high in posterior.bounds]
    hats = [] if agreement is None else [f"{value:.3f}" for value in agreement]
    draws = posterior.samples.T
    if posterior.zeta_samples is not None:
        draws, names = np.vstack([draws, posterior.zeta_samples]), (*names, "zeta")
        priors.append("")
    hats += [""] * (len(names) - len(hats))
    sd = draws.std(axis=1)
    q05, median, q95 = np.quantile(draws, [0.05, 0.5, 0.95], axis=1)
    # With two figures of the standard deviation.
    decimals = [
        4 if not spread > 0.0 else int(np.clip(1 - np.floor(np.log10(spread)), 0, 8))
        for spread in sd
    ]

    def column(values: Floats, key: str, head: str | None = None) -> Column:
        cells = [f"{value:.{count}f}" for value, count in zip(values, decimals, strict=True)]
        return Column(values, head, cells, csv=key)

    of = [titles.get(name, "damping ratio") for name in names]
    return Table(
        name="posterior",
        caption="Parameters",
        note="A factor of 1 is the stiffness in the building file.",
        columns=(
            Column(names, "parameter", csv="parameter"),
            Column(of, csv="of"),
            column(draws.mean(axis=1), "mean", "mean"),
            column(sd, "sd", "sd"),
            column(q05, "q05", "5 %"),
            column(median, "median"),
            column(q95, "q95", "95 %"),
            *([] if agreement is None else [Column(hats, "r-hat")]),
            Column(priors, "prior"),
            Column(of, "of"),
        ),
        corner="",
        words_last=True,
    )
