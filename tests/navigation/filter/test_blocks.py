"""Filter and smoother block by block, and what stays of a flight."""

import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flown import NO_GATE, fly, passes_in_one, start_near
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.navigation.filter import blocks, event_chain
from insgnss.navigation.filter.blocks import BlockwisePasses, record_bytes
from insgnss.navigation.filter.codes import NAV, POS
from insgnss.navigation.filter.correction import correct_solution
from insgnss.navigation.filter.covariances import ChainAgain
from insgnss.navigation.filter.event_chain import EventChain, common_errors, nodes_of
from insgnss.navigation.filter.forecast import forecast
from insgnss.navigation.filter.kernels.backward import CANCELLED
from insgnss.navigation.filter.smoother import SharedError
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.simulation.scenario import GnssOptions

SIGMA = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, *np.radians([2.0, 2.0, 5.0])])


@pytest.fixture(scope="module")
def posed():
    """Forty seconds with events, an outage of twelve seconds, and fixes that jump for two."""
    events = np.array([4.05, 12.3, 15.55, 16.0, 30.25])
    flown = fly(40.0, 7, imu_hz=50.0, gnss=GnssOptions(rate_hz=5.0), events_s=events)
    time, position = flown.problem.epochs.time, flown.problem.epochs.position
    flown.problem.epochs.has_position[(time > 10.0) & (time < 22.0)] = False
    position[(time > 30.0) & (time < 32.0), 1] += 3.0
    return flown.problem, start_near(flown, SIGMA)


def solved(posed: Any, monkeypatch: Any, block: int, kept_bytes: float, rows: int) -> Solution:
    """A solution with blocks of so many epochs; all records are kept where they are no larger."""
    monkeypatch.setattr(blocks, "EPOCHS_OF_BLOCK", block)
    monkeypatch.setattr(blocks, "WHOLE_BYTES", kept_bytes)
    return solve(*posed, "on", rows=rows)


@pytest.mark.parametrize(("block", "kept_bytes"), [(1, 0), (7, 0), (7, 1e12), (64, 0)])
def test_results_do_not_depend_on_the_blocks(posed, monkeypatch, block, kept_bytes):
    """Oracle: one block, all records kept; not a bit may differ, of covariances that are worked out
    again neither. Two passes, of which the second is linearised about the first, an outage, a
    covariance reset, events.
    """
    whole = solved(posed, monkeypatch, 10_000, 1e12, 10_000)
    in_blocks = solved(posed, monkeypatch, block, kept_bytes, 3)
    assert (whole.verdict[:, 0] == 3).any()
    assert whole.rows.size == whole.time.size > 2 * in_blocks.rows.size
    left = np.diagonal(whole.nav_covariance(), axis1=1, axis2=2) / whole.filter_sigma**2
    assert left.min() < CANCELLED  # (B.6) takes piece
    every = np.arange(whole.time.size)
    assert_array_equal(in_blocks.covariance(every), whole.covariance(every))
    assert_array_equal(in_blocks.nav_covariance(), whole.nav_covariance())
    for name in ("nav", "x", "filter_sigma", "nis", "verdict", "event_cross", "separation"):
        assert_array_equal(getattr(in_blocks, name), getattr(whole, name))
    assert_array_equal(whole.row_sigma[:, NAV], whole.filter_sigma)
    assert_array_equal(in_blocks.row_sigma, whole.row_sigma[in_blocks.rows])
    assert in_blocks.chain is not None
    assert whole.chain is not None
    T = np.tile(np.eye(9, whole.problem.layout.size), (5, 1, 1))
    assert_array_equal(
        in_blocks.chain.covariance_of(np.arange(len(T)), T),
        whole.chain.covariance_of(np.arange(len(T)), T),
    )


def test_blocks_give_what_the_passes_over_the_whole_flight_give(posed):
    """Oracle: one block, in which the kernels see all records at once."""
    problem, start = posed
    in_one = passes_in_one(problem, start)
    in_one.filter()
    expected = in_one.smooth()
    chain = in_one.chain(expected)
    assert chain is not None
    passes = BlockwisePasses(problem, start, np.arange(0, 150, 3), 100, 16, 0)
    passes.filter()
    got = passes.smooth()
    assert_array_equal(passes.smooth().delta, got.delta)  # the records are gone, and made again
    assert passes.history.P.shape[0] == 17
    assert expected.P is not None
    assert got.P is not None
    for name in ("delta", "nav_cov", "event_cross", "information", "adjoint"):
        assert_array_equal(getattr(got, name), getattr(expected, name))
    assert_array_equal(got.P, expected.P[::3][:50])
    assert_array_equal(got.P[:, :9, :9], np.array([expected.P[e, :9, :9] for e in got.rows]))
    of_blocks = passes.chain(got)
    assert of_blocks is not None
    assert_array_equal(of_blocks.transitions, chain.transitions)
    # of the states that poses read and of the nodes the same rows, and no others
    assert_array_equal(of_blocks.read.begin[[0, -1]], [0, of_blocks.gain.shape[0]])
    assert of_blocks.gain.size < chain.gain.size / 2
    T = np.tile(np.eye(9, problem.layout.size), (5, 1, 1))
    assert_array_equal(
        of_blocks.covariance_of(np.arange(len(T)), T), chain.covariance_of(np.arange(len(T)), T)
    )
    nodes = nodes_of(problem.layout, problem.epochs.time[of_blocks.epoch])
    assert nodes[0].size > 5
    assert_array_equal(
        common_errors(of_blocks, *nodes, T.__getitem__), common_errors(chain, *nodes, T.__getitem__)
    )
    with pytest.raises(ValueError, match="the chain of events does not keep this state"):
        of_blocks.covariance_of(np.arange(5), np.tile(np.eye(problem.layout.size), (5, 1, 1)))


@pytest.mark.parametrize("block", [7, 64])
def test_the_chain_of_many_events_is_worked_out_again(posed, monkeypatch, block):
    """Oracle: the chain that is kept; not a bit may differ, of any part, from parts of two events,
    through an outage, a covariance reset and a second pass. Nothing of an event stays but 9 x 9.
    """
    kept = solved(posed, monkeypatch, block, 0, 3)
    monkeypatch.setattr(blocks, "CHAIN_BYTES", 0)
    monkeypatch.setattr(event_chain, "EVENTS_OF_PIECE", 2)
    again = solved(posed, monkeypatch, block, 0, 3)
    assert isinstance(kept.chain, EventChain)
    assert isinstance(again.chain, ChainAgain)
    assert_array_equal(again.event_cross, kept.event_cross)
    assert set(kept.rows) - set(again.rows) == set(kept.event_epochs)
    for first, last in ((0, 5), (0, 2), (1, 4), (4, 5)):
        got, expected = (each.chain.piece(first, last) for each in (again, kept))
        for name in ("epoch", "transitions", "filtered", "gain"):
            assert_array_equal(getattr(got, name), getattr(expected, name))
        assert_array_equal(got.read.begin, expected.read.begin)
        assert_array_equal(got.read.state, expected.read.state)
    T = np.tile(np.eye(9, kept.problem.layout.size), (5, 1, 1))
    nodes = nodes_of(kept.problem.layout, kept.problem.epochs.time[kept.event_epochs])
    shared = (SharedError(0, kept.event_epochs[2], np.eye(3)),)
    A = [
        common_errors(each.enlarged(shared).chain, *nodes, T.__getitem__) for each in (again, kept)
    ]
    assert_array_equal(*A)


@pytest.mark.parametrize("block", [7, 64])
def test_images_correct_a_flight_of_many_events(posed, monkeypatch, block):
    """Oracle: the flight whose chain is kept, which `test_optimality` compares with one batch; not
    a bit may differ of its corrected states and covariances.
    """
    kept = solved(posed, monkeypatch, block, 0, 3)
    rng = np.random.default_rng(8)
    T = np.tile(np.eye(6, kept.problem.layout.size), (5, 1, 1))
    moment, root = rng.normal(size=(5, 6)), 1e-3 * rng.normal(size=(5, 6, 4))
    expected = correct_solution(kept, T, moment, root)
    monkeypatch.setattr(blocks, "CHAIN_BYTES", 0)
    again = solved(posed, monkeypatch, block, 0, 3)
    assert isinstance(again.chain, ChainAgain)
    got = correct_solution(again, T, moment, root)
    assert np.abs(got.nav - again.nav).max() > 1e-6
    for name in ("nav", "x", "event_cross"):
        assert_array_equal(getattr(got, name), getattr(expected, name))
    assert_array_equal(got.covariances.nav, expected.covariances.nav)


def test_a_part_of_a_solution_has_the_covariances_of_its_epochs(posed, monkeypatch):
    """Oracle: the whole, kept or worked out again; states that are left out, errors that no state
    describes, and an index from the end.
    """
    solution = solved(posed, monkeypatch, 7, 0, 3)
    every = solution.covariance(np.arange(solution.time.size))
    whole = solution.covariances
    piece = whole.piece(20, 90)
    at = np.array([0, 13, -1, 13])
    assert_array_equal(piece.whole(at), every[20:91][at])
    assert_array_equal(piece.variance(at), np.diagonal(every[20:91][at], axis1=1, axis2=2))
    assert_array_equal(piece.of_navigation(at), every[20:91][at][:, :9, :9])
    gone = np.array([10, 12])
    left = np.delete(np.arange(solution.problem.layout.size), gone)
    fewer = piece.without(gone)
    assert_array_equal(fewer.whole(at), every[20:91][at][:, left[:, None], left])
    assert_array_equal(fewer.variance(at), piece.variance(at)[:, left])
    A = np.random.default_rng(4).normal(size=(2, left.size))
    of_fewer = np.einsum("qi,kij,qj->kq", A, fewer.whole(at), A)
    assert_allclose(fewer.variance_of(at, A), of_fewer, rtol=1e-9)
    shared = np.diag([1.0, 2.0, 3.0])
    larger = piece.enlarged((SharedError(13, 20, shared),))
    expected = every[20:91].copy()
    expected[13:21, POS, POS] += shared
    assert_array_equal(larger.whole(at), expected[at])
    assert_array_equal(larger.of_navigation(at), expected[at][:, :9, :9])
    assert_array_equal(larger.variance(at), np.diagonal(expected[at], axis1=1, axis2=2))
    A = np.random.default_rng(5).normal(size=(2, every.shape[1]))
    of_larger = np.einsum("qi,kij,qj->kq", A, expected[at], A)
    assert_allclose(larger.variance_of(at, A), of_larger, rtol=1e-9)
    assert_array_equal(larger.piece(10, 30).whole(np.array([3, 11])), expected[[13, 21]])


def test_without_increments_only_what_is_kept_is_told(posed, monkeypatch):
    """Oracle: the solution with them, at the rows that it keeps; any other row is refused."""
    solution = solved(posed, monkeypatch, 64, 0, 3)
    bare = solution.without_increments()
    assert bare.problem.inc.dtheta.size == 0
    assert solution.chain is not None
    assert bare.chain is None  # the largest of all that an image leaves
    assert_array_equal(bare.covariance(bare.rows), solution.covariance(solution.rows))
    assert_array_equal(bare.nav_covariance(), solution.nav_covariance())
    with pytest.raises(ValueError, match=r"covariances exist only at Solution\.rows"):
        bare.covariance(np.array([1]))


def test_what_stays_of_an_epoch_is_a_kilobyte(posed, monkeypatch):
    """Oracle: bytes of arrays, counted. Records would be 13 times that."""
    solution = solved(posed, monkeypatch, 256, 0, 0)
    m, n = solution.time.size, solution.problem.layout.size
    arrays = [getattr(solution, name) for name in ("nav", "x", "filter_sigma", "nis", "verdict")]
    arrays += [solution.innovation, solution.innovation_sigma, solution.covariances.nav]
    assert all(len(each) == m for each in arrays)
    assert sum(each.nbytes for each in arrays) < 1100 * m
    assert solution.covariances.kept.nbytes == solution.rows.size * 4 * n * (n + 1)
    assert solution.rows.size == 7  # five events and both ends
    assert record_bytes(34, 3, False) == 8 * (34 * 34 + 11 * 34 + 6 * 34)
    assert record_bytes(34, 3, True) - record_bytes(34, 3, False) == 8 * (9 * 34 + 34)


def peak_bytes(seconds: float) -> tuple[int, int]:
    """Epochs of a flight, and the most that its solution takes on the way."""
    flown = fly(seconds, 5, imu_hz=20.0, gate=NO_GATE, gnss=GnssOptions(rate_hz=20.0))
    problem = replace(flown.problem, event_chain=False)
    start = start_near(flown, SIGMA)
    tracemalloc.start()
    solution = solve(problem, start, "off", separations=0, rows=100)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return solution.time.size, peak


def test_memory_is_linear_with_a_small_factor(monkeypatch):
    """Oracle: tracemalloc. Of two flights, one twice as long, the difference is what an epoch
    takes: two kilobytes on the way, where every record kept takes twelve and more.
    """
    monkeypatch.setattr(blocks, "WHOLE_BYTES", 0)
    (short, of_short), (long, of_long) = peak_bytes(60.0), peak_bytes(120.0)
    assert long > 1.9 * short
    assert of_long - of_short < 2000 * (long - short)
    assert of_long < 2.0 * of_short


def test_the_forecast_is_what_was_measured():
    """Oracle: what was measured of whole runs, within a third: 45 minutes at 500 Hz take 0.24 GB
    beyond the program, 8 hours 1.9 GB; every sample of 45 minutes as a trajectory takes two more;
    10 000 and 50 000 images within 15 minutes 0.43 and 0.7 GB.
    """
    short = forecast(1_350_000, 27_116, 34, 1, 350, 27_001)
    assert short.increments == 1_350_000 * 56
    assert_allclose(short.total, 0.28e9, rtol=0.33)
    assert_allclose(forecast(14_400_000, 290_000, 34, 1, 4000, 288_001).total, 1.9e9, rtol=0.33)
    dense = forecast(1_350_000, 27_116, 34, 1, 350, 1_350_000)
    assert dense.trajectory - short.trajectory > 2e9
    for images, measured in ((10_000, 0.43e9), (50_000, 0.70e9)):
        many = forecast(450_000, 9_000 + images, 34, 1, images, 9_001)
        assert_allclose(many.total, measured, rtol=0.33)
    twice = forecast(2_700_000, 54_232, 34, 1, 700, 54_002)
    assert twice.total < 2.05 * short.total
