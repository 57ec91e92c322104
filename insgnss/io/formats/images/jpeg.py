"""The Exif and XMP segments of a JPEG, read or replaced; everything else stays byte by byte.

A JPEG is a chain of segments (marker, length, content) up to the scan, which is not looked into.
Exif and XMP are APP1 segments, known by how they begin. The new ones stand behind the JFIF segment,
where there is one, Exif before XMP: before a segment of several pictures (MPF), which counts from
its own place and must not have its pictures pushed away.
"""

from collections.abc import Callable

from ....base.errors import InputError

EXIF, PACKET = b"Exif\x00\x00", b"http://ns.adobe.com/xap/1.0/\x00"
# bytes that a segment holds: its length has 16 bits and counts its own two bytes
SEGMENT_BYTES = 0xFFFF - 2
APP0, APP1 = 0xE0, 0xE1  # markers of the segments of JFIF, and of Exif and XMP
Read = Callable[[int, int], bytes]
Change = Callable[[bytes | None], bytes]


def with_tags(read: Read, size: int, who: str, exif: Change, xmp: Change) -> tuple[bytes, int]:
    """Return the head of the new file, and the byte of the old one where its rest begins.

    Parameters
    ----------
    read : callable
        Returns bytes at an offset and of a length.
    size : int
        Bytes of the whole.
    who : str
        The file, for messages.
    exif, xmp : callable
        Makes the new content of the segment from the old one, which is None where there is none.

    Raises
    ------
    InputError
        A broken chain, a segment that stands twice, or a new one too long for a JPEG.
    """
    segments, content_start = _segments(read, size, who)
    for start, make_content, kind in ((EXIF, exif, "Exif"), (PACKET, xmp, "XMP")):
        positions = [
            index
            for index, (marker, content) in enumerate(segments)
            if marker == APP1 and content.startswith(start)
        ]
        if len(positions) > 1:
            raise InputError(
                f"{who}: has {len(positions)} segments of {kind}; which one is valid is"
                " ambiguous; remove the others"
            )
        content = start + make_content(
            segments.pop(positions[0])[1][len(start) :] if positions else None
        )
        if len(content) > SEGMENT_BYTES:
            raise InputError(
                f"{who}: its {kind} would need {len(content)} bytes (limit {SEGMENT_BYTES});"
                " remove the thumbnail or the makers' note"
            )
        segments.insert(_insert_index(segments, start), (APP1, content))
    parts = [
        b"\xff" + bytes([marker]) + (len(content) + 2).to_bytes(2, "big") + content
        for marker, content in segments
    ]
    return b"\xff\xd8" + b"".join(parts), content_start


def exif_of(read: Read, size: int, who: str) -> bytes:
    """Return the TIFF within the first Exif segment, empty without one.

    Raises
    ------
    InputError
        A broken chain of segments.
    """
    segments, _ = _segments(read, size, who)
    return next(
        (
            content[len(EXIF) :]
            for marker, content in segments
            if marker == APP1 and content.startswith(EXIF)
        ),
        b"",
    )


def _insert_index(segments: list[tuple[int, bytes]], start: bytes) -> int:
    """Return where to insert: behind JFIF, and XMP behind Exif."""
    rows_before = [
        marker == APP0 or (marker == APP1 and start == PACKET and content.startswith(EXIF))
        for marker, content in segments
    ]
    return rows_before.index(False) if False in rows_before else len(rows_before)


def _segments(read: Read, size: int, who: str) -> tuple[list[tuple[int, bytes]], int]:
    """Return markers and contents of the head's segments, and the byte where the rest begins."""
    position = 2
    segments: list[tuple[int, bytes]] = []
    while True:
        header = read(position, 4)
        while header[:2] == b"\xff\xff":  # fill bytes
            position += 1
            header = read(position, 4)
        length = int.from_bytes(header[2:4], "big")
        if len(header) < 4 or header[0] != 0xFF or length < 2 or position + 2 + length > size:
            raise InputError(
                f"{who}: no JPEG from byte {position} of {size} on; it was cut off; copy it again"
                " from its source"
            )
        if not (APP0 <= header[1] <= 0xEF or header[1] == 0xFE):
            return segments, position
        segments.append((header[1], read(position + 4, length - 2)))
        position += 2 + length
