"""Whose clock stamps the exposures (`camera.clock`), where the recording tells it.

    of the receiver   its own file of marks (.MRK); the file of the fixes holds them and that of the
                      samples does not; they carry the GPS week as the fixes do, and the samples,
                      which count seconds of their own, do not
    of the IMU        the log of the samples holds them; each stamp is that of a sample

Where both clocks could be meant nothing is told, and the flight file says so.
"""

import numpy as np

from ...records import CameraEvents, GnssFixes, ImuSamples
from .sources import Source

SAME_S = 1e-6
FEWEST = 5  # stamps that are those of samples
LONGER = (
    20.0  # digits of a stamp of an event per sample interval: rounding does not make them equal
)


def clock_of_events(
    sources: tuple[Source, Source | None, Source | None],
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
    from ...io.formats import sniff_events

    of_imu, of_gnss, of_events = sources
    form = "" if of_events is None else sniff_events(of_events.path)
    if gnss is None or events is None or of_gnss is None or of_events is None:
        return "imu", "no fixes, or no exposures", False
    if of_events.path == of_imu.path:
        return "imu", "the log of the samples stamps them by its own clock", True
    if of_events.path == of_gnss.path:
        return "receiver", "the file of the fixes holds them", True
    if form == "mrk":
        return "receiver", "a file of marks (.MRK), which the receiver of the drone writes", True
    if form == "events_pos":
        return "receiver", "time marks of the receiver, as RTKLIB writes them", True
    if events.gps_week is not None and gnss.gps_week is not None and imu.gps_week is None:
        why = "they carry GPS week or date as the fixes do; the samples count seconds of their own"
        return "receiver", why, True
    if _are_samples(events, imu):
        return "imu", "each stamp is that of a sample", True
    return (
        "receiver",
        "the files do not tell whose clock stamps the exposures: the IMU's is taken; where the"
        " receiver did it (event input, hot-shoe), say so: an offset of the fixes moves them too",
        False,
    )


def _are_samples(events: CameraEvents, imu: ImuSamples) -> bool:
    """Tell whether the events bear stamps of samples, by more than their rounding."""
    if events.time.size < FEWEST:
        return False
    near = np.clip(np.searchsorted(imu.time, events.time), 1, imu.time.size - 1)
    off = np.minimum(np.abs(imu.time[near] - events.time), np.abs(imu.time[near - 1] - events.time))
    # stamps rounded to the interval of the samples would be theirs by chance
    interval = float(np.median(np.diff(imu.time)))
    grid = np.abs(events.time / interval - np.round(events.time / interval))
    return bool(off.max() < SAME_S and (grid.max() > 1.0 / LONGER or _uneven(imu.time)))


def _uneven(time: np.ndarray) -> bool:
    """Tell whether stamps are those of a clock, not multiples of an interval."""
    step = np.diff(time)
    return bool(np.ptp(step) > 1e-3 * float(np.median(step)))
