"""A run in closed form: a circle flown once, white innovations of known sigma, constant sigmas of
the states.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from insgnss.records import Check, Diagnostics, ExteriorOrientation
from insgnss.report.summary import run_summary

EPOCHS, IMAGES = 1200, 30
START = 205200.0
FIX_SIGMA = np.array([0.02, 0.02, 0.03])
POSITION_SIGMA = np.array([0.003, 0.002, 0.004])  # N, E, D, m
PSI_SIGMA = np.radians([0.003, 0.004, 0.02])


def make_diagnostics(scale: float = 1.0, **changes: Any) -> Diagnostics:
    """Diagnostics whose innovations are white with `scale` times the sigma they claim; `changes`
    replace fields.
    """
    rng = np.random.default_rng(4)
    time = START + 0.1 * np.arange(EPOCHS)
    angle = np.linspace(0.0, 2.0 * np.pi, EPOCHS)
    sigma = np.tile(np.concatenate([POSITION_SIGMA, np.full(3, 0.01), PSI_SIGMA]), (EPOCHS, 1))
    fix_sigma = np.tile(FIX_SIGMA, (EPOCHS, 1))
    innovation = scale * fix_sigma * rng.standard_normal((EPOCHS, 3))
    separation_sigma = 3.0 * sigma[::10]
    fields: dict[str, Any] = {
        "time": time,
        "position": np.stack(
            [200 * np.sin(angle), 200 * np.cos(angle), np.full(EPOCHS, -120.0)], axis=1
        ),
        "velocity": np.stack([10 * np.cos(angle), -10 * np.sin(angle), np.zeros(EPOCHS)], axis=1),
        "rpy": np.stack([np.full(EPOCHS, 0.3), np.full(EPOCHS, 0.05), -angle], axis=1),
        "event": np.linspace(300, 1100, IMAGES).astype(np.int64),
        "filter_sigma": 3.0 * sigma,
        "smoothed_sigma": sigma,
        "bias": np.tile(
            np.concatenate(
                [np.radians([36.0, -72.0, 108.0]) / 3600.0, np.array([1.0, -2.0, 3.0]) * 9.80665e-3]
            ),
            (EPOCHS, 1),
        ),
        "bias_sigma": np.tile(
            np.concatenate([np.radians(np.full(3, 9.0)) / 3600.0, np.full(3, 0.1) * 9.80665e-3]),
            (EPOCHS, 1),
        ),
        "fix_time": time,
        "innovation": innovation,
        "innovation_sigma": fix_sigma,
        "nis": ((innovation / fix_sigma) ** 2).sum(axis=1),
        "nis_limit": 31.8,
        "used": np.ones(EPOCHS, dtype=bool),
        "separation_time": time[::10],
        "separation": separation_sigma * rng.standard_normal(separation_sigma.shape),
        "separation_sigma": separation_sigma,
    }
    return Diagnostics(**(fields | changes))


def make_eo(first_heading_deg: float = 0.02) -> ExteriorOrientation:
    """Images at the exposures, sigmas east 2, north 3, up 4 mm and 0.004, 0.003, 0.02 deg, but for
    the heading of the first.
    """
    d = make_diagnostics()
    cov = np.tile(
        np.diag(np.concatenate([[0.002, 0.003, 0.004], np.radians([0.004, 0.003, 0.02])]) ** 2),
        (IMAGES, 1, 1),
    )
    cov[0, 5, 5] = np.radians(first_heading_deg) ** 2
    north_east_down = d.position[d.event]
    return ExteriorOrientation(
        tuple(f"{8001 + i}.tif" for i in range(IMAGES)),
        d.time[d.event],
        2008,
        np.array([0.81, 0.11, 400.0]),
        north_east_down[:, [1, 0, 2]] * [1, 1, -1],
        np.tile(np.eye(3), (IMAGES, 1, 1)),
        cov,
        np.zeros((IMAGES - 1, 6, 6)),
        np.eye(3),
        np.diag([-1.0, -1.0, 1.0]),
    )


def summarise(
    diagnostics: Diagnostics, eo: ExteriorOrientation | None, name: str = "ign8", **more: Any
) -> dict[str, Any]:
    """Summary with a small flight file around it."""
    flight = {
        "name": name,
        "gps_week": 2008,
        "imu": {"file": "imu.csv", "units": {"gyro": "rad/s"}, "columns": None},
    } | more
    return run_summary(
        diagnostics,
        eo,
        flight,
        {"imu.csv": "ab" * 32},
        {"insgnss": "0.1.0"},
        {"filter": 0.5},
        ("smoothed",),
        gps_week=2008,
    )


@pytest.fixture(scope="session")
def diagnostics() -> Callable[..., Diagnostics]:
    return make_diagnostics


@pytest.fixture(scope="session")
def eo() -> Callable[..., ExteriorOrientation]:
    return make_eo


@pytest.fixture(scope="session")
def summary() -> Callable[..., dict[str, Any]]:
    return summarise


@pytest.fixture
def odd_cases() -> dict[str, tuple[Diagnostics, ExteriorOrientation | None]]:
    """Runs in which something is missing, by name."""
    d = make_diagnostics()
    nothing = np.zeros(EPOCHS, dtype=bool)
    some = np.arange(EPOCHS) % 7 != 0
    empty = {
        "fix_time": np.empty(0),
        "innovation": np.empty((0, 3)),
        "innovation_sigma": np.empty((0, 3)),
    }
    empty |= {"nis": np.empty(0), "used": np.empty(0, dtype=bool)}
    unseparated = {
        "separation_time": np.empty(0),
        "separation": np.empty((0, 9)),
        "separation_sigma": np.empty((0, 9)),
    }
    velocity = {"velocity_nis": d.nis[:500], "velocity_used": some[:500]}
    check = Check("event spacing", "1.1 s <b>", "1.3 s & more", "note", "look for a double trigger")
    return {
        "no camera": (d, None),
        "everything rejected": (
            make_diagnostics(used=nothing, nis=np.full(EPOCHS, 1e4)),
            make_eo(),
        ),
        "some rejected, velocities": (make_diagnostics(used=some, **velocity), make_eo()),
        "no fix": (make_diagnostics(**empty), make_eo()),
        "no separation": (make_diagnostics(**unseparated), make_eo()),
        "separation undetermined": (
            make_diagnostics(separation=np.full((EPOCHS // 10, 9), np.nan)),
            make_eo(),
        ),
        "not a number": (make_diagnostics(nis=np.where(some, d.nis, np.nan)), make_eo()),
        "gaps, checks, resets": (
            make_diagnostics(
                gaps=((START + 5, 0.03),), checks=(check,), covariance_resets=np.array([START + 9])
            ),
            make_eo(),
        ),
        "one image": (d, dataclasses.replace(make_eo(), **_first_only(make_eo()))),
    }


def _first_only(eo: ExteriorOrientation) -> dict[str, Any]:
    first = {
        name: getattr(eo, name)[:1] for name in ("images", "time", "position_m", "C_mc", "cov")
    }
    return first | {"cross": np.zeros((0, 6, 6))}


LEG_S, TURN_S, LEG_SPEED = (
    20.0,
    10.0,
    10.0,
)  # of the block: four lines north and south, half-circles between them


def make_block(**changes: Any) -> Diagnostics:
    """Four lines of `LEG_S` at `LEG_SPEED` that a half-circle of `TURN_S` joins, 110 s, then on
    without turn; heading is the course.
    """
    time = 0.1 * np.arange(EPOCHS)
    in_period = np.mod(time, LEG_S + TURN_S)
    turns = np.floor(time / (LEG_S + TURN_S)) + np.clip((in_period - LEG_S) / TURN_S, 0.0, 1.0)
    course = np.pi * np.minimum(turns, 3.0)
    velocity = LEG_SPEED * np.stack([np.cos(course), np.sin(course), np.zeros(EPOCHS)], axis=1)
    fields = {
        "velocity": velocity,
        "position": np.cumsum(0.1 * velocity, axis=0),
        "rpy": np.stack([0 * course, 0 * course, course], axis=1),
    }
    return make_diagnostics(**(fields | changes))


@pytest.fixture(scope="session")
def block() -> Callable[..., Diagnostics]:
    return make_block
