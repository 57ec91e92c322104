"""The one door of this room for samples: from IMUs as they were read to what is estimated from.

`prepare_imu` leaves out stuck channels, applies sign, time offset, calibration and week, combines
several IMUs to one, and finds gyros with a dead band and the stationary periods. What a segment
needs besides, which the marks of its fixes and exposures decide, the result makes of itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geodesy.gpstime import WEEK_S
from ...records import Array, Finding, GnssFixes, ImuSamples, Increments
from ...records.observations import in_week
from .calibration import ImuCalibration
from .dead_band import DeadBand, dead_bands
from .gaps import edges, segments
from .increments import body_increments, merge_marks
from .several_imus.combine import combine
from .stationarity import StationaryPeriods, stationary_periods
from .stuck_channels import STUCK_S, without_stuck_channels

THERMOMETER_S = 10.0  # of the means of temperatures (s): an IMU does not follow faster (chosen)
LEAST_RANGE = 10.0  # sigmas of these means, of which a temperature that matters has a wider range


@dataclass(frozen=True, eq=False)
class Device:
    """An IMU as it was read, and what is known of it.

    Parameters
    ----------
    samples : ImuSamples
        In its own axes, as its file has them.
    C_b_imu : ndarray, shape (3, 3)
        Its axes to body.
    lever_m : tuple of float
        From the first IMU to it, body axes, m.
    accel_sign : float
        -1 where the accelerometers give the reaction to the specific force.
    time_offset_s : float
        What is added to its stamps, s.
    calibration : ImuCalibration or None
        Its deterministic calibration.
    white_noise : tuple of float
        White noise root densities of gyros (rad/s/sqrt(Hz)) and accelerometers (m/s^2/sqrt(Hz)),
        by which several IMUs are weighed.
    """

    samples: ImuSamples
    C_b_imu: Array
    lever_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accel_sign: float = 1.0
    time_offset_s: float = 0.0
    calibration: ImuCalibration | None = None
    white_noise: tuple[float, float] = (1.0, 1.0)

    def moved(self, offset_s: float) -> "Device":
        """Return the IMU with its stamps moved by `offset_s`, s."""
        return replace(self, time_offset_s=self.time_offset_s + offset_s)

    def span_s(self, week: int) -> Array:
        """Return first and last stamp (2,), s of a GPS week."""
        samples = self.samples
        whole = 0.0 if samples.gps_week is None else (samples.gps_week - week) * WEEK_S
        return np.asarray(samples.time[[0, -1]] + self.time_offset_s + whole)

    def in_shape(self, week: int) -> ImuSamples:
        """Return the samples as they are estimated from.

        Parameters
        ----------
        week : int
            The GPS week whose seconds the stamps are to count.

        Returns
        -------
        ImuSamples
            Calibrated, without stuck channels, acceleration with the sign of specific force.
        """
        imu = without_stuck_channels(self.samples, STUCK_S)
        if self.accel_sign < 0:
            imu = replace(imu, accel=-imu.accel)
        if self.time_offset_s:
            imu = replace(imu, time=imu.time + self.time_offset_s)
        return in_week(imu if self.calibration is None else self.calibration.apply(imu), week)


@dataclass(frozen=True, eq=False)
class PreparedImu:
    """The samples of a recording, and what they say of themselves.

    Parameters
    ----------
    samples : ImuSamples
        In the axes that `C_b_imu` takes into those of the body; of several IMUs in body axes.
    C_b_imu : ndarray, shape (3, 3)
        Takes the axes of the samples into those of the body.
    stationary : StationaryPeriods
        The stationary periods that hold a fix.
    dead_bands : mapping of int to DeadBand
        By the number of the gyro.
    weight : ndarray, shape (m, 2), or None
        Shares of each of m IMUs in gyro and accelerometer; None of a single one.
    checks : tuple of Finding
        What several IMUs say of each other.
    """

    samples: ImuSamples
    C_b_imu: Array
    stationary: StationaryPeriods
    dead_bands: Mapping[int, DeadBand]
    weight: Array | None = None
    checks: tuple[Finding, ...] = ()

    def segments(self, lo: float, hi: float) -> list[tuple[float, float]]:
        """Return begin and end, s, of the segments of [lo, hi] between gaps that are not bridged.

        Parameters
        ----------
        lo, hi : float, s

        Returns
        -------
        list of tuple of float
        """
        return segments(self.samples.time, lo, hi)

    def increments(
        self, lo: float, hi: float, *times: Array
    ) -> tuple[Increments, list[np.ndarray]]:
        """Integrate the samples of a segment, split at instants and at both ends of every gap.

        Parameters
        ----------
        lo, hi : float, s
            First and last instant of the segment.
        *times : ndarray, shape (n_i,), s
            Sorted instants.

        Returns
        -------
        tuple of Increments and list of ndarray of int, shape (n_i,)
            The increments, and for each of `times` the marks of its instants.

        Raises
        ------
        DataError
            Where the recording does not show how well a gap is bridged.
        """
        marks, (*rows, _) = merge_marks(*times, edges(self.samples.time, lo, hi))
        return body_increments(self.samples, self.C_b_imu, marks), rows

    def temperature(self, times: Array) -> Array:
        """Return the temperature of the sensor above its mean, in its range over the recording.

        Parameters
        ----------
        times : ndarray, shape (m,), s
            Instants.

        Returns
        -------
        Array
            (m,), of means over `THERMOMETER_S`, since thermometers are coarse and noisy; zeros
            where there is none, or where its range is less than `LEAST_RANGE` of their noise.
        """
        if self.samples.temperature is None:
            return np.zeros(times.size)
        from scipy.ndimage import uniform_filter1d

        time, value = self.samples.time, self.samples.temperature
        width = max(int(THERMOMETER_S / float(np.median(np.diff(time)))), 1)
        smooth = uniform_filter1d(value, width, mode="nearest")
        noise = float(np.std(value - smooth)) / np.sqrt(width)
        span = float(np.ptp(smooth))
        if span <= LEAST_RANGE * noise:
            return np.zeros(times.size)
        return (np.interp(times, time, smooth) - float(smooth.mean())) / span

    def without_samples(self) -> "PreparedImu":
        """Return the same with the first and the last sample alone."""
        return replace(self, samples=self.samples[[0, -1]])

    def without_stationary(self) -> "PreparedImu":
        """Return the same without stationary periods."""
        none = np.zeros(len(self.stationary), dtype=np.bool_)
        return replace(self, stationary=self.stationary.where(none))


def prepare_imu(devices: Sequence[Device], gnss: GnssFixes, week: int) -> PreparedImu:
    """Prepare the samples of a recording.

    Parameters
    ----------
    devices : sequence of Device
        Its IMUs, the first one first.
    gnss : GnssFixes
        The fixes, on the clock of the recording.
    week : int
        The GPS week whose seconds the stamps are to count.

    Returns
    -------
    PreparedImu

    Raises
    ------
    InputError
        Where several IMUs do not make one.
    """
    imus = [device.in_shape(week) for device in devices]
    imu, C_b_imu, weight, checks = imus[0], devices[0].C_b_imu, None, tuple[Finding, ...]()
    if len(imus) > 1:
        combined = combine(
            imus,
            [device.C_b_imu for device in devices],
            [device.lever_m for device in devices],
            [device.white_noise for device in devices],
        )
        imu, C_b_imu = combined.samples, np.eye(3)
        weight, checks = combined.weight, combined.checks
    stationary = stationary_periods(imu, gnss)
    first_fix, end_fix = (np.searchsorted(gnss.time, stationary.time[:, k]) for k in (0, 1))
    stationary = stationary.where(end_fix > first_fix)
    return PreparedImu(imu, C_b_imu, stationary, dead_bands(imu), weight, checks)
