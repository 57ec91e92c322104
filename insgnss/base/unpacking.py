"""Packed files: unpacked no further than a limit, and than memory holds.

A megabyte can unpack to a terabyte. Where a file states what it unpacks to (zip, and the variables
of numpy and MATLAB files) that is looked at before anything is unpacked; a stream that does not
(gzip, whose stated size is modulo 4 GB, bzip2, compress) is unpacked piece by piece and left at the
limit. The limit is 4 GB, and for a file whose size is known 200 times this size, or 100 MB if that
is more; the environment variable INSGNSS_UNPACKED_GB replaces both. No file sets it, so that none
can lift the limit.
"""

import bz2
import io
import math
import os
import zipfile
import zlib
from collections.abc import Callable
from functools import partial

from .errors import DataError, InputError, UsageError, required_library
from .memory import GB, available
from .wording import DOCTOR

UNPACKED_GB = "INSGNSS_UNPACKED_GB"
LIMIT_GB = 4.0  # of what any file unpacks to (GB): a day's recording of an IMU at 500 Hz as text
# unpacked by packed size: text of receivers has 3 to 30, XML of projects 5 to 60
MOST_UNPACKED_RATIO = 200.0
# bytes that a file of any size may unpack to: they take less than a second
ALWAYS_UNPACKED_BYTES = 1e8
GZIP, COMPRESS, BZIP2, ZIP = b"\x1f\x8b", b"\x1f\x9d", b"BZh", b"PK"
PACKED = (GZIP, COMPRESS, BZIP2, ZIP)
# bytes that are unpacked at a time, and that they may give
UNPACKED_AT_A_TIME, LONGEST_PIECE = 1 << 16, 1 << 17
USUAL_UNPACKED_RATIO = 100  # times the packed size: text of receivers is 3 to 30 times
MEMBERS = 10_000  # files in an archive: their list alone takes memory and time (chosen)
DAMAGED = (
    OSError,
    EOFError,
    ValueError,
    NotImplementedError,
    RuntimeError,
    zlib.error,
    zipfile.BadZipFile,
)


def unpacked_limit(packed: float = math.inf) -> float:
    """Return how many bytes a file may unpack to.

    Parameters
    ----------
    packed : float
        Its own size, bytes.

    Raises
    ------
    UsageError
        The environment variable is no number greater than zero.
    """
    text = os.environ.get(UNPACKED_GB, "")
    try:
        limit = float(text) if text else LIMIT_GB
    except ValueError:
        limit = math.nan
    if not limit > 0.0:
        raise UsageError(f"{UNPACKED_GB} = {text!r}: a number of GB greater than zero is expected")
    return (
        limit * GB
        if text
        else min(limit * GB, max(ALWAYS_UNPACKED_BYTES, MOST_UNPACKED_RATIO * packed))
    )


def check_unpacked(
    path: object, size: float, qualifier: str = "", packed: float = math.inf
) -> None:
    """Refuse a file that unpacks to more than the limit, or than memory holds.

    Parameters
    ----------
    path
        The file, for the message.
    size : float
        What it unpacks to, bytes.
    qualifier : str
        What stands before the size in the message, such as "up to ".
    packed : float
        The size of the file itself, bytes.

    Raises
    ------
    InputError
        Beyond the limit.
    DataError
        Beyond what this process may still take of the memory.
    """
    limit = unpacked_limit(packed)
    if size > limit:
        sufficient_gb = (
            math.ceil(size / GB) if qualifier != "more than " else math.ceil(2 * size / GB)
        )
        packed_note = f" for a file of {_in_gigabytes(packed)}" if limit < unpacked_limit() else ""
        problem = (
            f"unpacks to {qualifier}{_in_gigabytes(size)} (limit"
            f" {_in_gigabytes(limit)}{packed_note})"
        )
        advice = (
            f"if you trust the file's source, set {UNPACKED_GB}={sufficient_gb} in the environment"
        )
        raise InputError.in_file(path, f"{problem}; {advice}")
    free_bytes = available()
    if free_bytes is not None and size > free_bytes:
        problem = (
            f"unpacks to {qualifier}{_in_gigabytes(size)}, and memory has"
            f" {_in_gigabytes(free_bytes)} left"
        )
        raise DataError(
            f"{path}: {problem}; take a machine with more memory, or a shorter recording"
        )


def _in_gigabytes(size: float) -> str:
    """Return a size, bytes, as text in GB, or in MB where it is small."""
    return f"{size / GB:.3g} GB" if size >= 1e7 else f"{size / 1e6:.3g} MB"


def check_archive(path: object, archive: zipfile.ZipFile) -> None:
    """Refuse a zip whose members together unpack to more than the limit, or than memory holds.

    zipfile unpacks no member beyond the size that the archive states.

    Raises
    ------
    InputError
        Beyond the limit, or more than 10 000 members.
    DataError
        Beyond what this process may still take of the memory.
    """
    members = archive.infolist()
    if len(members) > MEMBERS:
        problem = f"holds {len(members)} files (limit {MEMBERS})"
        raise InputError.in_file(path, f"{problem}; unpack it and give the file itself")
    # the list of its members stands at the end
    check_unpacked(path, sum(member.file_size for member in members), packed=archive.start_dir)


def unpack(path: object, data: bytes) -> bytes:
    """Return the content of a packed file: gzip, bzip2, compress, or a zip of one file.

    Parameters
    ----------
    path
        The file, for messages.
    data : bytes
        All of it; what is not packed comes back as it is.

    Returns
    -------
    bytes
        The content.

    Raises
    ------
    InputError
        It is damaged, unpacks beyond the limit, or needs a package that is not there.
    DataError
        It unpacks to more than memory holds.
    """
    try:
        if data.startswith(ZIP):
            return _unpack_zip(path, data)
        if data.startswith(COMPRESS):
            return _unpack_compress(path, data)
        if data.startswith((GZIP, BZIP2)):
            return _count_and_fill(path, data, partial(_inflate, data))
    except DAMAGED as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        problem = f"cannot be unpacked: {why}; copy it again from its source"
        raise InputError.in_file(path, problem) from None
    return data


class _Bounded(io.RawIOBase):
    """A stream in memory that refuses to grow beyond the limits.

    Parameters
    ----------
    path
        The file, for the message.
    packed : float
        The size of what is unpacked, bytes.
    kept : float
        Bytes that are kept; what comes after them is counted only.
    """

    def __init__(self, path: object, packed: float, kept: float) -> None:
        free = available()
        limit = unpacked_limit(packed)
        self._path, self._packed = path, packed
        self._limit = limit if free is None else min(limit, free)
        self._kept, self.size, self.content = kept, 0, bytearray()

    def writable(self) -> bool:
        """Tell that it takes bytes."""
        return True

    def write(self, piece: object) -> int:
        """Take a piece of bytes."""
        view = memoryview(piece)  # type: ignore[arg-type]
        self.size += view.nbytes
        if self.size > self._limit:
            check_unpacked(self._path, self._limit + 1.0, "more than ", self._packed)
        if self.size <= self._kept:
            self.content += view
        return view.nbytes


def _count_and_fill(path: object, data: bytes, fill: Callable[[_Bounded], object]) -> bytes:
    """Return what `fill` writes; far more than of any recording is counted first."""
    stream = _Bounded(path, len(data), USUAL_UNPACKED_RATIO * len(data))
    fill(stream)
    if stream.size > len(stream.content):
        stream = _Bounded(path, len(data), math.inf)
        fill(stream)
    return bytes(stream.content)


def _inflate(data: bytes, stream: _Bounded) -> None:
    """Write the content of gzip or bzip2, of all the streams that stand one behind the other."""
    gzipped, offset = data.startswith(GZIP), 0
    while offset < len(data):
        if not data.startswith(GZIP if gzipped else BZIP2, offset):
            if data[offset:].strip(b"\0"):
                raise ValueError("bytes that do not belong to the file follow its end")
            return
        member = zlib.decompressobj(31) if gzipped else bz2.BZ2Decompressor()
        while not member.eof:
            if offset >= len(data):
                raise EOFError("it ends before its end-of-stream mark")
            chunk = data[offset : offset + UNPACKED_AT_A_TIME]
            offset += len(chunk)
            while True:
                piece = member.decompress(chunk, LONGEST_PIECE)
                stream.write(piece)
                chunk = getattr(member, "unconsumed_tail", b"")
                if member.eof or (len(piece) < LONGEST_PIECE and not chunk):
                    break
        offset -= len(member.unused_data)


def _unpack_zip(path: object, data: bytes) -> bytes:
    """Return the bytes of the one file that a zip archive holds."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = archive.namelist()
        if len(names) != 1:
            raise ValueError(f"the zip holds {len(names)} files, one is expected")
        check_archive(path, archive)
        return archive.read(names[0])


def _unpack_compress(path: object, data: bytes) -> bytes:
    """Return the bytes of a file that `compress` packed (.Z)."""
    problem = f"is packed by compress; pip install 'insgnss[ppk]', or unpack the file; {DOCTOR}"
    with required_library(problem, path):
        import ncompress
    return _count_and_fill(path, data, partial(ncompress.decompress, data))
