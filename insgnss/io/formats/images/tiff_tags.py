"""Tags of TIFF files, and of the TIFF that Exif puts into JPEG, changed without moving anything.

A TIFF is a header that points to a directory of tags, whose values stand anywhere in the file. New
directories are appended, with all old entries and the changed ones, and the header is pointed to
them: pixels, other pages and makers' notes, which often count from the file's start, stay where
they are (TIFF 6.0; BigTIFF by its offsets of 8 bytes).
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ....base.errors import InputError

EXIF_IFD, GPS_IFD, XMP = 0x8769, 0x8825, 700  # tags that hold or point to Exif, GPS and XMP
# codes of types in TIFF 6.0 and BigTIFF
BYTE, ASCII, TIFF_LONG, RATIONAL, UNDEFINED, SRATIONAL, LONG8 = 1, 2, 4, 5, 7, 10, 16
# bytes of a value by its type: those of TIFF 6.0 from 1 on, and three of BigTIFF
SIZES = dict(enumerate((1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4), start=1))
SIZES |= dict.fromkeys((16, 17, 18), 8)
MOST_ENTRIES = 4096  # tags of a directory: cameras write fewer than a hundred (chosen)

Value = tuple[int, Any]
"""Type and content: bytes of BYTE, ASCII and UNDEFINED, pairs of integers of rationals."""


@dataclass(frozen=True)
class _Entry:
    kind: int
    count: int
    field: bytes


class Tiff:
    """The first directory of a TIFF and the Exif and GPS directories under it.

    Parameters
    ----------
    read : callable
        Returns bytes at an offset and of a length.
    size : int
        Bytes of the whole.
    who : str
        The file, for messages.

    Raises
    ------
    InputError
        No TIFF, or directories that do not hold together.
    """

    def __init__(self, read: Callable[[int, int], bytes], size: int, who: str) -> None:
        """Read the header and the first, Exif and GPS directories; refuse what is no TIFF."""
        self._read, self._size, self._who = read, size, who
        header = read(0, 16)
        self._order = {b"II": "<", b"MM": ">"}.get(header[:2], "")
        magic = 0
        if self._order and len(header) >= 8:
            (magic,) = struct.unpack(f"{self._order}H", header[2:4])
        if magic not in (42, 43):
            raise self._broken("is no TIFF")
        self.big = magic == 43
        self._word, self._bytes = ("Q", 8) if self.big else ("I", 4)
        self._head = header[: 16 if self.big else 8]
        first_offset = self._unpack(self._word, self._head[-self._bytes :])
        self.first, self._next = self._directory(first_offset) if first_offset else ({}, 0)
        self.exif, self.gps = (self._below(tag) for tag in (EXIF_IFD, GPS_IFD))

    def bytes_of(self, directory: Mapping[int, _Entry], tag: int) -> bytes | None:
        """Return the bytes of a tag's value, or None."""
        entry = directory.get(tag)
        if entry is None:
            return None
        length = SIZES.get(entry.kind, 1) * entry.count
        return (
            entry.field[:length]
            if length <= self._bytes
            else self._bytes_at(self._unpack(self._word, entry.field), length)
        )

    def text_of(self, directory: Mapping[int, _Entry], tag: int) -> str:
        """Return the text of a tag, empty where it is missing."""
        return (self.bytes_of(directory, tag) or b"").decode("latin-1").strip("\0 ")

    def number_of(self, directory: Mapping[int, _Entry], tag: int) -> float | None:
        """Return the first number of a tag; None where it is missing or divides by zero."""
        entry, data = directory.get(tag), self.bytes_of(directory, tag)
        if entry is None or data is None:
            return None
        layout = {3: "H", 4: "I", 5: "II", 10: "ii"}.get(entry.kind, "")
        if not layout or len(data) < (byte_count := struct.calcsize(f"={layout}")):
            raise self._broken(f"tag {tag} holds no number")
        numbers = struct.unpack(self._order + layout, data[:byte_count])
        if len(numbers) == 1:
            return float(numbers[0])
        return float(numbers[0] / numbers[1]) if numbers[1] else None

    def changed(
        self, first_tags: Mapping[int, Value], exif: Mapping[int, Value], gps: Mapping[int, Value]
    ) -> tuple[bytes, bytes]:
        """Return the new header, and what follows the old end, with these tags set.

        Raises
        ------
        InputError
            Offsets of 4 bytes do not reach.
        """
        appended = bytearray(b"\x00" * (self._size % 2))
        pointers = {}
        for tag, old, new in ((EXIF_IFD, self.exif, exif), (GPS_IFD, self.gps, gps)):
            if new:
                entry = _Entry(
                    LONG8 if self.big else TIFF_LONG,
                    1,
                    struct.pack(self._order + self._word, self._append(appended, old, new, 0)),
                )
                pointers[tag] = entry
        start = self._append(appended, self.first | pointers, first_tags, self._next)
        if not self.big and self._size + len(appended) > 0xFFFFFFFF:
            raise InputError(
                f"{self._who}: is too long for the offsets of a TIFF (4 GiB); save it as BigTIFF"
            )
        return self._head[: -self._bytes] + struct.pack(self._order + self._word, start), bytes(
            appended
        )

    def _append(
        self, tail: bytearray, old: Mapping[int, _Entry], new: Mapping[int, Value], following: int
    ) -> int:
        """Append a directory and the values of its new tags; return its offset."""
        entries = dict(old)
        for tag, value in new.items():
            kind, data, count = self._packed(value)
            if len(data) <= self._bytes:
                entries[tag] = _Entry(kind, count, data.ljust(self._bytes, b"\x00"))
            else:
                entries[tag] = _Entry(
                    kind, count, struct.pack(self._order + self._word, self._size + len(tail))
                )
                tail += data + b"\x00" * (len(data) % 2)
        start = self._size + len(tail)
        tail += struct.pack(self._order + ("Q" if self.big else "H"), len(entries))
        for tag in sorted(entries):
            e = entries[tag]
            tail += struct.pack(f"{self._order}HH{self._word}", tag, e.kind, e.count) + e.field
        tail += struct.pack(self._order + self._word, following)
        return start

    def _packed(self, value: Value) -> tuple[int, bytes, int]:
        """Type, bytes and count of a value."""
        kind, content = value
        if kind in (RATIONAL, SRATIONAL):
            flat = [number for pair in content for number in pair]
            return (
                kind,
                struct.pack(f"{self._order}{len(flat)}{'I' if kind == RATIONAL else 'i'}", *flat),
                len(content),
            )
        return kind, content, len(content)

    def _below(self, tag: int) -> dict[int, _Entry]:
        entry = self.first.get(tag)
        return {} if entry is None else self._directory(self._offset(entry))[0]

    def _offset(self, entry: _Entry) -> int:
        is_offset_of_4 = SIZES.get(entry.kind) == 4
        return self._unpack(
            "I" if is_offset_of_4 else self._word,
            entry.field[: 4 if is_offset_of_4 else self._bytes],
        )

    def _directory(self, offset: int) -> tuple[dict[int, _Entry], int]:
        """Entries by tag, and the offset of the next directory."""
        width, form = (8, "Q") if self.big else (2, "H")
        n = self._unpack(form, self._bytes_at(offset, width))
        if n > MOST_ENTRIES:
            raise self._broken(
                f"a directory at byte {offset} claims {n} tags (limit {MOST_ENTRIES})"
            )
        step = 4 + 2 * self._bytes
        block = self._bytes_at(offset + width, n * step + self._bytes)
        entries = {}
        for k in range(n):
            tag, kind, count = struct.unpack_from(f"{self._order}HH{self._word}", block, k * step)
            entries[tag] = _Entry(kind, count, block[(k + 1) * step - self._bytes : (k + 1) * step])
        return entries, self._unpack(self._word, block[n * step :])

    def _unpack(self, form: str, data: bytes) -> int:
        return int(struct.unpack(self._order + form, data)[0])

    def _bytes_at(self, offset: int, length: int) -> bytes:
        if offset <= 0 or offset + length > self._size:
            raise self._broken(
                f"it refers to byte {offset + length}, but the file ends at byte {self._size}"
            )
        return self._read(offset, length)

    def _broken(self, message: str) -> InputError:
        return InputError(
            f"{self._who}: {message}; its tags are broken or it was cut off; copy it again from its"
            " source"
        )
