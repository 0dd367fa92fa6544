"""Formats that are known by their beginning and not read: each is refused by its name."""

import re
from pathlib import Path
from typing import NoReturn

from femupdate.measurement.text import TextFile, read_head

READS = "nothing: formats known but not supported"

_SPECTRA = "the spectra of a record, not its history; take the .V2 file beside it"
_CONVERT = "export the channels as CSV, MATLAB -v7 or numpy .npz"
_ARRAYS = "save its arrays with numpy.savez (of pyOMA2's modes Fn, Xi and Phi)"
_MODEL = "describe the building in a building file; measured data are read here"
# What the file begins with, what it is, and what to do.
_KNOWN = (
    (r"MS\x03", "miniSEED 3", "convert it to miniSEED 2 or CSV"),
    (r"\x80[\x02-\x05]", "a pickle of Python, which can run code", _ARRAYS),
    (r"\x89HDF|\x8aHDF", "an HDF5 file", _CONVERT),
    (r"\x93NUMPY", "a single numpy array", "save all channels with their times as .npz"),
    (r"RIFF....WAVE", "a sound file (WAV)", _CONVERT),
    (r"7z\xbc\xaf|Rar!", "an archive of 7-Zip or RAR", "unpack it or pack the records as zip"),
    (r"BZh[1-9]", "a file packed by bzip2", "unpack it or pack the records as zip"),
    (r"%PDF", "a PDF", "take the data, not the report"),
    (r"KINEMETRICS", "a Kinemetrics event file", _CONVERT),
    (r"\s*\d\s*(RESPONSE|FOURIER)[^\n]*\n\*", "an SMC file of spectra", "take the accelerogram"),
    (r"Response and Fourier amplitude spectra", "CSMIP Volume 3", f"these are {_SPECTRA}"),
    (
        r"(un)?corrected accelerogram[^\n]*GNS Science",
        "a GeoNet accelerogram (V1A or V2A)",
        "write its components, in mm/s2 behind 26 lines of header each, to CSV",
    ),
    (r"\* VOL1DS FILE", "a BHRC accelerogram", "write its values with their times to CSV"),
    (r"LabVIEW Measurement", "a LabVIEW measurement file", "export it as TDMS or CSV"),
    (r"(.{0,4000}\n)?(WID[12] |CMP6|DAT2)", "a GSE file", "convert it by ObsPy to miniSEED"),
    (r"\$ (File|PROGRAM|STORIES)|PROGRAM\s+\"ETABS\"", "a model of ETABS", _MODEL),
    (r"(.{0,4000}\n)?\s*(wipe|model\s+basic)", "a model of OpenSees", _MODEL),
    (
        r"(.*\n)?\s*kind\s*=\s*[\"'](frame|mesh|shear)",
        "a building file",
        "run `femupdate build-model` on it",
    ),
    (r"<\?xml|<!DOCTYPE|<html", "a web page or XML", "download the data file itself"),
)
_SUFFIXES = {
    ".evt": ("a Kinemetrics event file", _CONVERT),
    ".sgy": ("a SEG-Y file", "convert it with obspy to CSV"),
    ".segy": ("a SEG-Y file", "convert it with obspy to CSV"),
    ".gcf": ("a Güralp file", "convert it with obspy to CSV"),
    ".xls": ("an old workbook", "export it as CSV"),
}


def _known(head: str, suffix: str) -> tuple[str, str] | None:
    found = [
        (what, advice) for begins, what, advice in _KNOWN if re.match(begins, head, re.S | re.I)
    ]
    return found[0] if found else _SUFFIXES.get(suffix) if "\0" in head else None


def recognises(head: str, suffix: str) -> bool:
    return _known(head, suffix) is not None


def read(path: Path) -> NoReturn:
    """Say what the file is."""
    what, advice = _known(read_head(path), path.suffix.lower()) or ("a format", _CONVERT)
    raise TextFile(path).error(f"this is {what}, which is not read here; {advice}")
