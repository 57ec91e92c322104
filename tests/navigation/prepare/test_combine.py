"""Several IMUs on one body: combined, and held against each other."""

import re
from dataclasses import replace

import numpy as np
import pytest
from surveys import block_flight

from insgnss.base.errors import InputError
from insgnss.geodesy.axes import parse_axes
from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.navigation.prepare.several_imus.combine import combine
from insgnss.records import ImuSamples
from insgnss.simulation.sensors import ImuOptions, simulate_imu

GYRO_Q, ACCEL_Q = 5.2e-5, 5.1e-4  # rad/s/sqrt(Hz), m/s^2/sqrt(Hz), NavChip
SIGMA = (GYRO_Q, ACCEL_Q)
LEVERS = np.array([[0.0, 0.0, 0.0], [0.10, -0.04, 0.02], [-0.03, 0.06, 0.05]])
AXES = ("forward right down", "right backward down", "down right backward")
RATE = 200.0


@pytest.fixture(scope="module")
def motion():
    return block_flight(1.6, seed=4, start_in_air=True).motion


def ideal(motion, lever, rate=RATE, quantity="mean_rate", phase=0.0):
    """Exact readings of a sensor at a lever arm, body axes: its specific force is that of its own
    path.
    """
    imu = motion.imu(rate, quantity, phase_s=phase)
    if not np.any(lever):
        return imu
    dt = 0.0 if quantity == "instant_rate" else 1.0 / rate
    extra = np.zeros_like(imu.accel)
    for weight, back in ((1.0, 1.0), (4.0, 0.5), (1.0, 0.0)):  # Simpson's rule over the sample
        extra += weight / 6.0 * lever_force(motion, lever, imu.time - back * dt)
    return replace(imu, accel=imu.accel + extra * (dt if quantity == "increments" else 1.0))


def lever_force(motion, lever, time, h=1e-3):
    """C^T d2(C l)/dt2 in body axes, by the second difference."""
    time = np.clip(time, motion.start + h, motion.end - h)
    second = (
        (motion.C_lb(time + h) - 2.0 * motion.C_lb(time) + motion.C_lb(time - h)) @ lever / h**2
    )
    return np.einsum("nji,nj->ni", motion.C_lb(time), second)


def mounted(imu, axes, seed=None, rate=RATE, sigma=SIGMA, bias=0.0):
    """The same in the sensor's own axes, with bias and white noise."""
    C = parse_axes(axes)
    gyro, accel = imu.gyro @ C, imu.accel @ C
    if seed is not None:
        rng = np.random.default_rng(seed)
        scale = 1.0 / rate if imu.quantity == "increments" else 1.0
        gyro = (
            gyro
            + (
                rng.normal(0.0, sigma[0] * np.sqrt(rate), gyro.shape)
                + 1e-3 * bias * rng.normal(size=3)
            )
            * scale
        )
        accel = (
            accel
            + (
                rng.normal(0.0, sigma[1] * np.sqrt(rate), accel.shape)
                + 3e-2 * bias * rng.normal(size=3)
            )
            * scale
        )
    return replace(imu, gyro=gyro, accel=accel, source="")


def put_together(imus, levers=LEVERS, sigma=None, **options):
    m = len(imus)
    return combine(
        imus, [parse_axes(a) for a in AXES[:m]], list(levers[:m]), sigma or [SIGMA] * m, **options
    )


def parity(combined):
    """What the IMUs say of each other."""
    return next(check for check in combined.checks if check.name == "IMU parity")


@pytest.fixture(scope="module")
def three(motion):
    """Three noisy sensors on their lever arms, in three sets of axes."""
    return [mounted(ideal(motion, LEVERS[j]), AXES[j], seed=10 + j, bias=1.0) for j in range(3)]


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["mean_rate", "increments", "instant_rate"])
def test_the_lever_arm_is_taken_off(motion, quantity):
    """Oracle: exact motion of both points (second difference of the path of the second); what
    remains is the slope over 20 ms.
    """
    first, second = (
        mounted(ideal(motion, LEVERS[j], quantity=quantity), AXES[j]) for j in range(2)
    )
    got = put_together([first, second]).samples
    truth = motion.imu(RATE, "instant_rate" if quantity == "instant_rate" else "mean_rate")
    middle = slice(20, -20)
    assert got.quantity == truth.quantity
    np.testing.assert_allclose(got.gyro[middle], truth.gyro[middle], rtol=0, atol=1e-9)
    error = got.accel[middle] - truth.accel[middle]
    effect = (mounted(ideal(motion, LEVERS[1]), AXES[0]).accel - truth.accel)[middle]
    assert np.abs(effect).max() > 0.05
    assert np.sqrt(np.mean(error**2)) < 0.005 * np.sqrt(np.mean(effect**2))


def test_another_clock_and_rate_are_put_onto_the_first(motion):
    """Oracle: exact motion sampled at 250 Hz on a shifted grid, stamps late by 4.3 ms."""
    first = mounted(ideal(motion, LEVERS[0]), AXES[0], seed=1)
    second = mounted(
        ideal(motion, LEVERS[1], rate=250.0, phase=1.1e-3), AXES[1], seed=2, rate=250.0
    )
    got = put_together([first, replace(second, time=second.time + 4.3e-3)])
    clocks = next(c.found for c in got.checks if c.name == "IMU clocks")
    offset_ms, sigma_ms = map(float, re.match(r"IMU 2: (\S+) \+- (\S+) ms added", clocks).groups())
    assert offset_ms == pytest.approx(-4.3, abs=4.0 * sigma_ms)
    assert sigma_ms < 0.1
    assert parity(got).verdict == "ok"


def test_interpolation_keeps_what_was_turned(motion):
    """Oracle: the sum of the exact increments; noise-free, another rate and phase; no error
    accumulates.
    """
    first = mounted(ideal(motion, LEVERS[0]), AXES[0])
    second = mounted(ideal(motion, LEVERS[0], rate=170.0, phase=2.3e-3), AXES[1])
    got = put_together(
        [first, second], np.zeros((3, 3)), [(1.0, 1.0), (1e-6, 1e-6)]
    ).samples  # the second alone
    inside = slice(20, -20)
    np.testing.assert_allclose(
        np.cumsum(got.gyro[inside] / RATE, 0), np.cumsum(first.gyro[inside] / RATE, 0), atol=2e-7
    )
    np.testing.assert_allclose(got.gyro[inside], first.gyro[inside], atol=1e-4)


def test_noise_of_the_combination(motion):
    """Oracle: (K.2), 1 / sqrt(sum 1 / q^2), for equal and for unequal IMUs; stationary, white,
    sample standard deviations to 2 %.
    """
    n = 20_000
    time = np.arange(1, n + 1) / RATE
    rng = np.random.default_rng(6)
    sigmas = [(1e-4, 1e-3), (2e-4, 4e-3), (1e-4, 1e-3)]
    imus = [
        ImuSamples(
            time,
            rng.normal(0.0, g * np.sqrt(RATE), (n, 3)) @ parse_axes(a),
            (rng.normal(0.0, f * np.sqrt(RATE), (n, 3)) + [0, 0, -9.8]) @ parse_axes(a),
        )
        for (g, f), a in zip(sigmas, AXES, strict=True)
    ]
    got = put_together(imus, np.zeros((3, 3)), sigmas)
    gyro_noise, accel_noise = (1e8 + 0.25e8 + 1e8) ** -0.5, (1e6 + 1e6 / 16 + 1e6) ** -0.5
    np.testing.assert_allclose(got.samples.gyro.std(axis=0), gyro_noise * np.sqrt(RATE), rtol=0.02)
    np.testing.assert_allclose(
        got.samples.accel.std(axis=0), accel_noise * np.sqrt(RATE), rtol=0.02
    )
    np.testing.assert_allclose(got.weight.T, [[4 / 9, 1 / 9, 4 / 9], [16 / 33, 1 / 33, 16 / 33]])
    two = put_together(imus[:2], np.zeros((3, 3)), sigmas[:2])
    np.testing.assert_allclose(
        two.samples.gyro.std(axis=0), 1.25e8**-0.5 * np.sqrt(RATE), rtol=0.02
    )
    assert "hardly turns" in two.checks[0].found


def test_sound_imus_agree(three):
    """Oracle: white noise and constant biases only: q of (J.1), whose root is said, is 1 in the
    mean where the body moves little.
    """
    check = parity(put_together(three))
    assert check.verdict == "ok"
    gyro, accel = map(float, re.findall(r"(\d+\.\d+) \(", check.found))
    assert 1.0 <= gyro < 1.3**0.5
    assert 1.0 <= accel < 1.3**0.5


def test_sound_imus_of_the_papers_noise_agree():
    """Oracle: simulated NavChips (Table 5, with their Gauss-Markov biases and turn-on biases) at
    one place through take-off and turns.
    """
    flight = block_flight(4.0, seed=8)
    imus = [
        simulate_imu(
            flight, ImuOptions(rate_hz=100.0, axes=AXES[j]), np.random.default_rng(j)
        ).samples
        for j in range(2)
    ]
    got = put_together(imus, np.zeros((3, 3)))
    assert parity(got).verdict == "ok", parity(got).found


def test_vibration_of_the_rotors_is_no_fault(three):
    """Oracle: 83 Hz of 1 m/s^2 and 0.1 rad/s in opposite phase, as a soft board has it; its mean
    over 0.1 s is nothing.
    """
    shaken = []
    for imu, sign in zip(three, (1.0, -1.0, 1.0), strict=True):
        wave = sign * np.sin(2.0 * np.pi * 83.0 * imu.time)[:, None]
        shaken.append(replace(imu, gyro=imu.gyro + 0.1 * wave, accel=imu.accel + wave))
    for count in (2, 3):
        check = parity(put_together(shaken[:count]))
        assert check.verdict == "ok", check.found


@pytest.mark.parametrize(("angle_deg", "verdict"), [(2.0, "note"), (10.0, "contradiction")])
def test_an_imu_mounted_askew_is_told(three, angle_deg, verdict):
    """Oracle: the second turned about the vertical by a known angle."""
    C = rotation_from_rpy([0.0, 0.0, np.radians(angle_deg)])
    askew = parse_axes(AXES[1]).T @ C @ parse_axes(AXES[1])
    second = replace(three[1], gyro=three[1].gyro @ askew.T, accel=three[1].accel @ askew.T)
    check = parity(put_together([three[0], second]))
    assert check.verdict == verdict
    assert verdict == "contradiction" or "IMU 2 is turned by 2.0 deg against IMU 1" in check.found


def test_a_second_in_common_is_not_judged(three):
    """Oracle: no statistics of three half-seconds."""
    short = [
        replace(imu, time=imu.time[:300], gyro=imu.gyro[:300], accel=imu.accel[:300])
        for imu in three[:2]
    ]
    check = parity(put_together(short))
    assert check.verdict == "note"
    assert check.found == "less than two seconds in common"


def crippled(imu, fault, rng):
    """A recording with a fault from its middle on, in its own axes."""
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    half = len(gyro) // 2
    if fault == "stuck gyro axis":
        gyro[half:, 1] = gyro[half, 1]
    elif fault == "stuck accelerometer axis":
        accel[half:, 2] = accel[half, 2]
    elif fault == "scale step":
        gyro[half:] *= 1.05
        accel[half:] *= 1.05
    elif fault == "spikes":
        at = half + np.sort(rng.choice(half, 40, replace=False))
        gyro[at, 0] += rng.choice([-1.0, 1.0], 40) * 2.0
    elif fault == "bias step":
        accel[half:, 0] += 0.1
        gyro[half:, 2] += np.radians(0.2)
    elif fault == "noise":
        gyro[half:] += rng.normal(0.0, 20 * GYRO_Q * np.sqrt(RATE), gyro[half:].shape)
    elif fault == "dead from the start":
        gyro[:, 0] = 0.0
    return replace(imu, gyro=gyro, accel=accel)


FAULTS = (
    "stuck gyro axis",
    "stuck accelerometer axis",
    "scale step",
    "spikes",
    "bias step",
    "noise",
    "dead from the start",
)


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("which", [0, 2])
def test_of_three_the_faulty_one_is_named(three, fault, which):
    """Oracle: the injected fault."""
    imus = list(three)
    imus[which] = crippled(imus[which], fault, np.random.default_rng(3))
    check = parity(put_together(imus))
    assert check.verdict == "contradiction"
    assert check.found.startswith(f"IMU {which + 1} is faulty")


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("which", [0, 1])
def test_of_two_a_fault_is_seen_and_named_where_it_is_evident(three, fault, which):
    """Oracle: the injected fault; a step of scale or bias is nobody's; half the samples with noise
    is the data's word.
    """
    imus = list(three[:2])
    imus[which] = crippled(imus[which], fault, np.random.default_rng(3))
    check = parity(put_together(imus))
    assert check.verdict == "contradiction"
    if "step" in fault:
        assert "one of IMU 1, IMU 2 is faulty" in check.found
    else:
        assert check.found.startswith(f"IMU {which + 1} is faulty")


def test_a_gap_of_one_leaves_the_others(three):
    """Oracle: the first alone in the gap; counted in a note."""
    second = three[1]
    keep = (second.time < second.time[0] + 40.0) | (second.time > second.time[0] + 42.0)
    broken = replace(
        second, time=second.time[keep], gyro=second.gyro[keep], accel=second.accel[keep]
    )
    got = put_together([three[0], broken])
    inside = (three[0].time > second.time[0] + 40.5) & (three[0].time < second.time[0] + 41.5)
    np.testing.assert_allclose(got.samples.gyro[inside], three[0].gyro[inside], rtol=0, atol=1e-12)
    note = next(c for c in got.checks if c.name == "IMU overlap")
    assert note.verdict == "note"
    assert "IMU 2 lacks 2.1%" in note.found


def test_wrong_axes_are_a_contradiction(three):
    """Oracle: rates of other axes do not correlate."""
    C = [parse_axes(a) for a in ("forward right down", "forward right down")]
    got = combine(three[:2], C, list(LEVERS[:2]), [SIGMA] * 2)
    clocks = next(c for c in got.checks if c.name == "IMU clocks")
    assert clocks.verdict == "contradiction"
    assert "correlate by" in clocks.found
    assert parity(got).verdict == "contradiction"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lever_b": [[0.1, 0, 0], [0, 0, 0]]}, "lever arm .* of the first"),
        ({"sigma": [SIGMA]}, "2 IMUs with 2 sets of axes, 2 lever arms and 1 noises"),
        ({"sigma": [SIGMA, (0.0, 1.0)]}, "greater than zero"),
    ],
)
def test_what_cannot_be_combined_is_refused(three, change, message):
    """Oracle: the function's contract."""
    given = {
        "imus": three[:2],
        "C_b_imu": [np.eye(3)] * 2,
        "lever_b": list(LEVERS[:2]),
        "sigma": [SIGMA] * 2,
    } | change
    with pytest.raises(InputError, match=message):
        combine(**given)
    other = three[1]
    for changed, why in (
        (replace(other, quantity="instant_rate"), "instantaneous rates beside"),
        (replace(other, time=other.time + 1e4), "does not overlap"),
        (replace(other, gps_week=2000), None),
    ):
        if why:
            with pytest.raises(InputError, match=why):
                combine([three[0], changed], [np.eye(3)] * 2, list(LEVERS[:2]), [SIGMA] * 2)
