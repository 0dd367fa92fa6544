"""What the model lacks, on the page: the finding, the repair, and what remains."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from femupdate.effects.effect import Placed
from femupdate.effects.registry import CATALOGUE
from femupdate.report.curves import Interval
from femupdate.report.page import Block, Chart, Remarks, Text
from femupdate.report.page_charts import bar_figure, interval_figure
from femupdate.tables import Table

_SHOWN = 8
_LEAST_P = 1e-6  # below it a p-value says no more


def diagnosis_blocks(found: Mapping[str, Any]) -> list[Block]:
    """What `diagnose` has kept as JSON, for the page."""
    lead = f"Verdict: {found['verdict']}. {found['sentence']}"
    residual = (
        f"The residuals of the model as it was add up to {found['chi2']:.0f} over "
        f"{found['independent_points']:.0f} independent points{p_text(found['p_value'])}."
    )
    blocks: list[Block] = [Text((lead, residual))]
    effects = found["effects"][:_SHOWN]
    if effects:
        blocks += [_ranking(effects), _effects(effects)]
    if found["where"]:
        blocks.append(_where(found["where"]))
    remarks = [*found["would_decide"], *found["screen"]]
    if found["cannot_be_seen"]:
        unseen = ", ".join(_label(one) for one in found["cannot_be_seen"])
        remarks.append(f"These sensors cannot show: {unseen}.")
    if found["cannot_be_told_from_the_first"]:
        twins = ", ".join(_label(one) for one in found["cannot_be_told_from_the_first"])
        remarks.append(f"The data cannot tell the first effect from: {twins}.")
    if remarks:
        blocks.append(Remarks(tuple(remarks)))
    return blocks


def _label(text: str) -> str:
    """An effect and its place in words, from a label such as "added_mass@3F"."""
    name, _, place = text.partition("@")
    return Placed(CATALOGUE[name], place).in_words if name in CATALOGUE else text


def _words(record: Mapping[str, Any]) -> str:
    """The same of an effect that a diagnosis or a repair has kept, an older one without words."""
    name = record.get("name") or record.get("effect")
    return str(record.get("in_words") or _label(f"{name}@{record['place']}"))


def _ranking(effects: Sequence[Mapping[str, Any]]) -> Chart:
    names = [_words(record) for record in effects]
    values = np.array([record["log_evidence_over_none"] for record in effects], dtype=float)
    figure = bar_figure(names, values, "log evidence")
    return Chart(
        name="evidence",
        caption="How well each effect explains the data: its log evidence over the model as it was",
        panels=(("effects", figure),),
        note="A difference of 5 is strong evidence; one of 1 says little.",
        height=110 + 34 * len(names),
    )


def _effects(effects: Sequence[Mapping[str, Any]]) -> Table:
    elsewhere = {True: "holds", False: "too little", None: ""}
    rows = [
        (
            _words(record),
            record.get("size_in_words", ""),
            elsewhere[record.get("certified")],
            f"{100.0 * record['absorbed_by_theta']:.0f} %",
        )
        for record in effects
    ]
    head = ("effect", "size", "on other data", "hidden by the stiffness factors")
    return Table.of(head, rows, name="effects", caption="Effects")


def _where(cells: Sequence[Mapping[str, Any]]) -> Table:
    rows = tuple(
        (
            ", ".join(str(part) for part in (cell["floor"], cell.get("data")) if part),
            _band(*cell["band_hz"]),
            f"{np.sqrt(max(cell['excess'] + 1.0, 0.0)):.2f}",
        )
        for cell in sorted(cells, key=lambda cell: -float(cell["excess"]))
    )
    return Table.of(
        name="where",
        caption="Where the model as it was and the data disagree by more than noise",
        head=("floor", "band, Hz", "residual over noise (rms)"),
        rows=rows,
    )


def _band(low: float, high: float) -> str:
    """A band in Hz, or the frequency of a mode."""
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"


def repair_blocks(done: Mapping[str, Any], titles: Sequence[str]) -> list[Block]:
    """What `repair` has kept as JSON, for the page.

    Args:
        titles: of the stiffness factors.
    """
    if not done["rounds"]:
        return [Text((f"A repair added nothing ({done['verdict']}). {done['sentence']}",))]
    text = (added(done), f"What remains: {done['remaining']['sentence']}")
    return [Text(text), *_held(done), _before_after(done, titles)]


def added(done: Mapping[str, Any]) -> str:
    """What a repair added, and what that did."""
    names = "; ".join(_words(record) for record in done["rounds"])
    return (
        f"Added to the model: {names}. Residuals fell from {done['chi2_before']:.0f} to "
        f"{done['chi2_after']:.0f} over {done['independent_points']:.0f} independent points."
    )


def p_text(value: float) -> str:
    """A p-value in brackets: two decimals, or an exponent where it is small.

    Nothing where it is 1: the noise that is allowed for is then larger than that of the data.
    """
    if value >= 0.995:
        return ""
    if value < _LEAST_P:
        return f" (p-value under {_LEAST_P:.0e})".replace("e-0", "e-")
    return f" (p-value {value:.2f})" if value >= 0.01 else f" (p-value {value:.1g})"


def _held(done: Mapping[str, Any]) -> list[Block]:
    """On data that were kept out."""
    before, after = done["holdout_error_before"], done["holdout_error_after"]
    # What an older femupdate wrote has no halves.
    halves = [done.get(f"halves_chi2_{when}") for when in ("before", "after")]
    if None not in halves:
        text = (
            "Each half of the data was kept out in turn: by a fit to the other, its mean squared "
            f"residual was {halves[0]:.1f} before the repair and is {halves[1]:.1f} after it."
        )
        return [Text((text,))]
    if before is None or after is None:
        return []
    own = [done[f"holdout_own_error_{when}"] for when in ("before", "after")]
    sentences = (
        "On a measurement that was kept out, the error of the histories was "
        f"{100 * before:.0f} % before the repair and is {100 * after:.0f} % after it.",
        "With that measurement's own stiffness and damping it was "
        f"{100 * own[0]:.0f} % and is {100 * own[1]:.0f} %.",
    )
    return [Text(sentences)]


def _before_after(done: Mapping[str, Any], titles: Sequence[str]) -> Chart:
    rows = titles[: len(done["theta_before"])]
    both = []
    for word, line, series in (("before", "upper", 1), ("after", "lower", 0)):
        mean, sd = (np.array(done[f"theta{part}_{word}"]) for part in ("", "_sd"))
        both.append(
            Interval(
                name=f"{word} the repair ({line} line), mean ± 2 sd",
                mean=mean,
                low=mean - 2.0 * sd,
                high=mean + 2.0 * sd,
                series=series,
            )
        )
    figure = interval_figure(rows, both, "stiffness over that in the building file")
    return Chart(
        name="before_after",
        caption="Stiffness factors before and after the repair",
        panels=(("factors", figure),),
        height=120 + 46 * len(rows),
    )
