"""Bytes of a large file that are read where they are needed, piece by piece.

The file is not mapped: a map of one that another program cuts off ends the process by a signal, and
a read says so.
"""

import os
import threading
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.inputs import open_bytes


def shrunk(path: str | os.PathLike[str], count: int, size: int) -> InputError:
    """Return the error of a file that ended earlier than it said."""
    return InputError.in_file(
        path,
        f"became shorter while it was read: it ends at byte {count} of {size}; wait until the"
        " program that writes it is done, and try again",
    )


class FileBytes:
    """A file as an array of bytes, whose slices are read when they are asked for.

    Parameters
    ----------
    path : path
        The file.

    Attributes
    ----------
    size : int
        Bytes of the file as it was when it was opened.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path, self._lock = path, threading.Lock()

    def __enter__(self) -> "FileBytes":
        try:
            self._stream = open_bytes(self.path)
        except OSError as error:
            raise self._unreadable(error) from None
        self.size = os.fstat(self._stream.fileno()).st_size
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stream.close()

    def __getitem__(self, item: slice) -> NDArray[np.uint8]:
        """Return bytes of a slice without a step, by any thread.

        Raises
        ------
        InputError
            Where the file ends before.
        """
        start, stop, _ = item.indices(self.size)
        out = np.empty(max(stop - start, 0), dtype=np.uint8)
        count = 0
        while count < out.size:
            step = self._read(start + count, out[count:])
            if step == 0:
                raise shrunk(self.path, start + count, self.size)
            count += step
        return out

    def _unreadable(self, error: OSError) -> InputError:
        reason = f"cannot be read: {error.strerror or error}; check permission and medium"
        return InputError.in_file(self.path, reason)

    def _read(self, offset: int, out: NDArray[np.uint8]) -> int:
        try:
            if hasattr(os, "preadv"):
                return os.preadv(self._stream.fileno(), [out.data], offset)
            with self._lock:
                self._stream.seek(offset)
                return self._stream.readinto(out.data) or 0
        except OSError as error:
            raise self._unreadable(error) from None
