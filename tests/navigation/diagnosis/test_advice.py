"""What is said of a constant that the innovations contradict: numbers, signs, thresholds."""

import re
from dataclasses import replace
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from insgnss.base.findings.scale_prior import ScalePrior
from insgnss.geodesy.rotation import right_angle_rotations
from insgnss.navigation.diagnosis.advice import (
    FixClaims,
    advice,
    swing_check,
    unseen_constants,
    variance_check,
)
from insgnss.navigation.diagnosis.constants import ConstantsEvidence, Hypothesis
from insgnss.navigation.diagnosis.variances import VarianceHypothesis
from insgnss.navigation.filter.layout import FixErrors
from insgnss.navigation.prepare.fix_covariance.numbers import claimed_scale
from insgnss.records.cameras.mounting import Mounting, boresight_from_angles
from insgnss.records.states import (
    CLOCK_RATE,
    MISALIGNMENT,
    OF_LEVER_ARM,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)

ASKEW = Mounting(
    antenna_m=[0.46, 0.1, -0.6],
    imu_m=[0.113, 0.02, -0.05],
    camera_from_body=[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    boresight=boresight_from_angles("opk", [4.0, -3.0, 30.0]),
)
LEVEL = Mounting(antenna_m=[0.31, -0.12, 0.55], imu_m=[0.03, 0.0, 0.01], camera_from_body=np.eye(3))
ACCEL_SCALES = State(SCALE_FACTOR, sensor="accel")
# ten minutes at 10 m/s
SOLUTION: Any = SimpleNamespace(
    nav=np.array([[0.0, 0.0, 0.0, 6.0, 8.0, 0.0, 1.0, 0.0, 0.0, 0.0]]),
    time=np.array([0.0, 600.0]),
    problem=SimpleNamespace(inc=SimpleNamespace(nominal_s=0.02)),
)


def hypothesis(values: dict[State, tuple[float, float]], evidence: float = 50.0) -> Hypothesis:
    value, sigma = np.array(list(values.values())).T
    return Hypothesis(tuple(values), evidence, tuple(values), value, sigma, 1.0, evidence)


def told(values: dict[State, tuple[float, float]], evidence: float = 50.0):
    return advice(ASKEW, SOLUTION, hypothesis(values, evidence))


def test_advised_numbers_are_what_the_flight_file_lacks():
    """Oracle: vector addition; the mounting with the advised antenna has the lever arm that was
    estimated, to its last digit, whichever components are suspected.
    """
    for lever in ([0.2, -0.05, 0.15], [0.2, 0.0, 0.0]):
        values = {state: (v, 0.004) for state, v in zip(OF_LEVER_ARM, lever, strict=True) if v}
        (arm,) = told(values)
        numbers = re.search(r"mounting\.antenna_m = \[(.*?)\] would correct it", arm.advice)
        assert numbers is not None
        advised = replace(ASKEW, antenna_m=[float(v) for v in numbers[1].split(",")])
        wanted = ASKEW.antenna_lever_b + np.array(lever)
        assert np.abs(advised.antenna_lever_b - wanted).max() < 1e-3
    (clock,) = told({TIME_OFFSET: (-0.02, 0.001)})
    assert "add -0.0200 to gnss.time_offset_s" in clock.advice
    assert "0.20 m at 10.0 m/s" in clock.found
    (rate,) = told({CLOCK_RATE: (2e-5, 2e-6)})
    assert "runs +20 +- 2 ppm" in rate.found
    assert "0.06 m over half the flight" in rate.found


@pytest.mark.parametrize(
    ("state", "value", "sigma", "evidence", "verdict"),
    [
        (OF_LEVER_ARM[0], 0.021, 0.004, 5.1, "contradiction"),
        (OF_LEVER_ARM[0], 0.021, 0.004, 4.9, "note"),  # not strong
        (OF_LEVER_ARM[0], -0.019, 0.001, 50.0, "note"),  # negligible
        (OF_LEVER_ARM[2], -0.3, 0.049, 50.0, "contradiction"),
        (
            OF_LEVER_ARM[2],
            -0.3,
            0.051,
            50.0,
            "note",
        ),  # the flight determines it to no better than 5 cm
        (TIME_OFFSET, 0.0021, 1e-4, 5.1, "contradiction"),  # 21 mm at 10 m/s
        (TIME_OFFSET, -0.0019, 1e-4, 50.0, "note"),
        (CLOCK_RATE, 7e-6, 1e-6, 50.0, "contradiction"),  # 21 mm after five minutes
        (CLOCK_RATE, -6e-6, 1e-6, 50.0, "note"),
        (CLOCK_RATE, 7e-6, 1e-6, 4.9, "note"),
        (State(SCALE_FACTOR, "z", "", "gyro"), 0.01, 1e-4, 500.0, "note"),
        (State(MISALIGNMENT, "x from y", "rad", "accel"), 0.01, 1e-4, 500.0, "note"),
    ],
)
def test_what_contradicts_the_flight_file(state, value, sigma, evidence, verdict):
    """Oracle: the rule of `navigation.diagnosis.advice`: strong evidence (5), and 2 cm of
    position.
    """
    (check,) = told({state: (value, sigma)}, evidence)
    assert check.verdict == verdict


def test_the_most_significant_comes_first_and_rivals_are_named():
    """Oracle: sigmas by hand; the groups of the rivals."""
    values = {OF_LEVER_ARM[0]: (0.05, 0.015), TIME_OFFSET: (-0.047, 0.001)}
    assert [check.name for check in told(values)] == ["GNSS time offset", "antenna lever arm"]
    rival = replace(
        hypothesis({OF_LEVER_ARM[0]: (0.1, 0.01)}), groups=(OF_LEVER_ARM[0], OF_LEVER_ARM[2])
    )
    (check,) = advice(ASKEW, SOLUTION, hypothesis({TIME_OFFSET: (0.01, 0.001)}), [rival])
    assert (
        "cannot tell this error from antenna lever arm forward and antenna lever arm down"
        in check.found
    )
    assert check.verdict == "contradiction"
    of_imu = replace(rival, groups=(ACCEL_SCALES,))
    (check,) = advice(ASKEW, SOLUTION, hypothesis({TIME_OFFSET: (0.01, 0.001)}), [of_imu])
    assert check.verdict == "note"
    both = replace(rival, groups=(ACCEL_SCALES, TIME_OFFSET))
    (check,) = advice(ASKEW, SOLUTION, hypothesis({TIME_OFFSET: (0.01, 0.001)}), [both])
    assert check.verdict == "contradiction"
    assert "camera.clock" in check.advice
    assert "cannot tell this error" not in told({TIME_OFFSET: (0.01, 0.001)})[0].found


@pytest.mark.parametrize(
    ("offset", "named"), [(-0.010, True), (-0.005, True), (-0.0021, False), (0.01, False)]
)
def test_samples_that_are_no_means_are_named_with_the_key_that_mends_them(offset, named):
    """Oracle: the middle of the sample's interval by hand. At 50 Hz an instantaneous rate is 10 ms
    after the middle of the interval that it is taken for, the second of two halves 5 ms; both have
    the fixes look early. Following the advice about the fixes instead moved images by 16 sigmas.
    """
    (check,) = told({TIME_OFFSET: (offset, 1e-4)})
    assert ("imu.quantity" in check.advice) == named
    assert (f"add {-offset:+.4f} to imu.time_offset_s" in check.advice) == named


def test_scale_factors_in_percent_the_most_significant_first():
    """Oracle: by hand."""
    values = {State(SCALE_FACTOR, x, "", "gyro"): (0.01 * k, 1e-3) for k, x in enumerate("xyz", 1)}
    (check,) = told(values)
    assert check.name == "IMU scale factors"
    assert check.found.startswith("gyro z scale factor +3.00 +- 0.10 %, gyro y scale factor +2.00")
    assert "filter.scale_factor = true" in check.advice


def test_whose_noise_is_named():
    """Oracle: the family."""
    fixes = VarianceHypothesis("GNSS sigmas", 100.0, {"fixes.position": 2.0})
    assert variance_check(fixes).name == "GNSS sigmas"
    imu = VarianceHypothesis("IMU white noise", 100.0, {"gyro.white_noise": 3.0})
    check = variance_check(imu)
    assert (check.name, check.verdict) == ("IMU noise", "note")
    assert "gyro.white_noise 3.00" in check.found
    assert "tune --flight" in check.advice
    draft = variance_check(replace(imu, factors={"gyro.white_noise": 0.25}), drafted=True)
    assert draft.verdict == "ok"
    assert "gyro.white_noise 0.25 times as large" in draft.found


@pytest.mark.parametrize(
    ("source", "factor", "verdict"),
    [("calibrated", 1.32, "ok"), ("calibrated", 2.0, "note"), ("rtklib_pos", 1.3, "ok")]
    + [("", 1.3, "ok"), ("", 2.0, "note"), ("none of the table", 2.0, "note")],
)
def test_a_scale_that_is_usual_of_the_source_is_no_remark(source, factor, verdict):
    """Oracle: exp(mean + 2 widths) by hand: 1.73 of calibrated positions, 1.35 of RTKLIB's, 1.82
    of an unknown source; 1.32 is what 0.75 of a default leaves of sigmas that were right.
    """
    winner = VarianceHypothesis("GNSS sigmas", 800.0, {"fixes.position": factor})
    check = variance_check(winner, FixClaims(claimed_scale(source)))
    assert check.verdict == verdict
    assert f"positions scatter {factor:.2f} times" in check.found


@pytest.mark.parametrize(
    ("accel", "gyro", "errors", "asked"),
    [
        (2.4, 0.6, FixErrors(), True),
        (27.0, 1.0, FixErrors(), True),
        (1.9, 0.6, FixErrors(), False),
        (27.0, 7.0, FixErrors(), False),
        (27.0, 1.0, FixErrors(gm_sigma=(1.0, 1.0, 1.0)), False),
        (27.0, 1.0, FixErrors(unfixed_gm_sigma=1.0), False),
    ],
)
def test_restless_accelerometers_may_be_fixes_that_swing(accel, gyro, errors, asked):
    """Oracle: the rule in words; what moves gyros, too, is the IMU's, and slow errors of the fixes
    that are states compete by themselves.
    """
    factors = {"gyro.driving_noise": gyro, "accel.driving_noise": accel}
    notes = swing_check(VarianceHypothesis("IMU bias noise", 900.0, factors), errors)
    assert bool(notes) is asked
    for note in notes:
        assert note.verdict == "note"
        assert "GNSS positions swing" in note.found
        assert f"{accel:.1f} times as restless" in note.found


def test_sigmas_lower_than_claimed_are_said_as_they_are_adopted():
    """Oracle: by hand: 0.5 is adopted of positions, whose withheld pieces are predicted with it."""
    factors = {"fixes.position": 0.5, "fixes.velocity": 0.5}
    winner = VarianceHypothesis("GNSS sigmas", 800.0, factors, ("fixes.position",))
    check = variance_check(winner, FixClaims(ScalePrior(-0.4, 0.35)))
    assert check.verdict == "ok"
    assert "positions scatter 0.50 times" in check.found
    assert "velocities" not in check.found
    assert "withheld pieces are predicted" in check.found


@pytest.mark.parametrize(
    ("claims", "factors", "advised"),
    [
        (FixClaims(), {"fixes.position": 3.0}, "gnss.white_scale = 3.0"),
        (FixClaims(white_scale=0.5), {"fixes.position": 3.0}, "gnss.white_scale = 1.5"),
        (FixClaims(sigma_m=(0.02, 0.02, 0.04)), {"fixes.position": 3.0}, "sigma_m = [0.06, 0.06"),
        (FixClaims(), {"fixes.position": 1.0, "fixes.velocity": 3.0}, "nothing to do"),
    ],
)
def test_the_advised_key_is_one_that_acts(claims, factors, advised):
    """Oracle: by hand; `gnss.sigma_m` acts where a file has no sigmas, on velocities no key."""
    suspected = VarianceHypothesis("GNSS sigmas", 800.0, factors)
    assert advised in variance_check(suspected, claims).advice


def test_an_offset_that_the_exposures_share_costs_them_nothing():
    """Oracle: four sigmas of 5 ms are 20 ms, at 10 m/s 200 mm along the track; they move no image
    where the same clock stamps the exposures.
    """
    flight: Any = SimpleNamespace(**vars(SOLUTION), nav_covariance=lambda: np.eye(9)[None] * 1e-4)
    states = (*OF_LEVER_ARM, TIME_OFFSET)
    wide = np.array([0.2, 0.2, 0.2, 0.05])
    known = np.array([1e-3, 1e-3, 1e-3, 5e-3])  # m, s
    evidence = ConstantsEvidence(
        states, wide, np.zeros(4), np.diag((wide / known) ** 2), np.zeros(4)
    )
    own = unseen_constants(flight, evidence)
    assert own is not None
    assert "not reveal errors of GNSS time offset below 20 ms: " in own.found
    assert own.found.endswith("moves the images by up to 200 mm along track")
    assert own.verdict == "note"
    shared = unseen_constants(flight, evidence, events_with_fixes=True)
    assert shared is not None
    assert shared.found.endswith(
        "the offset moves no image, since exposures and fixes have the same clock"
    )
    assert shared.verdict == "ok"


def test_antenna_and_imu_are_offered_alike_where_images_depend_on_both():
    """Oracle: vector addition; the mounting with either of the advised places has the lever arm
    that was estimated, and the camera stands elsewhere by as much.
    """
    lever = np.array([0.2, -0.05, 0.15])
    values = {state: (v, 0.004) for state, v in zip(OF_LEVER_ARM, lever, strict=True)}
    (arm,) = advice(ASKEW, SOLUTION, hypothesis(values), exposures=True)
    assert arm.advice.startswith("mounting.imu_m = [")
    assert "filter.lever_arm" not in arm.advice
    wanted = ASKEW.antenna_lever_b + lever
    cameras = []
    for key in ("antenna_m", "imu_m"):
        numbers = re.search(rf"mounting\.{key} = \[(.*?)\]", arm.advice)
        assert numbers is not None
        advised = replace(ASKEW, **{key: [float(v) for v in numbers[1].split(",")]})
        assert np.abs(advised.antenna_lever_b - wanted).max() < 2e-3
        cameras.append(advised.camera_lever_b)
    apart = re.search(r"all images move by (\S+) m", arm.advice)
    assert apart is not None
    assert float(apart[1]) == pytest.approx(
        float(np.linalg.norm(cameras[0] - cameras[1])), abs=2e-3
    )


def test_an_exact_lever_arm_is_contradicted_and_not_estimated():
    """Oracle: the contract; a sigma of 0 states it as exact."""
    values = {OF_LEVER_ARM[0]: (0.2, 0.004)}
    (arm,) = advice(replace(ASKEW, antenna_sigma_m=0.0), SOLUTION, hypothesis(values))
    assert arm.verdict == "contradiction"
    assert arm.found.startswith(
        "another one explains the innovations, the vector from the IMU to the antenna is off by"
    )
    assert "stated as exact" in arm.expected
    assert "filter.lever_arm" not in arm.advice
    assert "mounting.antenna_sigma_m = 0 states an exact arm, so it is not estimated" in arm.advice
    (arm,) = told(values)
    assert "exact" not in str(arm)


@pytest.mark.parametrize(
    ("forward_m", "position_m", "hidden"),
    [(0.0049, 0.004, None), (0.0068, 0.004, "27 mm"), (0.0068, 0.01, None)],
)
def test_what_a_flight_would_not_show_is_said(forward_m, position_m, hidden):
    """Oracle: four sigma of what the flight tells, against 2 cm and three sigma of the positions.
    A lever arm 2 cm off, known to 7 mm, moved images of 5 mm by 4 sigma in silence.
    """
    alone = dict(zip(OF_LEVER_ARM, (forward_m, 0.003, 0.003), strict=True)) | {TIME_OFFSET: 1e-4}
    constants: Any = SimpleNamespace(requested=(), exact=(), known_to=lambda: alone)
    P = np.diag([position_m**2] * 3)[None]
    solution = SimpleNamespace(nav=SOLUTION.nav, time=SOLUTION.time, nav_covariance=lambda: P)
    check = unseen_constants(solution, constants)
    assert check is not None
    if hidden is None:
        assert check.verdict == "ok"
    else:
        assert check.verdict == "note"
        told = f"not reveal errors of antenna lever arm forward below {hidden}: the lever arm moves"
        assert told in check.found


def test_a_camera_that_is_turned_is_named_with_its_matrix():
    """Oracle: vector algebra; the lever arm of the true T minus that of the stated one, for all 23
    turns by right angles. A lever arm that no turn explains gets the old advice.
    """
    turned = replace(LEVEL, boresight=ASKEW.boresight)
    for stated, T in product((LEVEL, turned), right_angle_rotations()[1:]):
        true = replace(stated, camera_from_body=T)
        off = true.antenna_lever_b - stated.antenna_lever_b
        values = {
            state: (v, 0.002) for state, v in zip(OF_LEVER_ARM, off, strict=True) if abs(v) > 1e-9
        }
        (arm,) = advice(stated, SOLUTION, hypothesis(values, 50.0))
        if np.abs(off).max() > 0.02:
            matrix = T.astype(int).tolist()
            assert f"another mounting.camera_from_body = {matrix} would" in arm.advice
    off = dict(zip(OF_LEVER_ARM, [(0.1, 0.002), (0.0, 0.002), (0.0, 0.002)], strict=True))
    (arm,) = advice(LEVEL, SOLUTION, hypothesis(off, 50.0))
    assert "camera_from_body" not in arm.advice


def test_what_a_right_flight_may_show_does_not_stand_out():
    """Oracle: the largest evidence with wide sigmas of 160 right flights, 2.7."""
    values = {OF_LEVER_ARM[0]: (0.05, 0.01)}
    (weak,) = advice(LEVEL, SOLUTION, hypothesis(values, 2.7))
    (shown,) = advice(LEVEL, SOLUTION, hypothesis(values, 3.1))
    assert (weak.beyond_chance, shown.beyond_chance) == (False, True)
