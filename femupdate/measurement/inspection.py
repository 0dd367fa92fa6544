"""What is in a measured file, what looks wrong in it, and what to do with it next."""

import shlex
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from femupdate.measurement.checks import channel_findings, pair_findings, response_findings
from femupdate.measurement.frf_table import SOMEWHERE, response_functions, unnamed_functions
from femupdate.measurement.modes import mode_findings, modes_in_table
from femupdate.measurement.names import (
    BASE,
    FREQUENCY,
    RAW,
    TIME,
    FloorChannel,
    base_rank,
    channel_name,
    floor_height,
    floors_of,
    force_unit,
    is_acceleration,
    parse_channel,
    parse_frf_column,
    parse_history,
    si_factor,
    two_bases,
)
from femupdate.measurement.observation import fault_of, motions_in, said_of_rotation
from femupdate.measurement.reader import base_motion_in, read_measured, readers
from femupdate.measurement.recording import (
    RecordedChannel,
    RecordedFunction,
    RecordedMode,
    Recording,
    azimuth_of,
    in_m_s2,
)
from femupdate.measurement.resolve import axes_of, resolved

# Figures by which files are judged.
_ALONG_DEG = 10.0  # degrees, by which azimuths of one direction may differ


def proposed_floors(channels: Sequence[RecordedChannel]) -> tuple[str | None, ...]:
    """Floors that the channels' locations or names tell, None where they do not."""
    return floors_of([each.location or each.name for each in channels])


def _proposal(channels: Sequence[RecordedChannel], usable: Sequence[int]) -> dict[str, str]:
    """Our column name to the channel's number from 1, with a minus where it is turned."""
    floors = proposed_floors(channels)
    directions: dict[str, list[int]] = defaultdict(list)
    for k in usable:
        if floors[k] is not None:
            directions[_key(channels[k], directions, channels)].append(k)
    reached = {key: {floors[k] for k in indices} for key, indices in directions.items()}
    ordered = sorted(
        directions, key=lambda key: (BASE in reached[key], len(reached[key])), reverse=True
    )
    azimuths = {key: channels[directions[key][0]].azimuth_deg for key in ordered}
    right = [
        key
        for key in ordered[1:]
        if azimuths[key] is None
        or azimuths[ordered[0]] is None
        or _angle(azimuths[key], azimuths[ordered[0]]) >= 90.0 - _ALONG_DEG
    ]
    proposed: dict[str, str] = {}
    for axis, key in zip("xy", [*ordered[:1], *right[:1]], strict=False):
        by_floor: dict[str, list[int]] = defaultdict(list)
        for k in directions[key]:
            by_floor[floors[k] or ""].append(k)
        # Of several bases those inside the building are taken.
        ranks = {k: base_rank(channels[k].location or channels[k].name) for k in by_floor[BASE]}
        by_floor[BASE] = [k for k, rank in ranks.items() if rank == min(ranks.values())]
        rising = sorted((floor for floor in by_floor if by_floor[floor]), key=floor_height)
        forward = channels[by_floor[rising[0]][0]].azimuth_deg
        for floor in rising:
            several = len(by_floor[floor]) > 1
            for number, k in enumerate(by_floor[floor], start=1):
                azimuth = channels[k].azimuth_deg
                known = forward is not None and azimuth is not None
                turned = known and 90.0 < abs((azimuth or 0.0) - (forward or 0.0)) % 360.0 < 270.0
                name = channel_name(floor, str(number) if several else "", axis)
                proposed[name] = f"{'-' if turned else ''}{k + 1}"
    return proposed


def _key(
    channel: RecordedChannel,
    directions: Mapping[str, Sequence[int]],
    channels: Sequence[RecordedChannel],
) -> str:
    """What channels of one direction have in common."""
    parsed = parse_channel(channel.name)
    if parsed is not None:
        return parsed.direction
    if channel.azimuth_deg is None:
        return channel.direction.lower() or "x"
    for key, indices in directions.items():
        other = channels[indices[0]].azimuth_deg
        if other is not None and _angle(channel.azimuth_deg, other) <= _ALONG_DEG:
            return key
    return f"{channel.azimuth_deg:.0f}"


def _angle(first: float | None, second: float | None) -> float:
    """Angle between two axes, 0 to 90 degrees, whichever way they point."""
    apart = abs((first or 0.0) - (second or 0.0)) % 180.0
    return min(apart, 180.0 - apart)


_NO_BASE = "There is no base: the modes can be found if this is ambient vibration."
_FORCED = "Put in at which floor the force acts, and which channels are the floors."
_CHECK = "The floors are told from the sensors' places or names; check them against the building."


@dataclass(frozen=True)
class NextStep:
    """What to run next.

    Attributes:
        command: or an empty text.
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
        names: of a table's columns, the one of times included; None of any other file.
    """
    usable = [k for k, each in enumerate(histories) if each.horizontal]
    units = (histories[k].unit for k in usable)
    unknown = unit is None and any(stated is None or RAW.fullmatch(stated) for stated in units)
    options = f" --unit {shlex.quote(unit or 'UNIT')}" if unit or unknown else ""
    if not usable:
        return NextStep("", "None of the channels is a horizontal acceleration.")
    name = shlex.quote(str(path))
    identify = f"femupdate identify {name} -o {shlex.quote(f'{path.stem}_modes.csv')}"
    if columns:
        known = (*columns, *(each.name for each in histories))
        based = any(ours.startswith((BASE, "force/")) for ours in known)
        command = f"femupdate calibrate {name}{options}" if based else identify
        return NextStep(f"{command}{columns_option(columns)}", "", columns)
    proposed = _proposal(histories, usable)
    columns, numbers = dict(proposed), {o: int(k.lstrip("-")) - 1 for o, k in proposed.items()}
    if names is not None:  # columns of a table go by their names
        columns = {ours: histories[k].name for ours, k in numbers.items()}
        time = next((n for n in names if n not in {each.name for each in histories}), TIME)
        columns = columns if time.lower() == TIME else {TIME: time, **columns}
    along = {ours: theirs for ours, theirs in columns.items() if ".y" not in ours}
    left_over = [histories[k].name for k in usable if proposed_floors(histories)[k] is None]
    if proposed and left_over and (names is not None or not any(h.location for h in histories)):
        return NextStep(
            "",
            f"The names do not say which floor {', '.join(left_over)} is; say it for all channels"
            f" by --columns, such as 'base={histories[usable[0]].name},"
            f"RF={histories[usable[-1]].name}'.",
        )
    base = [ours for ours in proposed if ours.startswith(BASE)]
    floors = [ours for ours in proposed if not ours.startswith(BASE)]
    bases = (histories[numbers[ours]] for ours in base)
    if two_bases(lowest := [each.location or each.name for each in bases if not each.vertical]):
        return NextStep("", f"Is the base {' or '.join(lowest)}? Say it by --columns.", columns)
    others = [title for title in names or () if title.lower() != TIME]
    ours = len(others) == len(names or ()) - 1 and all(parse_history(title) for title in others)
    mapped = "" if ours else columns_option(along)
    calibrate = f"femupdate calibrate {name}{options}"
    forced = any((motion := parse_history(h.name)) and motion.force for h in histories)
    if (base or forced) and floors:
        return NextStep(calibrate + mapped, "" if ours else _CHECK, columns)
    what = "NUMBER" if names is None else "NAME"
    pushed = next((k for k, each in enumerate(histories) if each.quantity == "force"), None)
    if pushed is not None and not forced:
        force = str(pushed + 1) if names is None else histories[pushed].name
        option = columns_option({"force/RF": force, **along}, [] if floors else ["RF"], what)
        return NextStep(calibrate + option, _FORCED, columns)
    of_one_place = len({h.direction for h in histories} - {""}) == len(histories) < 4
    of_one_place |= len(histories) == 1
    if of_one_place and not floors:
        largest = max(usable, key=lambda k: float(abs(histories[k].values).max()))
        channel = f" --channel {largest + 1}" if len(histories) > 1 else ""
        return NextStep(f"femupdate predict --record {name}{channel}{options}", "")
    seconds = histories[usable[0]].values.size * histories[usable[0]].time_step
    # Records of earthquakes end before two minutes.
    if floors and not base and seconds >= 120.0:
        return NextStep(identify + mapped, _NO_BASE, columns)
    if not base and of_one_place:
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


def columns_option(
    columns: Mapping[str, str] | None, missing: Sequence[str] = (), what: str = "NUMBER"
) -> str:
    """Return the option that maps channels, or columns of a table, to floors; empty of none."""
    pairs = [f"{ours}={theirs}" for ours, theirs in (columns or {}).items()]
    pairs += [f"{ours}={what}" for ours in missing]
    return f" --columns {shlex.quote(','.join(pairs))}" if pairs else ""


_FRFS = (
    "Put in which response function, by its number, is which floor's: 2F/RF for 2F under a force at"
    " RF, 2F for 2F over the base."
)
_FRF_COLUMNS = (
    "Put in which column is which floor's, also of complex numbers: 2F/RF for 2F under a force at"
    " RF, 2F for 2F over the base."
)
_FORCE = "Put in the floor at which the force acts."
_NO_HEADER = (
    "Without a header the first column is taken for times; of frequencies say it by --columns, such"
    " as frequency_hz=1,2F=2, or 2F_re=2,2F_im=3 of real and imaginary parts."
)
_POINT_MODES = "Put in which component of the shapes is which floor's."

# What JSON holds of them, by the names that they have themselves.
_OF_CHANNEL = ("name", "location", "direction", "azimuth_deg", "vertical", "quantity", "unit")
_OF_FUNCTION = ("kind", "name", "unit", "response", "reference")
_OF_MODE = ("name", "frequency_hz", "frequency_sd_hz", "damping", "damping_sd", "sensors")
_POINTS = "It holds measuring points only; the histories or modes are in another file."


@dataclass(frozen=True, eq=False)
class InspectedChannel:
    """One history of a file and what is told from it.

    Attributes:
        number: from 1, by which commands take it.
        peak_m_s2: largest absolute acceleration, or None where the unit is not known.
    """

    number: int
    channel: RecordedChannel
    peak_m_s2: float | None
    floor: str | None
    findings: tuple[str, ...]

    @property
    def peak(self) -> float:
        """Largest absolute value, in the file's unit."""
        return float(np.abs(self.channel.values).max())

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last."""
        return (self.channel.values.size - 1) * self.channel.time_step

    @property
    def place(self) -> str:
        """Where the sensor sits; the channel's name where the file does not say."""
        return self.channel.location or self.channel.name

    @property
    def direction_text(self) -> str:
        """Direction in the file's words, with its azimuth where they do not tell it."""
        words, azimuth = self.channel.direction, self.channel.azimuth_deg
        if azimuth is None or azimuth_of(words) is not None:
            return words
        return f"{words} {azimuth:.0f}°".strip()

    @property
    def peak_text(self) -> str:
        """Largest absolute value with its unit."""
        if self.peak_m_s2 is not None:
            return f"{self.peak_m_s2:.4g} m/s²"
        return f"{self.peak:.4g} {self.channel.unit or '(no unit)'}"

    def as_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        channel = self.channel
        return {
            "number": self.number,
            **{name: getattr(channel, name) for name in _OF_CHANNEL},
            "rate_hz": 1.0 / channel.time_step,
            "samples": channel.values.size,
            "duration_s": self.duration_s,
            "peak": self.peak,
            "peak_m_s2": self.peak_m_s2,
            "floor": self.floor,
            "findings": self.findings,
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class Inspection:
    """What is in a file.

    Attributes:
        functions: its functions of frequency, those of a table included.
        modes: its identified modes, those of a table included.
        findings: sentences on what looks wrong between channels.
        rotation: sentences on what was done to times, and on the base's rotation.
    """

    path: Path
    reads: str
    recording: Recording
    channels: tuple[InspectedChannel, ...]
    functions: tuple[RecordedFunction, ...]
    modes: tuple[RecordedMode, ...]
    findings: tuple[str, ...]
    rotation: tuple[str, ...] = ()
    step: NextStep = field(default_factory=lambda: NextStep(""))

    @property
    def summary(self) -> str:
        """How many of what, and the format."""
        held = (
            ("channel", "channels", len(self.channels)),
            ("function of frequency", "functions of frequency", len(self.functions)),
            ("mode", "modes", len(self.modes)),
            ("measuring point", "measuring points", len(self.recording.points)),
        )
        parts = [
            f"{count} {each if count == 1 else several}" for each, several, count in held if count
        ]
        return f"{', '.join(parts) or 'nothing that is used'} ({self.reads})"

    @property
    def function_texts(self) -> tuple[str, ...]:
        """What each function of frequency is, where it was measured, and its band."""
        texts = []
        for function in self.functions:
            name, hz = f"{function.kind} {function.name}", function.frequency_hz
            if function.response and function.reference:
                name += f", {function.response} over {function.reference}"
            texts.append(
                f"{name}: {hz.size} points from {float(hz.min()):.4g} to {float(hz.max()):.4g} Hz,"
                f" {function.unit or 'no unit'}"
            )
        return tuple(texts)

    @property
    def mode_texts(self) -> tuple[str, ...]:
        """Frequency and damping of each identified mode."""
        texts = []
        for mode in self.modes:
            spread = "" if mode.frequency_sd_hz is None else f" ± {mode.frequency_sd_hz:.2g}"
            damping = "" if mode.damping is None else f", damping ratio {mode.damping:.4g}"
            seen = int(np.count_nonzero(~np.isnan(mode.shape)))
            name = f"mode {mode.name}" if mode.name else "mode"
            texts.append(
                f"{name} at {mode.frequency_hz:.5g}{spread} Hz{damping}, {seen} components"
            )
        return tuple(texts)

    @property
    def all_findings(self) -> tuple[str, ...]:
        """Sentences on what looks wrong in single channels, then between them."""
        sharing: dict[str, list[InspectedChannel]] = {}
        for each in self.channels:
            for finding in each.findings:
                sharing.setdefault(finding, []).append(each)
        single = []
        for finding, those in sharing.items():
            of = f"channels {', '.join(str(each.number) for each in those)}"
            if len(those) == 1:
                of = f"channel {those[0].number} ({those[0].channel.name})"
            single.append(f"{of}: {finding}")
        return (*single, *self.findings)

    def as_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        return {
            "path": self.path,
            "format": self.recording.format,
            "channels": [each.as_dict() for each in self.channels],
            "functions": [
                {
                    **{name: getattr(function, name) for name in _OF_FUNCTION},
                    "points": function.frequency_hz.size,
                    "band_hz": (float(function.frequency_hz[0]), float(function.frequency_hz[-1])),
                }
                for function in self.functions
            ],
            "modes": [{name: getattr(mode, name) for name in _OF_MODE} for mode in self.modes],
            "points": len(self.recording.points),
            "notes": (*self.recording.notes, *self.rotation),
            "findings": self.all_findings,
            "next": self.step.command,
            "advice": self.step.advice,
        }


def inspect_file(
    path: str | Path, unit: str | None = None, columns: Mapping[str, str] | None = None
) -> Inspection:
    """Return what is in a measured file, in any format that is known.

    Args:
        unit: of the accelerations, where the file does not say it.
        columns: our column name to the file's column or channel, where the user says it; a
            channel that is turned round is shown so.

    Raises:
        MeasurementError: it cannot be read.
    """
    path = Path(path)
    recording = read_measured(path)
    if unit and not force_unit(unit):
        si_factor(recording.file, unit, "acceleration")  # refuses what is no unit
    functions = (*recording.functions, *_functions_of_table(recording, unit, columns))
    table = recording.mode_table
    modes = recording.modes if table is None else modes_in_table(table, columns or {}, named=False)
    tabled = bool(functions) and recording.table is not None
    histories = () if tabled or table is not None else recording.histories(columns)
    done = tuple(dict.fromkeys(words for each in histories for words in each.done))
    floors: Sequence[str | None] = proposed_floors(histories)
    motions = [parse_channel(each.name) for each in histories]
    if columns and histories:  # as the user says them, in the directions x, y and z
        turned = motions_in(recording, columns)
        given = {(motion.name, motion.direction): ours for ours, motion in turned.items()}
        motions = [given.get((each.name, each.direction)) for each in histories]
        histories = tuple(
            each if ours is None else replace(turned[ours], direction=ours.direction.upper())
            for each, ours in zip(histories, motions, strict=True)
        )
        floors = [None if ours is None else ours.floor for ours in motions]
    # Vertical channels of the base whose places are known.
    placed = {k: ours for k, ours in enumerate(motions) if ours and ours.place is not None}
    channels = []
    for number, (channel, floor) in enumerate(zip(histories, floors, strict=True), start=1):
        assumed = unit if channel.quantity in ("acceleration", "unknown") else None
        stated, si = channel.unit or assumed, None
        stated = unit if unit and stated and RAW.fullmatch(stated) else stated
        if stated is not None and is_acceleration(stated):
            si = si_factor(recording.file, stated, "acceleration")
        peak = None if si is None else float(np.abs(channel.values).max()) * si
        findings = channel_findings(channel, si)
        channels.append(InspectedChannel(number, channel, peak, floor, findings))
    odd: list[str] = []
    for reference in dict.fromkeys(each.reference for each in functions):
        force = reference.removeprefix("a force at ")
        if reference in (BASE, f"a force at {force}"):
            those = [each for each in functions if each.reference == reference]
            values = np.array([each.values for each in those])
            if (found := force_unit(those[0].unit or "")) and found[0] == 1:  # a mobility
                values = 1j * values
            places = [each.response for each in those]
            force = "" if reference == BASE else force
            odd += response_findings(those[0].frequency_hz, values, places, force)
    return Inspection(
        path=path,
        reads=readers()[recording.format].READS,
        recording=recording,
        channels=tuple(channels),
        functions=functions,
        modes=modes,
        findings=(
            *pair_findings(histories, floors, placed=placed),
            *mode_findings(modes),
            *odd,
        ),
        rotation=(*done, *_rotation(recording, channels, placed, unit)),
        step=_step(path, recording, histories, functions, modes, unit, columns),
    )


def _rotation(
    recording: Recording,
    channels: Sequence[InspectedChannel],
    placed: Mapping[int, FloorChannel],
    unit: str | None,
) -> tuple[str, ...]:
    """What vertical channels of the base tell, or could tell, of its rotation."""
    below = [each for each in channels if each.floor == BASE]
    if not placed:
        up = [each for each in below if each.channel.vertical and base_rank(each.place) == 0]
        advice = (
            f"Channels {', '.join(str(each.number) for each in up)} are vertical at the base: with"
            " their places along the motion, in m, they measure how it turns. Map them under names"
            " such as base@-2.5.z."
        )
        return (advice,) if len(up) >= 2 else ()
    base = next((each.channel for each in below if not each.channel.vertical), None)
    vertical, places = [channels[k].channel for k in placed], tuple(placed.values())
    if len(placed) < 2 or base is None or None in [each.unit or unit for each in vertical]:
        return ()
    fault = fault_of(places)
    if fault is not None:
        return (fault,)
    rows = np.array([in_m_s2(recording.file, each, unit) for each in vertical])
    return said_of_rotation(places, rows, in_m_s2(recording.file, base, unit))


def _functions_of_table(
    recording: Recording, unit: str | None, columns: Mapping[str, str] | None
) -> tuple[RecordedFunction, ...]:
    """Functions in a table with a column of frequencies; none of any other file."""
    table = recording.table
    names = (table.names if table is not None else None) or ("",)
    axis = next((k for k, kind in axes_of(names).items() if kind == FREQUENCY), None)
    if table is None or axis is None:
        return ()
    others = (name for k, name in enumerate(names) if k != axis)
    if not columns and not all(map(parse_frf_column, others)):
        return unnamed_functions(replace(table, at=axis))
    table = resolved(table, columns)
    if not (table.force_units or any(column.force for column in table.frfs)):
        base_motion_in(recording, unit, columns)  # refuses what cannot be
    return response_functions(table)


def _step(
    path: Path,
    recording: Recording,
    histories: Sequence[RecordedChannel],
    functions: Sequence[RecordedFunction],
    modes: Sequence[RecordedMode],
    unit: str | None,
    columns: Mapping[str, str] | None,
) -> NextStep:
    if histories:
        names = None if recording.table is None else recording.table.names or ()
        step = next_step(path, histories, names, unit, columns)
        asked = names == () and not columns
        return replace(step, advice=f"{step.advice} {_NO_HEADER}".strip()) if asked else step
    calibrate = f"femupdate calibrate {shlex.quote(str(path))}"
    if any(not min(e.frequency_hz, 1.0 if e.damping is None else e.damping) > 0.0 for e in modes):
        return NextStep("", "Frequency and damping must be above 0: leave blank what is unknown.")
    if modes:
        placed = all(parse_channel(sensor) for mode in modes for sensor in mode.sensors)
        if columns or placed:
            return NextStep(calibrate + columns_option(columns))
        return NextStep(f"{calibrate} --columns 2F=NAME,RF=NAME", _POINT_MODES)
    if functions and recording.table is not None:
        references = {function.reference for function in functions}
        if not any(references):
            return NextStep(f"{calibrate} --columns 2F=NAME,RF=NAME", _FRF_COLUMNS)
        if references == {BASE}:
            return NextStep(f"{calibrate}{columns_option(columns)}")
        silent = SOMEWHERE in references
        known = unit is not None or all(function.unit for function in functions)
        options = " --force FLOOR" if silent else ""
        options += f" --unit {unit or 'm/s2/N'}" if unit or not known else ""
        options += columns_option(columns)
        advice = _FORCE if silent else "" if known else "Put in the unit of the responses."
        return NextStep(f"{calibrate}{options}", advice)
    told = [(at, f) for at, f in enumerate(functions, 1) if f.kind == "frequency response"]
    if told:
        ends = [floors_of([f.response for _, f in told]), floors_of([f.reference for _, f in told])]
        pairs = [
            floor if force == BASE else f"{floor}/{force}"
            for floor, force in zip(*ends, strict=True)
            if floor not in (None, BASE) and force
        ]
        if len({*pairs}) < len(told):
            return NextStep(f"{calibrate} --columns 2F/RF=NUMBER", _FRFS)
        told_columns = {pair: str(at) for pair, (at, _) in zip(pairs, told, strict=True)}
        return NextStep(calibrate + columns_option(told_columns), _CHECK)
    if functions:
        return NextStep("", "Spectra alone do not tell a response; give the histories.")
    return NextStep("", _POINTS)
