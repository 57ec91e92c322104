"""Checksummed sentences ($...*hh) of NMEA 0183 and its relatives."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.advance import through
from ....base.errors import InputError
from ....records import Finding
from .layout import decode
from .order import AtLines, note
from .text import FileLine, Source, load

# of a file's lines or rows: fewer damaged ones are left out and noted, more make it another format
BAD_SHARE_LIMIT = 0.01
# kinds that may all have a wrong checksum beside right ones of other kinds, as a program that
# corrects them leaves them; not those of positions and their standard deviations
LEFT_UNCHECKED = (b"RMC", b"VTG", b"ZDA", b"GSA", b"GSV", b"GLL")
# name of a sentence; in text without '$' one that is damaged
SENTENCE = re.compile(rb"(?:GGA|RMC|GST|VTG|ZDA|GSA|GSV|GLL|IMU|PPS),")
LEAST_UNCHECKED = 20  # sentences of such a kind: 20, since damage would leave one of them right


@dataclass(frozen=True, eq=False)
class Sentences:
    """The sentences of a file with a right checksum, the count of pieces that have none, of those
    taken without one by kind, and of pieces of other text before and between them.
    """

    path: str
    buf: NDArray[np.uint8]
    starts: NDArray[np.int64]
    stars: NDArray[np.int64]
    lines: NDArray[np.int64]
    n_bad: int
    unchecked: Mapping[str, int]
    n_other: int = 0

    def notes(self, rows: str) -> tuple[Finding, ...]:
        """Return the notes on what else stands in the file, for the record `rows`."""
        finding = f"text other than sentences in {self.n_other} places left out"
        advice = "if sentences are missing, let the logger write nothing else into this file"
        return (note(rows, finding, "sentences only", advice),) if self.n_other else ()

    def fields(self, *kinds: bytes) -> Iterator[tuple[FileLine, list[str]]]:
        """Yield line and fields of each sentence whose name ends in one of three letters.

        The first field stands without its '$'.
        """
        for line, text in through(list(self.texts())):
            if text[2:5] in kinds:
                yield FileLine(self.path, line), text.decode("ascii", "replace").split(",")

    def texts(self) -> Iterator[tuple[int, bytes]]:
        """Yield the line of each sentence and what stands between '$' and '*'."""
        data = self.buf.tobytes()
        columns = (self.starts.tolist(), self.stars.tolist(), self.lines.tolist())
        for start, star, line in zip(*columns, strict=True):
            yield line, data[start + 1 : star]


def read_sentences(path: Source) -> Sentences:
    """Read a log.

    Of a kind of `LEFT_UNCHECKED` whose checksums are all wrong beside right ones all are taken.

    Raises
    ------
    InputError
        More than 1 % of the other sentences have no right checksum; the first of them is named.
    """
    from . import _kernels

    buf, _ = load(path)
    n = _kernels.count_newlines(buf) + int(np.count_nonzero(buf == ord("$")))
    starts, stars, lines = (np.zeros(n, dtype=np.int64) for _ in range(3))
    n = _kernels.nmea_sentences(buf, starts, stars, lines)
    if n == 0:
        raise InputError.in_file(path, "holds no line; check that the recording was copied whole")
    between = _other_text(buf, starts[:n], stars[:n])
    starts, stars, lines = starts[:n][~between], stars[:n][~between], lines[:n][~between]
    if (n := starts.size) == 0:
        raise InputError.in_file(path, "holds no sentence ($...); check that this file is the log")
    good = stars > 0
    unchecked = (
        _rows_without_checksum(buf, starts, stars) if good.mean() < 1.0 - BAD_SHARE_LIMIT else {}
    )
    for rows in unchecked.values():
        good[rows] = True
    n_bad = int(n - good.sum())
    if n_bad > BAD_SHARE_LIMIT * n:
        first = int(np.argmin(good))
        text = decode(buf[starts[first] : starts[first] + 60].tobytes()).partition("\n")[0].strip()
        message = (
            f"no right checksum in {text!r}, as in {n_bad} of {n} sentences (limit"
            f" {BAD_SHARE_LIMIT:.0%}); record or copy the log again"
        )
        raise InputError.at_line(path, int(lines[first]), message)
    counts = {kind: len(rows) for kind, rows in unchecked.items()}
    places = starts[good], np.abs(stars[good]), lines[good]
    return Sentences(str(path), buf, *places, n_bad, counts, int(between.sum()))


def _other_text(
    buf: NDArray[np.uint8], starts: NDArray[np.int64], stars: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Which pieces are no sentence and none that lost its '$': stamps and messages of a logger."""
    between = stars == 0
    for row in np.flatnonzero(between).tolist():
        text = buf[starts[row] : starts[row] + 80].tobytes().partition(b"\n")[0].partition(b"$")[0]
        between[row] = SENTENCE.search(text) is None
    return between


def _rows_without_checksum(
    buf: NDArray[np.uint8], starts: NDArray[np.int64], stars: NDArray[np.int64]
) -> dict[str, list[int]]:
    """Rows of each kind of `LEFT_UNCHECKED` that has no right checksum; none where no other kind
    has one.
    """
    data = buf.tobytes()
    rows: dict[bytes, list[int]] = {}
    for row, start in enumerate(starts.tolist()):
        rows.setdefault(data[start + 3 : start + 6], []).append(row)
    if not (stars > 0).any():
        return {}
    return {
        kind.decode(): rows[kind]
        for kind in LEFT_UNCHECKED
        if len(rows.get(kind, ())) >= LEAST_UNCHECKED and (stars[rows[kind]] < 0).all()
    }


@dataclass(frozen=True)
class SentenceLines(AtLines):
    """Lines that rows were taken from."""

    path: str
    lines: list[int]
