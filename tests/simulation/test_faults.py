"""Faults of a recording: what they change, and that they change nothing else."""

import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import periodogram
from surveys import block_flight

from insgnss.base.errors import UsageError
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.description import FIXES
from insgnss.simulation.faults import FAULT_CHANNELS, ImuFaults, RowFaults, Stuck, Vibration
from insgnss.simulation.scenario import simulate_flight
from insgnss.simulation.sensors import ImuOptions, SecondImu

SHORT = {"minutes": 1.5, "imu_rate": 50.0, "start_in_air": True, "seed": 3}
IMU_FILE = "01_Observations/IMU/Data/Pre_calibrated/f8_{}_sob.csv"


@pytest.fixture(scope="module")
def ideal():
    return block_flight(1.0, start_in_air=True, seed=2).motion.imu(100.0)


def applied(ideal, seed=0, **faults):
    return ImuFaults(**faults).apply(ideal, np.random.default_rng(seed))


def table(path, **options):
    return np.loadtxt(path, comments="#", **options)


def test_no_fault_changes_nothing(ideal):
    """Oracle: the samples themselves, to the bit."""
    same = applied(ideal)
    for name in ("time", "gyro", "accel"):
        assert np.array_equal(getattr(same, name), getattr(ideal, name))


def test_gaps_take_samples_and_nothing_else(ideal):
    """Oracle: the clock: 0.5 s of 100 Hz are 50 samples, 2 s are 200; those that stay are the ones
    that were there.
    """
    cut = applied(ideal, gaps=((10.0, 0.5), (30.0, 2.0)))
    step = np.diff(cut.time)
    assert_allclose(step[step > 0.015], [0.51, 2.01], atol=1e-6)
    kept = np.isin(ideal.time, cut.time)
    assert kept.sum() == cut.time.size == ideal.time.size - 250
    assert np.array_equal(cut.gyro, ideal.gyro[kept])


def test_random_gaps_are_as_many_and_as_long_as_asked(ideal):
    """Oracle: counting; overlapping gaps merge, which with this seed none does."""
    cut = applied(ideal, seed=6, random_gaps=5, random_gap_s=(0.2, 0.4))
    step = np.diff(cut.time)
    assert (step > 0.015).sum() == 5
    assert 0.19 < step[step > 0.015].min() < step.max() < 0.42
    assert not np.array_equal(cut.time, applied(ideal, seed=7, random_gaps=5).time)


@pytest.mark.parametrize("channel", FAULT_CHANNELS)
def test_a_stuck_channel_repeats_and_the_others_go_on(ideal, channel):
    """Oracle: the samples; the value is the last reading before, or the one that is given."""
    k, at = FAULT_CHANNELS.index(channel), 20.0
    before = np.hstack([ideal.gyro, ideal.accel])
    for value in (None, 0.25):
        got = applied(ideal, stuck=(Stuck(channel, at, value, 10.0),))
        after = np.hstack([got.gyro, got.accel])
        on = (ideal.time - ideal.time[0] >= at) & (ideal.time - ideal.time[0] < at + 10.0)
        assert on.sum() == 1000
        assert (after[on, k] == (before[np.argmax(on) - 1, k] if value is None else value)).all()
        assert np.array_equal(after[~on], before[~on])
        others = np.arange(6) != k
        assert np.array_equal(after[:, others], before[:, others])


def test_clock_and_sign(ideal):
    """Oracle: arithmetic; UTC is 18 s behind GPS time."""
    got = applied(ideal, clock_offset_s=-18.0, reversed_accel=True)
    assert_allclose(got.time, ideal.time - 18.0, rtol=0, atol=1e-9)
    assert np.array_equal(got.accel, -ideal.accel)
    assert np.array_equal(got.gyro, ideal.gyro)


@pytest.mark.parametrize("quantity", ["mean_rate", "increments", "instant_rate"])
def test_vibration_is_a_line_of_its_frequency(quantity):
    """Oracle: scipy's periodogram: the energy lies within 10 % of 30 Hz, amplitudes within half and
    all of what is asked, mean zero.

    The mean over an interval of 5 ms takes sinc(30 / 200), 3.7 %, of the amplitude away.
    """
    motion = block_flight(1.0, start_in_air=True, seed=2).motion
    ideal = motion.imu(200.0, quantity)
    got = applied(ideal, vibration=Vibration(2.0, 0.05, 30.0, start_s=5.0, duration_s=40.0))
    unit = 200.0 if quantity == "increments" else 1.0
    for name, amplitude in (("accel", 2.0), ("gyro", 0.05)):
        line = unit * (getattr(got, name) - getattr(ideal, name))
        assert not line[:990].any()
        assert not line[9010:].any()
        on = line[1010:8990]
        f, power = periodogram(on, 200.0, axis=0)
        assert (power[(f > 27.0) & (f < 33.0)].sum(axis=0) > 0.99 * power.sum(axis=0)).all()
        size = (
            np.sqrt(2.0) * on.std(axis=0) / (1.0 if quantity == "instant_rate" else np.sinc(0.15))
        )
        assert (0.49 * amplitude < size).all()
        assert (size < 1.01 * amplitude).all()
        assert_allclose(on.mean(axis=0), 0.0, atol=0.01 * amplitude)


def test_truth_does_not_know_of_the_faults():
    """Oracle: the same flight without faults."""
    options = {"minutes": 0.5, "seed": 1, "start_in_air": True}
    faults = ImuFaults(gaps=((5.0, 2.0),), clock_offset_s=-18.0, stuck=(Stuck("gyro z", 3.0),))
    plain = simulate_flight(imu=ImuOptions(50.0), **options)
    faulty = simulate_flight(imu=ImuOptions(50.0, faults=faults), **options)
    assert np.array_equal(plain.truth.gyro_bias, faulty.truth.gyro_bias)
    assert np.array_equal(plain.truth.trajectory.lat, faulty.truth.trajectory.lat)
    assert np.array_equal(plain.gnss.lat, faulty.gnss.lat)
    assert faulty.imu.time.size == plain.imu.time.size - 100
    assert np.array_equal(
        faulty.imu.accel, plain.imu.accel[np.isin(plain.imu.time, faulty.imu.time + 18.0)]
    )


def test_rows_in_disorder_are_the_same_rows(tmp_path):
    """Oracle: sets and counts of the lines of the undisturbed file; binomial bounds of 4 sigma on
    the shares.
    """
    plain = write_dataset(tmp_path / "a", **SHORT)
    mixed = write_dataset(
        tmp_path / "b", **SHORT, imu_rows=RowFaults(duplicated=0.02, reordered=0.03, reach=3)
    )
    before, after = (
        (d.directory / IMU_FILE.format(1)).read_text().splitlines() for d in (plain, mixed)
    )
    assert before[0] == after[0]
    assert set(before) == set(after)
    n = len(before) - 1
    assert len(after) - len(before) == pytest.approx(0.02 * n, abs=4 * np.sqrt(0.02 * n))
    order = np.array([float(line.split(",")[0]) for line in after[1:]])
    back = np.diff(order) < 0
    assert back.sum() == pytest.approx(0.03 * n, abs=4 * np.sqrt(0.03 * n))
    assert np.diff(order).min() > -3.5 / 50.0
    assert (plain.directory / FIXES).read_bytes() == (mixed.directory / FIXES).read_bytes()


def test_late_stamps_are_late_and_the_readings_as_they_were(tmp_path):
    """Oracle: the undisturbed file; delays lie between zero and the limit, and only the stamps
    differ.
    """
    plain = write_dataset(tmp_path / "a", **SHORT)
    late = write_dataset(tmp_path / "b", **SHORT, gnss_rows=RowFaults(delayed=0.1, delay_s=0.05))
    before, after = (table(d.directory / FIXES) for d in (plain, late))
    assert np.array_equal(before[:, 1:], after[:, 1:])
    delay = after[:, 0] - before[:, 0]
    assert (delay != 0.0).mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.1 / len(delay)))
    assert delay.min() >= 0.0
    assert 0.04 < delay.max() <= 0.05


def test_a_wrong_flight_file_differs_in_what_is_asked_and_nothing_else(tmp_path):
    """Oracle: tomllib on both files; None takes a key away, a new table is added, the data are the
    same.
    """
    plain = write_dataset(tmp_path / "a", **SHORT)
    wrong = {
        "mounting": {"antenna_m": [0.8, 0.0, 0.0]},
        "filter": {"scale_factor": True},
        "gnss": {"gate_sigma": 4.0},
        "tangent_plane": None,
    }
    other = write_dataset(tmp_path / "b", **SHORT, flight_file=wrong | {"imu": {"noise": None}})
    right, left = (tomllib.loads(d.flight_file.read_text()) for d in (plain, other))
    assert left["mounting"].pop("antenna_m") == [0.8, 0.0, 0.0]
    assert left.pop("filter") == {"scale_factor": True}
    assert left["gnss"].pop("gate_sigma") == 4.0
    assert right["mounting"].pop("antenna_m") == [0.462, -0.001, -0.065]
    assert right.pop("tangent_plane")
    assert right["imu"].pop("noise") == "navchip"
    assert left == right
    assert (plain.directory / IMU_FILE.format(1)).read_bytes() == (
        other.directory / IMU_FILE.format(1)
    ).read_bytes()


def test_a_second_imu_has_errors_and_a_file_of_its_own(tmp_path):
    """Oracle: exact motion at the second place, in words its axes; noises differ; the first IMU's
    file is the one without a second.
    """
    plain = write_dataset(tmp_path / "a", **SHORT)
    quiet = SecondImu(ImuOptions(50.0, None, "right backward down"), (0.313, 0.020, 0.0))
    both = write_dataset(tmp_path / "b", **SHORT, second_imu=quiet)
    assert (plain.directory / IMU_FILE.format(1)).read_bytes() == (
        both.directory / IMU_FILE.format(1)
    ).read_bytes()
    second = table(both.directory / IMU_FILE.format(2), delimiter=",", skiprows=1)
    simulated = both.simulated
    lever = simulated.rig.C_cb.T @ [0.2, 0.0, 0.0]  # second less first, camera axes to body axes
    body = simulated.flight.motion.imu(50.0, lever_b=lever)
    assert_allclose(
        second[:, 1:4],
        np.stack([body.gyro[:, 1], -body.gyro[:, 0], body.gyro[:, 2]], axis=-1),
        rtol=0,
        atol=1e-9,
    )
    assert_allclose(
        second[:, 4:],
        np.stack([body.accel[:, 1], -body.accel[:, 0], body.accel[:, 2]], axis=-1),
        rtol=0,
        atol=1e-8,
    )
    twin = simulate_flight(
        minutes=0.3,
        seed=3,
        imu=ImuOptions(50.0),
        second_imu=SecondImu(ImuOptions(50.0), (0.113, 0.020, 0.0)),
        start_in_air=True,
    )
    assert twin.second_imu is not None
    assert (
        abs(
            np.corrcoef(
                (twin.second_imu[0].samples.accel - twin.flight.motion.imu(50.0).accel)[:, 0],
                twin.imu.accel[:, 0],
            )[0, 1]
        )
        < 0.5
    )
    assert not np.array_equal(twin.second_imu[0].samples.accel, twin.imu.accel)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Stuck("gyro w", 1.0), "gyro w"),
        (lambda: RowFaults(duplicated=1.0), "between 0 and 1"),
        (lambda: RowFaults(reach=0), "one place or more"),
    ],
)
def test_faults_that_are_none_are_refused(make, words):
    """Oracle: the contract; UsageError that names the value."""
    with pytest.raises(UsageError, match=words):
        make()


def test_a_recording_that_is_all_gap_is_refused(ideal):
    """Oracle: the contract."""
    with pytest.raises(UsageError, match="leave"):
        applied(ideal, gaps=((0.0, 1e4),))


def test_faults_may_be_given_as_plain_numbers():
    """Oracle: the records of the same numbers."""
    plain = ImuFaults(stuck=(("gyro x", 90.0),), vibration=(2.0, 0.02, 83.0))
    assert plain == ImuFaults(stuck=(Stuck("gyro x", 90.0),), vibration=Vibration(2.0, 0.02, 83.0))
    with pytest.raises(UsageError, match="stuck channel 'gyro'"):
        ImuFaults(stuck=(("gyro", 90.0),))
