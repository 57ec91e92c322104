"""What a source says of its fixes: the kind of their solution."""

from enum import IntEnum


class Quality(IntEnum):
    """RTKLIB's codes, which `GnssFixes.quality` holds."""

    UNKNOWN = 0
    FIXED = 1
    FLOAT = 2
    SBAS = 3
    DGPS = 4
    SINGLE = 5
    PPP = 6
