"""The recogniser on simulated flights, where units, axes, signs and clocks are known because the
test sets them.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from insgnss.geodesy.axes import axes_words, parse_axes
from insgnss.geodesy.rotation import right_angle_rotations, vector_from_rotation
from insgnss.navigation.recognise.claims import compare
from insgnss.navigation.recognise.findings import MOST_CONFIDENCE
from insgnss.navigation.recognise.recognition import recognise
from insgnss.records import GnssFixes, ImuSamples
from insgnss.simulation.scenario import GnssOptions, ImuOptions, simulate_flight

G = 9.80665
WITH_VELOCITY = GnssOptions(velocity_sigma_ms=(0.03, 0.03, 0.05))
PROPERTIES = (
    *("quantity", "accelerometer unit", "gyro unit", "gyro triad", "force sign"),
    *("vertical axis", "forward axis", "axes", "time offset", "time scale"),
)
UNITS = {("rad/s", "m/s^2"): (1.0, 1.0), ("deg/s", "g"): (180.0 / np.pi, 1.0 / G)}


def fly(plan, seed, minutes=3.0, **gnss):
    flown = simulate_flight(
        plan,
        minutes,
        seed=seed,
        imu=ImuOptions(rate_hz=100.0),
        gnss=GnssOptions(**gnss) if gnss else WITH_VELOCITY,
        start_in_air=True,
    )
    return flown.imu, flown.gnss


@pytest.fixture(scope="module")
def block():
    return fly("ign8", 11)


@pytest.fixture(scope="module")
def corridor():
    return fly("ign6x1", 12, 4.0)


def without_velocity(gnss):
    return replace(gnss, velocity_ned=None, velocity_cov_ned=None)


def every_second(gnss):
    return gnss[::2]


def as_mounted(imu, C_b_imu, gyro_factor, accel_factor):
    """The readings that the same flight leaves in a sensor of other axes and units."""
    return replace(
        imu, gyro=gyro_factor * imu.gyro @ C_b_imu, accel=accel_factor * imu.accel @ C_b_imu
    )


def answers(found):
    return (
        found.quantity,
        found.gyro_unit,
        found.accel_unit,
        found.accel_sign,
        found.axes,
        found.time_scale,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "units",
    [next(iter(UNITS)), *(pytest.param(u, marks=pytest.mark.slow) for u in list(UNITS)[1:])],
)
@pytest.mark.parametrize("sign", [1, pytest.param(-1, marks=pytest.mark.slow)])
def test_all_orientations_units_and_signs(block, corridor, sign, units):
    """Oracle: the orientation, unit and sign that the test gave the readings; no wrong answer, and
    no abstention on these flights.
    """
    flights = (
        (block[0], every_second(without_velocity(block[1]))),
        (corridor[0], every_second(corridor[1])),
    )
    gyro_factor, accel_factor = UNITS[units]
    for i, C_b_imu in enumerate(right_angle_rotations()):
        imu, gnss = flights[i % 2]
        found = recognise(as_mounted(imu, C_b_imu, gyro_factor, sign * accel_factor), gnss)
        assert answers(found) == ("mean_rate", *units, sign, axes_words(C_b_imu), "same")
        assert abs(found.time_offset_s) < 3.0 * found.time_offset_sigma_s
        assert tuple(f.name for f in found.findings) == PROPERTIES
        assert all(0.98 < f.confidence <= MOST_CONFIDENCE for f in found.findings), [
            (f.name, f.confidence) for f in found.findings
        ]
        best = int(np.argmax(found.curves["orientation_score"]))
        assert np.array_equal(found.curves["orientation"][best], C_b_imu)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("late", "velocity"),
    [
        (0.3, True),
        (0.3, False),
        (-0.3, False),
        (0.05, True),
        (1.37, True),
        (1.37, False),
        (18.0, False),
        (-18.0, True),
        (17.6, False),
    ],
)
def test_latency_within_its_sigma(block, late, velocity):
    """Oracle: the delay that the test gave the GNSS stamps; 20 ms is a third of a metre."""
    imu, gnss = block
    gnss = gnss if velocity else without_velocity(gnss)
    found = recognise(imu, replace(gnss, time=gnss.time - late))
    assert abs(found.time_offset_s - late) < 3.0 * found.time_offset_sigma_s
    assert found.time_offset_sigma_s < 0.02
    scale = {18.0: "GNSS in UTC", 17.6: "GNSS in UTC", -18.0: "IMU in UTC", 1.37: "other"}
    assert found.time_scale == scale.get(late, "same")
    assert found.axes == "forward right down"


def test_leap_seconds_are_those_of_the_date(block):
    """Oracle: IERS Bulletin C: GPST - UTC was 15 s in week 1560 (2009), 18 s in 2008 (2018)."""
    imu, gnss = block
    for week, leap in ((1560, 15.0), (2008, 18.0)):
        shifted = replace(gnss, time=gnss.time - leap, gps_week=week)
        assert recognise(replace(imu, gps_week=week), shifted).time_scale == "GNSS in UTC"
        other = recognise(
            replace(imu, gps_week=3568 - week), replace(shifted, gps_week=3568 - week)
        )
        assert other.time_scale == "other"


@pytest.mark.parametrize("gyro_unit", ["rad", "deg"])
@pytest.mark.parametrize("rate_hz", [100.0, 50.0])
def test_increments(block, gyro_unit, rate_hz):
    """Oracle: the definition of an increment, rate times interval; at 50 Hz 1 deg of increment is
    0.87 rad/s, close to 1.
    """
    imu, gnss = block
    every = round(100.0 / rate_hz)
    time, gyro, accel = imu.time[::every], imu.gyro[::every] / rate_hz, imu.accel[::every] / rate_hz
    if gyro_unit == "deg":
        gyro = np.degrees(gyro)
    found = recognise(ImuSamples(time, gyro, accel, "increments"), gnss)
    assert answers(found) == ("increments", gyro_unit, "m/s", 1, "forward right down", "same")
    assert found.gyro_factor == pytest.approx(
        1.0 if gyro_unit == "rad" else np.pi / 180.0, rel=1e-6
    )
    assert found.accel_factor == pytest.approx(1.0, rel=1e-6)
    assert [
        c.verdict
        for c in compare(found, np.eye(3), quantity="increments", gyro_unit="rad", accel_unit="m/s")
    ][1:] == ["ok"] * 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gyro_of_force", "words"),
    [
        (-np.eye(3), "gyro -x -y -z"),
        (np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), "gyro +y +x +z"),
    ],
)
def test_gyros_in_other_axes_than_the_accelerometers_are_told(block, gyro_of_force, words):
    """Oracle: the exchange of columns and signs that the test made; the words undo it."""
    imu, gnss = block
    found = recognise(replace(imu, gyro=imu.gyro @ gyro_of_force), gnss)
    assert found.axes is None
    assert found.finding("gyro triad").found == words
    check = next(c for c in compare(found, np.eye(3)) if c.name == "recognised axes")
    assert check.verdict == "contradiction"
    assert words in check.advice


@pytest.mark.parametrize(
    "gnss",
    [
        {"outlier_fraction": 0.05, "outlier_m": (1.0, 50.0)},
        {"rate_hz": 1.0, "sigma_m": (0.3, 0.3, 0.6), "correlated_sigma_m": (1.0, 1.0, 2.0)},
        {"rate_hz": 5.0, "outages": ((60.0, 30.0),)},
    ],
)
def test_poor_fixes(gnss):
    """Oracle: the simulator's truth, with gross errors, with a single-point receiver at 1 Hz, and
    with a gap.
    """
    imu, fixes = fly("ign8", 4, 4.0, **gnss)
    found = recognise(imu, fixes)
    assert answers(found) == ("mean_rate", "rad/s", "m/s^2", 1, "forward right down", "same")
    assert abs(found.time_offset_s) < 3.0 * found.time_offset_sigma_s


@pytest.mark.slow
def test_poor_sensors(corridor):
    """Oracle: the simulator's truth under gyro bias, spikes, coarse steps and gaps of half a
    second.
    """
    imu, gnss = corridor
    rng = np.random.default_rng(1)
    spiky = np.where(rng.random(imu.gyro.shape) < 1e-3, rng.normal(0.0, 30.0, imu.gyro.shape), 0.0)
    kept = np.arange(imu.time.size) % 1000 > 50
    for poor in (
        replace(imu, gyro=imu.gyro + np.radians([1.0, -2.0, 3.0])),
        replace(imu, gyro=imu.gyro + spiky, accel=imu.accel + 30.0 * spiky),
        replace(imu, gyro=np.round(imu.gyro, 2), accel=np.round(imu.accel, 1)),
        ImuSamples(imu.time[kept], imu.gyro[kept], imu.accel[kept]),
    ):
        found = recognise(poor, gnss)
        assert answers(found) == ("mean_rate", "rad/s", "m/s^2", 1, "forward right down", "same")
        assert abs(found.time_offset_s) < 3.0 * found.time_offset_sigma_s


def standing(seconds, rng, gyro_bias=0.002):
    """A sensor and a receiver at rest."""
    t, tg = np.arange(0.0, seconds, 0.01), np.arange(0.0, seconds, 0.1)
    imu = ImuSamples(
        t,
        rng.normal(gyro_bias, 0.002, (t.size, 3)),
        rng.normal(0.0, 0.05, (t.size, 3)) - [0.0, 0.0, 9.81],
    )
    noise = rng.normal(0.0, 0.02, (tg.size, 3))
    cov = np.broadcast_to(np.diag([4e-4] * 3), (tg.size, 3, 3))
    return imu, GnssFixes(
        tg, 0.8 + noise[:, 0] / 6.38e6, 0.1 + noise[:, 1] / 4.4e6, 500.0 + noise[:, 2], cov
    )


def test_who_stands_tells_the_accelerometers_unit_only():
    """Oracle: nothing turns, nothing moves: whatever else were said would be guessed."""
    for seed in range(5):
        found = recognise(*standing(60.0, np.random.default_rng(seed)))
        assert {f.name for f in found.findings if f.confidence > 0.0} == {
            "quantity",
            "accelerometer unit",
        }
        assert found.axes is None
        assert np.isinf(found.time_offset_sigma_s)
        assert {c.verdict for c in compare(found, np.eye(3))} == {"note"}


@pytest.mark.parametrize("channel", [*product(("gyro", "accel"), range(3))])
def test_a_dead_channel_makes_it_abstain(block, channel):
    """Oracle: a reading that never changes says nothing; with it another arrangement of axes may
    look better than the true one.
    """
    imu, gnss = block
    sensor, axis = channel
    values = getattr(imu, sensor).copy()
    values[:, axis] = 0.25
    found = recognise(replace(imu, **{sensor: values}), gnss)
    assert all(f.confidence == 0.0 for f in found.findings)
    assert "xyz"[axis] in found.findings[0].evidence


@pytest.mark.parametrize(
    ("samples", "fixes"), [(2, 1), (2, 600), (6000, 1), (6000, 12), (5, 5), (300, 30)]
)
def test_too_little_to_look_at(samples, fixes):
    """Oracle: common sense: no answer beyond the unit, and no error."""
    imu, gnss = standing(60.0, np.random.default_rng(0))
    gnss = gnss[:fixes]
    found = recognise(ImuSamples(imu.time[:samples], imu.gyro[:samples], imu.accel[:samples]), gnss)
    assert found.axes is None
    assert found.finding("axes").confidence == 0.0


@pytest.mark.slow
def test_another_flight_explains_nothing(block, corridor):
    """Oracle: the fixes of another flight, on the clock of this one and on a clock of their own."""
    for imu, gnss in (
        (block[0], corridor[1]),
        (corridor[0], replace(block[1], time=block[1].time - 1e5)),
    ):
        found = recognise(imu, without_velocity(gnss))
        assert {f.name for f in found.findings if f.confidence > 0.0} == {
            "quantity",
            "accelerometer unit",
        }


@pytest.mark.parametrize("apart", [205200.0, -1.5e9 + 0.25])
def test_clocks_with_nothing_in_common(corridor, apart):
    """Oracle: the difference that the test gave the clocks, as between seconds since power-up and
    time of week or Unix time.
    """
    imu, gnss = corridor
    found = recognise(imu, replace(gnss, time=gnss.time - apart))
    assert (found.axes, found.time_scale) == ("forward right down", "other")
    assert abs(found.time_offset_s - apart) < 3.0 * found.time_offset_sigma_s


def lawn_mower(line_s=24.0, lines=8):
    """A multirotor in wind that flies alike lines to and fro, nose first, and its fixes; force and
    rates from the motion by spline.
    """
    from scipy.interpolate import CubicSpline

    knots = np.arange(0.0, line_s * lines, 2.0)
    along = np.abs((knots / line_s) % 2.0 - 1.0) * 120.0
    rng = np.random.default_rng(7)
    line = np.column_stack(
        [0.8 * along + 1.2 * knots, 0.6 * along - 0.9 * knots, np.full(knots.size, -50.0)]
    )
    path = CubicSpline(knots, line + rng.normal(0.0, 0.3, line.shape))
    t = np.arange(0.0, line_s * (lines - 1), 0.01)
    force = path(t, 2) - [0.0, 0.0, 9.81]
    down = -(force + 0.3 * (path(t, 1) - [3.0, -2.0, 0.0]))
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    heading = np.unwrap(np.arctan2(path(t, 1)[:, 1], path(t, 1)[:, 0]))
    heading = np.convolve(np.pad(heading, 200, mode="edge"), np.ones(401) / 401, mode="valid")
    right = np.cross(down, np.column_stack([np.cos(heading), np.sin(heading), 0.0 * t]))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    C_nb = np.stack([np.cross(right, down), right, down], axis=2)
    rate = vector_from_rotation(np.swapaxes(C_nb[:-1], 1, 2) @ C_nb[1:]) / 0.01
    felt = np.einsum("nji,nj->ni", C_nb, force)
    imu = ImuSamples(
        t[1:],
        rate + rng.normal(0.0, 0.02, rate.shape),
        0.5 * (felt[1:] + felt[:-1]) + rng.normal(0.0, 0.3, rate.shape),
    )
    at = np.arange(1.0, t[-1] - 1.0, 0.2)
    p = path(at) + rng.normal(0.0, 0.2, (at.size, 3))
    cov = np.broadcast_to(np.eye(3) * 0.04, (at.size, 3, 3))
    return imu, GnssFixes(at, p[:, 0] / 6335439.0, p[:, 1] / 6378137.0, -p[:, 2], cov)


def test_lines_that_repeat_themselves_are_not_confused():
    """Oracle: the attitude that the test made; a line later everything repeats itself reversed, as
    if force were reversed and z up.
    """
    imu, gnss = lawn_mower()
    found = recognise(imu, gnss)
    assert (found.axes, found.accel_sign, found.time_scale) == ("forward right down", 1, "same")
    assert abs(found.time_offset_s) < 3.0 * found.time_offset_sigma_s


class TestCompare:
    """What is told of a wrong claim. The records are as the claim makes them."""

    def verdicts(self, found, axes="forward right down", **claim):
        return {c.name: c for c in compare(found, parse_axes(axes), **claim)}

    def test_a_true_claim_is_not_disturbed(self, block):
        """Oracle: the simulator's own axes and units."""
        found = recognise(*block)
        assert {c.verdict for c in self.verdicts(found).values()} == {"ok"}
        assert list(self.verdicts(found)) == [
            "recognised units",
            "recognised axes",
            "recognised sign",
            "recognised clock",
        ]

    @pytest.mark.parametrize(
        ("claimed", "true", "factor"),
        [
            ("deg/s", "rad/s", np.pi / 180.0),
            ("rad/s", "deg/s", 180.0 / np.pi),
            ("deg/h", "deg/s", 1.0 / 3600.0),
        ],
    )
    def test_gyro_unit(self, block, claimed, true, factor):
        """Oracle: the readings of a file in `true` units, converted as if they were in `claimed`
        ones.
        """
        imu, gnss = block
        check = self.verdicts(
            recognise(replace(imu, gyro=imu.gyro * factor), gnss), gyro_unit=claimed
        )["recognised units"]
        assert check.verdict == "contradiction"
        assert f'imu.units gyro = "{true}"' in check.advice
        assert "accel" not in check.advice

    @pytest.mark.parametrize(
        ("claimed", "true", "factor"),
        [("g", "m/s^2", G), ("m/s^2", "g", 1.0 / G), ("mg", "g", 1e-3)],
    )
    def test_accelerometer_unit(self, block, claimed, true, factor):
        """Oracle: the readings of a file in `true` units, converted as if they were in `claimed`
        ones.
        """
        imu, gnss = block
        check = self.verdicts(
            recognise(replace(imu, accel=imu.accel * factor), gnss), accel_unit=claimed
        )["recognised units"]
        assert check.verdict == "contradiction"
        assert f'imu.units accel = "{true}"' in check.advice

    def test_quantity(self, block):
        """Oracle: increments read as rates."""
        imu, gnss = block
        check = self.verdicts(
            recognise(replace(imu, gyro=imu.gyro * 0.01, accel=imu.accel * 0.01), gnss)
        )["recognised units"]
        assert check.verdict == "contradiction"
        assert 'imu.quantity = "increments"' in check.advice

    def test_axes(self, block):
        """Oracle: all 23 wrong claims."""
        found = recognise(*block)
        for C_b_imu in right_angle_rotations():
            wrong = not np.array_equal(C_b_imu, np.eye(3))
            check = next(c for c in compare(found, C_b_imu) if c.name == "recognised axes")
            assert check.verdict == ("contradiction" if wrong else "ok")
            assert ('imu.axes = "forward right down"' in check.advice) == wrong

    def test_sign(self, block):
        """Oracle: the reaction in the place of specific force; the vertical axis is still the right
        one.
        """
        imu, gnss = block
        checks = self.verdicts(recognise(replace(imu, accel=-imu.accel), gnss))
        assert checks["recognised sign"].verdict == "contradiction"
        assert checks["recognised axes"].verdict == "ok"

    @pytest.mark.parametrize(
        ("late", "verdict"), [(0.0, "ok"), (0.2, "note"), (18.0, "contradiction")]
    )
    def test_clock(self, block, late, verdict):
        """Oracle: the delay that the test gave; the advice holds what the claim had added."""
        imu, gnss = block
        check = self.verdicts(
            recognise(imu, replace(gnss, time=gnss.time - late)), time_offset_s=5.0
        )["recognised clock"]
        assert check.verdict == verdict
        if late:
            assert float(
                check.advice.split("gnss.time_offset_s = ")[1].split()[0]
            ) == pytest.approx(5.0 + late, abs=0.03)
        assert ("UTC" in check.advice) == (late == 18.0)


def test_exchanged_latitude_and_longitude_are_not_taken_for_a_reversed_force(block):
    """Oracle: the exchange made here; the same flight with a force that is reversed is told as
    such.
    """
    imu, gnss = block
    gnss = without_velocity(gnss)
    found = recognise(imu, replace(gnss, lat=gnss.lon, lon=gnss.lat))
    assert found.exchanged
    assert found.axes is None
    assert found.finding("force sign").confidence == 0.0
    check = next(c for c in compare(found, np.eye(3)) if c.name == "recognised sign")
    assert check.verdict == "contradiction"
    assert "exchanged" in check.advice
    found = recognise(replace(imu, accel=-imu.accel), gnss)
    assert not found.exchanged
    assert found.accel_sign == -1


def test_counts_are_not_taken_for_the_nearest_unit(block):
    """Oracle: a count of 2^-24 rad at 100 Hz, 5.96e-6 rad/s, is 1.23 deg/h, which no gyro is off
    by.
    """
    imu, gnss = block
    count = 100.0 * 2.0**-24
    found = recognise(replace(imu, gyro=imu.gyro / count), gnss)
    finding = found.finding("gyro unit")
    assert finding.confidence == 0.0
    said = float(finding.evidence.split("counts of about ")[1].split()[0])
    assert abs(said / count - 1.0) < 0.02


def test_rates_are_not_called_mean(block):
    """Oracle: the evidence must say what gravity cannot tell."""
    finding = recognise(*block).finding("quantity")
    assert finding.found == "rates"
    assert "instantaneous" in finding.evidence


def test_turns_flown_without_fixed_ambiguities_still_tell(block):
    """Oracle: the flight itself, whose fixes are float (0.2 m said, an error that stays) wherever
    it turns, and fixed on the lines.
    """
    imu, gnss = block
    course = np.unwrap(np.arctan2(gnss.velocity_ned[:, 1], gnss.velocity_ned[:, 0]))
    rate = np.convolve(np.abs(np.gradient(course, gnss.time)), np.ones(25) / 25.0, mode="same")
    gnss, floating = without_velocity(gnss), rate > np.quantile(rate, 0.5)
    cov = np.where(
        floating[:, None, None], np.diag([0.04, 0.04, 0.16]), np.diag([1.4e-4, 1.4e-4, 6e-4])
    )
    found = recognise(imu, replace(gnss, lat=gnss.lat + 0.2 / 6.4e6 * floating, cov_ned=cov))
    assert (found.finding("gyro unit").found, found.finding("force sign").found) == (
        "rad/s",
        "specific force",
    )
    assert abs(found.time_offset_s) < 0.05
