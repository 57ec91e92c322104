"""What two GNSS receivers measure: codes, phases, Doppler and C/N0.

They are a rover on an exact motion and a base beside it.

A receiver with the clock offset dt writes at T = t + dt of its clock what it receives at t. With
the range rho, and dts the offset of the satellite's clock when the signal was sent (`raw_paths`;
relativity is in it),

    P = rho + c (dt - dts) + T + I (f1/f)^2 + B + noise                                        (R.1)
    L lambda = rho + c (dt - dts) + T - I (f1/f)^2 + (N + b) lambda + noise                    (R.2)
    D = -((rho' - c dts' (1 - rho'/c) + T' - I' (f1/f)^2) (1 - dt') + c dt') / lambda + noise  (R.3)

that is, the Doppler is the rate of the phase by the receiver's clock, by which dt' is meant. T and
I are of the air (`raw_air`), N integers that change with lock (`raw_errors`). The receiver's own
biases are constant: B of codes for each system and band (the difference of systems is in it) and
for each GLONASS frequency number, b a part of a cycle for each system and band, and of GLONASS
phases a length for each frequency number.

Noise and reflections, air, clocks, slips and losses follow real ones in size and kind. Left out is
what receivers a few kilometres apart share (tides, delays between a satellite's signals, bending of
rays), the phase centres of antennas, and the wind-up of phases: a turn in heading is the same cycle
on all satellites, but a bank of 30 degrees would move the apparent antenna by a centimetre along
the roll axis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.advance import share
from ...base.errors import UsageError
from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from ...gnss.rinex.navigation_message import Navigation
from ...records import Array, CameraEvents
from ..flights import FlightMotion
from ..sensors import Rig, antenna_states
from .atmosphere import SimulatedIonosphere, Troposphere, Weather
from .constellation import constellation
from .errors import Locks, clock, noise, track
from .options import RawGnssOptions
from .paths import LIGHT, Paths, ReceiverAntenna, Satellites, satellites_in_view, signal_paths

Index = NDArray[np.int64]

SIGNALS = ("C1", "P2", "L1", "L2", "D1", "D2", "S1", "S2")
GPS_HZ = (1575.42e6, 1227.60e6)  # L1, L2 (IS-GPS-200)
# L1, L2 of channel 0 and from one channel to the next (GLONASS ICD)
GLONASS_HZ, GLONASS_STEP_HZ = (1602.0e6, 1246.0e6), (0.5625e6, 0.4375e6)
BASE_MARGIN_S = 5.0  # of the base's record beyond the rover's
# in the antenna's plane, more at its zenith, less on L2, noise
STRENGTH_DBHZ = 30.0, 20.0, 6.0, 0.7
FEWEST_EPOCHS = 5  # of a recording (chosen)
FEWEST_ABOVE_MASKS = 5  # above the masks at any epoch: four give a position, one more a check
GLONASS_CHANNEL_COUNT = 14  # -7 to 6
LOWEST_STRENGTH_DEG = 3.0  # elevation below which noise and delays are those at it (chosen)


@dataclass(frozen=True, eq=False)
class RawObservations:
    """What one receiver writes, and the truth at its epochs.

    It has n epochs and m rows (a satellite in an epoch).

    Parameters
    ----------
    gps_week : of all times.
    stamp : (n,) s, by the receiver's clock, on its grid: the epoch's time in the file.
    epoch : (m,) place of the row's epoch, not decreasing.
    satellite : (m,) "G05", sorted within an epoch.
    values : (m, 8) in the order of `SIGNALS`: m, m, cycles, cycles, Hz, Hz, dB-Hz, dB-Hz; NaN where
        not tracked.
    loss_of_lock : (m, 2) of L1 and L2: 0, or 1 where the receiver says so (RINEX bit 0).
    time : (n,) s, true GPST of the epochs.
    clock_s : (n,) receiver's clock minus GPST, stamp = time + clock_s.
    position, velocity : (n, 3) m, m/s, ECEF, of the antenna's phase centre at `time`.
    """

    gps_week: int
    stamp: Array
    epoch: Index
    satellite: NDArray[np.str_]
    values: Array
    loss_of_lock: NDArray[np.int8]
    time: Array
    clock_s: Array
    position: Array
    velocity: Array


@dataclass(frozen=True, eq=False)
class Slips:
    """Cycle slips (k,) of a receiver.

    They have stamp s, satellite, cycles (k, 2) on L1 and L2, reported (k,) as loss of lock or not.
    """

    stamp: Array
    satellite: NDArray[np.str_]
    cycles: Index
    reported: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SimulatedGnss:
    """Raw GNSS data of a flight.

    Parameters
    ----------
    rover, base : observations with their truth.
    navigation : the messages.
    events : (e,) s, camera events by the rover's clock.
    base_position_m : (3,) m, ECEF, of the base's phase centre.
    weather : true, at the base.
    """

    rover: RawObservations
    base: RawObservations
    navigation: Navigation
    events: Array
    base_position_m: Array
    weather: Weather
    rover_slips: Slips
    base_slips: Slips
    options: RawGnssOptions


@dataclass(frozen=True, eq=False)
class _Scene:
    """What both receivers share: the flight, satellites and air, and the options."""

    flight: FlightMotion
    satellites: Satellites
    troposphere: Troposphere
    ionosphere: SimulatedIonosphere
    options: RawGnssOptions


@dataclass(frozen=True)
class _Receiver:
    """What is a receiver's own.

    It has a rate, a share of the rates of slips and losses, and a bias of GLONASS phases for each
    number, m.
    """

    rate_hz: float
    share: float
    phase_slope_m: float


def simulate_raw_gnss(
    flight: FlightMotion,
    rig: Rig,
    events: CameraEvents,
    options: RawGnssOptions,
    rng: np.random.Generator,
) -> SimulatedGnss:
    """Raw data of rover and base over a whole flight.

    Parameters
    ----------
    events : of the same flight, at their true times.

    Raises
    ------
    UsageError
        Where the masks leave a receiver fewer than five satellites.
    """
    common, moving, standing, clocks = rng.spawn(4)
    rover = _rover(flight, rig, options, clocks)
    position, height = _base_place(flight, options)
    base = _base(rover, position, options, clocks)
    span = (float(base.time[0]), float(base.time[-1]))
    navigation = constellation(
        flight.gps_week, *span, options.systems, int(common.integers(1 << 31))
    )
    view = satellites_in_view(
        navigation, position, span, options.elevation_mask_deg, options.broadcast_error_m, common
    )
    scene = _Scene(
        flight,
        view,
        Troposphere(options.weather, height),
        _ionosphere(options, position, common),
        options,
    )
    share(0.3)
    rover_data, rover_slips = _observe(
        rover, scene, _Receiver(options.rate_hz, 1.0, options.glonass_phase_bias_m), moving
    )
    share(0.7)
    base_data, base_slips = _observe(
        base, scene, _Receiver(options.base_rate_hz, options.base_share, 0.0), standing
    )
    by_rover = events.time + _clock_at(events.time, rover, options.clock_jump_s)
    return SimulatedGnss(
        rover=rover_data,
        base=base_data,
        navigation=navigation,
        events=by_rover,
        base_position_m=position,
        weather=options.weather,
        rover_slips=rover_slips,
        base_slips=base_slips,
        options=options,
    )


def _rover(
    flight: FlightMotion, rig: Rig, options: RawGnssOptions, rng: np.random.Generator
) -> ReceiverAntenna:
    motion, frame = flight.motion, flight.motion.frame
    first = np.ceil(motion.start * options.rate_hz - 1e-6)
    last = np.floor(motion.end * options.rate_hz + 1e-6)
    stamp = np.arange(first, last + 1.0) / options.rate_hz
    if stamp.size < FEWEST_EPOCHS:
        raise UsageError(
            f"raw GNSS: {stamp.size} epochs at {options.rate_hz:g} Hz (limit {FEWEST_EPOCHS});"
            " raise rate_hz or fly longer"
        )
    offset, rate = _clock(stamp.size, 1.0 / options.rate_hz, options, rng)
    keep = (stamp - offset >= motion.start) & (stamp - offset <= motion.end)
    stamp, offset, rate = stamp[keep], offset[keep], rate[keep]
    time = stamp - offset
    position, velocity = antenna_states(motion, rig.antenna_lever_b, time)
    ecef = frame.origin_ecef + position @ frame.C_el.T
    up = -(frame.C_el @ motion.C_lb(time))[:, :, 2]
    return ReceiverAntenna(
        stamp, time, offset, rate, ecef, velocity @ frame.C_el.T, up, motion.angles(time)[:, 0]
    )


def _base_place(flight: FlightMotion, options: RawGnssOptions) -> tuple[Array, float]:
    """Position (3,) m, ECEF, and height, m, of the base."""
    frame = flight.motion.frame
    lat, lon, _ = frame.geodetic_from_position(
        [options.base_offset_m[0], options.base_offset_m[1], 0.0]
    )
    height = frame.height + options.base_offset_m[2]
    return geodetic_to_ecef(lat, lon, height), height


def _base(
    rover: ReceiverAntenna, position: Array, options: RawGnssOptions, rng: np.random.Generator
) -> ReceiverAntenna:
    rate_hz = options.base_rate_hz
    first, last = (
        np.floor((rover.stamp[k] + margin) * rate_hz)
        for k, margin in ((0, -BASE_MARGIN_S), (-1, BASE_MARGIN_S))
    )
    stamp = np.arange(first, last + 1.0) / rate_hz
    offset, rate = _clock(stamp.size, 1.0 / rate_hz, options, rng)
    lat, lon, _ = ecef_to_geodetic(position)
    zero, up = np.zeros((stamp.size, 3)), -rotation_en(lat, lon)[:, 2]
    return ReceiverAntenna(
        stamp,
        stamp - offset,
        offset,
        rate,
        zero + position,
        zero,
        zero + up,
        np.zeros(stamp.size),
    )


def _clock(
    n: int, interval: float, options: RawGnssOptions, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Offset (n,) s as written, and its rate (n,) without the jumps."""
    offset = clock(n, interval, options.clock_offset_s, options.clock_drift, rng)
    jumps = (
        options.clock_jump_s * np.round(offset / options.clock_jump_s)
        if options.clock_jump_s > 0.0
        else 0.0
    )
    return offset - jumps, np.gradient(offset, interval)


def _clock_at(time: Array, receiver: ReceiverAntenna, jump_s: float) -> Array:
    """Clock minus GPST (k,) s at instants (k,) of GPST.

    It is linear between epochs but for the jumps, which come with the later epoch.
    """
    if jump_s == 0.0:
        return np.interp(time, receiver.time, receiver.clock_s)
    jumps = np.concatenate(
        [[0.0], np.cumsum(jump_s * np.round(np.diff(receiver.clock_s) / jump_s))]
    )
    last = np.clip(
        np.searchsorted(receiver.time, time, side="right") - 1, 0, receiver.time.size - 1
    )
    return np.interp(time, receiver.time, receiver.clock_s - jumps) + jumps[last]


def _ionosphere(
    options: RawGnssOptions, position: Array, rng: np.random.Generator
) -> SimulatedIonosphere:
    """The shell around the base's place, ECEF (3,) m."""
    slope, wave, phase = rng.uniform(0.0, 2.0 * np.pi, 3)
    gradient = (options.iono_gradient * np.cos(slope), options.iono_gradient * np.sin(slope))
    lat, lon, _ = ecef_to_geodetic(position)
    return SimulatedIonosphere(
        (float(lat), float(lon)),
        options.iono_vertical_m,
        options.iono_rate_ms,
        gradient,
        options.iono_wave_m,
        (float(np.cos(wave)), float(np.sin(wave))),
        phase,
    )


def _observe(
    antenna: ReceiverAntenna, scene: _Scene, receiver: _Receiver, rng: np.random.Generator
) -> tuple[RawObservations, Slips]:
    """Observations and slips of one receiver."""
    options, satellites = scene.options, scene.satellites
    lock_rng, noise_rng, bias_rng = rng.spawn(3)
    paths = signal_paths(antenna, satellites)
    visible = paths.elevation > np.radians(options.elevation_mask_deg)
    visible &= paths.antenna_sine > np.sin(np.radians(options.antenna_mask_deg))
    count = visible.sum(axis=1)
    if (count < FEWEST_ABOVE_MASKS).any():
        least = int(np.argmin(count))
        shortage = (
            f"{count[least]} satellites above the masks at {antenna.time[least]:.1f} s (limit"
            f" {FEWEST_ABOVE_MASKS})"
        )
        raise UsageError(f"raw GNSS: {shortage}; lower a mask")
    tracking = options.tracking.times(receiver.share)
    locks = track(visible, antenna.bank, 1.0 / receiver.rate_hz, tracking, lock_rng)
    epoch, column = np.nonzero(locks.held[:, :, 0])
    values = _values(antenna, scene, paths, locks, receiver, (noise_rng, bias_rng))[epoch, column]
    k, j = np.nonzero(locks.slips.any(axis=2))
    slips = Slips(
        antenna.stamp[k],
        satellites.code[j],
        locks.slips[k, j],
        np.asarray(locks.report[k, j].any(axis=1)),
    )
    report = locks.report[epoch, column].astype(np.int8)
    truth = (antenna.time, antenna.clock_s, antenna.position, antenna.velocity)
    rows = (epoch, satellites.code[column], values, report)
    return RawObservations(scene.flight.gps_week, antenna.stamp, *rows, *truth), slips


def _values(
    antenna: ReceiverAntenna,
    scene: _Scene,
    paths: Paths,
    locks: Locks,
    receiver: _Receiver,
    rngs: tuple[np.random.Generator, np.random.Generator],
) -> Array:
    """(n, s, 8) values of `SIGNALS` by (R.1) to (R.3)."""
    (rng, bias_rng), options, interval = rngs, scene.options, 1.0 / receiver.rate_hz
    troposphere, ionosphere = _air(antenna, scene, paths)
    sine = np.sin(np.maximum(paths.elevation, np.radians(LOWEST_STRENGTH_DEG)))
    common = paths.distance + LIGHT * antenna.clock_s[:, None] - paths.clock + troposphere
    rate = paths.rate - paths.clock_rate * (1.0 - paths.rate / LIGHT)
    own_rate = antenna.clock_rate[:, None]
    glonass = np.array([code[0] == "R" for code in scene.satellites.code])
    channel = scene.satellites.channel
    strength, zenith, less, spread = STRENGTH_DBHZ
    out = np.empty((*sine.shape, len(SIGNALS)))
    for band in (0, 1):
        frequency = np.where(
            glonass, GLONASS_HZ[band] + channel * GLONASS_STEP_HZ[band], GPS_HZ[band]
        )
        wavelength, dispersed = LIGHT / frequency, ionosphere * (GPS_HZ[0] / frequency) ** 2
        hardware = options.hardware_bias_m * bias_rng.standard_normal(2)[glonass.astype(int)]
        of_channels = bias_rng.standard_normal(GLONASS_CHANNEL_COUNT)
        bias_of_channel = of_channels[channel + GLONASS_CHANNEL_COUNT // 2]
        hardware = hardware + glonass * options.glonass_code_bias_m * bias_of_channel
        fraction = (
            bias_rng.uniform(0.0, 1.0, 2)[glonass.astype(int)]
            + glonass * channel * receiver.phase_slope_m / wavelength
        )
        code, phase = (
            noise(sine, white, multipath, options.multipath_s, interval, rng)
            for white, multipath in (
                (options.code_sigma_m, options.code_multipath_m),
                (options.phase_sigma_m, options.phase_multipath_m),
            )
        )
        air_rate = np.gradient(troposphere - dispersed, interval, axis=0)
        doppler = (
            (rate + air_rate) * (1.0 - own_rate)
            + LIGHT * own_rate
            + options.doppler_sigma_ms * rng.standard_normal(sine.shape)
        )
        out[:, :, 0 + band] = common + dispersed + hardware + code
        out[:, :, 2 + band] = (
            (common - dispersed + phase) / wavelength + locks.cycles[:, :, band] + fraction
        )
        out[:, :, 4 + band] = -doppler / wavelength
        out[:, :, 6 + band] = (
            strength
            + zenith * paths.antenna_sine
            - less * band
            + spread * rng.standard_normal(sine.shape)
        )
        out[:, :, band::2][~locks.held[:, :, band]] = np.nan
    return out


def _air(antenna: ReceiverAntenna, scene: _Scene, paths: Paths) -> tuple[Array, Array]:
    """Delays (n, s) m of the troposphere, and of the ionosphere on the code of L1."""
    lat, lon, height = ecef_to_geodetic(antenna.position)
    low = np.radians(LOWEST_STRENGTH_DEG)
    elevation = np.maximum(paths.elevation, low)
    table = scene.troposphere.table(float(height.min()), float(height.max()), low)
    heights = np.broadcast_to(height[:, None], elevation.shape)
    troposphere = table(heights, elevation, grid=False) / np.sin(elevation)
    elapsed = antenna.time - scene.flight.motion.start
    return troposphere, scene.ionosphere.delay(
        elapsed, (lat, lon, height), paths.azimuth, elevation
    )
