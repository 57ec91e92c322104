"""Camera events of a file of their own beside those that the rover recorded: whether both hold the
same pulses at the same time.

The two may differ by a constant alone, which is found by matching (`io.exposures.clocks`): d =
t_file
- t_rover, the rover's stamps with its clock taken off. Events of one pulse agree to what a
converter rounds, below `SAME_PULSE_S`. A larger constant (time offset) shifts every image along the
path, 18 s of UTC in the place of GPST by 180 m at 10 m/s, and nothing else shows it.
"""

import numpy as np

from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S, leap_seconds
from ...io.exposures.clocks import match_clocks
from ...records import Array, CameraEvents, Finding, Question

NAME = "camera events"
SAME_PULSE_S = 0.005  # between stamps of one pulse: converters round to a hundredth of a second
# matched events, and their share of the shorter list: fewer may match by chance (chosen)
FEWEST_MATCHED, LEAST_SHARE = 3, 0.5
EXPECTED = "those that the rover recorded"
MOST_DELAY_S = 0.5  # from trigger to exposure: shutters take less (chosen)


def check_beside(events: CameraEvents, rover: CameraEvents, gps_week: int) -> Finding | None:
    """Compare the events of a file with the rover's, both in GPST and without a camera's delay.

    Parameters
    ----------
    events, rover : CameraEvents
        Events of the file and of the rover.
    gps_week : int
        GPS week of events that have none.

    Returns
    -------
    Finding or None
        None for fewer than three of either; a contradiction where all are off by a constant, a note
        where no constant brings half of the fewer ones together.
    """
    week = gps_week if events.gps_week is None else events.gps_week
    rover_week = gps_week if rover.gps_week is None else rover.gps_week
    rover_time = rover.time + (rover_week - week) * WEEK_S
    fewer = min(events.time.size, rover_time.size)
    if fewer < FEWEST_MATCHED:
        return None
    leap = int(leap_seconds(GPS_EPOCH_UNIX_S + week * WEEK_S + float(np.median(rover_time))))
    offset, pairs = _constant_offset(events.time, rover_time, (0.0, float(-leap)))
    source = events.source or "the file"
    if pairs < max(FEWEST_MATCHED, LEAST_SHARE * fewer):
        finding = (
            f"no constant time offset matches more than {pairs} of the {events.time.size} events"
            f" of {source} to the {rover_time.size} events of the rover"
        )
        return Question(NAME, EXPECTED).note(finding, "are both of this flight and camera?")
    finding = (
        f"{pairs} of the {events.time.size} events of {source} and of the {rover_time.size}"
        " events of the rover are the same"
    )
    if abs(offset) <= SAME_PULSE_S:
        return Question(NAME, EXPECTED).ok(f"{finding}, {1e3 * offset:+.1f} ms apart")
    is_utc = abs(offset + leap) <= SAME_PULSE_S
    finding += f" but for {offset:+.3f} s"
    finding += f", the {leap} leap seconds: UTC?" if is_utc else ""
    advice = "give the file's events in GPST" + ("" if is_utc else ", at the pulses")
    advice += ", or leave the file out to use the rover's events"
    return Question(NAME, EXPECTED).contradiction(finding, advice)


def _constant_offset(
    time: Array, rover_time: Array, likely: tuple[float, ...]
) -> tuple[float, int]:
    """Return the offset, s, that matches most of `time` (n,) to `rover_time` (m,), and how many.

    At even intervals several offsets match as many: of these the first `likely` one is taken, else
    the smallest.
    """
    match = match_clocks(rover_time, time, SAME_PULSE_S)
    most_matched = time.size - len(match.images)
    steps = time[0] - rover_time
    for offset in (*likely, *steps[np.argsort(np.abs(steps))].tolist()):
        shifted = rover_time + offset
        residual = time - shifted[np.searchsorted(0.5 * (shifted[1:] + shifted[:-1]), time)]
        matched = residual[np.abs(residual) <= SAME_PULSE_S]
        if matched.size >= most_matched:
            return offset + float(np.mean(matched)), matched.size
    return match.offset_s, most_matched


def check_camera_delay(delay_s: float) -> Finding:
    """Report the delay, s, that is added to the events; a note where it exceeds `MOST_DELAY_S`."""
    finding = f"{delay_s:+g} s added to each event, from the pulse to the middle of the exposure"
    expected = f"{MOST_DELAY_S:g} s at most"
    if abs(delay_s) <= MOST_DELAY_S:
        return Question("camera delay", expected).ok(finding)
    return Question("camera delay", expected).note(
        finding,
        "cameras expose within tenths of a second of their pulse; give the delay in seconds",
    )
