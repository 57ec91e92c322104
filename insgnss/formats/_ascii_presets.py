"""Templates of the generic ASCII table for tools whose layouts could not be checked: experimental, data_specs/generic_ascii.md.

No file of these tools was at hand, so every file says that it is unverified. Their importers let columns be assigned, or a template
of one's own is given to `write_generic_ascii`.
"""

from typing import Any

from ..records import FramedOrientation
from ..records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from ._eo import check_frame
from ._text import Source
from .generic_ascii import write_generic_ascii

PRESETS: dict[str, dict[str, Any]] = {
    "bingo": {"columns": "image xyz pok", "unit": "gon"},
    "bluh": {"columns": "image pok xyz", "unit": "gon"},
    "orima": {"columns": "image xyz opk s_xyz s_opk", "unit": "gon"},
    "xpro": {"columns": "image xyz opk s_xyz s_opk"},
    "simactive": {"columns": "image xyz opk"},
    "dji_terra": {"columns": "image lat lon h ypr s_plan", "delimiter": "comma"},
}


def _write(name: str, eo: FramedOrientation, path: Source) -> None:
    kinds = (GEOGRAPHIC,) if name == "dji_terra" else (PROJECTED, TANGENT)
    check_frame(eo, name, *kinds)
    write_generic_ascii(eo, path, note=f"experimental: this layout for {name} is unverified", **PRESETS[name])


def write_bingo(eo: FramedOrientation, path: Source) -> None:
    """Experimental: image X Y Z phi omega kappa, gon, phi first."""
    _write("bingo", eo, path)


def write_bluh(eo: FramedOrientation, path: Source) -> None:
    """Experimental: image phi omega kappa X Y Z, gon, phi first."""
    _write("bluh", eo, path)


def write_orima(eo: FramedOrientation, path: Source) -> None:
    """Experimental: image E N H omega phi kappa and their standard deviations, gon."""
    _write("orima", eo, path)


def write_xpro(eo: FramedOrientation, path: Source) -> None:
    """Experimental: image E N H omega phi kappa and their standard deviations, deg."""
    _write("xpro", eo, path)


def write_simactive(eo: FramedOrientation, path: Source) -> None:
    """Experimental: image X Y Z omega phi kappa, deg."""
    _write("simactive", eo, path)


def write_dji_terra(eo: FramedOrientation, path: Source) -> None:
    """Experimental: image, latitude, longitude, height, yaw, pitch, roll, horizontal and vertical accuracy."""
    _write("dji_terra", eo, path)
