"""From the images of each camera of a rig to the images of all of them in the order of time.

One solution serves all cameras: with D what the errors of all states at the instant of an image
make of its navigation errors, and J of (O.2) by the lever arm of its own camera, the errors of
image k of one camera and image l of any other are

    e_k = J_k D_k x_k,      cov(e_k, e_l) = J_k D_k cov_s(x_k, x_l) D_l' J_l'                  (O.4)

At one instant x_k = x_l: two images of a rig taken together are wholly correlated, e_l = J_l J_k^-1
e_k, and tell nothing of the body that one of them does not. The mountings are constants; what they
are wrong by is in no covariance, as with a single camera, and is for the adjustment to estimate.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...records import Array, ExteriorOrientation
from ...records.cameras.rig import RigCamera, RigImages


def rig_orientation(
    cameras: Sequence[ExteriorOrientation],
    names: Sequence[str],
    order: NDArray[np.int64],
    number: NDArray[np.int64],
    cross: tuple[Array, Array],
) -> ExteriorOrientation:
    """Join the images of the cameras of a rig.

    Parameters
    ----------
    cameras : sequence of ExteriorOrientation
        The images of each camera, of one tangent plane and week.
    names : sequence of str
        Names of the cameras.
    order, number : ndarray
        (n,) rows of the images of all cameras one after the other in the order of time, and their
        cameras (`records.cameras.rig.merged_order`).
    cross : tuple of Array
        (n - 1, 6, 6) covariances of neighbours in time, and (n, 6, 6) those with the next image of
        the same camera, in that order.

    Returns
    -------
    ExteriorOrientation
        The whole, `boresight` and `camera_from_body` those of the first camera.
    """

    def joined(name: str) -> Array:
        return np.asarray(np.concatenate([getattr(eo, name) for eo in cameras])[order])

    moving = all(eo.velocity_mps is not None and eo.rate_radps is not None for eo in cameras)
    images = [image for eo in cameras for image in eo.images]
    members = tuple(
        RigCamera(name, eo.boresight, eo.camera_from_body)
        for name, eo in zip(names, cameras, strict=True)
    )
    return replace(
        cameras[0],
        images=tuple(images[k] for k in order.tolist()),
        time=joined("time"),
        position_m=joined("position_m"),
        C_mc=joined("C_mc"),
        cov=joined("cov"),
        velocity_mps=joined("velocity_mps") if moving else None,
        rate_radps=joined("rate_radps") if moving else None,
        cross=cross[0],
        rig=RigImages(members, number, cross[1]),
    )
