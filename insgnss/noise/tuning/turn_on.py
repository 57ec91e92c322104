"""The constant part of the errors: what the means of static recordings tell of it, and what they
cannot.

A gyroscope at rest reads its bias and the Earth's rotation, 15 deg/h in all: the means are the bias
unless they are as small as that. An accelerometer reads its bias and gravity: only the part along
the vertical shows, as the excess of |mean| over 9.80665 m/s^2, and that only beyond +-0.015 m/s^2,
by which gravity varies over the Earth. The spread of the means over recordings is what changes from
turn-on to turn-on; that of the accelerometers holds what the mounting tilted in between.
"""

from collections.abc import Sequence

import numpy as np

from ...base.units import DEG_PER_H, MILLI_G, STANDARD_GRAVITY
from ...geodesy.earth import EARTH_RATE
from ...records import Array
from .recordings import StaticRecording

GRAVITY_SPREAD = 0.015  # m/s^2, by which gravity varies over the Earth: no bias below it shows
SEES_EARTH = 0.1  # of the Earth's rate, within which |mean rate| is it (chosen): 1.5 deg/h of bias


def turn_on_sigmas(
    recordings: Sequence[StaticRecording],
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the standard deviation of the turn-on bias from the means of recordings.

    Parameters
    ----------
    recordings : sequence of StaticRecording
        The recordings.

    Returns
    -------
    values : dict of str to float
        Standard deviation by sensor, rad/s and m/s^2; empty where only variances are known.
    notes : tuple of str
        A sentence on each.
    """
    blocks = [r.blocks for r in recordings if r.blocks is not None]
    if blocks and len(recordings[0].curves) < 6:
        return {}, ("some channels alone do not determine the turn-on bias: set it by hand",)
    if not blocks:
        return {}, (
            (
                "variances do not determine the turn-on bias: the noise model has none; set"
                " turn_on_bias by hand before processing"
            ),
        )
    gyro, accel = (
        np.array([b[sensor].mean(axis=0) for b in blocks]) for sensor in ("gyro", "accel")
    )
    rates = np.linalg.norm(gyro, axis=1)
    if (np.abs(rates / EARTH_RATE - 1.0) < SEES_EARTH).all():
        bias = float(np.sqrt(np.mean((rates - EARTH_RATE) ** 2)))
        how = f"difference of |mean rate| from the Earth's {EARTH_RATE / DEG_PER_H:.2f} deg/h"
    else:
        bias = float(np.sqrt(np.mean(gyro**2)))
        how = f"rms of the means, the Earth's rotation included{_spread(gyro, DEG_PER_H, 'deg/h')}"
    excess = float(np.sqrt(np.mean((np.linalg.norm(accel, axis=1) - STANDARD_GRAVITY) ** 2)))
    force = max(excess, GRAVITY_SPREAD)
    basis = f"along the vertical, the only direction that rest shows{_spread(accel, MILLI_G, 'mg')}"
    notes = (
        f"gyro turn_on_bias {bias / DEG_PER_H:.3g} deg/h: {how}",
        f"accel turn_on_bias {force / MILLI_G:.3g} mg: {basis}",
    )
    return {"gyro": bias, "accel": force}, notes


def _spread(means: Array, unit: float, name: str) -> str:
    """Return what changed from recording to recording, in words."""
    if len(means) < 2:
        return ""
    sd = means.std(axis=0, ddof=1) / unit
    tilt = (
        ", tilts included"
        if name == "mg"
        else "; if a calibration takes the common part away, this is what remains"
    )
    return (
        f"; over {len(means)} recordings the means spread by {sd[0]:.3g} {sd[1]:.3g} {sd[2]:.3g}"
        f" {name} (x y z){tilt}"
    )
