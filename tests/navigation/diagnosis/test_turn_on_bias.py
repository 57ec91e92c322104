"""A noise model without turn-on biases, as published variances give one: named, and refused where
the flight shows the biases.
"""

from dataclasses import replace
from pathlib import Path

import pytest

from insgnss import Flight, load_flight
from insgnss.base.errors import InputError
from insgnss.flight.inspection.described import inspect_flight
from insgnss.flight.processing.pipeline import process
from insgnss.navigation.diagnosis.evidence import TURN_ON, with_turn_on, without_turn_on
from insgnss.navigation.noise_model.model import NoiseModel, load_noise_model, write_noise_model
from insgnss.simulation.dataset import write_dataset

NAVCHIP = load_noise_model("navchip")
BARE = replace(
    NAVCHIP,
    name="bare",
    gyro=tuple(replace(axis, turn_on_bias=0.0) for axis in NAVCHIP.gyro),
    accel=tuple(replace(axis, turn_on_bias=0.0) for axis in NAVCHIP.accel),
)


def flight_of(directory: Path, noise: NoiseModel) -> Flight:
    """Three minutes in the air with an IMU of `noise`, whose flight file names a model without
    turn-on biases.
    """
    made = write_dataset(
        directory / "flight",
        "ign8",
        3.0,
        imu_rate=100.0,
        seed=3,
        noise=noise,
        start_in_air=True,
        line_length_m=200.0,
    )
    write_noise_model(BARE, file := directory / "bare.toml", ())
    flight = load_flight(made.flight_file)
    return replace(flight, imu=replace(flight.imu, noise=str(file)))


def test_biases_that_the_model_lacks_are_refused_by_name(tmp_path):
    """Oracle: a simulated NavChip, whose turn-on biases are 100 deg/h and 2 mg: one line that says
    what is missing and what to set.
    """
    with pytest.raises(
        InputError,
        match=(
            r"turn-on bias: noise model bare without turn_on_bias of gyro and accel.*100 deg/h and"
            r" 2 mg"
        ),
    ) as refusal:
        process(flight_of(tmp_path, NAVCHIP), tmp_path / "out")
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).endswith('accept = ["turn-on bias"] in the flight file overrules')


@pytest.mark.slow
def test_biases_that_the_model_lacks_are_accepted_by_name(tmp_path):
    """Oracle: the same flight with the name in `accept`, as its refusal says: it is processed with
    the model as it is, and told as such.
    """
    flight = flight_of(tmp_path, NAVCHIP)
    flight.path.write_text('accept = ["turn-on bias"]\n' + flight.path.read_text())
    flight = replace(load_flight(flight.path), imu=flight.imu)
    assert flight.accept == ("turn-on bias",)
    checks = process(flight, tmp_path / "out").diagnostics.checks
    (overruled,) = (check for check in checks if check.verdict == "contradiction")
    assert overruled.name == "turn-on bias"
    assert (
        "the innovations show them (estimating them lowers the misfit -2 log L by"
        in overruled.found
    )


@pytest.mark.slow
def test_an_imu_without_biases_leaves_it_at_a_note(tmp_path):
    """Oracle: a simulated IMU that has none; `inspect` and the report of `process` name the model
    all the same.
    """
    flight = flight_of(tmp_path, BARE)
    (check,) = (c for c in inspect_flight(flight).checks if c.name == "turn-on bias")
    assert check.verdict == "note"
    assert "constant biases are taken as zero" in check.found
    result = process(flight, tmp_path / "out")
    assert check in result.diagnostics.checks


def test_which_sensors_lack_them():
    """Oracle: the models themselves; a bias that is there stays as it is."""
    mixed = replace(NAVCHIP, accel=(NAVCHIP.accel[0], *BARE.accel[1:]))
    assert without_turn_on(NAVCHIP) == ()
    assert without_turn_on(mixed) == ("accel",)
    assert without_turn_on(BARE) == ("gyro", "accel")
    filled = with_turn_on(mixed)
    assert filled.gyro == NAVCHIP.gyro
    assert [axis.turn_on_bias for axis in filled.accel] == [
        NAVCHIP.accel[0].turn_on_bias,
        TURN_ON["accel"],
        TURN_ON["accel"],
    ]
