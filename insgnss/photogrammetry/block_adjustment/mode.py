"""Modes of orientation: what of a block takes part.

iso        everything: integrated sensor orientation
indirect   image observations and ground control; the orientation gives first values alone
fast_at    image observations of ground points, aerial control, a camera that is held (Blazquez and
           Colomina 2012, Fast AT: a simple procedure for quasi direct orientation), or that its
           calibration holds (camera.weighed)
direct     poses and camera are held; all points are intersected, ground control among them, which
           is compared with them as check points are (direct sensor orientation)
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...base.errors import DataError, InputError
from ...flight.config.block_file import BlockFile
from ...io.formats.blocks.camera_toml import read_camera_covariance
from ...io.formats.blocks.ground_points import GroundTable
from ...io.formats.blocks.measured_block import MeasuredBlock
from ...records.block import BrownCamera

CAMERA_HELD = ("fast_at", "direct")
FEWEST_CONTROL = 3
"""Ground control points without which nothing says where a block lies, how large and how turned."""


def file_in_mode(file: BlockFile, notes: list[str]) -> BlockFile:
    """Return the block file without what its mode has no use for.

    Parameters
    ----------
    file : BlockFile
        The block file.
    notes : list of str
        Gets a sentence where something was asked for that the mode does not estimate.

    Returns
    -------
    BlockFile
        In mode "direct" nothing of mounting and flight lines is estimated.
    """
    control = file.aerial_control
    if file.adjustment.mode != "direct":
        return file
    requested = [
        name
        for name in ("lever_arm_sigma_m", "shift_sigma_m", "drift_sigma_mps")
        if getattr(control, name) is not None
    ]
    requested += ["time_offset_sigma_s"] * (control.time_offset_sigma_s > 0.0)
    if requested:
        options = ", ".join(f"aerial_control.{name}" for name in requested)
        notes.append(f"mode direct estimates nothing: {options} has no effect")
    held = replace(
        control,
        boresight_sigma_deg=0.0,
        lever_arm_sigma_m=None,
        time_offset_sigma_s=0.0,
        shift_sigma_m=None,
        drift_sigma_mps=None,
    )
    return replace(file, aerial_control=held)


def cameras_in_mode(
    file: BlockFile, cameras: Sequence[BrownCamera], notes: list[str]
) -> tuple[BrownCamera, ...]:
    """Return the cameras, which modes "fast_at" and "direct" hold.

    Parameters
    ----------
    file : BlockFile
        The block file.
    cameras : sequence of BrownCamera
        The cameras.
    notes : list of str
        Gets a sentence where errors of a held camera are not counted.

    Returns
    -------
    tuple of BrownCamera
        In these modes nothing of them is free, but for what a calibration has standard deviations
        of, where it is weighed.
    """
    if file.adjustment.mode not in CAMERA_HELD:
        return tuple(cameras)
    path = file.camera.file
    P = None if path is None else read_camera_covariance(path)
    if file.camera.weighed and P is not None:
        return tuple(replace(camera, free=P.parameters) for camera in cameras)
    notes.append(
        f"mode {file.adjustment.mode} holds the camera: the standard deviations do not"
        " include its errors"
        + (
            "; camera.weighed includes them, as the camera file states them"
            if P is not None
            else ""
        )
    )
    return tuple(replace(camera, free=()) for camera in cameras)


def ground_in_mode(
    file: BlockFile, ground: GroundTable | None, measured: Sequence[str], notes: list[str]
) -> GroundTable | None:
    """Return the ground points with the role that they have.

    Parameters
    ----------
    file : BlockFile
        Says the mode, and whether a vehicle is control too.
    ground : GroundTable or None
        The points.
    measured : sequence of str
        Names of the points that are measured in images.
    notes : list of str
        Gets a sentence where control points become check points.

    Returns
    -------
    GroundTable or None
        In mode "direct" all of them are check points.

    Raises
    ------
    DataError
        Mode "indirect" with fewer than three control points and no vehicle: the block has no
        datum.
    """
    mode, names, control = file.adjustment.mode, set(measured), 0
    if ground is not None:
        control = sum(
            name in names
            for name, check in zip(ground.points, ground.check, strict=True)
            if not check
        )
    if mode == "indirect" and control < FEWEST_CONTROL and file.vehicle.file is None:
        raise DataError(
            f"mode indirect: {control} ground control points are measured in images; without"
            f" aerial control at least {FEWEST_CONTROL} are needed to place the block; measure"
            " more of them, or take another mode"
        )
    if mode != "direct" or ground is None:
        return ground
    if control:
        notes.append(
            f"mode direct: {control} ground control points take no part and are compared with the"
            " intersected points, as check points are"
        )
    return replace(ground, check=np.ones(len(ground.points), dtype=bool))


def source_in_mode(
    mode: str,
    source: MeasuredBlock,
    ground: GroundTable | None,
    notes: list[str],
    moving: Sequence[str] = (),
) -> MeasuredBlock:
    """Return the image observations that take part.

    Parameters
    ----------
    mode : str
        The mode.
    source : MeasuredBlock
        All of them.
    ground : GroundTable or None
        The ground points.
    notes : list of str
        Gets a sentence where tie points are left out.
    moving : sequence of str
        Points of a vehicle, which are ground points of one image each.

    Returns
    -------
    MeasuredBlock
        In mode "fast_at" those of ground points alone.

    Raises
    ------
    InputError
        Mode "fast_at" without ground points in images.
    """
    if mode != "fast_at":
        return source
    names = {*(ground.points if ground is not None else ()), *moving}
    measured = source.measured
    of_ground = np.array([name in names for name in measured.points], dtype=bool)
    all_observations = measured.observations
    keep = of_ground[all_observations.point]
    if not keep.any():
        raise InputError(
            "mode fast_at: no image observation is of a ground point; give ground points with"
            " --ground, under the names that they have in the image observations"
        )
    if not keep.all():
        notes.append(
            f"mode fast_at: {int((~keep).sum())} of {keep.size} image observations are of tie"
            " points, which take no part"
        )
    new = np.cumsum(of_ground) - 1
    kept = all_observations.rows(keep)
    observations = replace(kept, point=new[kept.point])
    points = tuple(p for p, mine in zip(measured.points, of_ground, strict=True) if mine)
    return replace(source, measured=replace(measured, points=points, observations=observations))
