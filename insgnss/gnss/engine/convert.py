"""Receivers' own logs (.ubx, .sbf, .rtcm3) as RINEX, by RTKLIB's converter.

A log of PX4 may hold that of its receiver. The converter is that of the wheel pyrtklib5, in a
process of its own. What a file is its first bytes tell: frames of u-blox, Septentrio or RTCM 3 that
follow each other. RTCM 3 has no date but the time of week, which is taken to lie within half a week
of the navigation messages that are given besides; without these it would be of the week in which
the file is converted.
"""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np

from ...base.errors import DataError, InputError
from ...base.inputs import first_bytes
from ...base.output.scratch import refuse_cut_off
from ...base.wording import DOCTOR
from ...geodesy.gpstime import calendar_from_gps
from ...io.formats.logs.ulog import receiver_bytes
from ...records import Question
from ..rinex.joined import RinexFile
from ..rinex.navigation_message import TOE, read_navigation
from ..rinex.observations import read_observations

MODULE = "pyrtklib5"
MAKERS = {"UBX": "u-blox", "SEPT": "Septentrio", "RTCM3": "RTCM 3", "ULOG": "PX4"}
QUOTED_CHARACTERS = 200  # characters of the converter's message that an error quotes: a line or two
BY_HAND = "convert the log to RINEX by hand, and give the RINEX file"
# first bytes of a log, and frames that tell its format (chosen)
HEAD_BYTES, LEAST_FRAMES = (1 << 14, 3)
CONVERTED_WITHIN_S = 600.0  # of the converter: a damaged log must not hold the run (chosen)
RTCM_PREAMBLE, RTCM_AROUND = 0xD3, 6  # first byte, and bytes about a message: head 3, CRC 3
UBX_AROUND = 8  # bytes about a message of u-blox: sync 2, class and id 2, length 2, checksum 2
UBX_SYNC, SBF_SYNC, ULOG = b"\xb5\x62", b"$@", b"ULog\x01\x12\x35"


def log_format(path: Path) -> str:
    """Return the name of a receiver's log, a key of `MAKERS`; empty for other files."""
    if not path.is_file():
        return ""
    first_part = first_bytes(path, HEAD_BYTES)
    if first_part.startswith(ULOG):
        return "ULOG"
    if _count_ubx_frames(first_part) >= LEAST_FRAMES:
        return "UBX"
    if first_part.startswith(SBF_SYNC) and first_part.count(SBF_SYNC) >= LEAST_FRAMES:
        return "SEPT"
    return "RTCM3" if _count_rtcm_frames(first_part) >= LEAST_FRAMES else ""


def _count_ubx_frames(content: bytes) -> int:
    """Count the frames of u-blox that follow each other from the first one on."""
    start = content.find(UBX_SYNC)
    count = 0
    while 0 <= start <= len(content) - UBX_AROUND and content[start : start + 2] == UBX_SYNC:
        count += 1
        start += UBX_AROUND + int.from_bytes(content[start + 4 : start + 6], "little")
        start = content.find(UBX_SYNC, start) if content[start : start + 1] == b"$" else start
    return count


def _count_rtcm_frames(content: bytes) -> int:
    """Count the frames of RTCM 3 that follow each other from the first byte on."""
    start = count = 0
    while start <= len(content) - 3 and content[start] == RTCM_PREAMBLE and content[start + 1] < 4:
        count += 1
        start += RTCM_AROUND + (content[start + 1] << 8) + content[start + 2]
    return count


def convert_log(path: Path, directory: Path, navigation: tuple[Path, ...]) -> RinexFile:
    """Convert a receiver's log to RINEX 3.04; a file that is none stays as it is.

    Parameters
    ----------
    path : Path
        The file.
    directory : Path
        Gets the RINEX; is made.
    navigation : tuple of Path
        Broadcast messages, of which RTCM 3 gets its week.

    Raises
    ------
    InputError
        Without the converter.
    DataError
        Where it finds no observations.
    """
    stream = log_format(path)
    if not stream:
        return RinexFile(path)
    if importlib.util.find_spec(MODULE) is None:
        raise InputError.in_file(
            path,
            f"is a log of {MAKERS[stream]}; its converter comes with pip install 'insgnss[ppk]'"
            f" ({MODULE}), or give RINEX (convbin -v 3.04 {path.name}); {DOCTOR}",
        )
    directory.mkdir(parents=True, exist_ok=True)
    if stream == "ULOG":
        return _of_autopilot(path, directory, navigation)
    observations = directory / f"{path.stem}.obs"
    command = [
        stream,
        str(path.absolute()),
        str(observations),
        str(directory / f"{path.stem}.nav"),
    ]
    week = ""
    if stream == "RTCM3":
        messages = read_navigation(navigation)
        median_toe = float(np.median(messages.table[:, TOE]))
        date = calendar_from_gps(messages.gps_week, median_toe, "gpst")
        command.append(f"{date:%Y,%m,%d,%H,%M,%S}")
        week = ", its week by the navigation files"
    _run([sys.executable, "-m", "insgnss.gnss.engine.convert_worker", *command], path)
    if not observations.is_file():
        raise DataError(
            f"{path}: {MAKERS[stream]}: the converter found no raw observations in it; let the"
            " receiver log them (UBX-RXM-RAWX, RTCM 1074 to 1127), or give RINEX"
        )
    for written in (observations, observations.with_suffix(".nav")):
        if written.is_file():
            refuse_cut_off(written)
    epochs = read_observations(observations).time.size
    finding = f"{path.name} is of {MAKERS[stream]}: {epochs} epochs as RINEX 3.04{week}"
    check = Question("receiver log", "RINEX, or a log that the converter reads").ok(finding)
    return RinexFile(observations, (check,))


def _of_autopilot(path: Path, directory: Path, navigation: tuple[Path, ...]) -> RinexFile:
    """Convert what a receiver sent to the autopilot of a PX4 log, as `convert_log` does a log.

    Raises
    ------
    DataError
        Where the log does not hold it, or no frames that the converter reads.
    """
    sent = directory / f"{path.stem}.from_receiver"
    sent.write_bytes(receiver_bytes(path))
    if not log_format(sent):
        raise DataError(
            f"{path}: PX4: holds no messages of its receiver (topic gps_dump); let the autopilot"
            " log them (GPS_DUMP_COMM), or give the receiver's own log or RINEX"
        )
    return convert_log(sent, directory, navigation)


def _run(command: list[str], path: Path) -> None:
    """Run the converter; DataError where it fails."""
    try:
        process = subprocess.run(
            command, capture_output=True, text=True, timeout=CONVERTED_WITHIN_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise DataError(
            f"{path}: the converter did not finish in {CONVERTED_WITHIN_S:g} s; {BY_HAND}"
        ) from None
    if process.returncode:
        last_line = (process.stderr.strip().splitlines() or ["nothing"])[-1]
        raise DataError(
            f"{path}: the converter stopped; it said: {last_line[:QUOTED_CHARACTERS]}; {BY_HAND}"
        )
