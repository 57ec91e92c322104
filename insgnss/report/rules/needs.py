"""What accuracy images are wanted with, as `[output]` of a flight file states it.

Standard library only, for the command line.
"""

from collections.abc import Mapping
from typing import Any

NEEDS = {  # by `output.need`: m east, north, up, and deg about these axes
    "control": ((0.03, 0.03, 0.05), (0.02, 0.02, 0.05)),  # no ground control: a few cm, half a px
    "start values": ((1.0, 1.0, 1.0), (1.0, 1.0, 2.0)),  # what a bundle adjustment converges from
}


def stated_need(output: Mapping[str, Any] | None) -> tuple[Any, Any]:
    """Return the needs of a resolved table [output]: m and deg; None for what it does not state."""
    output = output or {}
    preset = NEEDS.get(output.get("need") or "", (None, None))
    stated = output.get("need_m"), output.get("need_deg")
    return tuple(s or p for s, p in zip(stated, preset, strict=True))  # type: ignore[return-value]
