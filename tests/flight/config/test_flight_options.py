"""Every option of the flight file that changes an estimate or a reading, through `process` or
`read_recording`.

One short simulated flight and one drive serve all tests; each option gets a flight file of its own
beside them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from insgnss import load_flight
from insgnss.flight.processing.pipeline import ProcessResult, process
from insgnss.flight.processing.recording import Recording, read_recording
from insgnss.geodesy.earth import EARTH_RATE, normal_gravity
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.records import Estimate
from insgnss.records.states import TIME_OFFSET
from insgnss.simulation.dataset import Dataset, write_dataset, write_simulated
from insgnss.simulation.description import FIXES, Units, flight_toml, imu_file, true_tables
from insgnss.simulation.ground import drive
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import observe
from insgnss.simulation.sensors import ImuOptions, Rig, SecondImu

SIGMA = (0.02, 0.02, 0.03)  # m, north, east, down: white errors of the fixes, as they claim


@dataclass(frozen=True)
class Data:
    """A data set with flight files beside its own."""

    dataset: Dataset

    @property
    def root(self) -> Path:
        return self.dataset.directory

    @property
    def imu(self) -> np.ndarray:
        """(n, 7) rows of the IMU file: time, gyro, accel in SI."""
        return np.loadtxt(self.root / imu_file(self.dataset.simulated), delimiter=",", skiprows=1)

    def write_imu(self, name: str, rows: np.ndarray, header: str = "tow,gx,gy,gz,ax,ay,az") -> str:
        np.savetxt(self.root / name, rows, fmt="%.12g", delimiter=",", header=header, comments="")
        return name

    def write_fixes(
        self, name: str, edit: Callable[[np.ndarray], np.ndarray], more: str = ""
    ) -> str:
        head, *_ = (self.root / FIXES).read_text().splitlines()
        np.savetxt(
            self.root / name,
            edit(np.loadtxt(self.root / FIXES)),
            fmt="%.11g",
            header=head.lstrip("# ") + more,
        )
        return name

    def flight(self, name: str, **changes: Any) -> Path:
        simulated = self.dataset.simulated
        path = self.root / f"{name}.toml"
        quiet = {"output": {"formats": []}, **changes}
        path.write_text(
            flight_toml(true_tables(simulated, Units.of("mean_rate", None, None), "navchip"), quiet)
        )
        return path

    def recording(self, name: str, **changes: Any) -> Recording:
        return read_recording(load_flight(self.flight(name, **changes)))

    def process(self, name: str, **changes: Any) -> ProcessResult:
        return process(load_flight(self.flight(name, **changes)), self.root / "products" / name)


@pytest.fixture(scope="module")
def air(tmp_path_factory):
    """A minute and a half in the air with a second IMU half a metre from the first."""
    return Data(
        write_dataset(
            tmp_path_factory.mktemp("options") / "air",
            "ign8",
            1.5,
            imu_rate=100.0,
            seed=3,
            start_in_air=True,
            line_length_m=100.0,
            gnss=GnssOptions(sigma_m=SIGMA),
            second_imu=SecondImu(ImuOptions(100.0), (0.113, 0.520, 0.0)),
        )
    )


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    """A drive of a simple IMU and poor fixes, which begins with a stand."""
    gnss = GnssOptions(rate_hz=1.0, sigma_m=(3.0, 3.0, 3.0))
    simulated = observe(
        drive(2.2, seed=4, stand_s=25.0), 5, imu=ImuOptions(100.0, "consumer"), gnss=gnss
    )
    return Data(write_simulated(tmp_path_factory.mktemp("options") / "car", simulated))


def _contradictions(recording: Recording) -> set[str]:
    return {check.name for check in recording.checks if check.verdict == "contradiction"}


def _sigma(result: ProcessResult) -> np.ndarray:
    """(3,) median standard deviation of the images' positions, m, east, north, up."""
    assert result.eo is not None
    return np.median(np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2)), axis=0)[:3]


def _state(result: ProcessResult, name: str) -> Estimate:
    return next(state for state in result.diagnostics.states if state.name == name)


def test_reversed_force_is_turned_back(air):
    """Oracle: the readings before their sign was changed; without the key they contradict."""
    rows = air.imu
    rows[:, 4:] *= -1.0
    file = air.write_imu("reversed.csv", rows)
    got = air.recording("accel_sign", imu={"file": file, "accel_sign": -1})
    np.testing.assert_allclose(got.imu.accel, air.imu[:, 4:], rtol=0, atol=1e-9)
    assert not _contradictions(got)
    assert _contradictions(air.recording("accel_plain", imu={"file": file}))


def test_calibration_is_taken_off(air):
    """Oracle: readings made by hand from the file's: (1 + scale) times them, plus a bias of one
    axis.
    """
    rows = air.imu
    rows[:, 1] = 1.002 * rows[:, 1] + np.radians(1.0)
    rows[:, 6] = 0.998 * rows[:, 6] + 0.1
    text = (
        '[gyro]\nbias = ["1 deg/s", "0 deg/s", "0 deg/s"]\nscale_factor = ["2000 ppm", "0 ppm", "0'
        ' ppm"]\n'
    )
    text += (
        '[accel]\nbias = ["0 m/s^2", "0 m/s^2", "0.1 m/s^2"]\nscale_factor = ["0 ppm", "0 ppm",'
        ' "-2000 ppm"]\n'
    )
    (air.root / "imu_calibration.toml").write_text(text)
    file = air.write_imu("uncalibrated.csv", rows)
    got = air.recording("calibration", imu={"file": file, "calibration": "imu_calibration.toml"})
    np.testing.assert_allclose(
        np.hstack([got.imu.gyro, got.imu.accel]), air.imu[:, 1:], rtol=0, atol=1e-9
    )


def test_two_imus_have_less_noise_than_one(air):
    """Oracle: exact motion; the noise of a mean of two sensors is that of one over root two, and
    lever_m takes the arm off.
    """
    simulated = air.dataset.simulated
    lever = Rig().C_cb.T @ (np.array([0.113, 0.520, 0.0]) - np.array(simulated.rig.imu_m))
    more = {"file": imu_file(simulated, 2), "noise": "navchip"}
    one = air.recording("alone")
    both = air.recording("more", imu={"further": [{**more, "lever_m": lever.tolist()}]})
    without = air.recording("more_unmoved", imu={"further": [more]})
    assert both.noise.gyro[0].white_noise == pytest.approx(
        one.noise.gyro[0].white_noise / np.sqrt(2.0), rel=1e-3
    )
    exact = simulated.flight.motion.imu(100.0)

    def error(recording: Recording, what: str) -> np.ndarray:
        place = np.searchsorted(exact.time, recording.imu.time - 1e-6)
        seen = getattr(recording.imu, what) @ recording.C_b_imu.T
        return seen - getattr(exact, what)[place]

    inside = slice(200, -200)
    noise = [np.std(np.diff(error(r, "gyro")[inside], axis=0)) for r in (one, both)]
    assert noise[1] == pytest.approx(noise[0] / np.sqrt(2.0), rel=0.05)
    smooth = np.ones(50) / 50.0
    slow = [
        np.std([np.convolve(e, smooth, "valid") for e in error(r, "accel")[inside].T])
        for r in (both, without)
    ]
    assert slow[0] < 0.7 * slow[1]


def test_samples_without_time_are_counted(air):
    """Oracle: the stamps of the file before they were taken out of it."""
    rows = air.imu
    file = air.write_imu("untimed.csv", rows[:, 1:], "gx,gy,gz,ax,ay,az")
    got = air.recording(
        "rate_hz", imu={"file": file, "rate_hz": 100.0, "time_offset_s": float(rows[0, 0])}
    )
    np.testing.assert_allclose(got.imu.time, rows[:, 0], rtol=0, atol=1e-6)


def test_quality_has_least_sigmas(air):
    """Oracle: the table of the flight file, its defaults, and the claims of the fixes where they
    are larger.
    """
    rows = len(np.loadtxt(air.root / FIXES))
    quality = np.where(np.arange(rows) % 3 == 0, 2, 1)
    file = air.write_fixes("quality.txt", lambda fixes: np.column_stack([fixes, quality]), " Q")
    own = {"float": [0.1, 0.01, 0.4]}
    for name, floor, options in (
        ("quality", (0.3, 0.3, 0.6), {}),
        ("quality_own", (0.1, 0.02, 0.4), {"quality_sigma_m": own}),
    ):
        gnss = air.recording(name, gnss={"file": file, **options}).gnss
        sigma = np.sqrt(np.diagonal(gnss.cov_ned, axis1=1, axis2=2))
        np.testing.assert_allclose(
            sigma[gnss.quality == 2],
            np.broadcast_to(floor, (np.sum(gnss.quality == 2), 3)),
            rtol=1e-6,
        )
        np.testing.assert_allclose(
            sigma[gnss.quality == 1],
            np.broadcast_to(SIGMA, (np.sum(gnss.quality == 1), 3)),
            rtol=1e-6,
        )


def test_a_pos_of_an_engine_is_calibrated_unless_it_is_not_to_be(air):
    """Oracle: (k sigma)^2 + floor^2 + (ppm d)^2 of fixed epochs, k = 0.75, floor 1 mm, 1 ppm of 0;
    and what the file has.
    """
    write_rtklib_pos(air.dataset.simulated.gnss, air.root / "plain.pos")
    lines = (air.root / "plain.pos").read_text().splitlines()
    fields = [line.split() for line in lines[2:]]
    head = [f"% ref pos   : {' '.join(fields[0][2:5])}", lines[0], lines[1]]
    rows = [" ".join([*row[:5], "1", "14", *row[7:]]) for row in fields]
    (air.root / "engine.pos").write_text("\n".join([*head, *rows]) + "\n")
    kept, found = (
        air.recording(f"pos_{on}", gnss={"file": "engine.pos", "calibrate_covariance": on})
        for on in (False, True)
    )
    expected = 0.75**2 * kept.gnss.cov_ned[0] + 0.001**2 * np.eye(3)
    np.testing.assert_allclose(found.gnss.cov_ned[0], expected, rtol=0.0, atol=1e-9)
    assert [check.name for check in found.checks].count("GNSS covariance") == 1
    assert "GNSS covariance" not in [check.name for check in kept.checks]


@pytest.mark.parametrize(("key", "value"), [("length", "cm"), ("quality", "nmea")])
def test_units_of_fixes(air, key, value):
    """Oracle: the same fixes in m and RTKLIB's codes (NMEA's 4 is fixed, RTKLIB's 1)."""

    def edit(fixes: np.ndarray) -> np.ndarray:
        if key == "length":
            fixes[:, 3:7] *= 100.0
            return fixes
        return np.column_stack([fixes, np.full(len(fixes), 4)])

    head = "tow lat[deg] lon[deg] h sd_n sd_e sd_u" + (" Q" if key == "quality" else "")
    name = f"units_{key}.txt"
    np.savetxt(air.root / name, edit(np.loadtxt(air.root / FIXES)), fmt="%.11g", header=head)
    gnss = air.recording(f"units_{key}", gnss={"file": name, "units": {key: value}}).gnss
    plain = air.dataset.simulated.gnss
    np.testing.assert_allclose(gnss.height, plain.height, atol=1e-3)
    np.testing.assert_allclose(gnss.cov_ned, plain.cov_ned, rtol=1e-3, atol=1e-8)
    assert gnss.quality is None if key == "length" else set(gnss.quality) == {1}


@pytest.mark.slow
def test_correlated_errors_do_not_average(air):
    """Oracle: an error of one sigma that outlasts the flight stays one sigma; of 0.2 s it averages
    over the minute's many.
    """
    off = air.process("correlated_off", gnss={"gm_sigma": "off"})
    assert off.diagnostics.time_correlated == ()
    result = {}
    for time_s in (1000.0, 0.2):
        result[time_s] = air.process(
            f"correlated_{time_s:g}", gnss={"gm_sigma": 1.0, "correlation_time_s": time_s}
        )
        error = result[time_s].diagnostics.time_correlated[0]
        assert (error.share, error.white) == ((1.0,) * 3, (1.0,) * 3)
        assert error.time_s == pytest.approx(time_s)
    east_north_up = np.array(SIGMA)[[1, 0, 2]]
    np.testing.assert_allclose(_sigma(result[1000.0]), east_north_up, rtol=0.15)
    assert (_sigma(result[0.2]) < 0.6 * east_north_up).all()
    assert (_sigma(result[0.2]) > 1.1 * _sigma(off)).all()


@pytest.mark.slow
def test_uncorrelated_scales_the_sigmas_of_the_fixes(air):
    """Oracle: the variance of an innovation is that of the fix, k^2 sigma^2, plus the prediction's,
    which is smaller.
    """
    for k in (1.0, 3.0):
        d = air.process(
            f"uncorrelated_{k:g}", gnss={"gm_sigma": "off", "white_scale": k}
        ).diagnostics
        settled = d.innovation_sigma[d.fix_time > d.fix_time[0] + 20.0]
        assert (settled >= k * np.array(SIGMA)).all()
        assert (np.median(settled, axis=0) < 1.3 * k * np.array(SIGMA)).all()


@pytest.mark.slow
def test_time_offset_is_held_by_its_sigma(air):
    """Oracle: the offset that the flight file was made to lack; a prior of 0.1 ms does not let it
    go there. The report's series ends with what the table of constants says.
    """
    late = 0.004
    results = [
        air.process(name, gnss={"time_offset_s": -late}, filter={"time_offset": True, **options})
        for name, options in (("offset", {}), ("offset_tight", {"time_offset_sigma_s": 1e-4}))
    ]
    wide, tight = (_state(result, "GNSS time offset") for result in results)
    series = results[0].diagnostics.constants
    assert series is not None
    column = series.states.index(TIME_OFFSET)
    assert series.value[-1, column] == pytest.approx(wide.value, rel=1e-9)
    assert series.sigma[-1, column] == pytest.approx(wide.sigma, rel=1e-9)
    assert series.filter_sigma[0, column] > 10.0 * series.filter_sigma[-1, column]
    assert (wide.prior, tight.prior) == (0.1, 1e-4)
    assert abs(wide.value - late) < 4.0 * wide.sigma + 2e-4
    assert wide.observed
    assert abs(tight.value) < 0.5 * late
    assert tight.sigma <= 1e-4


@pytest.mark.slow
def test_lever_arm_is_held_by_its_sigma(air):
    """Oracle: the mounting that the flight was simulated with; a prior of 1 mm does not let the
    estimate go there.
    """
    antenna, wrong = np.array(air.dataset.simulated.rig.antenna_m), np.array([0.0, 0.0, 0.05])
    off = -(air.dataset.simulated.rig.C_cb.T @ wrong)[2]
    wide, tight = (
        _state(
            air.process(name, mounting={"antenna_m": (antenna + wrong).tolist()}, filter=options),
            "antenna lever arm down",
        )
        for name, options in (
            ("lever", {"lever_arm": True}),
            ("lever_tight", {"lever_arm": True, "lever_arm_sigma_m": 1e-3}),
        )
    )
    assert (wide.prior, tight.prior) == (0.3, 1e-3)
    assert abs(wide.value - off) < 4.0 * wide.sigma
    assert wide.sigma < 0.1
    assert abs(tight.value) < 4e-3
    assert tight.sigma <= 1e-3


@pytest.mark.slow
def test_robust_gives_suspicious_fixes_less_weight(air):
    """Oracle: every tenth fix is four sigma too high, which passes the gate."""

    def edit(fixes: np.ndarray) -> np.ndarray:
        fixes[::10, 3] += 4.0 * SIGMA[2]
        return fixes

    file = air.write_fixes("suspicious.txt", edit)
    truth = air.dataset.simulated.truth.eo
    error = []
    for robust in (False, True):
        eo = air.process(
            f"robust_{robust}", gnss={"file": file, "gm_sigma": "off"}, filter={"robust": robust}
        ).eo
        at = [truth.images.index(image) for image in eo.images]
        error.append(float(np.mean(eo.position_m[:, 2] - truth.position_m[at, 2])))
    assert 0.008 < error[0] < 0.016  # a tenth of 12 cm, and what the noise makes of four images
    assert error[0] - error[1] > 0.003


@pytest.mark.slow
def test_wheels_and_rests_hold_the_drive(car):
    """Oracle: exact motion, without side slip, at rest for the first 25 s; what the vehicle is
    known to do brings the estimate to it.
    """
    motion = car.dataset.simulated.flight.motion
    heading, stand, told = {}, {}, {}
    for name, options in (
        ("wheels", {"non_holonomic": True}),
        ("plain", {}),
        ("off", {"zero_velocity": "off"}),
    ):
        result = car.process(name, filter=options, gnss={"gm_sigma": "off"})
        path = result.trajectory
        true = motion.C_nl(path.time) @ motion.C_lb(path.time)
        error = vector_from_rotation(true @ np.swapaxes(path.C_nb, 1, 2))[:, 2]
        heading[name] = (np.sqrt(np.mean(error**2)), np.median(np.sqrt(path.cov[:, 8, 8])))
        still = (path.time > motion.start + 3.0) & (path.time < motion.start + 22.0)
        stand[name] = (
            np.sqrt(np.mean(path.velocity_ned[still] ** 2)),
            np.median(np.sqrt(path.cov[still][:, 3, 3])),
        )
        told[name] = any("zero-velocity updates" in line for line in result.report["history"])
    assert (np.array(heading["wheels"]) < 0.9 * np.array(heading["plain"])).all()
    assert (np.array(stand["plain"]) < 0.4 * np.array(stand["off"])).all()
    assert told == {"wheels": True, "plain": True, "off": False}
    assert len(car.recording("rests").stationary) > 0
    assert len(car.recording("no_rests", filter={"zero_velocity": "off"}).stationary) == 0


def test_a_sensor_that_stands_needs_no_fixes(tmp_path):
    """Oracle: gravity and Earth rate of a sensor tilted by hand: 3 deg of pitch; the place of the
    flight file.
    """
    rng = np.random.default_rng(8)
    lat, pitch, n = np.radians(46.0), np.radians(3.0), 6000
    C_nb = np.array(
        [[np.cos(pitch), 0.0, np.sin(pitch)], [0.0, 1.0, 0.0], [-np.sin(pitch), 0.0, np.cos(pitch)]]
    )
    rate = C_nb.T @ np.array([EARTH_RATE * np.cos(lat), 0.0, -EARTH_RATE * np.sin(lat)])
    force = C_nb.T @ np.array([0.0, 0.0, -float(normal_gravity(lat, 400.0))])
    still = np.hstack(
        [rate + 5e-4 * rng.standard_normal((n, 3)), force + 5e-3 * rng.standard_normal((n, 3))]
    )
    rows = np.column_stack([1000.0 + 0.01 * np.arange(n), still])
    np.savetxt(
        tmp_path / "imu.csv",
        rows,
        fmt="%.9f",
        delimiter=",",
        header="tow,gx,gy,gz,ax,ay,az",
        comments="",
    )
    text = 'gps_week = 2008\n[imu]\nfile = "imu.csv"\n[gnss]\nstationary = [46.0, 7.0, 400.0]\n'
    text += "[initial]\nroll_deg = 0.0\npitch_deg = 2.0\nheading_deg = 0.0\n"
    (tmp_path / "flight.toml").write_text(text)
    path = process(load_flight(tmp_path), tmp_path / "out").trajectory
    assert (
        abs(np.degrees(np.arcsin(-path.C_nb[-1, 2, 0])) - 3.0) < 0.2
    )  # 3.5 mg, navchip's turn-on bias at 2 sigma
    assert np.abs(path.height - 400.0).max() < 0.05
    assert np.abs(np.degrees(path.lat) - 46.0).max() < 1e-6
    rows[3000:, 4] += 2.0 * np.sin(0.1 * np.arange(3000))
    np.savetxt(
        tmp_path / "imu.csv",
        rows,
        fmt="%.9f",
        delimiter=",",
        header="tow,gx,gy,gz,ax,ay,az",
        comments="",
    )
    assert "standing" in _contradictions(read_recording(load_flight(tmp_path)))
