"""Archives of records, such as the station archives of CESMD: their channels together."""

import gzip
import io
import tarfile
import tempfile
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from femupdate.errors import MeasurementError
from femupdate.measurement.recording import Recording
from femupdate.measurement.text import TextFile, read_head
from femupdate.storage import LARGEST_BYTES

READS = "zip, tar and gzip archives of records"

_INTEGRATED = {"velocity", "displacement"}
_NOT_LOOKED_INTO = ("archive", "unsupported")
_ZIP, _GZIP = ("PK\x03\x04", "PK\x05\x06"), "\x1f\x8b"
_TAR, _TAR_AT = "ustar", 257  # its mark, and where that stands in the first header
_PADDING = 1_000_000  # bytes of headers and blocks that are filled up, which pack well


def recognises(head: str, suffix: str) -> bool:
    if head.startswith(_ZIP):
        return suffix not in (".npz", ".xlsx", ".xlsm")
    return head.startswith(_GZIP) or head[_TAR_AT:].startswith(_TAR)


def read(path: Path) -> Recording:
    """Channels of all records in an archive, unpacked under our own names for a moment."""
    file = TextFile(path)
    with tempfile.TemporaryDirectory() as folder:
        return _together(file, _unpacked(file, Path(folder)))


def _members(file: TextFile) -> Iterator[tuple[str, int, Any]]:
    """Name, bytes and what reads each file; of a tar, what follows is not unpacked before."""
    head = read_head(file.path)
    if head.startswith(_ZIP):
        with zipfile.ZipFile(file.path) as archive:
            members = [member for member in archive.infolist() if not member.is_dir()]
            if "[Content_Types].xml" in {member.filename for member in members}:
                raise file.error("this is a workbook, not a record; export it as CSV")
            _check_size(file, len(members), sum(member.file_size for member in members))
            for member in members:
                yield member.filename, member.file_size, partial(archive.read, member)
        return
    packed = head.startswith(_GZIP)
    if packed:
        with gzip.open(file.path, "rb") as single:
            begin = single.read(_TAR_AT + len(_TAR))
        if not begin.endswith(_TAR.encode()) and begin.strip(b"\0"):  # an empty tar is zeros
            with gzip.open(file.path, "rb") as single:
                data = _Limited(file, single).read(LARGEST_BYTES + 2 * _PADDING)
            yield file.path.stem, len(data), lambda: data
            return
    with (
        (gzip.open if packed else open)(file.path, "rb") as stream,
        tarfile.open(fileobj=_Limited(file, stream), mode="r|") as tar,
    ):
        for entry in tar:
            content = tar.extractfile(entry) if entry.isreg() else None
            if content is not None:
                yield entry.name, entry.size, content.read


class _Limited(io.BufferedIOBase):
    """A stream of which no more is read than an archive of records holds."""

    def __init__(self, file: TextFile, stream: gzip.GzipFile | io.BufferedReader) -> None:
        self._file, self._stream, self._passed = file, stream, 0

    def read(self, size: int | None = -1, /) -> bytes:
        """The next bytes; headers of a tar archive may be as large as files."""
        data = self._stream.read(size)
        self._passed += len(data)
        _check_size(self._file, 0, max(self._passed - _PADDING, 0))
        return data


def _unpacked(file: TextFile, folder: Path) -> dict[str, Path]:
    """Where every file of an archive was unpacked to, by its name, in the order of the names."""
    paths: dict[str, Path] = {}
    total = 0
    for number, (name, size, read) in enumerate(_members(file)):
        parts = PurePosixPath(name.replace("\\", "/"))
        if parts.is_absolute() or ".." in parts.parts or ":" in name:
            raise file.error(
                f"the archive would write {name!r} outside its folder; pack the records again"
            )
        total += size
        _check_size(file, number + 1, total)
        paths[name] = folder / f"{number}{parts.suffix}"
        paths[name].write_bytes(read())
    return {name: paths[name] for name in sorted(paths)}


def _check_size(file: TextFile, count: int, size: int) -> None:
    """Refuse more files or bytes than archives of records hold."""
    factor = size / max(file.path.stat().st_size, 1)
    # At most 2,000 files, packed by a factor of 200: station archives hold some tens.
    if count > 2000 or size > LARGEST_BYTES or factor > 200.0:
        raise file.error(
            f"the archive holds {count or 'some'} files of {size / 1e6:.0f} MB, {factor:.0f}"
            " times its own size: no archive of records; unpack it yourself and give the record"
        )


def _together(file: TextFile, unpacked: dict[str, Path]) -> Recording:
    members = {name: _member(file, name, path, len(unpacked)) for name, path in unpacked.items()}
    readable = {name: recording for name, recording in members.items() if recording is not None}
    records = {name: recording for name, recording in readable.items() if recording.table is None}
    # Velocities and displacements that were integrated from the accelerations beside them.
    kinds = {name: {c.quantity for c in record.channels} for name, record in records.items()}
    if any("acceleration" in kind for kind in kinds.values()):
        records = {n: r for n, r in records.items() if not kinds[n] <= _INTEGRATED}
    left_out = [name for name in unpacked if name not in (records or readable)]
    some = ", ".join(left_out[:3]) + (" ..." if len(left_out) > 3 else "")
    other = f"Other files of the archive that hold no accelerations: {len(left_out)} ({some})."
    notes = (other,) if left_out else ()
    if len(records or readable) == 1:
        (only,) = (records or readable).values()
        table = None if only.table is None else replace(only.table, file=file)
        return replace(only, file=file, table=table, notes=(*only.notes, *notes))
    heads = {name: read_head(unpacked[name]) for name in left_out if unpacked[name].stat().st_size}
    inner = [name for name, head in heads.items() if recognises(head, PurePosixPath(name).suffix)]
    if not records and inner:
        raise file.error(
            f"the archive holds other archives ({', '.join(inner)}); unpack it and give that of"
            " one station"
        )
    if not records:
        raise file.error(
            f"the archive holds no record, only {', '.join(left_out) or 'nothing'}; give another"
            if not readable
            else f"the archive holds several tables ({', '.join(readable)}); unpack it and give one"
        )
    stems = [PurePosixPath(name).stem for name, record in records.items() for _ in record.channels]
    channels = [channel for record in records.values() for channel in record.channels]
    # Names are told apart by their locations, else by the names of their files.
    names = [channel.name for channel in channels]
    for more in ([channel.location for channel in channels], stems):
        count = Counter(names)
        names = [
            f"{name}, {words}" if count[name] > 1 and words not in name else name
            for name, words in zip(names, more, strict=True)
        ]
    named = (replace(channel, name=name) for channel, name in zip(channels, names, strict=True))
    return Recording(file, tuple(named), notes=notes)


def _member(file: TextFile, name: str, path: Path, members: int) -> Recording | None:
    """What a member holds; None of one that is no record."""
    from femupdate.measurement.reader import read_as, readers

    if path.stat().st_size == 0:
        return None
    head, suffix = read_head(path), path.suffix.lower()
    known = readers().items()
    kind = next((name for name, reader in known if reader.recognises(head, suffix)), None)
    if kind is None or kind in _NOT_LOOKED_INTO:
        return None
    try:
        return read_as(kind, path)
    except MeasurementError as error:
        if getattr(readers()[kind], "FALLBACK", False) and members > 1:  # a note beside the records
            return None
        raise MeasurementError(str(error).replace(str(path), f"{file.path}: {name}")) from None
