"""Errors of the fixes: found where a flight has them, and where it has not, not."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flown import Flown, error_of, fly, start_near
from numpy.testing import assert_array_equal

from insgnss.diagnosis.advice import contradictions
from insgnss.diagnosis.candidates import with_layout
from insgnss.diagnosis.decision import is_suspicious
from insgnss.diagnosis.estimated import state_verdicts
from insgnss.diagnosis.time_correlated import time_correlated_error
from insgnss.navigation.layout import FixErrors, state_layout
from insgnss.navigation.solution import Solution, solve
from insgnss.orient.mounting import Mounting, boresight_from_angles
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.stochastic.model import load_noise_model

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NAVCHIP = load_noise_model("navchip")
NONE = FixErrors()
EVERYTHING = FixErrors(lever_arm_m=0.3, time_offset_s=0.2)


def layout_factory(fixes: FixErrors):
    return state_layout(NAVCHIP, fixes=fixes)


def solved(flown: Flown, fixes: FixErrors = NONE, lever=(0.0, 0.0, 0.0)) -> Solution:
    """The flight with the antenna where it is not, by `lever`, and the states of `fixes`."""
    problem = replace(
        flown.problem,
        layout=layout_factory(fixes),
        antenna_lever_b=flown.problem.antenna_lever_b - np.array(lever),
    )
    return solve(problem, start_near(replace(flown, problem=problem), SIGMA), separations=0)


@pytest.fixture(scope="module")
def clean() -> Flown:
    return fly(100.0, seed=21)


@pytest.fixture(scope="module")
def late() -> Flown:
    return fly(100.0, seed=22, gnss=GnssOptions(latency_s=0.02))


def test_a_flight_without_such_errors_is_not_suspected(clean):
    """Oracle: white fixes, the right lever arm and clock of the simulator."""
    solution = solved(clean)
    assert not is_suspicious(solution, layout_factory, FixErrors())
    assert contradictions(solved(clean, EVERYTHING), Mounting(), True, True) == []


def test_a_latency_is_found_within_its_sigma(late):
    """Oracle: the simulated 20 ms; the filter without the state takes them in without a rejection,
    so only the likelihood tells.
    """
    solution = solved(late)
    assert (solution.verdict[:, 0] != 2).all()
    assert is_suspicious(solution, layout_factory, FixErrors())
    told = solved(late, EVERYTHING)
    offset = told.problem.layout.offset
    sigma = np.sqrt(told.P[-1, 9 + offset, 9 + offset])
    assert sigma < 0.004
    assert abs(told.x[-1, offset] + 0.02) < 3.0 * sigma
    (check,) = contradictions(told, Mounting(), True, True)
    assert (check.name, check.verdict) == ("GNSS time offset", "contradiction")
    advised = re.search(r"add (\S+) to gnss\.time_offset_s", check.advice)
    assert advised is not None
    assert (
        abs(float(advised[1]) + 0.02) < 3.0 * sigma + 1e-4
    )  # which is added to stamps that are 20 ms late
    assert contradictions(told, Mounting(), True, False) == []


def test_a_lever_arm_is_found_within_its_sigma(clean):
    """Oracle: the simulator's lever arm, the problem lacks 0.2 m forward and 0.15 m down."""
    lever = np.array([0.2, 0.0, 0.15])
    assert is_suspicious(solved(clean, lever=lever), layout_factory, FixErrors())
    told = solved(clean, EVERYTHING, lever)
    first = told.problem.layout.lever
    sigma = np.sqrt(np.diag(told.P[-1])[9 + first : 12 + first])
    assert (np.abs(told.x[-1, first : first + 3] - lever) < 3.5 * sigma).all()
    (check,) = contradictions(told, Mounting(), True, True)
    assert check.name == "antenna lever arm"
    verdicts = {v.name: v for v in state_verdicts(told)}
    assert verdicts["antenna lever arm forward"].observed == bool(sigma[0] < 0.1)
    assert verdicts["antenna lever arm forward"].moves_m == pytest.approx(sigma[0])


def test_the_advised_lever_arm_cures_the_flight_file(clean):
    """Oracle: the simulator's lever arm; the flight file has the antenna 0.2 m and 0.15 m off, in a
    camera mounted askew.

    Written into the mounting as the advice says, its number gives the lever arm within 3.5 sigma
    and the half millimetre of its last digit, and the flight that is solved with it contradicts it
    no more.
    """
    true, wrong = clean.problem.antenna_lever_b, np.array([0.2, 0.0, 0.15])
    mounting = Mounting(
        imu_m=[0.113, 0.02, -0.05],
        camera_from_body=[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        boresight=boresight_from_angles("opk", [4.0, -3.0, 30.0]),
    )
    mounting = replace(mounting, antenna_m=mounting.imu_m + mounting.C_cb @ (true - wrong))
    told = solved(clean, EVERYTHING, wrong)
    (check,) = contradictions(told, mounting, True, True)
    numbers = re.search(r"mounting\.antenna_m = \[(.*?)\] would be it", check.advice)
    assert numbers is not None
    cured = replace(mounting, antenna_m=[float(v) for v in numbers[1].split(",")])
    first = told.problem.layout.lever
    sigma = np.sqrt(np.diag(told.P[-1])[9 + first : 12 + first])
    assert (np.abs(cured.antenna_lever_b - true) < 3.5 * sigma + 1e-3).all()
    again = solved(clean, EVERYTHING, true - cured.antenna_lever_b)
    assert contradictions(again, cured, True, True) == []


ASKEW = Mounting(
    antenna_m=[0.46, 0.1, -0.6],
    imu_m=[0.113, 0.02, -0.05],
    camera_from_body=[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    boresight=boresight_from_angles("opk", [4.0, -3.0, 30.0]),
)


def estimated(lever, lever_sigma: float, late_s: float, late_sigma: float) -> Any:
    """What `contradictions` reads of a solution at 10 m/s with fixes of 2 cm: lever arm and time
    offset, with their sigmas.
    """
    layout = state_layout(NAVCHIP, fixes=EVERYTHING)
    x, P = np.zeros((2, layout.size - 9)), np.zeros((2, layout.size, layout.size))
    at, offset = slice(layout.lever, layout.lever + 3), layout.offset
    x[-1, at], x[-1, offset] = lever, late_s
    P[-1, 9:, 9:][at, at], P[-1, 9 + offset, 9 + offset] = lever_sigma**2 * np.eye(3), late_sigma**2
    epochs = SimpleNamespace(
        position_cov=0.02**2 * np.eye(3)[None], has_position=np.ones(1, dtype=bool)
    )
    nav = np.array([[0.0, 0.0, 0.0, 6.0, 8.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
    return SimpleNamespace(problem=SimpleNamespace(layout=layout, epochs=epochs), x=x, P=P, nav=nav)


def test_advised_numbers_are_what_the_flight_file_lacks():
    """Oracle: vector addition; the mounting with the advised antenna has the lever arm that was
    estimated, to its last digit.
    """
    lever = np.array([0.2, -0.05, 0.15])
    arm, clock = contradictions(estimated(lever, 0.004, -0.02, 0.001), ASKEW, True, True)
    numbers = re.search(r"mounting\.antenna_m = \[(.*?)\] would be it", arm.advice)
    assert numbers is not None
    advised = replace(ASKEW, antenna_m=[float(v) for v in numbers[1].split(",")])
    assert np.abs(advised.antenna_lever_b - (ASKEW.antenna_lever_b + lever)).max() < 1e-3
    assert "add -0.0200 to gnss.time_offset_s" in clock.advice


@pytest.mark.parametrize(
    ("off_m", "sigma_m", "verdict"),
    [
        (0.023, 0.004, "contradiction"),  # beyond five sigma, the fixes' own 2 cm, and 2 cm
        (0.023, 0.005, None),  # within five sigma
        (0.019, 0.003, None),  # within the fixes' own sigma
        (0.30, 0.049, "contradiction"),
        (0.30, 0.051, "note"),  # the flight determines it to no better than 5 cm
    ],
)
def test_what_contradicts_a_lever_arm(off_m, sigma_m, verdict):
    """Oracle: the rule of `diagnosis.advice`: five sigma and the fixes' own sigma; determined to 5
    cm.
    """
    found = contradictions(estimated([off_m, 0.0, 0.0], sigma_m, 0.0, 0.001), ASKEW, True, True)
    assert [check.verdict for check in found] == ([] if verdict is None else [verdict])


def test_correlated_errors_are_found_and_make_the_sigmas_honest():
    """Oracle: exact motion; a Gauss-Markov error of 3 cm and 15 s, which white fixes of that size
    turn into errors of many sigma.

    Over 100 s there are seven correlation times: mean squares over the nine states within 0.3 and
    3.
    """
    options = GnssOptions(
        sigma_m=(0.01, 0.01, 0.01), correlated_sigma_m=(0.03, 0.03, 0.03), correlation_time_s=15.0
    )
    flown = fly(100.0, seed=23, gnss=options)
    plain = solved(flown)
    assert is_suspicious(plain, layout_factory, FixErrors())
    found = time_correlated_error(plain, layout_factory, FixErrors())
    assert found is not None
    assert found.gm_sigma is not None
    claimed = np.sqrt(0.01**2 + 0.03**2)
    assert 0.015 < found.gm_sigma[0] * claimed < 0.06
    assert 0.005 < found.white_scale[0] * claimed < 0.015
    assert 4.0 < found.correlation_time_s < 60.0
    again = solved(flown, found)
    squares = [
        np.mean(
            error_of(s.nav, flown.true_nav())[:, :3] ** 2
            / np.diagonal(s.P, axis1=1, axis2=2)[:, :3]
        )
        for s in (plain, again)
    ]
    assert squares[0] > 5.0
    assert 0.3 < squares[1] < 3.0


def test_states_keep_their_place_and_value_in_another_layout(clean):
    """Oracle: the names."""
    problem, start = clean.problem, start_near(clean, SIGMA)
    start = replace(start, x=np.arange(start.x.size, dtype=float))
    wide, wide_start = with_layout(
        problem, start, layout_factory(FixErrors(lever_arm_m=0.2, gm_sigma=(1.0, 1.0, 1.0)))
    )
    for s, name in enumerate(wide.layout.names):
        if name in problem.layout.names:
            k = problem.layout.names.index(name)
            assert wide_start.x[s] == start.x[k]
            assert wide_start.P[9 + s, 9 + s] == start.P[9 + k, 9 + k]
        else:
            assert wide_start.P[9 + s, 9 + s] == wide.layout.sigma0[s] ** 2
    assert_array_equal(wide_start.P[:9, :9], start.P[:9, :9])
