"""The command to run next on a measured file, with a proposal which floors its channels are."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.columns import BASE, TIME, ForceChannel, parse_history
from femupdate.measurement.proposal import columns_of, is_usable, proposal
from femupdate.measurement.thresholds import PROPOSAL

_NO_BASE = "There is no base: the modes can be found if this is ambient vibration."
_FORCED = "Put in at which floor the force acts, and which channels are the floors."
_CHECK = (
    "The floors are told from the sensors' places or names; check them against the building, or"
    " write them to a file that you can correct, by --write-mapping."
)


@dataclass(frozen=True)
class NextStep:
    """What to run next.

    Attributes:
        command: or an empty text.
        advice: a sentence on it.
        columns: our column name to the channel or column that the file proposes, both directions.
    """

    command: str
    advice: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)


def next_step(
    path: Path,
    histories: Sequence[RecordedChannel],
    names: Sequence[str] | None,
    unit: str | None,
    columns: Mapping[str, str] | None = None,
) -> NextStep:
    """Return what to run next on a file of histories.

    Args:
        histories: of it.
        names: of a table's columns, the one of times included; None of any other file.
        unit: that the user gave.
        columns: our column name to the file's, that the user gave.
    """
    usable = [k for k, each in enumerate(histories) if is_usable(each)]
    unknown = unit is None and any(histories[k].unit is None for k in usable)
    options = f" --unit {unit or 'UNIT'}" if unit or unknown else ""
    if not usable:
        return NextStep("", "None of the channels is a horizontal acceleration.")
    if columns:
        return NextStep(_as_told(path, columns, options), "", columns)
    proposed = proposal(histories)
    columns = columns_of(proposed, histories, names)
    along = columns_of({k: v for k, v in proposed.items() if ".y" not in k}, histories, names)
    base = [ours for ours in proposed if ours.startswith(BASE)]
    floors = [ours for ours in proposed if not ours.startswith(BASE)]
    ours = names is not None and _speaks_our_names(names)
    mapped = "" if ours else columns_option(along)
    calibrate = f"femupdate calibrate {shlex.quote(str(path))}{options}"
    forced = any(isinstance(parse_history(each.name), ForceChannel) for each in histories)
    if (base or forced) and floors:
        return NextStep(calibrate + mapped, "" if ours else _CHECK, columns)
    what = "NUMBER" if names is None else "NAME"
    pushed = next((k for k, each in enumerate(histories) if each.quantity == "force"), None)
    if pushed is not None and not forced:
        own = str(pushed + 1) if names is None else histories[pushed].name
        option = columns_option({"force/RF": own, **along}, [] if floors else ["RF"], what)
        return NextStep(calibrate + option, _FORCED, columns)
    if len(histories) <= PROPOSAL.components and not floors:
        return NextStep(_predict(path, histories, usable, options), "")
    if floors and not base and _lasts(histories[usable[0]]) >= PROPOSAL.ambient_s:
        identify = f"femupdate identify {shlex.quote(str(path))} -o modes.csv{mapped}"
        return NextStep(identify, _NO_BASE, columns)
    if not base and len(histories) <= PROPOSAL.components:
        return NextStep(
            "",
            f"The channel sits at {', '.join(floors)}: a response needs the base's record too, with"
            " the same times in one file.",
        )
    missing = ([] if base else [BASE]) + ([] if floors else ["RF"])
    return NextStep(
        calibrate + columns_option(along, missing, what),
        f"Put in which channels are {' and '.join(missing)}: their places do not tell it.",
        columns,
    )


def _lasts(channel: RecordedChannel) -> float:
    """Length, s."""
    return channel.values.size * channel.time_step


def _as_told(path: Path, columns: Mapping[str, str], options: str) -> str:
    """The command for channels that the user has given to floors."""
    name = shlex.quote(str(path))
    if any(ours.startswith((BASE, "force/")) for ours in columns):
        return f"femupdate calibrate {name}{options}{columns_option(columns)}"
    return f"femupdate identify {name} -o modes.csv{columns_option(columns)}"


def _speaks_our_names(names: Sequence[str]) -> bool:
    others = [name for name in names if name.lower() != TIME]
    return len(others) == len(names) - 1 and all(parse_history(name) for name in others)


def columns_option(
    columns: Mapping[str, str] | None, missing: Sequence[str] = (), what: str = "NUMBER"
) -> str:
    """Return the option that maps channels, or columns of a table, to floors; empty of none."""
    pairs = [f"{ours}={theirs}" for ours, theirs in (columns or {}).items()]
    pairs += [f"{ours}={what}" for ours in missing]
    return f" --columns {shlex.quote(','.join(pairs))}" if pairs else ""


def _predict(
    path: Path, histories: Sequence[RecordedChannel], usable: Sequence[int], options: str
) -> str:
    largest = max(usable, key=lambda k: float(abs(histories[k].values).max()))
    channel = f" --channel {largest + 1}" if len(histories) > 1 else ""
    return f"femupdate predict --record {shlex.quote(str(path))}{channel}{options}"
