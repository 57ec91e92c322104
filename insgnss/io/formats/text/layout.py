"""How a text table is written: its delimiter, decimal sign, header and number of fields.

Rules, the same for all formats
    UTF-8 with or without byte order mark, else Latin-1. A line is a comment where its first
    character is one of # % ! ; or where it begins with //. The delimiter is the first of tab,
    semicolon, comma and blanks that separates the first 20 data lines; a decimal comma is one where
    the delimiter is no comma and no field has a point. The header is the first line without any
    number, under which a line of - or = may be drawn and a line of units stand, else the last
    comment line before the data that has as many fields as they. Lines with fewer fields may stand
    before a header, such as the date of a recording. Everything else is data: every line has the
    same number of fields, and the first that has not, or that is no number where a number must
    stand, is refused with its line. An empty field is a missing value, the last of a line behind
    its delimiter too: where a number must stand, the row is left out and counted in tables of
    recordings, if these are fewer than 1 % (`order.SHARE_LIMIT`), and refused in others. Nothing is
    filled in.
"""

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.inputs import BOM
from ....base.units import LARGEST_UNIT, spells_zero
from .pieces import FileBytes

WORD = re.compile(r"[A-Za-z]{2,}")  # in the first fields of a line, which may begin with a stamp

COMMENTS = ("#", "%", "!", ";", "//")
# data lines that settle delimiter, decimal sign and number of fields: all alike (chosen)
SAMPLE_LINES = 20
LONGEST_HEADER = 1 << 14  # characters of a header's line: a longer one is data or text (chosen)
LONGEST_FIELD = 4096  # characters of a field: no number or name is so long, binary data are
SCAN_BYTES = 1 << 22  # bytes of a file looked through at once: 4 MB of memory (chosen)
LONGEST_UNIT = 10  # characters of a unit under a header: degrees/s has nine, dates more (chosen)
MOST_FIELDS = 1000  # of a line: no table of a recording has so many columns (chosen)
BINARY = "the file is binary, packed or damaged; copy it again or convert it to text"
SAVED = "not text; save the table as CSV, or its columns as .npz or .mat"
CONTAINERS = {  # by their first characters
    "PAR1": f"is a Parquet file, {SAVED}",
    "ARROW1": f"is a Feather (Arrow) file, {SAVED}",
    "PK\x03\x04": f"is a zip archive (unpack it) or a spreadsheet, {SAVED}",
    "\x1f\x8b": "is a gzip archive; unpack it",
}
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f]")

_SPELLED = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf|infinity)"
NUMBER = re.compile(_SPELLED, re.IGNORECASE | re.ASCII)
_IN_ANY_SCRIPT = re.compile(_SPELLED, re.IGNORECASE)
SMALLEST_PRECISE = 1e-280  # number: smaller ones lose digits in a double
_QUOTED = re.compile(r'(?<![^\t;,\s])"(?:[^"]|"")*"(?![^\t;,\s])')
_MASK = re.compile("\x00([0-9]+)\x00")
_LONG = re.compile(rf"(?<![^\t;,\s])[^\t;,\s]{{{LONGEST_FIELD + 1}}}")  # from a field's begin on
_COLUMN_NAME = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")
RULE = re.compile(r"[-=_+|,;\s]*[-=]{3}[-=_+|,;\s]*")  # a line that is drawn
OEM_LOG = re.compile(r"[#%]([A-Z]\w{3,}A),[^;]*;")  # the name of a log of NovAtel
_DELIMITERS = ("\t", ";", ",", None)


@dataclass(frozen=True)
class TextLayout:
    """How a text table is written.

    Attributes
    ----------
    delimiter : str, optional
        None stands for blanks.
    decimal : str
        Decimal sign.
    n_fields : int
        Fields a line.
    header : str, optional
        The header as it stands.
    header_fields : tuple of str, optional
        Its fields.
    header_line : int, optional
        Its line.
    skip_to : int
        Byte of the first data line.
    first_line : int
        The first data line.
    """

    delimiter: str | None
    decimal: str
    n_fields: int
    header: str | None = None
    header_fields: tuple[str, ...] | None = None
    header_line: int | None = None
    skip_to: int = 0
    first_line: int = 1


def float_of(text: str, decimal: str = ".") -> float | None:
    """Return the finite number that `text` spells, None where it is none.

    Digits are those of ASCII, without signs between them; only a zero that is written as one is
    zero, so that a number too small for a float is none.
    """
    sign, wrong_sign = (",", ".") if decimal == "," else (".", ",")
    if not NUMBER.fullmatch(text) or wrong_sign in text:
        return None
    x = float(text.replace(sign, "."))
    zero = x == 0.0 and spells_zero(text)
    return x if zero or SMALLEST_PRECISE < abs(x) < LARGEST_UNIT else None


def decode(data: bytes) -> str:
    """Decode UTF-8 text, else Latin-1, without a byte order mark before it."""
    data = data.removeprefix(BOM)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def quote(text: str | None, limit: int = 80) -> str:
    """Return text of a file as a message shows it, in quotation marks, cut where it is long."""
    text = text or ""
    return repr(text if len(text) <= limit else text[: limit - 3] + "...")


def printable(name: str) -> str:
    """Return a name out of a binary file without what would break a message's line.

    A question mark stands for each such character.
    """
    return name if name.isprintable() else "".join(c if c.isprintable() else "?" for c in name)


def split_fields(text: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line; one delimiter may close it.

    A delimiter within a field in double quotation marks separates nothing; the marks stay.
    """
    text = text.strip(" \r\n") if delimiter == "\t" else text.strip()
    masked, quotes = _mask_quoted(text)
    if delimiter is None:
        fields = masked.split()
    else:
        fields = [field.strip() for field in masked.removesuffix(delimiter).split(delimiter)]
    return [_MASK.sub(lambda m: quotes[int(m[1])], field) for field in fields] if quotes else fields


def row_fields(text: str, layout: TextLayout) -> list[str]:
    """Return the fields of a data line, the last one empty where it ends behind its delimiter."""
    fields = split_fields(text, layout.delimiter)
    trailing = layout.delimiter is not None and text.rstrip(" \r\n").endswith(layout.delimiter)
    return [*fields, ""] if trailing and len(fields) == layout.n_fields - 1 else fields


def _mask_quoted(text: str) -> tuple[str, list[str]]:
    """Return a line with a mark in the place of each field in quotation marks, and these fields."""
    quotes: list[str] = []
    if '"' not in text:
        return text, quotes

    def mark(match: re.Match[str]) -> str:
        quotes.append(match[0])
        return f"\x00{len(quotes) - 1}\x00"

    return _QUOTED.sub(mark, text), quotes


def unquote(field: str) -> str:
    """Return a field without its quotation marks, those doubled within it single."""
    if len(field) > 1 and _QUOTED.fullmatch(field):
        return field[1:-1].replace('""', '"')
    return field.strip("\"'")


def refuse_long(path: object, line: int, text: str) -> None:
    """Raise InputError where a line has a field that is longer than any number or name."""
    if len(text) > LONGEST_FIELD and _LONG.search(text):
        longest = max(map(len, re.split(r"[\t;,\s]", text)))
        problem = f"a field of {longest} characters (limit {LONGEST_FIELD})"
        raise InputError.at_line(path, line, f"{problem}; {BINARY}")


def is_comment(text: str) -> bool:
    """Tell whether a line is a comment."""
    return text.lstrip().startswith(COMMENTS)


def _no_text(first_line: str) -> str:
    """Say what a binary file is that tables are often kept in, and what to do."""
    message = (text for start, text in CONTAINERS.items() if first_line.startswith(start))
    return next(message, f"is no text; {BINARY}")


def is_binary(text: str) -> bool:
    """Tell whether a line holds a character that no text has."""
    return _CONTROL.search(text) is not None


def _has_number(text: str) -> bool:
    """Tell whether a line holds a number, one in digits of another script among them.

    Such a line is no header: it is data, whose numbers are refused.
    """
    tokens = re.split(r"[\t;,\s]+", text)
    return any(_IN_ANY_SCRIPT.fullmatch(token.strip("\"'")) for token in tokens if token)


def _sample(
    buf: NDArray[np.uint8] | FileBytes,
) -> tuple[list[tuple[int, int, str]], list[tuple[int, str]]]:
    """Return the first data lines (line, byte, text) and the comments (line, text) before them."""
    size = 1 << 16
    while True:
        raw = bytes(buf[:size]).split(b"\n")[:-1]
        data: list[tuple[int, int, str]] = []
        comments: list[tuple[int, str]] = []
        offset = 0
        for line, chunk in enumerate(raw, start=1):
            text = decode(chunk)
            drawn = len(data) == 1 and RULE.fullmatch(text)  # under the header
            if is_comment(text):
                if not data:
                    comments.append((line, text.strip()))
            elif text.strip() and not drawn:
                data.append((line, offset, text))
            offset += len(chunk) + 1
            if len(data) > SAMPLE_LINES:
                break
        if len(data) > SAMPLE_LINES or size >= buf.size:
            return data, comments
        size *= 8


def _refuse_empty_beginning(
    path: str | os.PathLike[str], buf: NDArray[np.uint8] | FileBytes, layout: TextLayout
) -> None:
    """Refuse a row whose first field is empty, which would pass for a comment behind `;`."""
    line = 1
    for begin in range(0, buf.size, SCAN_BYTES):
        piece = np.asarray(buf[begin : begin + SCAN_BYTES + 1])
        ends = np.flatnonzero(piece[:-1] == ord("\n"))
        for k in np.flatnonzero(piece[ends + 1] == ord(";")).tolist():
            start = begin + int(ends[k]) + 1
            text = decode(bytes(buf[start : start + LONGEST_HEADER]).partition(b"\n")[0])
            fields = split_fields(text, ";")
            if len(fields) == layout.n_fields and any(map(NUMBER.fullmatch, fields)):
                problem = f"{quote(text)} begins with an empty field"
                raise InputError.at_line(
                    path, line + k + 1, f"{problem}; fill it in, or begin a comment with #"
                )
        line += ends.size


def _separates(lines: Sequence[str], delimiter: str | None) -> bool:
    if delimiter is None:
        return True
    lines = [_mask_quoted(text)[0] for text in lines]
    if not all(delimiter in text for text in lines):
        return False
    if delimiter != ",":
        return True
    # 1,5 2,5 is two numbers with decimal commas, not three fields
    return not any(
        len(f.split()) > 1 and all(map(NUMBER.fullmatch, f.split()))
        for text in lines
        for f in split_fields(text, ",")
    )


def _delimiter_of(texts: Sequence[str]) -> str | None:
    return next(sign for sign in _DELIMITERS if _separates(texts, sign))


def _lines_before_header(texts: Sequence[str]) -> int:
    """Count the lines before a header that has more fields than each of them, as the data have.

    A table whose lines all have a number has none; a torn line is not followed by a header.
    """
    header = next((k for k in range(len(texts) - 2, 0, -1) if not _has_number(texts[k])), 0)
    delimiter = _delimiter_of(texts[header + 1 : SAMPLE_LINES + 1]) if header else None
    counts = [len(split_fields(text, delimiter)) for text in texts]
    while header and counts[header - 1] == counts[header] and not _has_number(texts[header - 1]):
        header -= 1  # from a line of units to that of the names
    alike = len(set(counts[header:])) == 1 and max(counts[:header], default=0) < counts[header]
    return header if alike else 0


def _units_row(names: Sequence[str] | None, rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the units in the line under a header without any; empty where it is of data."""
    first, *data_rows = rows
    bracketed = any("(" in name or "[" in name for name in names or "(")
    if bracketed or not data_rows or len({len(row) for row in rows}) > 1:
        return ()
    units = tuple(field.strip("\"'()[] ") for field in first)
    short = all(len(unit) <= LONGEST_UNIT for unit in units) and any(units)
    numeric = [any(map(NUMBER.fullmatch, row)) for row in rows]
    return units if short and not numeric[0] and all(numeric[1:]) else ()


def _header_fields(text: str, delimiter: str | None, n_fields: int) -> tuple[str, ...] | None:
    text = re.sub(r"^\s*(?:[#%!;]+|//)\s*", "", text)
    if len(text) > LONGEST_HEADER:
        return None
    for sign in dict.fromkeys((delimiter, ",", ";", "\t", None)):
        fields = _COLUMN_NAME.findall(text) if sign is None else split_fields(text, sign)
        if len(fields) == n_fields:
            return tuple(fields)
    return None


def _instead(comments: list[tuple[int, str]]) -> str:
    """Say what to do about a file that has comments alone, as logs of NovAtel look."""
    logs = {match[1] for _, text in comments if (match := OEM_LOG.match(text))}
    if not logs:
        return "check that the recording was copied whole"
    return (
        f"its lines are logs of NovAtel ({', '.join(sorted(logs))}), of which positions alone are"
        " read; write a table tow,gx,gy,gz,ax,ay,az from RAWIMU logs with the scale factors of your"
        " IMU (CORRIMU logs lack gravity and the Earth's rotation, which the filter needs)"
    )


def sniff(path: str | os.PathLike[str], buf: NDArray[np.uint8] | FileBytes) -> TextLayout:
    """Return the layout of the table in `buf`; InputError where there is no data line."""
    data, comments = _sample(buf)
    data = data[_lines_before_header([text for _, _, text in data]) :]
    head = data.pop(0) if data and not _has_number(data[0][2]) else None
    if head is not None and is_binary(head[2]):
        raise InputError.at_line(path, head[0], _no_text(head[2]))
    if not data:
        raise InputError.in_file(path, f"holds no data line; {_instead(comments)}")
    for line, _, text in data:
        refuse_long(path, line, text)
    texts = [text for _, _, text in data[:SAMPLE_LINES]]
    delimiter = _delimiter_of(texts)
    fields = [split_fields(text, delimiter) for text in texts]
    units = _units_row(head and _header_fields(head[2], delimiter, len(fields[0])), fields)
    if units:
        del data[0], fields[0]
    flat = [f for row in fields for f in row if NUMBER.fullmatch(f)]
    commas = delimiter != "," and any("," in field for field in flat)
    decimal = "," if commas and not any("." in field for field in flat) else "."
    counts = Counter(len(row) for row in fields)
    n_fields = counts.most_common(1)[0][0]
    if delimiter is not None and (
        n_fields + 1 in counts or (head and len(split_fields(head[2], delimiter)) == n_fields + 1)
    ):  # rows whose last field is empty
        short = (
            text.rstrip(" \r\n")
            for text, row in zip(texts, fields, strict=True)
            if len(row) == n_fields
        )
        n_fields += all(text.endswith(delimiter) for text in short)
    line, offset, _ = data[0]
    if n_fields > MOST_FIELDS:
        problem = f"{n_fields} fields (limit {MOST_FIELDS})"
        raise InputError.at_line(path, line, f"{problem}; is it a table?")
    layout = TextLayout(delimiter, decimal, n_fields, skip_to=offset, first_line=line)
    if delimiter == ";":
        _refuse_empty_beginning(path, buf, layout)
    named = head and (head[0], head[2])
    if named is None and comments and _header_fields(comments[-1][1], delimiter, n_fields):
        named = comments[-1]
    if named is None:
        return layout
    names = _header_fields(named[1], delimiter, n_fields)
    if names is not None and units:
        pairs = zip(names, units, strict=True)
        names = tuple(f"{name} [{unit}]" if unit else name for name, unit in pairs)
    return replace(layout, header=named[1].strip(), header_fields=names, header_line=named[0])


def kinds_of_lines(rows: Sequence[Sequence[str]]) -> set[str]:
    """Return the words that tell lines apart, of which all with one have as many fields."""
    leading = [WORD.search(",".join(row[:2])) for row in rows]
    pairs = Counter(
        ("" if word is None else word[0], len(row)) for word, row in zip(leading, rows, strict=True)
    )
    kinds = {word for word, _ in pairs}
    several = 1 < len(kinds) == len(pairs) and min(pairs.values()) > 1
    return kinds if several and "" not in kinds else set()
