"""Kinematic ground control as observation groups: places, sizes, and what stands between."""

from dataclasses import dataclass, replace

import numpy as np

from ....flight.config.block_tables.vehicle import VehicleTable
from ....records.block import Array, ImageBlock
from ...adjust.aerial import TIME_OFFSET, ParameterObservation
from ...adjust.groups import ObservationGroup, weight_of
from ...adjust.kinematic import (
    CLOCK,
    SIZE,
    TARGET_ARM,
    VEHICLE_SHIFT,
    KinematicControl,
    TargetSize,
)
from ...adjust.unknowns import Key, Unknowns
from .places import Vehicle

MOUNTING = "mounting"
LOOSE = {CLOCK: 10.0, TARGET_ARM: 10.0, VEHICLE_SHIFT: 100.0}


@dataclass(frozen=True, eq=False)
class VehicleControl:
    """Kinematic ground control of a block.

    Parameters
    ----------
    groups : tuple of ObservationGroup
        Places, sizes, and the prior of each parameter.
    blocks : dict
        First values of the parameters.
    """

    groups: tuple[ObservationGroup, ...]
    blocks: dict[Key, Array]


def vehicle_control(
    vehicle: Vehicle | None,
    block: ImageBlock,
    blocks: dict[Key, Array],
    options: VehicleTable | None = None,
) -> VehicleControl:
    """Return the kinematic ground control of a block.

    Parameters
    ----------
    vehicle : Vehicle or None
        The vehicle.
    block : ImageBlock
        The block that sees it.
    blocks : dict
        Parameters of the aerial control; a delay of the exposures moves the target as well.
    options : VehicleTable, optional
        What is estimated besides; by default as the block file has it.

    Returns
    -------
    VehicleControl
        Nothing without a vehicle.
    """
    if vehicle is None:
        return VehicleControl((), {})
    options = options or vehicle.options
    names = _shared(options)
    parameters = dict.fromkeys(names, 0)
    parameters.pop(SIZE, None)
    if (TIME_OFFSET, 0) in blocks:
        parameters[TIME_OFFSET] = 0
    image, point = rows_in(vehicle, block)
    groups: list[ObservationGroup] = [
        ParameterObservation((name, 0), value, np.diag(1.0 / sigma**2), MOUNTING)
        for name, (value, sigma) in names.items()
    ]
    groups.append(
        KinematicControl(
            tuple(point),
            vehicle.exposures.position_m,
            weight_of(vehicle.cov, f"{options.file}: places of the target"),
            vehicle.exposures.velocity,
            vehicle.exposures.C_mv,
            parameters,
        )
    )
    for k in np.flatnonzero(np.isfinite(vehicle.size_px)).tolist():
        assert options.size_m is not None
        groups.append(
            TargetSize(
                image[k],
                int(block.camera[image[k]]),
                point[k],
                float(vehicle.size_px[k]),
                float(vehicle.size_sigma_px[k]),
                options.size_m,
                SIZE in names,
            )
        )
    return VehicleControl(tuple(groups), {(name, 0): value for name, (value, _) in names.items()})


def _shared(options: VehicleTable) -> dict[str, tuple[Array, Array]]:
    """Return first values and standard deviations of what all exposures share."""
    shared: dict[str, tuple[Array, Array]] = {}
    if options.target_sigma_m is not None:
        shared[TARGET_ARM] = np.zeros(3), np.array(options.target_sigma_m)
    if options.time_offset_sigma_s > 0.0:
        shared[CLOCK] = np.zeros(1), np.array([options.time_offset_sigma_s])
    if options.shift_sigma_m is not None:
        shared[VEHICLE_SHIFT] = np.zeros(3), np.array(options.shift_sigma_m)
    if options.sizes is not None and options.size_sigma_m > 0.0:
        shared[SIZE] = np.zeros(1), np.array([options.size_sigma_m])
    return shared


def rows_in(vehicle: Vehicle, block: ImageBlock) -> tuple[list[int], list[int]]:
    """Return the rows of the vehicle's images and points in a block.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    block : ImageBlock
        The block.

    Returns
    -------
    tuple of list
        (n,) images and (n,) points.
    """
    image = {name: k for k, name in enumerate(block.images)}
    point = {name: k for k, name in enumerate(block.points)}
    return [image[name] for name in vehicle.images], [point[name] for name in vehicle.points]


def with_first_points(values: Unknowns, vehicle: Vehicle | None, block: ImageBlock) -> Unknowns:
    """Return first values with the places of the target, which one image alone sees.

    Parameters
    ----------
    values : Unknowns
        First values.
    vehicle : Vehicle or None
        The vehicle.
    block : ImageBlock
        The block.

    Returns
    -------
    Unknowns
        The same otherwise.
    """
    if vehicle is None:
        return values
    point = values.point.copy()
    point[rows_in(vehicle, block)[1]] = vehicle.exposures.position_m
    return values.with_points(point)


def remedies(
    vehicle: Vehicle | None, options: VehicleTable
) -> list[tuple[str, str, str, VehicleTable, Key]]:
    """Return what the block file leaves out of the vehicle, each estimated.

    Parameters
    ----------
    vehicle : Vehicle or None
        The vehicle.
    options : VehicleTable
        Table [vehicle] of the block file.

    Returns
    -------
    list of tuple
        Name, key of the block file, unit, the options that ask for it, and its block.
    """
    out: list[tuple[str, str, str, VehicleTable, Key]] = []
    if vehicle is None:
        return out
    speed = np.linalg.norm(vehicle.exposures.velocity, axis=1)
    if options.time_offset_sigma_s == 0.0 and np.median(speed) > 0.1:
        wider = replace(options, time_offset_sigma_s=LOOSE[CLOCK])
        out.append((CLOCK, "vehicle.time_offset_sigma_s", "s", wider, (CLOCK, 0)))
    if options.target_sigma_m is None:
        wider = replace(options, target_sigma_m=(LOOSE[TARGET_ARM],) * 3)
        out.append((TARGET_ARM, "vehicle.target_sigma_m", "m", wider, (TARGET_ARM, 0)))
    if options.shift_sigma_m is None:
        wider = replace(options, shift_sigma_m=(LOOSE[VEHICLE_SHIFT],) * 3)
        out.append((VEHICLE_SHIFT, "vehicle.shift_sigma_m", "m", wider, (VEHICLE_SHIFT, 0)))
    return out
