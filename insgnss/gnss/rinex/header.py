"""Header of a RINEX observation file, versions 2 to 4 (RINEX 2.11, 2012; 3.05, 2020; 4.02, 2024),
and the bytes behind it. Of observations version 4 is written as 3 is.

A record is 80 columns, its label in columns 61 to 80. Codes of observations are those of RINEX 3:
kind (C code, L phase, D Doppler, S C/N0), band, attribute. RINEX 2 has no attribute: C1 is the
open code of its band (1C, L2C 2X, GLONASS 2C), P1 and P2 the precise one (GPS 1W 2W, GLONASS 1P
2P), other bands and systems have X where nothing more is known. Phase, Doppler and C/N0 take
the attribute of the code that the file lists for their band: the open one on band 1, the precise
one on band 2, if both are there. RINEX 2.12 has a letter in the place of the band, A (1C), B (1X),
C (2X), D (2C), beside which 1 and 2 are the precise codes. What has no such code keeps the name it
has. RINEX 3.02 calls BeiDou's B1 band 1, all others band 2.
"""

import math
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, required_library
from ...base.inputs import read_bytes
from ...base.unpacking import PACKED, check_unpacked, unpack
from ...io.formats.text.layout import decode, float_of, quote
from ...io.formats.text.text import Source, load
from ...records import Array

LABEL_COLUMN = 60  # column at which the label of a header line begins, from 0
SYSTEM_LETTERS = "GRECJIS"
SYSTEM_NAMES = {
    "G": "GPS",
    "R": "GLONASS",
    "E": "Galileo",
    "C": "BeiDou",
    "J": "QZSS",
    "I": "NavIC",
    "S": "SBAS",
}
SYSTEM_TIMES = {"G": "GPS", "R": "GLO", "E": "GAL", "C": "BDT", "J": "QZS", "I": "IRN", "S": "GPS"}
TYPES_2, TYPES_3 = "# / TYPES OF OBSERV", "SYS / # / OBS TYPES"
FILE_KINDS = {
    "N": "navigation data",
    "G": "GLONASS navigation data",
    "H": "SBAS navigation data",
    "M": "meteorological data",
    "C": "clock data",
}
COMPACT = b"COMPACT RINEX"
OF_TYPES = re.compile(
    rb"^.{3} {0,2}(\d{1,3}).{54,56}(?:SYS / # / OBS TYPES|# / TYPES OF OBSERV)", re.MULTILINE
)
RECORDS_READ = (  # labels of the records whose values are taken
    *(TYPES_2, TYPES_3, "APPROX POSITION XYZ", "ANTENNA: DELTA H/E/N", "INTERVAL", "LEAP SECONDS"),
    *("TIME OF FIRST OBS", "GLONASS SLOT / FRQ #", "SYS / SCALE FACTOR"),
)
WHOLE_COUNT = re.compile(r" *[0-9]+ *")
SLOTS = re.compile(r" *(?:[0-9]+ +)?(?:R *[0-9]{1,2} +[+-]?[0-9]+ *)*")
LETTERS_ALONE = re.compile("[A-Za-z]+")
SCALE_FIELD = re.compile(r"([A-Z]) +(10{0,3})")  # a factor of 1, 10, 100 or 1000
RESTORED_LINE = 160  # bytes; two lines of text
_OLD_SIGNALS = {
    "G1": "1C",
    "R1": "1C",
    "S1": "1C",
    "J1": "1C",
    "G2": "2X",
    "R2": "2C",
    "J2": "2X",
    "C1": "2I",
    "C2": "2I",
    "C6": "6I",
    "C7": "7I",
}
_PRECISE = {"G1": "1W", "G2": "2W", "R1": "1P", "R2": "2P"}
_OF_2_12 = {"A": "1C", "B": "1X", "C": "2X", "D": "2C"}  # signals that RINEX 2.12 names by a letter

Record = tuple[int, str, str]  # line, label, columns 1 to 60


@dataclass(frozen=True, eq=False)
class RinexHeader:
    """Contents of the header; None where it does not hold them.

    Parameters
    ----------
    path : str
        The file.
    version : float
        2.11, say.
    system : str
        Letter of the header, M for mixed.
    clock : str, optional
        GPS, GLO, GAL, BDT, QZS or IRN, of the stamps.
    marker : str
        Name of the marker.
    receiver, antenna : str
        Type as it stands, radome included.
    approx_position_m : ndarray, shape (3,), optional
        m ECEF, None also where it is zero.
    antenna_delta_m : ndarray, shape (3,)
        m up, east, north, from the marker to the antenna reference point.
    interval_s : float, optional
        s.
    leap_seconds : int, optional
        GPST - UTC.
    types : mapping
        Codes by system, as the file has them; of RINEX 2 for the system "".
    glonass_slots : mapping
        Frequency number by satellite.
    scale : mapping
        Factor by system and code that numbers are to be divided by.
    records : mapping
        Columns 1 to 60 of all records by label.
    lines : int
        Number of lines of the header.
    """

    path: str
    version: float
    system: str
    clock: str | None
    marker: str
    receiver: str
    antenna: str
    approx_position_m: Array | None
    antenna_delta_m: Array
    interval_s: float | None
    leap_seconds: int | None
    types: Mapping[str, tuple[str, ...]]
    glonass_slots: Mapping[str, int] = field(default_factory=dict)
    scale: Mapping[tuple[str, str], float] = field(default_factory=dict)
    records: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    lines: int = 0


QUOTED_CHARACTERS = 200  # of another program's message (chosen): some two lines
LINE_BYTES = 128  # in which the end of a line is looked for first: lines of RINEX 2 have 80


def load_rinex(path: Source) -> tuple[NDArray[np.uint8], bool, tuple[str, ...]]:
    """Load a file, plain or packed (gzip, compress, bzip2, zip, Hatanaka).

    Returns
    -------
    buf : ndarray of uint8
        The bytes, unpacked, with a newline at their end.
    complete : bool
        Whether the last line had its end.
    complaints : tuple of str
        Warnings of the unpacking.

    Raises
    ------
    InputError
        Where the file cannot be unpacked.
    """
    buf, complete = load(path)
    if complete and buf.size > Path(path).stat().st_size:
        buf = buf[:-1]  # a line's end behind the last one would be a line without observations
    first_bytes = bytes(buf[:100])
    if not first_bytes.startswith(PACKED) and COMPACT not in first_bytes:
        return buf, complete, ()
    content = unpack(path, read_bytes(path))
    complaints: tuple[str, ...] = ()
    if COMPACT in content[:80]:
        content, complaints = _restore_compact(path, content)
    complete = content.endswith(b"\n")
    unpacked = np.frombuffer(bytearray(content if complete else content + b"\n"), dtype=np.uint8)
    return unpacked, complete, complaints


def _restore_compact(path: Source, content: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Return the RINEX of compact RINEX (Hatanaka), and what its program complained of."""
    problem = "is packed; install the package hatanaka (extra [ppk]), or unpack the file first"
    with required_library(problem, path):
        import hatanaka
    check_unpacked(path, most_restored(content), "up to ")
    with warnings.catch_warnings(record=True) as complaints:
        warnings.simplefilter("always")
        try:
            content = hatanaka.decompress(content)
        except (hatanaka.HatanakaException, ValueError, OSError, EOFError) as error:
            problem = f"cannot be unpacked: {_one_line(error)}; copy it again from its source"
            raise InputError.in_file(path, problem) from None
    return content, tuple(_one_line(item.message) for item in complaints)


def most_restored(content: bytes) -> int:
    """Return a bound of the bytes that compact RINEX becomes.

    A line of it is one satellite's at an epoch, which no more than 16 characters an observation
    and a short one of a clock, a date or satellites' names stand for.
    """
    header = content[: content.find(b"END OF HEADER") + 1]
    types = [int(number) for number in OF_TYPES.findall(header)]
    return len(content) + content.count(b"\n") * (16 * max(types, default=0) + RESTORED_LINE)


def _one_line(message: object) -> str:
    """Return a message without line breaks, at most `QUOTED_CHARACTERS`."""
    return " ".join(str(message).split())[:QUOTED_CHARACTERS]


def _incorrect(path: Source, line: int | None, problem: str) -> InputError:
    """Return the error for a header that is to be corrected."""
    return InputError.at_line(path, line, f"{problem}; correct the header")


def header_of(path: Source, buf: NDArray[np.uint8]) -> tuple[RinexHeader, int]:
    """Return the header at the start of `buf`, and the offset behind it."""
    version, system = _first_line(path, decode(bytes(buf[:400])).split("\n")[0].rstrip("\r"))
    records: list[Record] = []
    offset = 0
    while not records or records[-1][1] != "END OF HEADER":
        if offset >= buf.size:
            problem = "the file ends without END OF HEADER; copy it again from its source"
            raise InputError.at_line(path, len(records), f"truncated: {problem}")
        text, offset = line_at(buf, offset)
        label = text[LABEL_COLUMN:].strip()
        records.append((len(records) + 1, label, text[:LABEL_COLUMN]))
        if label == "" and text.strip():
            problem = f"no header record: {quote(text.strip())}; complete the header, or copy the"
            problem += " file again"
            if offset >= buf.size:
                problem = (
                    "truncated: the file ends within its header; copy it again from its source"
                )
            raise InputError.at_line(path, len(records), problem)
        ending = next((name for name in RECORDS_READ if text.rstrip().endswith(name)), label)
        if label not in (ending, "COMMENT"):
            problem = f"{ending} stands beside columns 61 to 80: {quote(text.strip())}"
            raise _incorrect(path, len(records), problem)
    return _build_header(path, version, system, records), offset


def line_at(buf: NDArray[np.uint8], offset: int) -> tuple[str, int]:
    """Return the line at an offset, without its end, and the offset of the next one.

    `buf` must end in a newline.
    """
    width = LINE_BYTES
    while not (ends := np.flatnonzero(buf[offset : offset + width] == ord("\n"))).size:
        width *= 4
    end = offset + int(ends[0])
    return decode(bytes(buf[offset:end])).rstrip("\r"), end + 1


def _first_line(path: Source, text: str) -> tuple[float, str]:
    """Return version and system of the first line; InputError where it is not read here."""
    refused = partial(InputError.at_line, path, 1)
    if "RINEX VERSION / TYPE" not in text[LABEL_COLUMN:]:
        content = "is not RINEX: line 1 has no RINEX VERSION / TYPE in columns 61 to 80"
        raise refused(
            f"{content}; give a RINEX 2 to 4 observation file (convert a receiver's own format"
            " first)"
        )
    version = text[:9].strip()
    kind = text[20:21].upper()
    if not re.fullmatch(r"[0-9](\.[0-9]+)?", version):
        raise refused(f"RINEX version {quote(version)} is no number; copy the file again")
    if version[0] not in "234":
        raise refused(
            f"RINEX {version}; versions 2 to 4 are read here; convert it to RINEX 3 (gfzrnx -vo 3,"
            " convbin -v 3)"
        )
    if kind != "O":
        content = FILE_KINDS.get(kind, f"type {quote(kind)}")
        raise refused(
            f"holds {content} where observations must stand; give the observation file here"
        )
    letter = text[40:41].upper().strip() or "G"
    if letter not in SYSTEM_LETTERS + "M":
        problem = f"satellite system {letter!r} is none of {', '.join(SYSTEM_LETTERS)}, M"
        raise _incorrect(path, 1, problem)
    return float(version), letter


def _build_header(
    path: Source, version: float, system: str, records: Sequence[Record]
) -> RinexHeader:
    """Build the header from its records; InputError where one of them cannot be read."""
    by_label: dict[str, list[str]] = {}
    for _, label, text in records:
        by_label.setdefault(label, []).append(text)
    types = types_of(path, version, records)
    if not types:
        problem = f"the header has no {TYPES_2 if version < 3 else TYPES_3}; copy the file again"
        raise InputError.at_line(path, len(records), problem)

    def text_of(label: str, start: int = 0, stop: int = LABEL_COLUMN) -> str:
        return by_label[label][-1][start:stop].strip() if label in by_label else ""

    def numbers(label: str, count: int) -> Array | None:
        return _numbers_of_record(path, records, label, count) if label in by_label else None

    approx, delta = numbers("APPROX POSITION XYZ", 3), numbers("ANTENNA: DELTA H/E/N", 3)
    interval, leap = numbers("INTERVAL", 1), numbers("LEAP SECONDS", 1)
    clock = "".join(
        LETTERS_ALONE.findall(text_of("TIME OF FIRST OBS"))
    ).upper() or SYSTEM_TIMES.get(system)
    if clock is not None and clock not in SYSTEM_TIMES.values():
        problem = (
            f"the header's time system {clock!r} is none of {', '.join(SYSTEM_TIMES.values())}"
        )
        raise _incorrect(path, None, problem)
    return RinexHeader(
        path=str(path),
        version=version,
        system=system,
        clock=clock,
        marker=text_of("MARKER NAME"),
        receiver=text_of("REC # / TYPE / VERS", 20, 40),
        antenna=" ".join(text_of("ANT # / TYPE", 20, 40).split()),
        approx_position_m=approx if approx is not None and approx.any() else None,
        antenna_delta_m=delta if delta is not None else np.zeros(3),
        interval_s=float(interval[0]) if interval is not None and interval[0] > 0 else None,
        leap_seconds=int(leap[0]) if leap is not None and leap[0] > 0 else None,
        types=types,
        glonass_slots=_glonass_slots(path, records),
        scale=scale_of(path, records, types),
        records={label: tuple(lines) for label, lines in by_label.items()},
        lines=len(records),
    )


def _numbers_of_record(path: Source, records: Iterable[Record], label: str, count: int) -> Array:
    """Return the first `count` numbers of the last record of a label; InputError with its line."""
    line, _, text = [record for record in records if record[1] == label][-1]
    fields = text.split()[:count]
    if len(fields) < count:  # numbers of 14 columns may touch
        fields = [text[14 * k : 14 * (k + 1)] for k in range(count)]
    if not text.strip():
        return np.zeros(count)
    values = [float_of(field.strip()) for field in fields]
    if None in values:
        expected = f"expected {count} number{'s' * (count > 1)}"
        raise _incorrect(path, line, f"{label}: {quote(text.strip())}, {expected}")
    return np.array(values, dtype=np.float64)


def types_of(path: Source, version: float, records: Iterable[Record]) -> dict[str, tuple[str, ...]]:
    """Return the observation codes by system as the records list them; empty where they list none.

    Those of RINEX 2 are for the system "".
    """
    label, width, code_width = (TYPES_2, 9, 6) if version < 3 else (TYPES_3, 13, 4)
    types: dict[str, list[str]] = {}
    missing = last_line = 0
    system = ""
    for line, record_label, text in records:
        if record_label != label:
            continue
        count = text[:6] if version < 3 else text[1:6]
        if count.strip():
            if missing:
                raise _incorrect(path, line, f"{label}: {missing} codes fewer than announced")
            system = "" if version < 3 else text[0].upper()
            if not WHOLE_COUNT.fullmatch(count) or (version >= 3 and system not in SYSTEM_LETTERS):
                expected = "expected a system and a number of codes"
                raise _incorrect(path, line, f"{label}: {quote(text.rstrip())}, {expected}")
            missing = int(count)
            types[system] = []
        codes = [
            text[6 + code_width * k : 6 + code_width * (k + 1)].strip()
            for k in range(min(width, missing))
        ]
        if not all(codes) or not types:
            problem = f"{label}: fewer codes than announced: {quote(text.rstrip())}"
            raise _incorrect(path, line, problem)
        types[system] += codes
        missing -= len(codes)
        last_line = line
    if missing:
        raise _incorrect(path, last_line, f"{label}: {missing} codes fewer than announced")
    return {name: tuple(codes) for name, codes in types.items()}


def codes_of(version: float, system: str, types: Sequence[str]) -> tuple[str, ...]:
    """Return the RINEX 3 codes of the `types` of one system in a file of this version.

    A name that has no code, or whose code is taken, stays.
    """
    if version >= 3:
        named_for_b1 = version == 3.02 and system == "C"  # B1 was band 1 in 3.02, 2 elsewhere
        codes = [
            f"{name[0]}2{name[2:]}" if named_for_b1 and name[1:] in ("1I", "1Q", "1X") else name
            for name in types
        ]
    else:
        before_2_12 = version < 2.12 or not any(name[1:2] in _OF_2_12 for name in types)
        codes = [
            (_code_of_name if before_2_12 else _code_2_12)(system, name, types) for name in types
        ]
    return tuple(code if codes.index(code) == k else types[k] for k, code in enumerate(codes))


def _code_of_name(system: str, name: str, types: Sequence[str]) -> str:
    """Return the RINEX 3 code of a name of RINEX 2; the name itself where it has none."""
    if len(name) != 2 or name[0] not in "CPLDS" or not name[1].isdecimal():
        return name
    band = name[1]
    opened = _OLD_SIGNALS.get(system + band, "" if system == "C" else f"{band}X")
    precise = _PRECISE.get(system + band, "")
    usual, rare = ("C", "P") if band == "1" else ("P", "C")
    listed = next((kind for kind in (usual, rare) if kind + band in types), usual)
    kind = name[0] if name[0] in "CP" else listed
    attribute = precise if kind == "P" and precise else opened
    if not attribute or (name[0] == "P" and not precise):
        return name
    return ("C" if name[0] == "P" else name[0]) + attribute


def _code_2_12(system: str, name: str, types: Sequence[str]) -> str:
    """Return the code of a name of RINEX 2.12: letters are open signals, digits precise ones."""
    if len(name) != 2 or name[0] not in "CLDS":
        return _code_of_name(system, name, types)
    signal = system + name[1]
    return name[0] + _OF_2_12.get(
        name[1], _PRECISE.get(signal, _OLD_SIGNALS.get(signal, f"{name[1]}X"))
    )


def _glonass_slots(path: Source, records: Iterable[Record]) -> dict[str, int]:
    """Return the frequency channels of GLONASS satellites ("R01") that the header lists."""
    pairs: list[tuple[str, str]] = []
    for line, label, text in records:
        if label == "GLONASS SLOT / FRQ #":
            if not SLOTS.fullmatch(text):
                expected = "expected pairs such as R01  1"
                raise _incorrect(path, line, f"{label}: {quote(text.strip())}, {expected}")
            pairs += re.findall(r"R *([0-9]{1,2}) +([+-]?[0-9]+)", text)
    return {f"R{int(slot):02d}": int(number) for slot, number in pairs}


def scale_of(
    path: Source, records: Iterable[Record], types: Mapping[str, tuple[str, ...]]
) -> dict[tuple[str, str], float]:
    """Return the scale factors of RINEX 3; a record without codes is of all codes of its system."""
    factors: dict[tuple[str, str], float] = {}
    system = ""
    factor = math.nan
    for line, label, text in records:
        if label != "SYS / SCALE FACTOR":
            continue
        match = SCALE_FIELD.fullmatch(text[:6].strip())
        if match:
            system = match[1]
            factor = float(match[2])
        elif text[:10].strip() or not system:
            expected = "expected a system and 1, 10, 100 or 1000"
            raise _incorrect(path, line, f"{label}: {quote(text.strip())}, {expected}")
        for code in text[10:].split() or (types.get(system, ()) if match else ()):
            factors[system, code] = factor
    return factors
