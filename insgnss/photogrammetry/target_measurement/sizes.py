"""Apparent sizes of a vehicle's target of known diameter, from its matched deformation.

The matching takes metres along the axes of the signal to pixels by T. The diameter of a disc that
is parallel to the image lies along G e in it, with e level and across the viewing axis and G the
predicted derivative of pixels by east and north; the disc's ellipse is L / |T^-1 t| long in the
direction t of G e. Without distortion it would be longer by (f / q_3) / |G e|, q_3 the depth:

    size = L (f / q_3) / (|G e| |T^-1 t|)                                                    (GT.7)

Its standard deviation is that of the deformation (T = M^-1 T_0) and that of both ends by (GT.4).
"""

from collections.abc import Sequence

import numpy as np

from ...io.formats.vehicle.target_sizes import TargetSizes
from ...records.block import Array
from .inputs import TargetInputs
from .windows import Window, accepted

LEVEL_SINE = 1e-6
"""Of the sine of the tilt below which every diameter is parallel to the image."""


def target_sizes(inputs: TargetInputs, windows: Sequence[Window]) -> TargetSizes:
    """Return the apparent sizes of a target in the photographs in which it was measured.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and the vehicle.
    windows : sequence of Window
        All windows.

    Returns
    -------
    TargetSizes
        One an accepted window (GT.7).
    """
    predictions, length = inputs.predictions, inputs.request.target.size_m
    images, points, size, sigma = [], [], [], []
    for window, match in accepted(windows):
        if match.M_cov is None:
            continue
        i, p = int(predictions.image[window.row]), int(predictions.point[window.row])
        axis = inputs.eo.C_mc[i][:, 2]
        depth = float(axis @ (inputs.ground.position_m[p] - inputs.eo.position_m[i]))
        along = predictions.by_point[window.row] @ _across(axis)
        slope = float(np.linalg.norm(along))
        t = along / slope
        inverse = np.linalg.inv(match.to_pixel)
        w = inverse @ t
        ratio = inputs.camera.of("f") / depth / slope
        diameter_px = length * ratio / float(np.linalg.norm(w))
        # T^-1 = T_0^-1 M: d(T^-1 t) = T_0^-1 dM t = T^-1 M^-1 dM t
        by_M = np.kron(w @ inverse @ np.linalg.inv(match.M), t) / float(w @ w)
        variance = diameter_px**2 * float(by_M @ match.M_cov @ by_M) + 2.0 * match.edge_px**2
        images.append(inputs.eo.images[i])
        points.append(inputs.ground.points[p])
        size.append(diameter_px)
        sigma.append(float(np.sqrt(variance)))
    return TargetSizes(tuple(images), tuple(points), np.array(size), np.array(sigma))


def _across(axis: Array) -> Array:
    """Return the level direction that is parallel to the image; east of an image that is level."""
    e = np.array([-axis[1], axis[0], 0.0])
    sine = float(np.linalg.norm(e))
    return e / sine if sine > LEVEL_SINE else np.array([1.0, 0.0, 0.0])
