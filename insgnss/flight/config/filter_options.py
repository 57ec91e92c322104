"""Tables [filter] and [initial] of the flight file: what is estimated, and where it starts."""

from dataclasses import dataclass
from typing import Literal

from ...io.options.kinds import Checked
from ...io.options.schema import Triple, option


@dataclass(frozen=True)
class InitialAttitude(Checked, table="initial"):
    """Attitude at the first fix, where one is known: table [initial].

    Parameters
    ----------
    sigma_deg : tuple of float
        Standard deviations of roll, pitch and heading, deg.
    roll_deg, pitch_deg, heading_deg : float
        Of the body forward-right-down, heading from true north, deg.

    Raises
    ------
    UsageError
        For a value that cannot be.
    """

    roll_deg: float = option(
        ..., "initial roll, where an attitude is known", unit="deg", low=-180.0, high=180.0
    )
    pitch_deg: float = option(..., "initial pitch", unit="deg", low=-90.0, high=90.0)
    heading_deg: float = option(..., "initial heading", unit="deg", low=-180.0, high=360.0)
    sigma_deg: Triple = option(
        (2.0, 2.0, 5.0), "standard deviations of roll, pitch and heading", kind="sigmas", unit="deg"
    )


@dataclass(frozen=True)
class FilterOptions(Checked, table="filter"):
    """States and constraints of the filter beside the usual ones: table [filter].

    Parameters
    ----------
    scale_factor : bool
        Whether scale factors of gyroscopes and accelerometers are states.
    misalignment : bool
        Whether their misalignments are states: nine of twelve. The gyros' axes define those of the
        body, and how they are turned in it counts as bore-sight.
    second_pass : str
        "auto", "on" or "off": linearise again about the smoothed flight.
    time_offset : bool
        Whether a time offset of the fixes and its rate are states.
    time_offset_sigma_s : float
        A-priori standard deviation of the time offset, s.
    lever_arm : bool
        Whether the error of the lever arm from IMU to antenna is a state.
    lever_arm_sigma_m : float
        A-priori standard deviation of each of its components, m.
    zero_velocity : str
        "auto" or "off": zero-velocity and zero-angular-rate updates in stationary periods.
    non_holonomic : bool
        Non-holonomic constraint of a wheeled vehicle: no velocity across its forward axis.
    adaptive_noise : str
        "auto" or "off": larger noise of IMU or fixes adopted where the innovations show it.
    robust : bool
        Whether suspicious fixes get Huber weights instead of all or nothing.

    Raises
    ------
    UsageError
        For a value that cannot be.
    """

    scale_factor: bool = option(False, "scale-factor states of gyros and accelerometers")
    misalignment: bool = option(
        False,
        "estimate misalignments of the sensor axes against the gyro axes; a rotation of the gyro "
        "axes in the body counts as bore-sight",
    )
    second_pass: Literal["auto", "on", "off"] = option(
        "auto", "relinearise about the smoothed flight"
    )
    time_offset: bool = option(
        False,
        "estimate time offset and clock rate of the fixes relative to the IMU's clock",
    )
    time_offset_sigma_s: float = option(
        0.1, "its a-priori standard deviation", unit="s", low=1e-4, high=10.0
    )
    lever_arm: bool = option(False, "estimate the error of the lever arm from IMU to antenna")
    lever_arm_sigma_m: float = option(
        0.3, "its a-priori standard deviation, each component", unit="m", low=1e-3, high=10.0
    )
    zero_velocity: Literal["auto", "off"] = option(
        "auto",
        "zero-velocity and zero-angular-rate updates (ZUPT, ZARU) in stationary periods, where they"
        " are detected",
    )
    non_holonomic: bool = option(
        False,
        "non-holonomic constraint (NHC) for a wheeled vehicle whose forward axis is that of the "
        "body: no velocity across it",
    )
    adaptive_noise: Literal["auto", "off"] = option(
        "auto",
        "raise the noise of the IMU and the sigmas of the fixes if the likelihood of the flight "
        "shows that they are stated too small",
    )
    robust: bool = option(
        False, "give suspicious fixes a larger covariance instead of either using or rejecting them"
    )
