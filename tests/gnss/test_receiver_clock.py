"""Camera events from the rover's clock to GPST: closed forms of clocks, and receivers simulated
with drift and jumps under the engine.
"""

from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.gnss.exposures.receiver_clock import clock_error, error_at, to_gpst
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.ppk import PpkInput, solve_ppk
from insgnss.gnss.rinex.camera_events import camera_events
from insgnss.gnss.rinex.observations import read_observations
from insgnss.records import CameraEvents, GnssFixes
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.raw_gnss.options import RawGnssOptions

STAMP = 1000.0 + 0.1 * np.arange(100)


def fixes_at(time, week=2000):
    n = time.size
    return GnssFixes(
        time,
        np.full(n, 0.8),
        np.full(n, 0.1),
        np.full(n, 500.0),
        np.tile(np.eye(3), (n, 1, 1)),
        gps_week=week,
    )


def rover_of(stamp, week=2000, comments=()):
    return SimpleNamespace(
        time=stamp, gps_week=week, header=SimpleNamespace(records={"COMMENT": comments})
    )


def sawtooth(stamp, drift=2e-6):
    """A clock that drifts from 0.45 ms, with jumps of -1 ms that keep it below 0.5 ms."""
    free = 4.5e-4 + drift * 10.0 * (stamp - stamp[0])
    return free - 1e-3 * np.round(free / 1e-3)


def test_a_drifting_clock_is_taken_off():
    """Oracle: the clock itself, a straight line."""
    clock = 4e-4 - 3e-6 * (STAMP - 1000.0)
    when = np.array([1000.0, 1001.234, 1005.55, 1009.9])
    events = CameraEvents(("a", "b", "c", "d"), when, 2000)
    found = to_gpst(events, rover_of(STAMP), fixes_at(STAMP - clock))
    np.testing.assert_allclose(
        found.time, when - 4e-4 + 3e-6 * (when - 1000.0), rtol=0.0, atol=1e-10
    )
    assert found.images == events.images
    assert found.notes[-1].verdict == "ok"
    assert (
        found.notes[-1].found
        == "+0.3703 to +0.4000 ms off GPST, subtracted from the times of the camera events"
    )


def test_a_jump_comes_with_the_later_epoch():
    """Oracle: the sawtooth's line before the jump continued to the later epoch, behind it the one
    behind the jump.
    """
    clock = sawtooth(STAMP)
    k = int(np.flatnonzero(np.diff(clock) < -5e-4)[0])
    when = np.array([STAMP[k] + 0.03, STAMP[k] + 0.09, STAMP[k + 1], STAMP[k + 1] + 0.01])
    error, known = error_at(STAMP, clock, when)
    line = 4.5e-4 + 2e-5 * (when - 1000.0)
    np.testing.assert_allclose(error, line - [0.0, 0.0, 1e-3, 1e-3], rtol=0.0, atol=1e-9)
    assert known.all()
    straight = np.interp(when, STAMP, clock)
    assert np.abs(straight - error)[:2].min() > 2e-4  # what a line through the jump would err by


@pytest.mark.parametrize(
    ("step_s", "jumps"), [(4.5e-5, False), (-4.5e-5, False), (5.5e-5, True), (-5.5e-5, True)]
)
def test_a_step_of_fifty_microseconds_beyond_the_drift_is_a_jump(step_s, jumps):
    """Oracle: the rule's 50 us, beyond what a bad crystal drifts (10 us/s, 1 us in 0.1 s).

    Half way between two epochs a clock that jumps goes on as before, one that does not has half
    of the step. 0.1 us, 1.5 um at 15 m/s.
    """
    drift = 1e-5 * np.sign(step_s)
    clock = drift * (STAMP - STAMP[0]) + np.where(np.arange(STAMP.size) > 50, step_s, 0.0)
    error, _ = error_at(STAMP, clock, STAMP[50:51] + 0.05)
    expected = clock[50] + 0.05 * drift + (0.0 if jumps else 0.5 * step_s)
    np.testing.assert_allclose(error, expected, rtol=0.0, atol=1e-7)


def test_a_bad_crystal_does_not_jump():
    """Oracle: a straight line of 9 us/s, which makes 180 us between epochs that are 20 s apart."""
    stamp = 1000.0 + 20.0 * np.arange(5)
    clock = 9e-6 * (stamp - 1000.0)
    error, _ = error_at(stamp, clock, np.array([1010.0, 1055.0]))
    np.testing.assert_allclose(error, [9e-5, 9e-6 * 55.0], rtol=0.0, atol=1e-10)


def test_gaps_and_ends_are_bridged_and_told():
    """Oracle: a line over a gap; before a jump in it, and outside, the nearest position's clock."""
    keep = (STAMP < 1002.95) | (STAMP > 1006.05)
    clock = 1e-4 + 1e-6 * (STAMP - 1000.0)
    when = np.array([999.5, 1004.0, 1008.0, 1012.0])
    error, known = error_at(STAMP[keep], clock[keep], when)
    np.testing.assert_allclose(error, [1e-4, 1.04e-4, 1.08e-4, clock[-1]], rtol=0.0, atol=1e-10)
    assert known.tolist() == [False, False, True, False]
    jumped = np.where(STAMP > 1004.5, clock - 1e-3, clock)[keep]
    error, _ = error_at(STAMP[keep], jumped, when)
    assert error[1] == pytest.approx(clock[29], abs=1e-12)
    events = CameraEvents(("a", "b", "c", "d"), when, 2000)
    note = to_gpst(events, rover_of(STAMP), fixes_at((STAMP - clock)[keep])).notes[-1]
    assert note.verdict == "note"
    assert "3 events, the first at 999.500 s, have no positions" in note.found


def test_time_marks_that_are_in_gpst_stay():
    """Oracle: the events as they stand; the comment is the one that convbin writes."""
    events = CameraEvents(("a", "b"), np.array([1001.0, 1002.0]), 2000)
    rover = rover_of(STAMP, comments=("log: flight.ubx", "format: u-blox UBX, option: -TADJ=0.1"))
    found = to_gpst(events, rover, fixes_at(STAMP - 4e-4))
    np.testing.assert_array_equal(found.time, events.time)
    assert "+0.4000 to +0.4000 ms off GPST, not subtracted" in found.notes[-1].found


def test_weeks_may_differ_and_other_flights_are_refused():
    """Oracle: the same instants counted from another week; positions half an epoch off belong to
    none.
    """
    clock = np.full(STAMP.size, 2e-4)
    stamp, found = clock_error(rover_of(STAMP), fixes_at(STAMP - clock - 604800.0, week=2001))
    np.testing.assert_array_equal(stamp, STAMP)
    np.testing.assert_allclose(found, clock, rtol=0.0, atol=1e-9)
    single, known = error_at(STAMP[:1], clock[:1], np.array([1000.0, 1001.0]))
    assert (single.tolist(), known.tolist()) == ([2e-4, 2e-4], [True, False])
    with pytest.raises(InputError, match="are not at epochs of the rover"):
        clock_error(rover_of(STAMP), fixes_at(STAMP + 0.05))


CLOCKS = {
    "offset": {"clock_offset_s": 4e-4, "clock_drift": 2e-7},
    "jumps": {"clock_drift": 1e-5, "clock_jump_s": 1e-3},
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", CLOCKS)
def test_events_of_a_simulated_flight_are_at_their_true_times(tmp_path, kind):
    """Oracle: the simulated instants of exposure. 0.5 us: stamps have 0.1 us, the receiver's code
    biases are metres (10 ns).
    """
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    write_dataset(
        tmp_path,
        "ign8",
        4.0,
        imu_rate=20.0,
        seed=23,
        start_in_air=True,
        raw_gnss=RawGnssOptions(rate_hz=2.0, **CLOCKS[kind]),
    )
    rover, base, *navigation = (
        next(tmp_path.rglob(pattern)) for pattern in ("rov*o", "tr2*o", "rov*n", "rov*g")
    )
    truth, true = (
        np.load(tmp_path / "truth" / "raw_gnss.npz"),
        np.load(tmp_path / "truth" / "eo.npz")["tow"],
    )
    options = EngineOptions(
        base_position_m=tuple(truth["base_position"].tolist()), base_point="apc"
    )
    result = solve_ppk(
        PpkInput(rover, base, tuple(navigation), options, wet_delay=False, velocity=False)
    )
    clock, stamp = truth["rover_clock_s"], truth["rover_stamp"]
    jump = np.flatnonzero(np.abs(np.diff(clock)) > 5e-4)
    assert (jump.size > 0) == (kind == "jumps")
    written = camera_events(read_observations(rover)).time
    assert np.abs(written - true).max() > 1e-4
    assert np.isin(np.searchsorted(stamp, written) - 1, jump).any() == (
        kind == "jumps"
    )  # events between the two epochs of a jump
    assert np.abs(result.events.time - true).max() < 5e-7
    assert any(check.name == "receiver clock" for check in result.events.notes)
