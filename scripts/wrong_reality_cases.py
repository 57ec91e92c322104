"""The cases of wrong_reality.py: what is planted in the records of a recording, and which messages
name it.

A plant takes the records of a right recording and the values of its flight file, a `Scene`, and
returns a changed copy; everything random comes from the generator that is handed in.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import insgnss

RATE_HZ = 100.0  # of the IMU
EARTH_A, EARTH_E2 = 6378137.0, 6.69437999014e-3
G = 9.80665
DEG_H, MG = np.radians(1.0) / 3600.0, 1e-3 * G

LEVER, OFFSET, RATE = "antenna lever arm", "GNSS time offset", "clock rate"
NOISE, SIGMAS = "IMU noise:", "GNSS sigmas:|: the GNSS sigmas are too small"
WARM_UP, STEP = "IMU warm-up", "IMU bias step"
CORRELATED, LOST = "time-correlated", "rejected by the gate|lost the fixes|were rejected"
FLOAT = f"{LOST}|incorrect fixes"
SCALE = {"gyro": r"gyro( \w+)? scale factor", "accel": r"accel(erometer)?( \w+)? scale factor"}
MISALIGNED = {"gyro": r"gyro (\w+ from|misal)", "accel": r"accel(erometer)? (\w+ from|misal)"}
VELOCITY = r"velocities scatter|velocities \(|velocities were|fixes\.velocity"


def radii(lat: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Metres of a radian of latitude and of one of longitude."""
    w = np.sqrt(1.0 - EARTH_E2 * np.sin(lat) ** 2)
    return EARTH_A * (1.0 - EARTH_E2) / w**3 + height, (EARTH_A / w + height) * np.cos(lat)


@dataclass(frozen=True)
class Scene:
    """What is handed to `estimate`: the records and the flight file's values."""

    imu: insgnss.ImuSamples
    gnss: insgnss.GnssFixes
    events: insgnss.CameraEvents | None
    mounting: insgnss.Mounting
    noise: str = "navchip"
    truth: insgnss.Trajectory | None = None

    def of_imu(self, **changes: Any) -> "Scene":
        """The scene with other samples."""
        return replace(self, imu=replace(self.imu, **changes))

    def of_gnss(self, **changes: Any) -> "Scene":
        """The scene with other fixes."""
        return replace(self, gnss=replace(self.gnss, **changes))


Draw = np.random.Generator
Plant = Callable[[Scene, Draw], Scene]


@dataclass(frozen=True)
class Case:
    """A fault: `plant` changes the records, `culprit` is the pattern of messages that name it.

    `harmless` : it must not be refused. `simulated` : options of the simulator. `beyond` : why no
    data can tell it; such a case is not judged.
    """

    name: str
    plant: Plant = lambda scene, draw: scene
    culprit: str = "(?!)"
    harmless: bool = False
    simulated: tuple[tuple[str, Any], ...] = ()
    beyond: str = ""


def lever(axis: int, size_m: float) -> Plant:
    """The antenna is elsewhere than the flight file says."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        m, off = scene.mounting, size_m * np.eye(3)[axis]
        return replace(scene, mounting=replace(m, antenna_m=m.antenna_m + m.C_cb @ off))

    return plant


def latency(late_s: float) -> Plant:
    """The stamps of the fixes are late."""
    return lambda scene, draw: scene.of_gnss(time=scene.gnss.time + late_s)


def clock(ppm: float, camera: bool = False) -> Plant:
    """The IMU's clock runs fast, and that of the camera with it where it is the same."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        begin, events = scene.imu.time[0], scene.events
        if camera and events is not None:
            stamps = events.time + 1e-6 * ppm * (events.time - begin)
            scene = replace(scene, events=replace(events, time=stamps))
        return scene.of_imu(time=scene.imu.time + 1e-6 * ppm * (scene.imu.time - begin))

    return plant


def linear(sensor: str, scale: float = 0.0, off_axis: float = 0.0) -> Plant:
    """Scale factors, alike on all axes, and misalignments of random sign of a sensor."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        turn = off_axis * draw.choice([-1.0, 1.0], (3, 3)) * (1.0 - np.eye(3))
        M = (1.0 + scale) * np.eye(3) + turn
        return scene.of_imu(**{sensor: getattr(scene.imu, sensor) @ M.T})

    return plant


def noisy(gyro: float = 1.0, accel: float = 1.0) -> Plant:
    """White noise of the IMU is that many times its model's."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        more = {}
        for sensor, factor in (("gyro", gyro), ("accel", accel)):
            density = getattr(insgnss.load_noise_model("navchip"), sensor)[0].white_noise
            sigma = density * np.sqrt((factor**2 - 1.0) * RATE_HZ)
            right = getattr(scene.imu, sensor)
            more[sensor] = right + sigma * draw.standard_normal(right.shape)
        return scene.of_imu(**more)

    return plant


def drifting(gyro: float, accel: float, jump_s: float | None = None) -> Plant:
    """Biases grow over the record to these values, or jump to them; of random signs."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        since = scene.imu.time - scene.imu.time[0]
        course = since / since[-1] if jump_s is None else (since > jump_s).astype(float)
        of_gyro, of_accel = course[:, None] * draw.choice([-1.0, 1.0], (2, 1, 3))
        return scene.of_imu(
            gyro=scene.imu.gyro + gyro * of_gyro, accel=scene.imu.accel + accel * of_accel
        )

    return plant


def warming(gyro: float, accel: float, time_s: float) -> Plant:
    """Biases of these sizes decay from the first sample on; factors 1, -0.7, 0.5 on the axes."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        course = np.exp(-(scene.imu.time - scene.imu.time[0]) / time_s)[:, None]
        shape = course * np.array([1.0, -0.7, 0.5])
        return scene.of_imu(
            gyro=scene.imu.gyro + gyro * shape, accel=scene.imu.accel + accel * shape
        )

    return plant


def claimed(factor: float) -> Plant:
    """The fixes claim that many times their sigmas."""
    return lambda scene, draw: scene.of_gnss(cov_ned=scene.gnss.cov_ned * factor**2)


def rectified(accel: float) -> Plant:
    """Accelerometer biases of this size a tenth of g of load beyond one, alike on all axes."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        load = np.linalg.norm(scene.imu.accel, axis=1) / G - 1.0
        return scene.of_imu(accel=scene.imu.accel + accel * (load / 0.1)[:, None])

    return plant


def late_gyro(late_s: float) -> Plant:
    """The gyros show what the accelerometers show so much later."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        time, gyro = scene.imu.time, scene.imu.gyro
        late = [np.interp(time - late_s, time, gyro[:, c]) for c in range(3)]
        return scene.of_imu(gyro=np.stack(late, axis=1))

    return plant


def one_axis(sensor: str, row: int, column: int, rad: float) -> Plant:
    """One axis of a sensor is turned towards one other."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        M = np.eye(3)
        M[row, column] = rad
        return scene.of_imu(**{sensor: getattr(scene.imu, sensor) @ M.T})

    return plant


def of_antenna(scene: Scene, time: np.ndarray) -> np.ndarray:
    """The velocity of the antenna, north east down, (n, 3)."""
    true = scene.truth.at(time)
    arm = np.einsum("kij,j->ki", true.C_nb, scene.mounting.antenna_lever_b)
    return true.velocity_ned + np.gradient(arm, time, axis=0)


def tracked(natural_hz: float) -> Plant:
    """A receiver's loop follows the antenna behind by its acceleration over (2 pi Hz)^2."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        wn, time = 2.0 * np.pi * natural_hz, scene.gnss.time
        behind = -np.gradient(of_antenna(scene, time), time, axis=0) / wn**2
        return moved(lambda since, _: behind)(scene, draw)

    return plant


def smoothed(natural_hz: float, damping: float = 0.7, follows_velocity: bool = True) -> Plant:
    """A receiver's tracking loop of second order, solved over the exact motion.

    One that does not follow velocities is a low pass, late by 2 damping / (2 pi Hz), of which the
    engine knows, so that its stamps are right.
    """

    def plant(scene: Scene, draw: Draw) -> Scene:
        wn, dt = 2.0 * np.pi * natural_hz, 1e-3
        lag = 2.0 * damping / wn
        first, last = scene.truth.time[[0, -1]]
        fixes = scene.gnss.time
        time = np.arange(max(fixes[0] - 10.0, first), min(fixes[-1] + lag, last), dt)
        v = of_antenna(scene, time)
        e, rate, behind = np.zeros(3), np.zeros(3), np.zeros_like(v)
        for k in range(1, time.size):  # e'' = a - 2 d w e' - w^2 e; of a low pass a + 2 d w v
            a = (v[k] - v[k - 1]) / dt
            input_ = a if follows_velocity else a + 2.0 * damping * wn * v[k]
            if k == 1 and not follows_velocity:
                e = lag * v[0]
            rate = rate + dt * (input_ - 2.0 * damping * wn * rate - wn**2 * e)
            e = e + dt * rate
            behind[k] = e
        at = fixes if follows_velocity else fixes + lag
        error = -np.stack([np.interp(at, time, column) for column in behind.T], axis=1)
        if not follows_velocity:
            way = np.cumsum(v, axis=0) * dt
            moved_on = [np.interp(at, time, c) - np.interp(fixes, time, c) for c in way.T]
            error += np.stack(moved_on, axis=1)
        return moved(lambda since, _: error)(scene, draw)

    return plant


def of_path(error: Callable[[Callable[[np.ndarray], np.ndarray], np.ndarray], np.ndarray]) -> Plant:
    """Fixes off by a function of the way flown (n, 3) at any time, and of their times."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        first, last = scene.truth.time[[0, -1]]
        time = np.arange(first, last, 5e-3)
        way = np.cumsum(of_antenna(scene, time), axis=0) * 5e-3

        def path(at: np.ndarray) -> np.ndarray:
            return np.stack([np.interp(at, time, column) for column in way.T], axis=1)

        off = error(path, scene.gnss.time)
        return moved(lambda since, _: off)(scene, draw)

    return plant


def extrapolating(ahead_s: float) -> Plant:
    """A receiver that predicts its positions over this time, by velocity."""
    h = 0.02

    def error(path: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
        velocity = (path(at - ahead_s) - path(at - ahead_s - h)) / h
        return path(at - ahead_s) + ahead_s * velocity - path(at)

    return of_path(error)


def averaging(fixes: int) -> Plant:
    """Every fix is the mean of this odd number about it, its noise as it was."""

    def error(path: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
        dt, half = float(np.median(np.diff(at))), fixes // 2
        return sum(path(at + k * dt) for k in range(-half, half + 1)) / fixes - path(at)

    return of_path(error)


def late_by_speed(s_per_mps: float) -> Plant:
    """Fixes are late in proportion to the speed."""

    def error(path: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
        speed = np.linalg.norm(path(at + 0.05) - path(at - 0.05), axis=1) / 0.1
        return path(at - s_per_mps * speed) - path(at)

    return of_path(error)


def sagging(m_per_g: float) -> Plant:
    """The antenna goes down by this for every g of load beyond one (IMU on a gimbal)."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        true, time = scene.truth.at(scene.gnss.time), scene.imu.time
        load = np.linalg.norm(scene.imu.accel, axis=1) / G - 1.0
        mean = np.convolve(load, np.full(25, 0.04), "same")
        down = m_per_g * np.interp(scene.gnss.time, time, mean)
        off = true.C_nb[:, :, 2] * down[:, None]
        return moved(lambda since, _: off)(scene, draw)

    return plant


def clock_of_fixes(ppm: float, first_s: float = 0.0, last_s: float = np.inf) -> Plant:
    """The clock of the fixes runs fast, in the part of the flight between these seconds."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        begin, imu, gnss = scene.imu.time[0] + first_s, scene.imu, scene.gnss
        end, events = begin + last_s - first_s, scene.events
        if np.isfinite(last_s):
            imu, gnss = (one[(one.time >= begin) & (one.time <= end)] for one in (imu, gnss))
            if events is not None:
                events = events[(events.time > begin + 1.0) & (events.time < end - 1.0)]
        late = replace(gnss, time=gnss.time + 1e-6 * ppm * (gnss.time - begin))
        return replace(scene, imu=imu, gnss=late, events=events)

    return plant


def dropped(samples: int, since_s: float) -> Plant:
    """Samples are lost at once, and the stamps count on without them."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        imu = scene.imu
        k = int(np.searchsorted(imu.time - imu.time[0], since_s))
        keep = np.r_[:k, k + samples : imu.time.size]
        return scene.of_imu(time=imu.time[: keep.size], gyro=imu.gyro[keep], accel=imu.accel[keep])

    return plant


def moved(error: Callable[[np.ndarray, Draw], np.ndarray]) -> Plant:
    """The fixes are off by a function of time since the beginning, (n, 3) north east down, m."""

    def plant(scene: Scene, draw: Draw) -> Scene:
        fixes = scene.gnss
        north, east, down = error(fixes.time - scene.imu.time[0], draw).T
        meridian, parallel = radii(fixes.lat, fixes.height)
        lat, lon = fixes.lat + north / meridian, fixes.lon + east / parallel
        return scene.of_gnss(lat=lat, lon=lon, height=fixes.height - down)

    return plant


def wandering(sigma_m: float, time_s: float) -> Plant:
    """A Gauss-Markov error of the fixes that their sigmas do not hold."""

    def error(since: np.ndarray, draw: Draw) -> np.ndarray:
        e = sigma_m * draw.standard_normal((since.size, 3))
        for k, phi in enumerate(np.exp(-np.diff(since) / time_s), 1):
            e[k] = phi * e[k - 1] + np.sqrt(1.0 - phi**2) * e[k]
        return e

    return moved(error)


def directions(n: int, draw: Draw) -> np.ndarray:
    """Unit vectors, (n, 3)."""
    way = draw.standard_normal((n, 3))
    return way / np.linalg.norm(way, axis=1)[:, None]


def ambiguity(size_m: float, *spans: tuple[float, float]) -> Plant:
    """Wrong ambiguities: fixes off by a constant from a first to a last second."""

    def error(since: np.ndarray, draw: Draw) -> np.ndarray:
        return sum(
            ((since >= first) & (since < last))[:, None] * size_m * directions(1, draw)
            for first, last in spans
        )

    return moved(error)


def converging(size_m: float, time_s: float, *onsets: float) -> Plant:
    """Float solutions that claim to be fixed: fixes step by so much and converge."""

    def error(since: np.ndarray, draw: Draw) -> np.ndarray:
        return sum(
            np.where(since >= onset, np.exp(-np.maximum(since - onset, 0.0) / time_s), 0.0)[:, None]
            * size_m
            * directions(1, draw)
            for onset in onsets
        )

    return moved(error)


def swinging(size_m: float, period_s: float) -> Plant:
    """Fixes swing smoothly by this amplitude, with a phase of its own on each axis."""

    def error(since: np.ndarray, draw: Draw) -> np.ndarray:
        phase = 2.0 * np.pi * draw.random(3)
        return size_m * np.sin(2.0 * np.pi * since[:, None] / period_s + phase)

    return moved(error)


def outliers(share: float, size_m: float) -> Plant:
    """Single fixes are off in random directions."""

    def error(since: np.ndarray, draw: Draw) -> np.ndarray:
        return size_m * directions(since.size, draw) * (draw.random((since.size, 1)) < share)

    return moved(error)


def outage(scene: Scene, draw: Draw) -> Scene:
    """No fixes from second 150 to 180."""
    since = scene.gnss.time - scene.imu.time[0]
    return replace(scene, gnss=scene.gnss[(since < 150.0) | (since > 180.0)])


def jitter(scene: Scene, draw: Draw) -> Scene:
    """The stamps of the samples tremble by 1 ms, by 3 ms at the most."""
    by = 1e-3 * np.clip(draw.standard_normal(scene.imu.time.size), -3.0, 3.0)
    return scene.of_imu(time=scene.imu.time + by)


def fast(scene: Scene, draw: Draw) -> Scene:
    """Velocities of the fixes are 5 cm/s off to the north."""
    return scene.of_gnss(velocity_ned=scene.gnss.velocity_ned + np.array([0.05, 0.0, 0.0]))


def camera_late(scene: Scene, draw: Draw) -> Scene:
    """The events of the camera are 10 ms late."""
    late = np.minimum(scene.events.time + 0.01, scene.gnss.time[-1] - 1e-3)
    return replace(scene, events=replace(scene.events, time=late))


def crooked(scene: Scene, draw: Draw) -> Scene:
    """The bore-sight is half a degree off about every axis."""
    off = insgnss.boresight_from_angles("opk", [0.5, 0.5, 0.5])
    m = scene.mounting
    return replace(scene, mounting=replace(m, boresight=m.boresight @ off))


def model(name: str) -> Plant:
    """The noise model of another IMU."""
    return lambda scene, draw: replace(scene, noise=name)


VELOCITIES = (("gnss_sigma_velocity_mps", (0.03, 0.03, 0.05)),)
NOTHING = Case("nothing wrong", harmless=True)
CASES = (
    NOTHING,
    *(
        Case(
            f"lever arm {way} {100 * size:g} cm off",
            lever(axis, size),
            f"{LEVER}(:| {way})",
            size < 0.015,
        )
        for axis, way in enumerate(("forward", "right", "down"))
        for size in (0.01, 0.02, 0.05, 0.1, 0.3, 1.0)
    ),
    *(
        Case(f"latency {ms:g} ms", latency(1e-3 * ms), f"{OFFSET}|latency", abs(ms) <= 1.0)
        for ms in (0.5, 1.0, 2.0, 5.0, 10.0, 50.0, -10.0)
    ),
    *(Case(f"IMU clock {ppm} ppm fast", clock(ppm), RATE, ppm <= 5) for ppm in (5, 20, 100)),
    Case("clock of IMU and camera 20 ppm fast", clock(20.0, True), RATE),
    *(
        Case(f"{s} scale {100 * k:g} %", linear(s, k), SCALE[s], k < 0.005)
        for s, sizes in (("gyro", (0.001, 0.01, 0.03)), ("accel", (0.001, 0.01)))
        for k in sizes
    ),
    *(
        Case(f"{s} misaligned {1e3 * a:g} mrad", linear(s, 0.0, a), MISALIGNED[s], a < 0.005)
        for s in ("gyro", "accel")
        for a in (0.002, 0.01)
    ),
    Case("gyro x 5 mrad from y", one_axis("gyro", 0, 1, 0.005), "gyro x from y"),
    Case("gyro x 5 mrad from z", one_axis("gyro", 0, 2, 0.005), "gyro x from z"),
    *(
        Case(f"accel bias {mg:g} mg at a load of 1.2", rectified(0.5 * mg * MG), "load")
        for mg in (1.0, 2.0, 4.0)
    ),
    *(Case(f"gyros {ms:g} ms late", late_gyro(1e-3 * ms), "gyros") for ms in (2.0, 5.0)),
    *(Case(f"receiver's loop of {hz:g} Hz", tracked(hz), "loop") for hz in (0.5, 1.0, 2.0, 4.0)),
    *(
        Case(f"receiver's low pass of {hz:g} Hz, latency known", smoothed(hz, 0.7, False), "loop")
        for hz in (1.0, 2.0)
    ),
    *(
        Case(f"receiver's second order loop of {hz:g} Hz", smoothed(hz), "loop")
        for hz in (1.0, 2.0)
    ),
    *(Case(f"fixes extrapolated by {s:g} s", extrapolating(s), "loop|follow") for s in (0.1, 0.2)),
    *(Case(f"fixes averaged over {n}", averaging(n), "loop|follow|smooth") for n in (3, 5, 9)),
    Case("fixes late by 0.2 ms a m/s", late_by_speed(2e-4), OFFSET),
    Case("fixes late by 1 ms a m/s", late_by_speed(1e-3), OFFSET),
    *(Case(f"antenna sags by {m:g} m a g", sagging(m), "load|loop|follow") for m in (0.05, 0.2)),
    *(
        Case(f"clock of the fixes {ppm:+g} ppm", clock_of_fixes(ppm), f"{RATE}|{OFFSET}")
        for ppm in (20.0, 50.0, -50.0, 100.0)
    ),
    *(
        Case(f"clock of the fixes {ppm:+g} ppm, 84 s", clock_of_fixes(ppm, 120.0, 204.0), RATE)
        for ppm in (20.0, 50.0, -50.0, 100.0)
    ),
    *(Case(f"{n} samples lost", dropped(n, 150.0), "samples (were )?lost") for n in (4, 20)),
    Case("gyro white noise x 3", noisy(gyro=3.0), NOISE, True),
    Case("gyro white noise x 10", noisy(gyro=10.0), NOISE),
    Case("accel white noise x 3", noisy(accel=3.0), NOISE, True),
    Case("accel white noise x 10", noisy(accel=10.0), NOISE),
    Case("IMU white noise x 30", noisy(30.0, 30.0), NOISE),
    Case("vibration factor 5", culprit=NOISE, simulated=(("vibration", 5.0),)),
    Case("IMU warms up, 150 deg/h, 5 mg, 90 s", warming(150.0 * DEG_H, 5.0 * MG, 90.0), WARM_UP),
    Case("IMU warms up, 500 deg/h, 15 mg, 90 s", warming(500.0 * DEG_H, 15.0 * MG, 90.0), WARM_UP),
    Case("IMU warms up, 150 deg/h, 5 mg, 60 s", warming(150.0 * DEG_H, 5.0 * MG, 60.0), WARM_UP),
    Case("biases drift by 200 deg/h, 3 mg", drifting(200.0 * DEG_H, 3.0 * MG), WARM_UP),
    Case("biases drift by 50 deg/h, 0.5 mg", drifting(50.0 * DEG_H, 0.5 * MG), NOISE, True),
    Case("biases drift by 1000 deg/h, 20 mg", drifting(1000.0 * DEG_H, 20.0 * MG), WARM_UP),
    Case("biases jump by 150 deg/h, 5 mg", drifting(150.0 * DEG_H, 5.0 * MG, 59.0), STEP),
    Case("gyro biases jump by 200 deg/h", drifting(200.0 * DEG_H, 0.0, 150.0), STEP),
    Case("gyro biases jump by 2000 deg/h", drifting(2000.0 * DEG_H, 0.0, 150.0), STEP),
    Case("IMU stamps tremble by 1 ms", jitter, f"{NOISE}|IMU rate|jitter"),
    Case("noise model too good (tactical)", model("tactical"), f"{NOISE}|turn-on bias"),
    Case("noise model too bad (consumer)", model("consumer"), NOISE, True),
    Case("sigmas claimed a half", claimed(1 / 2), SIGMAS),
    Case("sigmas claimed a third", claimed(1 / 3), SIGMAS),
    Case("sigmas claimed double", claimed(2.0), SIGMAS, True),
    Case("sigmas claimed five times", claimed(5.0), SIGMAS, True),
    Case("GNSS errors of 1 cm, 20 s", wandering(0.01, 20.0), CORRELATED),
    Case("GNSS errors of 3 cm, 20 s", wandering(0.03, 20.0), CORRELATED),
    Case("GNSS errors of 3 cm, 120 s", wandering(0.03, 120.0), CORRELATED),
    Case("GNSS errors of 2 cm, 60 s", wandering(0.02, 60.0), CORRELATED),
    Case("GNSS errors of 4 cm, 300 s", wandering(0.04, 300.0), CORRELATED),
    Case("wrong ambiguity, 30 cm for 10 s", ambiguity(0.3, (150.0, 160.0)), LOST),
    Case("wrong ambiguity, 30 cm for 30 s", ambiguity(0.3, (140.0, 170.0)), LOST),
    Case(
        "wrong ambiguity, 30 cm for 10 s, twice",
        ambiguity(0.3, (125.0, 135.0), (165.0, 175.0)),
        LOST,
    ),
    Case(
        "wrong ambiguity, 30 cm for 30 s, twice",
        ambiguity(0.3, (110.0, 140.0), (190.0, 220.0)),
        FLOAT,
    ),
    *(
        Case(f"float fixes of {100 * m:g} cm, {t:g} s, twice", converging(m, t, *onsets), FLOAT)
        for m, t, onsets in (
            (0.3, 10.0, (110.0, 200.0)),
            (0.3, 20.0, (110.0, 200.0)),
            (0.3, 40.0, (100.0, 200.0)),
            (1.0, 20.0, (120.0, 190.0)),
        )
    ),
    Case("float fixes of 30 cm, 20 s, once", converging(0.3, 20.0, 150.0), FLOAT),
    *(
        Case(f"fixes swing by {100 * m:g} cm over {t:g} s", swinging(m, t), f"{CORRELATED}|slow")
        for m, t in ((0.3, 120.0), (0.3, 300.0), (1.0, 300.0))
    ),
    Case("outliers of 1 m, 1 %", outliers(0.01, 1.0), LOST, True),
    Case("outliers of 20 m, 5 %", outliers(0.05, 20.0), LOST, True),
    Case("outage of 30 s", outage, "no GNSS position was used", True),
    Case("fixes of 1.5 m", harmless=True, simulated=(("gnss_sigma_m", (1.5, 1.5, 3.0)),)),
    Case("fixes at 1 Hz", harmless=True, simulated=(("gnss_rate_hz", 1.0),)),
    Case("velocities as they should be", harmless=True, simulated=VELOCITIES),
    Case("velocities 5 cm/s off", fast, VELOCITY, simulated=VELOCITIES),
    Case("camera 10 ms late", camera_late, beyond="events alone have the camera's clock"),
    Case("bore-sight 0.5 deg off", crooked, beyond="the images are not looked at"),
    Case(
        "all fixes 3 cm off",
        moved(lambda since, draw: np.tile([0.03, 0.0, 0.0], (since.size, 1))),
        beyond="a base station is where it is said to be",
    ),
    Case("GNSS errors of 3 cm, 1000 s", wandering(0.03, 1000.0), beyond="slower than the flight"),
)
