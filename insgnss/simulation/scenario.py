"""A whole simulated flight in memory: what the sensors recorded, and the truth about it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.advance import within
from ..base.errors import UsageError, near
from ..geodesy.frames import TangentPlane
from ..records import Array, CameraEvents, ExteriorOrientation, GnssFixes, ImuSamples, Trajectory
from ..records.cameras.mounting import Mounting
from .flights import START_TOW, FlightMotion, fly
from .ground import drive, walk
from .layout import PLANS, FlightPlan
from .motion import ExactMotion
from .raw_gnss.options import RawGnssOptions
from .raw_gnss.receiver import GnssOptions, simulate_gnss
from .raw_gnss.scenario import SimulatedGnss, simulate_raw_gnss
from .sensors import ImuOptions, Rig, SecondImu, SimulatedImu, simulate_events, simulate_imu

JOURNEYS = {"car": drive, "walk": walk}
JOURNEY_MIN = 5.0  # of a car or a walk without --minutes (chosen)
PATH_SHARE = 0.25  # of the time that a simulation takes
# what flight files state of a lever arm and stamps that are exact
EXACT_LEVER_ARM_M, EXACT_STAMP_S = 1e-3, 5e-5
FLIGHTS = (*PLANS, *JOURNEYS)


@dataclass(frozen=True, eq=False)
class Truth:
    """The truth of a flight.

    Parameters
    ----------
    eo : exterior orientation of every exposure, those without an event too; covariances zero.
    trajectory : of the IMU's navigation centre, covariances zero.
    gyro_bias, accel_bias : (n, 3) rad/s, m/s^2, body axes, at the trajectory's times: all errors
        but white and quantization noise.
    outlier : (m,) which GNSS fixes are outliers.
    """

    eo: ExteriorOrientation
    trajectory: Trajectory
    gyro_bias: Array
    accel_bias: Array
    outlier: NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedFlight:
    """Observations of a flight, with the options that made them, and the truth.

    They are in SI units, IMUs in their own axes.

    Parameters
    ----------
    second_imu : samples of a second IMU and its options, or None.
    raw_gnss : what the receivers of rover and base measured, or None.
    """

    flight: FlightMotion
    imu: ImuSamples
    gnss: GnssFixes
    events: CameraEvents
    rig: Rig
    imu_options: ImuOptions
    gnss_options: GnssOptions
    tangent_plane: TangentPlane
    truth: Truth
    second_imu: tuple[SimulatedImu, SecondImu] | None = None
    raw_gnss: SimulatedGnss | None = None

    @property
    def mounting(self) -> Mounting:
        """The mounting as `process` and `estimate` take it."""
        rig = self.rig
        vectors = (rig.antenna_m, rig.imu_m, rig.camera_from_body, rig.boresight)
        antenna_m, imu_m, camera_from_body, boresight = (np.array(x) for x in vectors)
        return Mounting(antenna_m, imu_m, camera_from_body, boresight, EXACT_LEVER_ARM_M)

    def __repr__(self) -> str:
        """Return the recordings in one line."""
        return f"<SimulatedFlight {self.imu!r}, {self.gnss!r}, {self.events!r}>"


def simulate_flight(
    flight: str | FlightPlan = "ign8",
    minutes: float | None = None,
    *,
    seed: int = 0,
    start_tow: float = START_TOW,
    **changes: Any,
) -> SimulatedFlight:
    """Simulate a flight; the same arguments give the same numbers.

    Parameters
    ----------
    flight : "ign8", "ign6x1", "car", "walk", or a plan.
    minutes : of the record; None for the plan's own, of a journey 5.
    seed : of everything random: gusts, trigger delays, errors of each sensor (independent streams).
    start_tow : s, of the first instant, GPS week 2008.
    changes : keywords of `observe`, and fields of `FlightPlan`, such as start_in_air, wind_ms,
        turbulence, ground_s or line_length_m; of a journey stand_s.

    Raises
    ------
    UsageError : unknown flight or field, or a plan that cannot be flown.
    """
    if not isinstance(flight, FlightPlan) and flight not in FLIGHTS:
        raise UsageError(f"flight {flight!r} is unknown; {near(str(flight), FLIGHTS)}")
    sensors = {name: changes.pop(name) for name in OF_SENSORS if name in changes}
    sensor_seed: int | np.random.SeedSequence = seed
    if isinstance(flight, str) and flight in JOURNEYS:
        if extra := [name for name in changes if name != "stand_s"]:
            raise UsageError(f"{flight}: there is no {extra[0]}; {near(extra[0], ['stand_s'])}")
        length = JOURNEY_MIN if minutes is None else minutes
        path = JOURNEYS[flight](length, seed=seed, start_tow=start_tow, **changes)
    else:
        path_seed, sensor_seed = _seeds(seed)
        plan = PLANS[flight] if isinstance(flight, str) else flight
        if minutes is not None:
            changes["minutes"] = minutes
        with within(0.0, PATH_SHARE):
            path = fly(plan.changed(**changes), path_seed, start_tow=start_tow)
    with within(PATH_SHARE, 1.0):
        return observe(path, sensor_seed, **sensors)


IMU_SHARE = 0.3  # of the time of an observed flight that its IMU takes, where it has raw GNSS


def observe(
    flight: FlightMotion,
    seed: int | np.random.SeedSequence = 0,
    *,
    imu: ImuOptions | None = None,
    gnss: GnssOptions | None = None,
    raw_gnss: RawGnssOptions | None = None,
    rig: Rig | None = None,
    second_imu: SecondImu | None = None,
    missing_events: float = 0.0,
    truth_hz: float = 10.0,
) -> SimulatedFlight:
    """Simulate what the sensors record of a flight, however its motion came about, and the truth.

    Parameters
    ----------
    seed : of the errors of each sensor (independent streams).
    imu, gnss, rig : options of the sensors and their mounting.
    second_imu : another IMU with errors of its own.
    raw_gnss : of rover and base, whose errors have nothing to do with those of the positions that
        `gnss` describes; None: none.
    missing_events : share of exposures without event.
    truth_hz : rate of the true trajectory.
    """
    imu, gnss, rig = imu or ImuOptions(), gnss or GnssOptions(), rig or Rig()
    sensor_seed = _seeds(seed)[1] if isinstance(seed, int) else seed
    inertial, receiver, camera, second_rng, raw = np.random.default_rng(sensor_seed).spawn(5)
    with within(0.0, 1.0 if raw_gnss is None else IMU_SHARE):
        recorded = simulate_imu(flight, imu, inertial)
    fixes, outlier = simulate_gnss(flight, rig, gnss, receiver)
    events = simulate_events(flight, missing_events, camera)
    observed = None
    if raw_gnss is not None:
        with within(IMU_SHARE, 1.0):
            observed = simulate_raw_gnss(flight, rig, events, raw_gnss, raw)
    second = None
    if second_imu is not None:
        lever_b = rig.C_cb.T @ (np.array(second_imu.imu_m) - np.array(rig.imu_m))
        second = simulate_imu(flight, second_imu.options, second_rng, lever_b), second_imu
    trajectory = true_trajectory(flight.motion, _times(flight.motion, truth_hz), flight.gps_week)
    plane = TangentPlane(flight.motion.frame.lat, flight.motion.frame.lon, 0.0)
    truth = Truth(
        true_eo(flight, rig, plane), trajectory, *_biases(recorded, trajectory.time), outlier
    )
    return SimulatedFlight(
        flight=flight,
        imu=recorded.samples,
        gnss=fixes,
        events=events,
        rig=rig,
        imu_options=imu,
        gnss_options=gnss,
        tangent_plane=plane,
        truth=truth,
        second_imu=second,
        raw_gnss=observed,
    )


OF_SENSORS = tuple(observe.__kwdefaults__ or ())  # names of its options


def _seeds(seed: int) -> list[np.random.SeedSequence]:
    """Return the seed of the path and that of the sensors."""
    if seed < 0:
        raise UsageError(f"seed {seed}; it must not be negative")
    return np.random.SeedSequence(seed).spawn(2)


def true_eo(flight: FlightMotion, rig: Rig, plane: TangentPlane) -> ExteriorOrientation:
    """Return the exterior orientation of every exposure, without error and with zero covariance."""
    motion = flight.motion
    n = flight.time.size
    C_ml = plane.C_em.T @ motion.frame.C_el
    C_mb = C_ml @ motion.C_lb(flight.time)
    # of m from l, in m
    origin = C_ml @ motion.frame.position_from_geodetic(plane.lat, plane.lon, plane.height)
    lever_m = C_mb @ rig.camera_lever_b
    position = motion.position(flight.time) @ C_ml.T - origin + lever_m
    rate = np.einsum("nij,nj->ni", C_mb, motion.omega_lb_b(flight.time))
    return ExteriorOrientation(
        flight.images,
        flight.time,
        flight.gps_week,
        np.array([plane.lat, plane.lon, plane.height]),
        position,
        C_mb @ rig.C_cb.T,
        np.zeros((n, 6, 6)),
        np.zeros((max(n - 1, 0), 6, 6)),
        np.array(rig.boresight),
        np.array(rig.camera_from_body),
        ("truth of a simulation",),
        velocity_mps=motion.velocity(flight.time) @ C_ml.T + np.cross(rate, lever_m),
        rate_radps=rate,
    )


def true_trajectory(motion: ExactMotion, time: Array, gps_week: int) -> Trajectory:
    """Return the true state of the IMU's navigation centre at `time` (n,), zero covariance."""
    lat, lon, height = motion.geodetic(time)
    C_nl = motion.C_nl(time)
    velocity = np.einsum("nij,nj->ni", C_nl, motion.velocity(time))
    return Trajectory(
        time,
        lat,
        lon,
        height,
        velocity,
        C_nl @ motion.C_lb(time),
        np.zeros((time.size, 9, 9)),
        gps_week,
    )


def _times(motion: ExactMotion, rate_hz: float) -> Array:
    if not rate_hz > 0.0:
        raise UsageError(f"true trajectory at {rate_hz} Hz; the rate must be positive")
    n = int(np.floor((motion.end - motion.start) * rate_hz + 1e-6))
    return motion.start + np.arange(n + 1) / rate_hz


def _biases(imu: SimulatedImu, time: Array) -> tuple[Array, Array]:
    """Slow errors of the samples that cover `time`."""
    k = np.clip(np.searchsorted(imu.time, time - 1e-7), 0, imu.time.size - 1)
    return imu.gyro_bias[k], imu.accel_bias[k]
