"""Kinematic ground control as observation groups: places, sizes, and what stands between."""

import numpy as np

from ....records.block import Array
from ...adjust.aerial import EXPOSURE_DELAY
from ...adjust.groups import ObservationGroup, weight_of
from ...adjust.kinematic import SIZE, KinematicControl, TargetSize
from ...adjust.unknowns import Key
from ..inputs import BlockInputs
from ..parameters import VEHICLE_PARAMETERS, priors


def vehicle_control(
    inputs: BlockInputs, blocks: dict[Key, Array]
) -> tuple[list[ObservationGroup], dict[Key, Array]]:
    """Return the kinematic ground control of a block.

    Parameters
    ----------
    inputs : BlockInputs
        The block, its vehicle, and what the block file estimates of it.
    blocks : dict
        Parameters of the aerial control; a delay of the exposures moves the target as well.

    Returns
    -------
    groups : list of ObservationGroup
        Places, sizes, and the prior of each parameter; none without a vehicle.
    blocks : dict
        First values of the parameters.
    """
    vehicle, block, options = inputs.vehicle, inputs.block, inputs.file.vehicle
    if vehicle is None:
        return [], {}
    shared = priors(inputs.file, VEHICLE_PARAMETERS)
    first = {one.key: one.value for one in shared}
    parameters = {name: row for name, row in first if name != SIZE}
    if (EXPOSURE_DELAY, 0) in blocks:
        parameters[EXPOSURE_DELAY] = 0
    image, point, _ = (rows.tolist() for rows in vehicle.rows_in(block))
    places = KinematicControl(
        tuple(point),
        vehicle.exposures.position_m,
        weight_of(vehicle.cov, f"{options.file}: places of the target"),
        vehicle.exposures.velocity,
        vehicle.exposures.C_mv,
        parameters,
    )
    groups: list[ObservationGroup] = [*shared, places]
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
                (SIZE, 0) in first,
            )
        )
    return groups, first
