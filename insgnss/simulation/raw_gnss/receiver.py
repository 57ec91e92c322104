"""A GNSS receiver on an exact motion.

Positions and velocities of its antenna, with errors, claims, latency and degraded periods.

The position of a fix is that of the antenna (S.2 of `sensors`) at the instant that the fix belongs
to, its stamp less the latency.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...geodesy.frames import LocalFrame
from ...navigation.noise_model.model import AxisNoise, GaussMarkov
from ...noise.processes.realisation import simulate_noise
from ...records import Array, GnssFixes
from ...records.qualities import Quality
from ..faults import in_period
from ..flights import FlightMotion
from ..motion import ExactMotion
from ..sensors import Rig, antenna_states


@dataclass(frozen=True)
class FixEpisode:
    """A period without fixed ambiguities.

    Times are s after the record's start, directions north, east, down.

    Parameters
    ----------
    quality : of `records.qualities`.
    sigma_m : of the error, which replaces that of the other fixes and has this `correlation_time_s`
        (0: white).
    claim_m : what the fixes say of it; None: the truth.
    """

    start_s: float
    duration_s: float
    quality: int = Quality.FLOAT
    sigma_m: tuple[float, float, float] = (0.3, 0.3, 0.5)
    correlation_time_s: float = 30.0
    claim_m: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if not (
            self.duration_s > 0.0 and self.correlation_time_s >= 0.0 and min(self.sigma_m) > 0.0
        ):
            raise UsageError(
                f"fixes of quality {self.quality} for {self.duration_s} s, sigma {self.sigma_m} m,"
                f" correlation time {self.correlation_time_s} s; duration and sigma must be"
                " positive, the correlation time not negative"
            )


@dataclass(frozen=True)
class GnssOptions:
    """How the receiver measures and errs.

    Directions are north, east, down, times s after the record's start.

    Parameters
    ----------
    sigma_m : white errors.
    correlated_sigma_m, correlation_time_s : a Gauss-Markov error on top.
    claim_correlated : whether the fixes claim the sum of both, or the white part alone.
    outlier_fraction, outlier_m : share of fixes displaced in a random direction, by a distance in
        this range, beyond their claim.
    outages : (start, duration) without fixes.
    episodes : of another quality; the fixes carry a quality where there is one.
    velocity_sigma_ms : None for no velocity.
    phase_s : of the stamps against full multiples of the interval in GPS time.
    latency_s : a fix stamped t belongs to t - latency_s; -18 for a receiver that gives UTC as GPS
        time.
    """

    rate_hz: float = 10.0
    sigma_m: tuple[float, float, float] = (0.02, 0.02, 0.03)
    correlated_sigma_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    correlation_time_s: float = 60.0
    claim_correlated: bool = True
    outlier_fraction: float = 0.0
    outlier_m: tuple[float, float] = (0.5, 5.0)
    outages: tuple[tuple[float, float], ...] = ()
    episodes: tuple[FixEpisode, ...] = ()
    velocity_sigma_ms: tuple[float, float, float] | None = None
    phase_s: float = 0.0
    latency_s: float = 0.0

    def __post_init__(self) -> None:
        if not self.rate_hz > 0.0 or not 0.0 <= self.outlier_fraction < 1.0:
            raise UsageError(
                f"GNSS at {self.rate_hz} Hz with a share of {self.outlier_fraction} outliers; use a"
                " positive rate and a share below 1"
            )


def simulate_gnss(
    flight: FlightMotion, rig: Rig, options: GnssOptions, rng: np.random.Generator
) -> tuple[GnssFixes, NDArray[np.bool_]]:
    """Fixes of the antenna, and which of them are outliers, (n,).

    Raises
    ------
    UsageError
        When outages leave none.
    """
    motion = flight.motion
    white, correlated, gross, bad = rng.spawn(4)
    stamp = _stamps(motion, options)
    instant = np.clip(stamp - options.latency_s, motion.start, motion.end)
    position, velocity = antenna_states(motion, rig.antenna_lever_b, instant)
    C_ln = motion.frame.C_ln_at(position)
    sigma_m, time_s, n = options.correlated_sigma_m, options.correlation_time_s, instant.size
    error = white.standard_normal((n, 3)) * options.sigma_m
    error += _correlated(sigma_m, time_s, n, options.rate_hz, correlated)
    claim = np.square(options.sigma_m) + np.square(sigma_m) * options.claim_correlated
    variance = np.broadcast_to(claim, (instant.size, 3)).copy()
    quality = np.full(instant.size, Quality.FIXED, dtype=np.int64)
    for episode, stream in zip(options.episodes, bad.spawn(len(options.episodes)), strict=True):
        inside = in_period(stamp - motion.start, episode.start_s, episode.duration_s)
        error[inside] = _correlated(
            episode.sigma_m, episode.correlation_time_s, int(inside.sum()), options.rate_hz, stream
        )
        variance[inside] = np.square(
            episode.sigma_m if episode.claim_m is None else episode.claim_m
        )
        quality[inside] = episode.quality
    outlier = gross.random(instant.size) < options.outlier_fraction
    direction = gross.standard_normal((instant.size, 3))
    direction *= (
        gross.uniform(*options.outlier_m, instant.size) / np.linalg.norm(direction, axis=1)
    )[:, None]
    error += outlier[:, None] * direction
    keep = np.ones(instant.size, dtype=bool)
    for outage in options.outages:
        keep &= ~in_period(stamp - motion.start, *outage)
    if not keep.any():
        raise UsageError(f"GNSS outages {options.outages} leave no fix; shorten them")
    velocity_ned, velocity_cov = _measured_velocity(
        np.einsum("nji,nj->ni", C_ln, velocity)[keep], options, white
    )
    lat, lon, height = _moved(motion.frame, position, C_ln, error)
    fixes = GnssFixes(
        stamp[keep],
        lat[keep],
        lon[keep],
        height[keep],
        variance[keep][:, :, None] * np.eye(3),
        velocity_ned,
        velocity_cov,
        quality=quality[keep] if options.episodes else None,
        gps_week=flight.gps_week,
        source="simulated GNSS",
    )
    return fixes, outlier[keep]


def _stamps(motion: ExactMotion, options: GnssOptions) -> Array:
    """Stamps on the receiver's grid, of instants within the motion."""
    shift = options.latency_s - options.phase_s
    first = np.ceil((motion.start + shift) * options.rate_hz - 1e-6)
    last = np.floor((motion.end + shift) * options.rate_hz + 1e-6)
    stamps = np.arange(first, last + 1.0) / options.rate_hz + options.phase_s
    return np.clip(stamps, motion.start + options.latency_s, motion.end + options.latency_s)


def _correlated(
    sigma_m: tuple[float, ...], time_s: float, n: int, rate_hz: float, rng: np.random.Generator
) -> Array:
    """(n, 3) m of Gauss-Markov processes, white where their time is zero."""
    if n == 0 or time_s == 0.0:
        return rng.standard_normal((n, 3)) * sigma_m
    axes = (AxisNoise(gauss_markov=(GaussMarkov.from_sigma(time_s, sigma),)) for sigma in sigma_m)
    return np.column_stack([simulate_noise(axis, n, 1.0 / rate_hz, rng) for axis in axes])


def _moved(
    frame: LocalFrame, position: Array, C_ln: Array, error_ned: Array
) -> tuple[Array, Array, Array]:
    return frame.geodetic_from_position(position + np.einsum("nij,nj->ni", C_ln, error_ned))


def _measured_velocity(
    truth: Array, options: GnssOptions, rng: np.random.Generator
) -> tuple[Array | None, Array | None]:
    if options.velocity_sigma_ms is None:
        return None, None
    cov = np.broadcast_to(np.diag(np.square(options.velocity_sigma_ms)), (len(truth), 3, 3))
    return truth + rng.standard_normal(truth.shape) * options.velocity_sigma_ms, cov
