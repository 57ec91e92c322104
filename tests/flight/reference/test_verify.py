"""The verb `verify`: a simulated flight passes, a defect of the core is found, exit codes and
texts.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from posed import Pose, posed

from insgnss import load_flight
from insgnss.cli import main
from insgnss.flight.reference import verify as module
from insgnss.flight.reference.verify import LIMIT_SIGMAS, verify, verify_problem
from insgnss.simulation.dataset import write_dataset


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Three minutes at 100 Hz, the first of them at rest before the take-off."""
    return write_dataset(
        tmp_path_factory.mktemp("verified") / "ign8", "ign8", 3.0, imu_rate=100.0, seed=3
    )


@pytest.fixture(scope="module")
def flight_file(dataset):
    return dataset.flight_file


def test_a_simulated_flight_passes(flight_file, capsys):
    """Oracle: the two implementations; measured 4e-4 sigma and 1e-4 of the standard deviations."""
    assert main(["verify", str(flight_file), "--minutes", "0.4", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["passed"]
    assert found["in_sigmas"] < 3e-3
    assert abs(found["sigma_ratio"]) < 1e-3
    assert found["decided_otherwise"] == 0
    assert found["epochs"] > 240
    assert {d["quantity"] for d in found["differences"]} >= {
        "position",
        "velocity",
        "attitude",
        "gyro bias",
        "accelerometer bias",
    }
    assert found["core_s"] < found["twin_s"]


@pytest.mark.slow
def test_the_part_is_where_it_is_asked_for_and_the_headline_says_the_result(dataset, capsys):
    """Oracle: the options, and the first instant of the simulated flight."""
    first = dataset.simulated.flight.motion.start
    assert (
        main(
            [
                "verify",
                str(dataset.flight_file),
                "--minutes",
                "0.3",
                "--start",
                str(first + 120.0),
                "-q",
            ]
        )
        == 0
    )
    out = capsys.readouterr().out
    assert out.splitlines()[0].startswith("core and reference twin agree: largest difference")
    assert f"{first + 120.0:.1f} to {first + 138.0:.1f} s" in out


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"scale_factor": True, "misalignment": True, "robust": True},
        {"lever_arm": True},
        {"time_offset": True},
        {"non_holonomic": True},
        {"second_pass": "on"},
    ],
    ids=str,
)
def test_simulated_flights_pass_with_every_option(flight_file, changes):
    """Oracle: the two implementations; a wheeled vehicle is what a drone is not, and its
    measurements are rejected by both alike.
    """
    flight = load_flight(flight_file)
    found = verify(replace(flight, filter=replace(flight.filter, **changes)), 0.5)
    assert found.passed, found.summary()
    assert found.in_sigmas < 0.02


def test_a_defect_of_the_core_is_found(monkeypatch):
    """Oracle: a planted one: the core is given a lever arm that is 20 mm longer, which moves the
    IMU by less than a sigma of a fix.
    """
    from insgnss.navigation.filter import solution

    problem, start = posed(Pose(motion=("velocity",)))
    assert verify_problem(problem, start).passed
    right = solution.solve

    def wrong(problem, *rest, **more):
        return right(
            replace(problem, antenna_lever_b=problem.antenna_lever_b + [0.02, 0.0, 0.0]),
            *rest,
            **more,
        )

    monkeypatch.setattr(solution, "solve", wrong)
    found = verify_problem(problem, start)
    assert found.in_sigmas > LIMIT_SIGMAS
    assert found.refusal is not None
    assert found.refusal.exit_code == 4


@pytest.mark.slow
def test_what_does_not_agree_is_exit_code_4_with_the_table(flight_file, monkeypatch, capsys):
    """Oracle: the command line's contract: the result on standard output, one line on standard
    error.
    """
    monkeypatch.setattr(module, "LIMIT_SIGMAS", 1e-9)
    assert main(["verify", str(flight_file), "--minutes", "0.3", "-q"]) == 4
    out, err = capsys.readouterr()
    assert "DO NOT AGREE" in out
    assert len(err.splitlines()) == 1
    assert "sigma (limit 1e-09)" in err


@pytest.mark.parametrize(
    ("argv", "code", "says"),
    [
        (["--start", "nan"], 2, "--start nan: must be a number"),
        (["--minutes", "0"], 2, "--minutes 0.0: must be greater than zero"),
        (["--start", "1"], 4, "heading not observable"),
        (["--start", "600000"], 3, "do not overlap"),
    ],
)
def test_parts_that_cannot_be_verified(argv, code, says, flight_file, capsys):
    """Oracle: the command line's contract; a start before the flight is its start, where the
    vehicle rests.
    """
    given = argv if "--minutes" in argv else [*argv, "--minutes", "0.3"]
    assert main(["verify", str(flight_file), *given, "-q"]) == code
    out, err = capsys.readouterr()
    assert says in err
    assert out == ""


def test_sigmas_of_zero_are_not_estimated():
    """Oracle: hand calculation; a model without bias states has biases and sigmas of zero, and the
    comparison says 0, not nan.
    """
    problem, start = posed(Pose())
    assert problem.layout.size == 9
    found = verify_problem(problem, start)
    assert [d.in_sigmas for d in found.differences[3:]] == [0.0, 0.0, 0.0]
    assert np.isfinite([d.sigma_ratio for d in found.differences]).all()
