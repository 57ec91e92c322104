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

from dataclasses import dataclass, replace

import numpy as np

from ..prepare.gaps import nominal_interval
from ..records import Array, Check, ImuSamples
from ..stochastic.model import GaussMarkov, NoiseModel

OFTEN = 0.1  # share of the samples that show one number
PROBED = 200_000
# of the white noise's power at low frequencies, from which on the band's error counts
COUNTS = 0.3
LONGEST_S = 60.0  # of a run: longer ones are stands, where the readings say nothing more


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
    def process(self) -> GaussMarkov:
        """The error as a process (D.1)."""
        return GaussMarkov.from_sigma(self.duration_s, self.half_width / np.sqrt(3.0))


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
    values, counts = np.unique(column[:: -(-column.size // PROBED)], return_counts=True)
    usual = values[int(np.argmax(counts))]
    inside = column == usual
    share = float(inside.mean())
    if share < OFTEN or values.size < 2:
        return None
    half_width = float(np.abs(values[values != usual] - usual).min())
    edges = np.flatnonzero(np.concatenate([[True], inside[1:] != inside[:-1], [True]]))
    lengths = np.diff(edges)[inside[edges[:-1]]] * interval_s
    lengths = np.minimum(lengths, LONGEST_S)
    return DeadBand(half_width, share, float(np.sum(lengths**2) / np.sum(lengths)))


def with_dead_bands(
    imu: ImuSamples, C_b_imu: Array, noise: NoiseModel
) -> tuple[NoiseModel, list[Check]]:
    """Add the errors of dead bands to a noise model.

    Parameters
    ----------
    imu : ImuSamples
        In the sensor's own axes.
    C_b_imu : ndarray, shape (3, 3)
        IMU axes to body.
    noise : NoiseModel
        Of the body's axes.

    Returns
    -------
    tuple of NoiseModel, list of Check
        The model, and a note that names the gyros; the same model and none without a band.
    """
    interval = nominal_interval(imu.time)
    scale = 1.0 / interval if imu.quantity == "increments" else 1.0
    gyro, named = list(noise.gyro), []
    for k, column in enumerate(imu.gyro.T):
        band = dead_band_of(column * scale, interval)
        if band is None:
            continue
        axis = int(np.argmax(np.abs(C_b_imu[:, k])))
        sigma = band.half_width / np.sqrt(3.0)
        if 2.0 * sigma**2 * band.duration_s < COUNTS * gyro[axis].white_noise ** 2:
            continue
        processes = (*gyro[axis].gauss_markov, band.process)
        gyro[axis] = replace(gyro[axis], gauss_markov=processes)
        named.append(
            f"{'xyz'[k]} (one number in {100.0 * band.share:.0f} % of the samples, next to it"
            f" {np.degrees(band.half_width):.2g} deg/s, for {band.duration_s:.2g} s)"
        )
    if not named:
        return noise, []
    note = Check(
        "IMU noise",
        f"dead band or coarse resolution of gyro {', '.join(named)}; an error of that size and"
        " length was added to the noise model",
        "readings that follow every slow turn",
        "note",
        "let the device write its raw rates with all digits: heading is worse by what they hide",
    )
    return replace(noise, gyro=(gyro[0], gyro[1], gyro[2])), [note]
