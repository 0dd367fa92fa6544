"""The first section of the page: the answer in a few sentences."""

import numpy as np

from femupdate.report.page import Block, Remarks, Section, Text
from femupdate.report.page_finder import added
from femupdate.report.scale import interval_text
from femupdate.study import as_written
from femupdate.workflow.page_parts import PageStudy, bad_items, posterior_notes, read_json, searched
from femupdate.workflow.page_prediction import predicted_quantities
from femupdate.workflow.prediction_quantities import DrawnQuantity
from femupdate.workflow.summary import effect_parameter

_WARNS = ("is missing", "too small", "too narrow", "unlike", "misses", "not enough", "beyond")


def summary_section(page: PageStudy) -> Section:
    """What a reader with one minute should know."""
    sentences = (
        *_stiffness(page),
        *_effects(page),
        *_first_mode(page),
        *_prediction(page),
        *_finder(page),
    )
    notes = posterior_notes(page)
    warnings = (*bad_items(page), *(one for one in notes if any(word in one for word in _WARNS)))
    blocks: list[Block] = []
    if warnings:
        blocks.append(Remarks(warnings, warning=True))
    blocks.append(Remarks(sentences) if sentences else Text(("Nothing was calibrated yet.",)))
    return Section("summary", "In short", tuple(blocks))


def _stiffness(page: PageStudy) -> tuple[str, ...]:
    posterior = page.posterior
    if posterior is None:
        return ()
    factors = posterior.of("stiffness")
    draws = factors.samples
    mean = draws.mean(axis=0)
    softest, stiffest = int(mean.argmin()), int(mean.argmax())
    spread = 100.0 * (draws.std(axis=0) / mean)
    lead = f"{posterior.observation.source}, floors {', '.join(posterior.observation.floors)}"
    if len(factors.names) == 1:
        return (f"Measured {lead}: the stiffness is {_text(draws[:, 0])} times the file's.",)
    titles = [page.titles[name] for name in factors.names]
    return (
        f"Calibrated to {lead}. Of the stiffness in the building file, {titles[softest]} has "
        f"least, {_text(draws[:, softest])} times, and {titles[stiffest]} most, "
        f"{_text(draws[:, stiffest])} times (5 to 95 % in brackets).",
        f"The data determine the factors to {spread.min():.2g} to {spread.max():.2g} % (one "
        "standard deviation).",
    )


def _effects(page: PageStudy) -> tuple[str, ...]:
    """The effects that the building lists, each with its size."""
    posterior = page.posterior
    if posterior is None:
        return ()
    effects = posterior.of("effect")
    found = [
        _of_effect(page.titles[name], name, draws)
        for name, draws in zip(effects.names, effects.samples.T, strict=True)
    ]
    return (f"The model holds effects: {'; '.join(found)}.",) if found else ()


def _of_effect(title: str, name: str, draws: np.ndarray) -> str:
    """A parameter of an effect in the unit in which it is read."""
    own = effect_parameter(name)
    if own is None:
        return f"{title}, {_text(draws)}"
    factor, _, unit = own.as_read(1.0, 0.0)
    where, _, what = title.partition(": ")
    return f"{where}: {_text(factor * draws)} {unit} ({own.text or what})"


def _text(draws: np.ndarray) -> str:
    low, high = np.quantile(draws, [0.05, 0.95])
    return interval_text(float(draws.mean()), float(draws.std()), float(low), float(high))


def _first_mode(page: PageStudy) -> tuple[str, ...]:
    modes = page.modes
    if not modes:
        return ()
    first = modes[0]
    if first.influence is None:
        lead = f"The lowest mode that the base motion excites, {first.name},"
    else:
        lead = f"The mode that matters most to the data, {first.name},"
    return (
        f"{lead} is at {first.tracked.frequency_mean:.2f} Hz (standard deviation "
        f"{first.tracked.frequency_sd:.2g} Hz) and moves "
        f"{100.0 * first.effective_mass:.0f} % of the mass.",
    )


def _prediction(page: PageStudy) -> tuple[str, ...]:
    found = predicted_quantities(page)
    if not found:
        return ()
    settings = page.recorded("prediction").settings
    keys = ("acceleration", "ratio" if "ratio" in found else "drift", "base")
    parts = [_largest(found[key]) for key in keys]
    name = str(settings.get("file", "the record")).replace("\\", "/").rsplit("/", 1)[-1]
    scale = float(settings.get("scale", 1.0))
    scaled = "" if scale == 1.0 else f", scaled by {scale:g}"
    return (f"Under {name}{scaled}: {'; '.join(parts)}.",)


def _largest(one: DrawnQuantity) -> str:
    own = one.statistics
    k = int(own.mean.argmax())
    values = (float(part[k]) for part in (own.mean, own.sd, own.q05, own.q95))
    place = "" if one.places[k] == "base" else f" at {one.places[k]}"
    return f"{one.name}{place} {interval_text(*values)} {one.unit}"


def _finder(page: PageStudy) -> tuple[str, ...]:
    """The verdict on this model, and the repair that followed or that made it."""
    folder, sentences = searched(page), []
    if page.state("diagnosis") is not None:
        with as_written(path := folder.path("diagnosis.json")):
            found = read_json(path)
            sentences.append(f"What the model lacks: {found['verdict']}. {found['sentence']}")
    with as_written(path := folder.path("repair.json")):
        done = read_json(path)
        if done.get("rounds"):
            here = folder.folder != page.study.folder
            which = "This model was repaired" if here else "A repaired model has a page of its own"
            sentences.append(f"{which}. {added(done)}")
    return tuple(sentences)
