"""The formats that an exterior orientation is written to: each registered here once, with the frames that it can carry.

A writer is a pure function of a `FramedOrientation` in one of its frames and a path; what it needs besides are its options.
`eo_json` is the master and takes the `ExteriorOrientation` itself.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

TANGENT, GEOCENTRIC, GEOGRAPHIC, PROJECTED = "tangent plane", "geocentric", "geographic", "projected"
CARTESIAN = (TANGENT, PROJECTED, GEOCENTRIC)
Heights = Literal["", "ellipsoid", "sea level"]


@dataclass(frozen=True)
class Export:
    """One format.

    product : its usual file name.   what : one line for people.   writer : module and function in `formats`.
    frames : kinds of frame that it can carry, the first by default.   heights : to what its consumer takes heights: any, which the
    frame says (""), or always above the ellipsoid of WGS84 or sea level.   options : what the writer takes besides.
    reader : module and function that read it back; empty where the format cannot be.
    experimental : why not all of the convention could be checked; empty where it could.   several : a directory of files.
    """

    product: str
    what: str
    writer: str
    frames: tuple[str, ...]
    heights: Heights = ""
    options: tuple[str, ...] = ()
    reader: str = ""
    experimental: str = ""
    several: bool = False

    @property
    def write(self) -> Callable[..., Any]:
        """The writer."""
        return _function(self.writer)

    @property
    def read(self) -> Callable[..., Any] | None:
        """The reader, None where there is none."""
        return _function(self.reader) if self.reader else None


def _function(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    function: Callable[..., Any] = getattr(import_module(f".{module}", __package__), name)
    return function
