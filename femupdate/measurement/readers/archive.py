"""Zip archives of records, such as the station archives of CESMD: their channels together."""

import tempfile
import zipfile
from collections import Counter
from dataclasses import replace
from pathlib import Path, PurePosixPath

from femupdate.errors import MeasurementError
from femupdate.measurement.channel import RecordedChannel
from femupdate.measurement.reader import Reader
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import TextFile, read_head
from femupdate.measurement.thresholds import FILES

# A station archive holds some tens of files of a few MB; text shrinks five to ten times.
_NOT_LOOKED_INTO = ("archive", "unsupported")


def _recognises(head: str, suffix: str) -> bool:
    return head.startswith(("PK\x03\x04", "PK\x05\x06")) and suffix != ".npz"


def _read(path: Path) -> Recording:
    """Channels of all records in an archive, in the order of the records' names.

    Members are unpacked under names of our own into a folder that is removed again.

    Raises:
        MeasurementError: the archive is damaged, a workbook, too large when unpacked, or holds no
            record; or a record in it cannot be read.
    """
    file = TextFile(path)
    try:
        with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
            members = _members(file, archive)
            unpacked = {m.filename: _unpack(archive, m, k, folder) for k, m in enumerate(members)}
            return _together(file, unpacked)
    except MeasurementError:
        raise
    except Exception as error:  # a damaged archive makes zipfile raise nearly anything
        raise file.error(
            f"this is a workbook or an archive that cannot be opened ({error}); export it as CSV"
            " or unpack it"
        ) from None


def _members(file: TextFile, archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    members = [member for member in archive.infolist() if not member.is_dir()]
    names = {member.filename for member in members}
    if "[Content_Types].xml" in names:
        raise file.error("this is a workbook, not a record; export it as CSV")
    for name in names:
        parts = PurePosixPath(name.replace("\\", "/"))
        if parts.is_absolute() or ".." in parts.parts or ":" in name:
            raise file.error(
                f"the archive would write {name!r} outside its folder; pack the records again"
            )
    size = sum(member.file_size for member in members)
    packed = max(sum(member.compress_size for member in members), 1)
    if (
        len(members) > FILES.members
        or size > FILES.archive_mb * 1_000_000
        or size / packed > FILES.packed
    ):
        raise file.error(
            f"the archive holds {len(members)} files of {size / 1e6:.0f} MB, {size / packed:.0f}"
            " times its own size: no archive of records; unpack it yourself and give the record"
        )
    return sorted(members, key=lambda member: member.filename)


def _unpack(archive: zipfile.ZipFile, member: zipfile.ZipInfo, number: int, folder: str) -> Path:
    suffix = PurePosixPath(member.filename).suffix
    path = Path(folder) / f"{number}{suffix}"
    path.write_bytes(archive.read(member))
    return path


def _together(file: TextFile, unpacked: dict[str, Path]) -> Recording:
    alone = len(unpacked) == 1
    recordings = {name: _member(file, name, path, alone) for name, path in unpacked.items()}
    found = {name: one for name, one in recordings.items() if one is not None}
    records = {name: one for name, one in found.items() if one.table is None}
    left_out = [name for name in unpacked if name not in (records or found)]
    if len(records or found) == 1:
        (only,) = (records or found).values()
        table = None if only.table is None else replace(only.table, file=file)
        return replace(only, file=file, table=table, notes=(*only.notes, *_notes(left_out)))
    inner = [name for name in left_out if zipfile.is_zipfile(unpacked[name])]
    if not records and inner:
        raise file.error(
            f"the archive holds other archives ({', '.join(inner)}); unpack it and give that of"
            " one station"
        )
    if not records:
        raise file.error(
            f"the archive holds no record, only {', '.join(left_out) or 'nothing'}"
            if not found
            else f"the archive holds several tables ({', '.join(found)}); unpack it and give one"
        )
    named = [(PurePosixPath(name).stem, c) for name, one in records.items() for c in one.channels]
    return Recording(file, _distinct(named), notes=_notes(left_out))


def _member(file: TextFile, name: str, path: Path, alone: bool) -> Recording | None:
    """What a member holds; None of one that is no record."""
    from femupdate.measurement.registry import readers

    if path.stat().st_size == 0:
        return None
    head, suffix = read_head(path), path.suffix.lower()
    reader = next((r for r in readers().values() if r.recognises(head, suffix)), None)
    if reader is None or reader.name in _NOT_LOOKED_INTO:
        return None
    try:
        return reader.read(path)
    except MeasurementError as error:
        if reader.fallback and not alone:  # a note beside the records
            return None
        raise MeasurementError(str(error).replace(str(path), f"{file.path}: {name}")) from None


def _distinct(found: list[tuple[str, RecordedChannel]]) -> tuple[RecordedChannel, ...]:
    """Channels whose names are told apart by their locations, else by the names of their files."""
    names = [channel.name for _, channel in found]
    for more in ([channel.location for _, channel in found], [stem for stem, _ in found]):
        count = Counter(names)
        names = [
            f"{name}, {words}" if count[name] > 1 and words not in name else name
            for name, words in zip(names, more, strict=True)
        ]
    channels = (channel for _, channel in found)
    return tuple(replace(channel, name=name) for channel, name in zip(channels, names, strict=True))


def _notes(left_out: list[str]) -> tuple[str, ...]:
    if not left_out:
        return ()
    some = ", ".join(left_out[:3]) + (" ..." if len(left_out) > 3 else "")
    return (f"Other files of the archive that hold no histories: {len(left_out)} ({some}).",)


READER = Reader("archive", "zip archives of records", _recognises, _read)
