"""Mutations of `fuzz_readers.py` of which it is known what a reader may make of them.

A number is spelled in another way, or as no number is; the file gets a byte order mark, two lines
are joined, two blocks change places. Where the reader takes the file, all numbers of its record are
held against those of the file as it stands:

    same      the same numbers: another spelling of one, or one that no reader may take
    rows      the same numbers in any order
    finite    no more of them that are not finite: a number as written, not what stands for none

A record with a new note has said what it left out, and is not held against anything.
"""

import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np
from fuzz_cases import Case

Array = np.ndarray
NUMBER = rb"(?<![\w.+\-%s])[+-]?(?:\d+(?:[%s]\d*)?|[%s]\d+)(?:[eE][+-]?\d+)?(?![\w.\-%s])"
NAMED = ("bingo", "opensfm tracks")  # whose whole numbers are names of images and points
DECIMAL_COMMA = ("imu_csv units",)
FIXED = ("rinex", "navigation")  # columns of fixed width
ORDERED = (  # tables whose rows have stamps or names, so that their order says nothing
    *("imu_csv", "imu_csv units", "gnss_text", "rtklib_pos", "rtklib_pos dated", "nmea", "aimu"),
    *("mrk", "odyn", "barometer", "trajectory_csv"),
)
DIFFERENT = ("compact RINEX", "inspected")  # differences of numbers, and guesses at what is there
OF_NO_NUMBER = ("notes", "read", "lines", "source", "path", "history", "layout", "records")
DESCRIBING = ("satellites", "ratio", "age_s", "pdop", "hdop")  # not known where they cannot be
EXTREMES = (
    *(b"1e308", b"-1e308", b"1.7976931348623157e308", b"1e200", b"-1e155", b"1e150", b"9e18"),
    *(b"123456789012345678901234567890", b"5e-324", b"1e-310", b"1e-200", b"2147483648", b"-1"),
    *(b"0", b"-0.0", b"0.5", b"1e16", b"18446744073709551616", b"4e4"),
)
ARABIC = {48 + k: chr(0x0661 + k - 1) for k in range(10)}
WIDE = {48 + k: chr(0xFF10 + k) for k in range(10)}


def respelled(rng: np.random.Generator, text: str) -> str:
    """Another spelling of the same number."""
    sign, body = ("-", text[1:]) if text[0] == "-" else ("", text.lstrip("+"))
    mantissa, e, exponent = body.partition("e" if "e" in body else "E")
    point = "," if "," in mantissa else "."
    whole, _, part = mantissa.partition(point)
    shift = int(exponent or 0) - len(part)
    options = (
        f"{sign or '+'}{body}",
        f"{sign}00{body}",
        f"{sign}{whole or '0'}{point}{part}000{e}{exponent}",
        f"{sign}{whole}{part}E{shift:+d}",
        f"{sign}0{point}{whole}{part}e{shift + len(whole + part)}",
    )
    return options[int(rng.integers(len(options)))]


def misspelled(rng: np.random.Generator, text: str, toml: bool) -> str:
    """What no reader may take for a number, made of one with another value than `text`."""
    last = next(i for i in reversed(range(len(text))) if text[i].isdigit())
    other = f"{text[:last]}{(int(text[last]) + 1) % 10}{text[last + 1 :]}"
    options = (
        other.translate(ARABIC),
        other.translate(WIDE),
        "\u2212" + other.lstrip("+-"),
        "\u2013" + other.lstrip("+-"),
        other.replace(".", "\u00b7") if "." in other else other + "\u00b2",
        other.replace(".", "\u066b") if "." in other else "\u0664" + other,
        *(() if toml else (f"{other[:-1]}_{other[-1]}", f"{other.lstrip('+-')}_0")),
        *(("1e-400", "nan", "inf", "0x1p3", f"{other}f", f"{other}x", "1e", "--1", "1.2.3", "NaN")),
        *(("-Infinity", "1e+", "e5", ".", "+", "1'000", "1d5", "None", "null", "1e5e5")),
    )
    return options[int(rng.integers(len(options)))]


def numbers_in(case: Case, data: bytes) -> list[re.Match[bytes]]:
    """Numbers of a file that stand apart from words."""
    comma = case.name in DECIMAL_COMMA
    signs, around = (b".,", b",") if comma else (b".", b"")
    found = re.finditer(NUMBER % (around, signs, signs, around), data)
    return [match for match in found if case.name not in NAMED or b"." in match[0]]


def structured(rng: np.random.Generator, case: Case) -> tuple[bytes, str]:
    """The case's file after one such mutation, and what a reader may make of it."""
    data, kind = case.data, rng.random()
    tabular = case.name in ORDERED
    if kind < 0.05:
        return b"\xef\xbb\xbf" + data, "same"
    if kind < 0.12:
        lines = data.split(b"\n")
        k = int(rng.integers(len(lines)))
        said = lines[k].lstrip()[:1] in (b"#", b"%", b"!", b";", b"")
        joined = [*lines[:k], b"".join(lines[k : k + 2]), *lines[k + 2 :]]
        return b"\n".join(joined), "same" if tabular and not said else ""
    if kind < 0.2:
        return swapped(rng, data), "rows" if tabular else ""
    places = numbers_in(case, data)
    if not places:
        return data, "same"
    place = places[int(rng.integers(len(places)))]
    text = place[0].decode("ascii")
    if kind < 0.4:
        new, expected = respelled(rng, text).encode(), "same"
    elif kind < 0.75:
        new, expected = misspelled(rng, text, case.file.endswith(".toml")).encode(), "same"
    else:
        new, expected = EXTREMES[int(rng.integers(len(EXTREMES)))], "finite"
    start = place.start()
    if case.name in FIXED:
        while start > 0 and data[start - 1 : start] == b" " and place.end() - start < len(new) + 1:
            start -= 1
        absent = set(new) <= set(b"-0.")  # of an observation
        if absent or place.end() - start < len(new) or len(new) > max(len(text), 12):
            return data, "same"
        new = new.rjust(place.end() - start)
    out = data[:start] + new + data[place.end() :]
    begin = out.rfind(b"\n", 0, start) + 1
    if out[begin : begin + 1] == b"$":
        end = out.index(b"\n", start)
        out = out[:begin] + checked(out[begin:end]) + out[end:]
    return out, "" if case.name.startswith(DIFFERENT) else expected


def checked(line: bytes) -> bytes:
    """The NMEA sentence of a line with a right checksum."""
    body, check = line[1:].partition(b"*")[0], 0
    for byte in body:
        check ^= byte
    return b"$%b*%02X\r" % (body, check)


def swapped(rng: np.random.Generator, data: bytes) -> bytes:
    """Two blocks of lines that are alike change places."""
    lines = data.split(b"\n")
    size = int(rng.integers(1, max(2, len(lines) // 3)))
    first = int(rng.integers(max(1, len(lines) - 2 * size)))
    middle = first + size
    last = int(rng.integers(middle, max(middle + 1, len(lines) - size)))
    if any(
        not line[:1].strip(b"#%!;") or line[:1].isalpha() for line in lines[first : last + size]
    ):
        return data  # comments and names of columns stay
    later = [*lines[last : last + size], *lines[middle:last]]
    return b"\n".join([*lines[:first], *later, *lines[first:middle], *lines[last + size :]])


def numbers_of(record: object, without: tuple[str, ...] = OF_NO_NUMBER) -> Array:
    """All numbers of a record, in its order, but those of some fields."""
    out: list[Array] = []

    def visit(node: object) -> None:
        if isinstance(node, np.ndarray):
            if node.dtype.kind in "iufb":
                out.append(node.astype(np.float64).ravel())
            elif node.dtype.kind == "O":
                visit(node.tolist())
        elif isinstance(node, int | float | np.number):
            out.append(np.array([float(node) if abs(node) < 1e308 else np.inf]))
        elif isinstance(node, Mapping):
            visit(tuple(node.values()))
        elif isinstance(node, list | tuple):
            for item in node:
                visit(item)
        elif is_dataclass(node):
            visit([getattr(node, f.name) for f in fields(node) if f.name not in without])

    visit(record)
    return np.concatenate(out) if out else np.empty(0)


def notes_of(record: object) -> set[str]:
    """What the notes of a record have found."""
    return {str(getattr(note, "found", note)) for note in getattr(record, "notes", ())}


def contradiction(expected: str, record: object, base: object) -> str:
    """What is wrong with the record of a mutated file beside that of the file as it stands."""
    if not expected or notes_of(record) - notes_of(base):
        return ""
    if expected == "finite":
        without = (*OF_NO_NUMBER, *DESCRIBING)
        ours, theirs = numbers_of(record, without), numbers_of(base, without)
        more = int(np.isnan(ours).sum()) - int(np.isnan(theirs).sum())
        return f"{more} more numbers that are none" if ours.size == theirs.size and more > 0 else ""
    ours, theirs = numbers_of(record), numbers_of(base)
    if ours.size != theirs.size:
        return f"{ours.size} numbers instead of {theirs.size}"
    if expected == "rows":
        ours, theirs = np.sort(ours), np.sort(theirs)
    other = ~np.isclose(ours, theirs, rtol=1e-9, atol=1e-12, equal_nan=True)
    if not other.any():
        return ""
    k = int(np.argmax(other))
    return f"{ours[k]:.12g} instead of {theirs[k]:.12g}"
