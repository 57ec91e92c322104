"""Gyros that read one number, mostly zero, as long as they turn slower than some rate.

Some devices hide what is below a threshold, or print a rate to a hundredth of a rad/s. While the
rate stays inside such a band of half-width d the reading stays the same, and its error is what the
rate changes: bounded by d, whatever it is, and lasting as long as the rate stays inside. Nothing in
the readings tells more, so the error is taken as evenly spread over the band and as correlated over
the time for which a reading that is inside goes on being inside,

    sigma = d / sqrt(3),   T = sum L^2 / sum L                                                 (D.1)

with L the lengths of the runs of that one number. It enters the noise model as a Gauss-Markov
process of the axis. Where noise lifts the readings out of the band at every other sample (dither),
T is an interval or two and the process is left out: it is below the white noise. The hidden bias
keeps its sign from run to run, so T is the whole of a run that a sample finds itself in, and not
the half of it that lies ahead. A stand makes it long, and so it must be: the gyros then read zero
and not their bias, which an update of zero rate would take for the bias itself.
"""

from dataclasses import dataclass

import numpy as np

from ...records import Array, ImuSamples
from .gaps import nominal_interval
from .stuck_channels import MOST_PROBED, run_edges

LEAST_SHARE_OF_ONE_VALUE = 0.1  # share of the samples that show one number
# of the white noise's power at low frequencies, from which on the band's error counts
LEAST_POWER_SHARE = 0.3
LONGEST_RUN_S = 60.0  # of a run: longer ones are stands, where the readings say nothing more


@dataclass(frozen=True)
class DeadBand:
    """A band of a gyro.

    Parameters
    ----------
    half_width : float, rad/s
        The smallest change that its readings show.
    share : float
        Of its samples inside.
    duration_s : float, s
        How long a reading inside goes on being inside (D.1).
    """

    half_width: float
    share: float
    duration_s: float

    @property
    def sigma(self) -> float:
        """Standard deviation of the error (D.1), rad/s."""
        return float(self.half_width / np.sqrt(3.0))

    def counts(self, white_noise: float) -> bool:
        """Whether the error counts beside a root power spectral density in rad/s/sqrt(Hz)."""
        return 2.0 * self.sigma**2 * self.duration_s > LEAST_POWER_SHARE * white_noise**2


def dead_bands(imu: ImuSamples) -> dict[int, DeadBand]:
    """Find the bands of an IMU's gyros.

    Parameters
    ----------
    imu : ImuSamples
        In the sensor's own axes.

    Returns
    -------
    dict of int to DeadBand
        By the number of the gyro.
    """
    interval = nominal_interval(imu.time)
    scale = 1.0 / interval if imu.quantity == "increments" else 1.0
    bands = (dead_band_of(column * scale, interval) for column in imu.gyro.T)
    return {k: band for k, band in enumerate(bands) if band is not None}


def dead_band_of(column: Array, interval_s: float) -> DeadBand | None:
    """Find the band of a gyro's readings.

    Parameters
    ----------
    column : ndarray, shape (n,), rad/s
    interval_s : float, s

    Returns
    -------
    DeadBand or None
        None where no number is read often.
    """
    values, counts = np.unique(column[:: -(-column.size // MOST_PROBED)], return_counts=True)
    usual = values[int(np.argmax(counts))]
    inside = column == usual
    share = float(inside.mean())
    if share < LEAST_SHARE_OF_ONE_VALUE or values.size < 2:
        return None
    half_width = float(np.abs(values[values != usual] - usual).min())
    edges = run_edges(inside)
    lengths = np.diff(edges)[inside[edges[:-1]]] * interval_s
    lengths = np.minimum(lengths, LONGEST_RUN_S)
    return DeadBand(half_width, share, float(np.sum(lengths**2) / np.sum(lengths)))
