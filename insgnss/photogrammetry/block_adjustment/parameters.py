"""Unknowns between trajectories and images: what the block file asks for, one row an unknown."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...flight.config.block_file import BlockFile
from ...geodesy.rotation import vector_from_rotation
from ...records.block import Array
from ...records.states import State
from ...records.verdicts import Estimate
from ...report.rules.wording import screen_unit
from ..adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY, ParameterObservation
from ..adjust.kinematic import SIZE, TARGET_ARM, VEHICLE_CLOCK, VEHICLE_SHIFT
from ..adjust.precision import Precision
from ..adjust.unknowns import Key

SIGNIFICANT_SIGMAS = 3.0  # beyond which an estimate differs from zero or from its statement
HELD_M = 1e-4  # standard deviation of a lever arm that is stated and not estimated
# standard deviation of a lever arm that nobody states (m): antennas of drones stand 0.05 to 0.3 m
# from the camera, and files do not say whether their positions are of the antenna
UNSTATED_ARM_M = (0.15, 0.15, 0.15)


@dataclass(frozen=True)
class BlockParameter:
    """An unknown that all poses of a block, or all places of a vehicle, share.

    Parameters
    ----------
    name : str
        Its name among the unknowns.
    option : str
        Table and key of its standard deviation in the block file; it is estimated where there is
        one.
    unit : str
        m, s or rad; of rad it is a rotation.
    loose : float or tuple of float
        The standard deviation with which trials estimate it, as the block file would have it,
        beyond any error that was seen; zero: none does.
    axes : tuple of str
        Names of its components.
    error : str
        What sentences call it where the block file leaves it out; by default its name.
    """

    name: str
    option: str
    unit: str
    loose: float | tuple[float, ...]
    axes: tuple[str, ...] = ("",)
    error: str = ""

    @property
    def key(self) -> Key:
        """Its block of unknowns."""
        return self.name, 0

    def stated(self, file: BlockFile) -> Any:
        """Return its standard deviation as the block file has it.

        Parameters
        ----------
        file : BlockFile
            The block file.

        Returns
        -------
        float, tuple or None
            None or zero: it is not estimated.
        """
        table, field = self.option.split(".")
        return getattr(getattr(file, table), field)

    def left_out(self, file: BlockFile) -> bool:
        """Tell whether a block file leaves it out; a bore-sight also where it is held nearly, a
        lever arm where nobody states it.

        Parameters
        ----------
        file : BlockFile
            The block file.

        Returns
        -------
        bool
            Whether a trial may estimate it.
        """
        stated = self.stated(file)
        held = self.name == BORESIGHT and stated < self.loose
        return not stated or held or stated == UNSTATED_ARM_M

    def estimated_in(self, file: BlockFile) -> BlockFile:
        """Return a block file that asks for it.

        Parameters
        ----------
        file : BlockFile
            The block file.

        Returns
        -------
        BlockFile
            The same otherwise.
        """
        table, field = self.option.split(".")
        wider = replace(getattr(file, table), **{field: self.loose})
        return replace(file, **{table: wider})

    def sigma(self, file: BlockFile) -> Array | None:
        """Return its standard deviations in `unit`; None where it is not estimated.

        Parameters
        ----------
        file : BlockFile
            The block file.

        Returns
        -------
        ndarray or None
            One an axis.
        """
        stated = self.stated(file)
        if self.name == BORESIGHT and not file.aerial_control.absolute_attitudes:
            return None
        if not stated or (self.name == SIZE and file.vehicle.sizes is None):
            return None
        sigma = np.broadcast_to(np.asarray(stated, dtype=np.float64), len(self.axes))
        return np.radians(sigma) if self.unit == "rad" else sigma

    def first(self, file: BlockFile) -> Array:
        """Return its first value.

        Parameters
        ----------
        file : BlockFile
            The block file.

        Returns
        -------
        ndarray
            A vector; of a rotation its matrix.
        """
        if self.name == CAMERA_LEVER_ARM:
            return np.array(file.aerial_control.lever_arm_m or (0.0,) * 3)
        return np.eye(3) if self.unit == "rad" else np.zeros(len(self.axes))

    def change(self, value: Array, file: BlockFile) -> Array:
        """Return a value less its first one.

        Parameters
        ----------
        value : ndarray
            The value.
        file : BlockFile
            The block file.

        Returns
        -------
        ndarray
            The difference in `unit`; of a rotation its vector.
        """
        return vector_from_rotation(value) if self.unit == "rad" else value - self.first(file)


XYZ = ("x", "y", "z")
FRD = ("forward", "right", "down")
ENU = ("east", "north", "up")
MOUNTING_PARAMETERS = (
    BlockParameter(CAMERA_LEVER_ARM, "aerial_control.lever_arm_sigma_m", "m", (10.0,) * 3, XYZ),
    BlockParameter(BORESIGHT, "aerial_control.boresight_sigma_deg", "rad", 30.0, XYZ),
    BlockParameter(
        EXPOSURE_DELAY,
        "aerial_control.time_offset_sigma_s",
        "s",
        1.0,
        error="delay of the exposures",
    ),
)
"""Between a trajectory and the camera."""
VEHICLE_PARAMETERS = (
    BlockParameter(TARGET_ARM, "vehicle.target_sigma_m", "m", (10.0,) * 3, FRD),
    BlockParameter(VEHICLE_CLOCK, "vehicle.time_offset_sigma_s", "s", 10.0),
    BlockParameter(VEHICLE_SHIFT, "vehicle.shift_sigma_m", "m", (100.0,) * 3, ENU),
    BlockParameter(SIZE, "vehicle.size_sigma_m", "m", 0.0),
)
"""Of a vehicle whose target the images see; no trial estimates its size."""
PARAMETERS = {
    parameter.name: parameter for parameter in (*MOUNTING_PARAMETERS, *VEHICLE_PARAMETERS)
}


def prior(key: Key, value: Array, sigma: Array) -> ParameterObservation:
    """Return the first value of a parameter as an observation.

    Parameters
    ----------
    key : tuple
        Its block.
    value, sigma : ndarray
        First value and standard deviations.

    Returns
    -------
    ParameterObservation
        Of the variance component "mounting".
    """
    return ParameterObservation(key, value, np.diag(1.0 / sigma**2))


def priors(file: BlockFile, parameters: Sequence[BlockParameter]) -> list[ParameterObservation]:
    """Return the first values of parameters that a block file asks for.

    Parameters
    ----------
    file : BlockFile
        The block file.
    parameters : sequence of BlockParameter
        Which of them.

    Returns
    -------
    list of ParameterObservation
        One a parameter; a stated lever arm that is not estimated is held by one too.
    """
    out = []
    for parameter in parameters:
        sigma = parameter.sigma(file)
        if parameter.name == CAMERA_LEVER_ARM and sigma is None and file.aerial_control.lever_arm_m:
            sigma = np.full(3, HELD_M)
        if sigma is not None:
            out.append(prior(parameter.key, parameter.first(file), sigma))
    return out


def estimates(
    file: BlockFile, parameters: Sequence[BlockParameter], precision: Precision
) -> dict[str, dict[str, Any]]:
    """Return what was estimated of parameters.

    Parameters
    ----------
    file : BlockFile
        The block file.
    parameters : sequence of BlockParameter
        Which of them.
    precision : Precision
        The adjustment.

    Returns
    -------
    dict
        By name: unit, value, standard deviations, and those before.
    """
    blocks, out = precision.result.values.blocks, {}
    for parameter in parameters:
        before = parameter.sigma(file)
        if parameter.key in blocks and before is not None:
            out[parameter.name] = {
                "unit": parameter.unit,
                "value": parameter.change(blocks[parameter.key], file),
                "sigma": np.sqrt(np.diagonal(precision.cov(parameter.key))),
                "sigma_before": before,
            }
    return out


def determined_unknowns(figures: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Say of each unknown of cameras, mounting and vehicle whether the block determines it.

    Parameters
    ----------
    figures : mapping
        Figures of the block.

    Yields
    ------
    tuple of str
        Its name, a verdict, and its value with standard deviation.
    """
    for camera in figures["cameras"]:
        for name, est in camera["parameters"].items():
            if not est["estimated"]:
                continue
            moved = est["value"] - est["first"]
            unit = " px" if name in ("f", "cx", "cy", "b1", "b2") else ""
            sure = abs(est["value"]) > SIGNIFICANT_SIGMAS * est["sigma"]
            verdict = "determined" if sure or name in ("f", "cx", "cy") else "not significant"
            yield (
                f"{name} of {camera['name']}",
                verdict,
                f"{est['value']:.6g}{unit}, sigma {est['sigma']:.2g}, moved by {moved:+.2g}",
            )
    vehicle = figures["vehicle"] or {"parameters": {}}
    for name, est in (figures["mounting"] | vehicle["parameters"]).items():
        factor, unit = screen_unit(est["unit"])
        columns = zip(
            PARAMETERS[name].axes,
            *map(est.get, ("value", "sigma", "sigma_before")),
            strict=True,
        )
        for axis, value, sigma, before in columns:
            one = Estimate(State(name, axis), value, sigma, before)
            numbers = f"sigma {factor * sigma:.2g} (before {factor * before:.2g})"
            degree = one.degree("determined", "improved", "not determined")
            yield one.name, degree, f"{factor * value:+.3g} {unit}, {numbers}"
