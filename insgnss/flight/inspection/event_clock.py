"""Whose clock stamps the exposures (`camera.clock`), where the recording tells it.

    of the receiver   its own file of marks (.MRK); the file of the fixes holds them and that of the
                      samples does not; they carry the GPS week as the fixes do, and the samples,
                      which count seconds of their own, do not
    of the IMU        the log of the samples holds them; each stamp is that of a sample

Where both clocks could be meant nothing is told, and the flight file says so.
"""

from dataclasses import replace

import numpy as np

from ...base.errors import InsgnssError
from ...io.formats import read_events, sniff_events
from ...navigation.recognise.turns import ENOUGH_IMAGES, exposures_off_lines
from ...records import CameraEvents, GnssFixes, ImuSamples
from ...records.observations import in_week
from .sources import InputSource

SAME_SAMPLE_S = 1e-6  # from a stamp of an event to that of a sample: tables print microseconds
FEWEST_OF_SAMPLES = 5  # stamps that are those of samples
# digits of a stamp of an event per sample interval: rounding does not make them equal
LONGER = 20.0
SCALE_OPEN = (
    "the file does not state the time scale of its dates, and UTC was assumed; choose utc, gpst "
    "(18 s apart) or local time such as utc+02:00"
)
HOURS = range(-12, 15)  # zones of the clocks of cameras, h ahead of UTC
# share of the exposures that may lie off the lines in the right scale: ferry, a start in a turn
OFF_LINES = 0.05
# times as many, and images more, that lie off them in every other scale: 18 s late, 18 s of images
# at each line's end lie in the turn behind it
CLEARER, FEWEST_OFF = 4.0, 5


def clock_of_events(
    sources: tuple[InputSource, InputSource | None, InputSource | None],
    imu: ImuSamples,
    gnss: GnssFixes | None,
    events: CameraEvents | None,
) -> tuple[str, str, bool]:
    """Tell whose clock stamps the exposures.

    Parameters
    ----------
    sources : tuple
        Of samples, fixes and exposures.
    imu, gnss, events : records
        As the files have them, before they were brought into one week.

    Returns
    -------
    tuple of str, str, bool
        "imu" or "receiver", why, and whether the recording tells it.
    """
    of_imu, of_gnss, of_events = sources
    form = "" if of_events is None else sniff_events(of_events.path)
    if gnss is None or events is None or of_gnss is None or of_events is None:
        return "imu", "no fixes, or no exposures", False
    if of_events.path == of_imu.path:
        return (
            "imu",
            ("the exposures are in the log of the IMU, on the IMU's clock"),
            True,
        )
    if of_events.path == of_gnss.path:
        return "receiver", "the exposures are in the file of the fixes", True
    if form == "mrk":
        return (
            "receiver",
            ("exposures in a file of marks (.MRK) of the drone's receiver"),
            True,
        )
    if form == "events_pos":
        return (
            "receiver",
            "the exposures are time marks of the receiver, as RTKLIB writes them",
            True,
        )
    if events.gps_week is not None and gnss.gps_week is not None and imu.gps_week is None:
        why = "exposures and fixes have a GPS week or date; the IMU samples only count seconds"
        return "receiver", why, True
    if _are_samples(events, imu):
        return "imu", "each time stamp is that of an IMU sample", True
    return (
        "receiver",
        "the files do not show which clock stamps the exposures, and the IMU's is assumed; if it "
        'is the receiver\'s (event input, hot-shoe), set "receiver", and a time offset of the '
        "fixes then moves the exposures, too",
        False,
    )


def scale_of_dates(
    source: InputSource, events: CameraEvents, gnss: GnssFixes
) -> tuple[InputSource, CameraEvents]:
    """Choose the time scale of dates that do not state it: that in which they lie on lines.

    UTC, GPST and whole hours ahead of UTC are tried; the source says what was found, and is left
    open where two would do.

    Parameters
    ----------
    source : InputSource
        Of the exposures, read as UTC.
    events : CameraEvents
    gnss : GnssFixes
        In the week of the events, or without one.
    """
    count, week = events.time.size, events.gps_week
    if "time_scale" not in source.keys or week is None or count < ENOUGH_IMAGES:
        return source, events
    if gnss.gps_week is None:  # a clock of its own, which shows no scale
        return source, events
    columns = source.keys.get("columns")
    fixes = in_week(gnss, week)
    scales = ("utc", "gpst", *(f"utc{hours:+03d}:00" for hours in HOURS if hours))
    read = {s: read_events(source.path, columns=columns, time_scale=s) for s in scales}
    times = [in_week(read[scale], week).time for scale in scales]
    misses = dict(zip(scales, exposures_off_lines(times, fixes), strict=True))
    best_scale, second_scale = sorted(misses, key=lambda scale: misses[scale])[:2]
    if misses[best_scale] > OFF_LINES * count or misses[second_scale] < max(
        CLEARER * misses[best_scale], FEWEST_OFF
    ):
        return source, events
    why = (
        f"the file does not state the time scale: with {best_scale} {count - misses[best_scale]} "
        f"of {count} exposures lie on straight flight lines, with {second_scale} "
        f"{count - misses[second_scale]}"
    )
    keys = source.keys | {"time_scale": best_scale}
    return replace(source, keys=keys, why=source.why | {"time_scale": why}), read[best_scale]


def on_clock_of_samples(
    source: InputSource, events: CameraEvents, of_imu: InputSource, imu: ImuSamples
) -> tuple[InputSource, CameraEvents]:
    """Take the exposures by the column that stamps the samples, where their own does not reach.

    Autopilots stamp every table with the time since power-up, some besides with another clock.

    Parameters
    ----------
    source, events
        The exposures.
    of_imu, imu
        The samples.
    """
    in_recording = (imu.time[0] <= events.time) & (events.time <= imu.time[-1])
    columns, stamp = source.keys.get("columns"), of_imu.keys.get("columns")
    if in_recording.any() or not isinstance(columns, dict) or not isinstance(stamp, dict):
        return source, events
    on_sample_clock = {**columns, "tow": stamp["tow"]}
    on_sample_clock.pop("week", None)
    units = {"units": {"time": of_imu.keys.get("units", {}).get("time", "s")}}
    try:
        read = read_events(source.path, columns=on_sample_clock, **units)
    except InsgnssError:  # no such column, or no clock
        return source, events
    if not ((imu.time[0] <= read.time) & (read.time <= imu.time[-1])).any():
        return source, events
    why = "the column of this name also has the time stamps of the IMU samples"
    keys = source.keys | {"columns": on_sample_clock} | units
    return replace(
        source, keys=keys, why=source.why | dict.fromkeys(("columns", *units), why)
    ), read


def _are_samples(events: CameraEvents, imu: ImuSamples) -> bool:
    """Tell whether the events bear stamps of samples, by more than their rounding."""
    if events.time.size < FEWEST_OF_SAMPLES:
        return False
    sample_row = np.clip(np.searchsorted(imu.time, events.time), 1, imu.time.size - 1)
    gap = np.minimum(
        np.abs(imu.time[sample_row] - events.time), np.abs(imu.time[sample_row - 1] - events.time)
    )
    # stamps rounded to the interval of the samples would be theirs by chance
    interval = float(np.median(np.diff(imu.time)))
    grid = np.abs(events.time / interval - np.round(events.time / interval))
    return bool(gap.max() < SAME_SAMPLE_S and (grid.max() > 1.0 / LONGER or _is_uneven(imu.time)))


def _is_uneven(time: np.ndarray) -> bool:
    """Tell whether stamps are those of a clock, not multiples of an interval."""
    step = np.diff(time)
    return bool(np.ptp(step) > 1e-3 * float(np.median(step)))
