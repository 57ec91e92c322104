"""Navigation files of RINEX 4 as those of RINEX 3: the messages that both have.

RINEX 4 sets a line before each record that says what it is,

    > EPH G01 LNAV

and adds messages of the modernised signals (CNAV, CNV1 to CNV3), offsets between the systems'
times (STO), orientation of the Earth (EOP) and ionosphere (ION). The messages of RINEX 3, LNAV of
GPS and QZSS, FDMA of GLONASS, INAV and FNAV of Galileo, D1 and D2 of BeiDou, stand in their old
form behind that line (RINEX 4.00, section 5.4). They are taken, the others left out and counted;
the engine gets the same as a file of RINEX 3.04. A fifth line of GLONASS (status and health, new
with 3.05) is left out.
"""

from collections import Counter
from pathlib import Path

from ...base.errors import InputError

OF_RINEX_3 = {"LNAV": "GJI", "FDMA": "R", "INAV": "E", "FNAV": "E", "D1": "C", "D2": "C"}
OF_RINEX_3 |= {"D1D2": "C", "SBAS": "S"}
GLONASS_LINES = 4  # of a message of RINEX 3.04; later versions add a fifth
VERSION_3 = "     3.04"


def as_rinex_3(path: str | Path, lines: list[str], start: int) -> tuple[list[str], Counter[str]]:
    """Return the lines of a RINEX 4 file with what RINEX 3 does not have as empty ones.

    Parameters
    ----------
    path : path-like
        The file, for messages.
    lines : list of str
        All of them.
    start : int
        Index of the first line behind the header.

    Returns
    -------
    lines : list of str
        As many, so that line numbers stay.
    left_out : Counter
        Records that were left out, by kind.

    Raises
    ------
    InputError
        Where no record line stands first, or one names no satellite.
    """
    out = [*lines]
    left_out = Counter[str]()
    in_rinex_3 = False
    message_start = 0
    out[0] = VERSION_3 + lines[0][9:]
    for k in range(start, len(lines)):
        line = lines[k]
        if line.startswith(">"):
            fields = line[1:].split()
            if len(fields) < 3:
                raise InputError.at_line(
                    path,
                    k + 1,
                    f"{line[:40]!r} is no record of RINEX 4, such as '> EPH G01 LNAV'; fetch the"
                    " file again",
                )
            kind, satellite, message = fields[:3]
            in_rinex_3 = kind == "EPH" and satellite[:1] in OF_RINEX_3.get(message, "")
            if not in_rinex_3:
                left_out[f"{kind} {message}"] += 1
            out[k] = ""
            message_start = k + 1
        elif k == start and line.strip():
            raise InputError.at_line(
                path, k + 1, "no record of RINEX 4 (> EPH ...) behind the header; fetch it again"
            )
        elif not in_rinex_3 or (
            lines[message_start][:1] == "R" and k - message_start >= GLONASS_LINES
        ):
            out[k] = ""
    return out, left_out
