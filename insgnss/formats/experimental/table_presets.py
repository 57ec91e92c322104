"""Templates of the generic ASCII table for tools whose layouts could not be checked.

The format is data_specs/generic_ascii.md.

Every file says that it is unverified. The tools' importers let columns be assigned, or a template
of one's own is given to `write_generic_ascii`.
"""

from functools import partial
from typing import Any

from ...records import FramedOrientation
from ...records.framed import GEOGRAPHIC, PROJECTED, TANGENT
from ..orientation.exported import check_frame
from ..orientation.generic_ascii import write_generic_ascii
from ..text.text import Source

PRESETS: dict[str, dict[str, Any]] = {
    "bingo": {"columns": "image xyz pok", "unit": "gon"},  # phi first
    "bluh": {"columns": "image pok xyz", "unit": "gon"},
    "orima": {"columns": "image xyz opk s_xyz s_opk", "unit": "gon"},
    "xpro": {"columns": "image xyz opk s_xyz s_opk"},
    "simactive": {"columns": "image xyz opk"},
    # fields that Trimble Business Center writes for it (help.fieldsystems.trimble.com, Export
    # Flight Mission Files), all but `activate`
    "uasmaster": {
        "columns": "image number xyz roll_ned pitch_ned yaw_ned tow",
        "delimiter": "comma",
    },
    # the order of the sample in ContextCapture's user guide, Import photo positions
    "contextcapture": {"columns": "image xyz opk"},
    "dji_terra": {"columns": "image lat lon h ypr s_plan", "delimiter": "comma"},
}


def write_preset(name: str, eo: FramedOrientation, path: Source) -> None:
    """Write the table of the tool `name` of `PRESETS`.

    Raises
    ------
    UsageError
        A frame that the table cannot carry.
    """
    kinds = (GEOGRAPHIC,) if name == "dji_terra" else (PROJECTED, TANGENT)
    check_frame(eo, name, *kinds)
    write_generic_ascii(
        eo,
        path,
        note=f"experimental: this layout for {name} is unverified",
        quotes=False,  # of which the programs may know nothing
        **PRESETS[name],
    )


(
    write_bingo,
    write_bluh,
    write_orima,
    write_xpro,
    write_simactive,
    write_uasmaster,
    write_contextcapture,
    write_dji_terra,
) = (partial(write_preset, name) for name in PRESETS)
