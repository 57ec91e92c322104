"""Ground points in the axes of a block: their CRS, their roles, and where they cannot be."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.errors import InputError, InsgnssError, near
from ...base.tables import Columns
from ...base.units import FOOT_M, METRE
from ...flight.config.block_file import BlockFile
from ...geodesy.datums import fitting_crs
from ...geodesy.frames import TangentPlane
from ...io.formats.blocks.ground_points import GroundAxes, GroundTable, read_ground_points
from ...io.formats.blocks.measured_block import MeasuredBlock
from ...io.formats.blocks.reading import read_measured_block, recognise_format
from ...io.formats.returned.crs import stated_crs
from ...records import Array, ExteriorOrientation
from ..comparison.poses import PLANE_M, degrees_for_metres, refuse_heights
from ..comparison.shifts import KILOMETRE
from .placing import noted_plane

# largest distance of the middle of ground points from that of the images (m) at which another CRS
# is named for them: blocks are smaller, and zones differ by more
NEAR_GROUND_M = 5e3
FALSE_ORIGIN = 5e5  # m: false eastings and northings, and prefixes of zones, are multiples of it
METRES_OF_RADIAN = 6.4e6  # radius by which degrees are compared with it
FAR_GROUND_M = 100e3
"""Ground points farther from the images than this stand in other axes."""


def ground_in_plane(
    file: BlockFile,
    source: MeasuredBlock | None,
    eo: ExteriorOrientation | None,
    notes: list[str],
) -> GroundTable | None:
    """Return the ground points in the axes of the block.

    Parameters
    ----------
    file : BlockFile
        Says where they are and in which CRS.
    source : MeasuredBlock, optional
        What the photogrammetry program has of them.
    eo : ExteriorOrientation, optional
        Whose tangent plane has the axes of the block.
    notes : list of str
        Gets a sentence where something was assumed.

    Returns
    -------
    GroundTable or None
        The points; None where there are none.

    Raises
    ------
    InputError
        They are not where the images are, or a name is unknown.
    """
    ground, crs, path = None, None, file.images.file
    if source is not None:
        ground, crs = source.ground, source.crs
    if file.ground.file is not None:
        path = file.ground.file
        ground, crs = ground_of(path, file.ground.columns)
    if ground is None or not ground.points:
        return None
    crs = file.ground.crs or crs
    ground = _roles(file, ground)
    if eo is None:
        return ground if crs is None else _in_own_plane(ground, crs, file.ground.geoid, notes)
    plane = TangentPlane(*eo.origin)
    if crs is None and file.aerial_control.positions_alone:
        raise InputError.in_file(
            path,
            "does not say in which CRS its ground points are, and without a flight no tangent"
            " plane is known; name their CRS by ground.crs or --crs, such as EPSG:2056+5728,"
            ' or by the origin of their plane, "origin 46.57 6.54 deg 0 m"',
        )
    as_read = ground
    if crs is None and degrees_for_metres(ground.position_m):
        problem = "its x and y are degrees: as metres its points would be centimetres apart"
        raise InputError.in_file(path, f"{problem}; name their CRS by ground.crs or --crs")
    axes = None if crs is None else GroundAxes(crs, file.ground.geoid, eo.datum, eo.epoch)
    if axes is not None:
        unit = METRE if axes.projection is None else axes.projection.units[1]
        refuse_heights(ground.position_m, unit, path)
        try:
            ground = ground.in_plane(axes, plane)
        except InputError as refusal:
            x, y, _ = ground.position_m[0]
            why = f"coordinates such as {x:.3f} {y:.3f}: {refusal}"
            advice = _otherwise_near(ground, axes, plane, eo)
            raise InputError.in_file(path, f"{why}; {advice}" if advice else why) from None
        notes += [axes.unit_note] if axes.unit_note else []
    away = np.linalg.norm(
        ground.position_m[:, :2] - np.median(eo.position_m[:, :2], axis=0), axis=1
    )
    if (away > FAR_GROUND_M).any():
        k = int(np.argmax(away))
        x, y, z = ground.position_m[k]
        if axes is None:
            fits = _fitting(as_read, plane, eo) or "such as EPSG:2056"
            advice = f"they stand in a CRS: name it by ground.crs or --crs, {fits}"
        else:
            advice = (
                _exchanged_positions(file, as_read, axes, eo)
                or _otherwise_near(as_read, axes, plane, eo)
                or f"{crs} is not their CRS; name the right one, with its zone"
            )
        raise InputError.in_file(
            path,
            f"point {ground.points[k]!r} ({x:.0f}, {y:.0f}, {z:.0f}) lies {away[k] / 1e3:.0f} km"
            f" from the images; {advice}",
        )
    return ground


def _exchanged_positions(
    file: BlockFile, ground: GroundTable, axes: GroundAxes, eo: ExteriorOrientation
) -> str:
    """Say that images lie near the points with latitude and longitude exchanged; empty if not."""
    path = file.aerial_control.file
    if path is None or not file.aerial_control.positions_alone:
        return ""
    try:
        lat, lon, _ = axes.geodetic(np.median(ground.position_m, axis=0, keepdims=True))
    except InsgnssError:
        return ""
    away = np.hypot(lat[0] - eo.origin[1], lon[0] - eo.origin[0])
    if away * METRES_OF_RADIAN > FAR_GROUND_M:
        return ""
    return f"those of {path.name} have latitude and longitude exchanged: exchange them there"


def _otherwise_near(
    ground: GroundTable, axes: GroundAxes, plane: TangentPlane, eo: ExteriorOrientation
) -> str:
    """Return how points of a CRS lie near the images when read otherwise; empty if in no way."""
    for reading, advice in _readings(axes):
        try:
            position = ground.position_m @ reading.T
            placed = replace(ground, position_m=position).in_plane(axes, plane)
        except InsgnssError:
            continue
        away = placed.position_m[:, :2] - np.median(eo.position_m[:, :2], axis=0)
        if (np.linalg.norm(away, axis=1) < FAR_GROUND_M).all():
            return f"they lie there {advice}"
    fits = _fitting(ground, plane, eo)
    return (
        f"{axes.crs} is not their CRS; {fits}"
        if fits
        else _subtraction_sentence(ground, axes, plane, eo)
    )


def _readings(axes: GroundAxes) -> tuple[tuple[Array, str], ...]:
    """Return what the coordinates of points may be multiplied by (3, 3), and what is then wrong."""
    exchanged = np.eye(3)[[1, 0, 2]]
    signs = tuple(
        (np.diag(sign), f"if their {name} have the other sign: correct it")
        for name, sign in zip(
            ("longitudes", "latitudes") if axes.projection is None else ("eastings", "northings"),
            ((-1.0, 1.0, 1.0), (1.0, -1.0, 1.0)),
            strict=True,
        )
    )
    if axes.projection is None:
        units = {"radians": np.degrees(1.0), "gon": 0.9}
        return (
            (exchanged, "with longitude and latitude exchanged: exchange the columns"),
            *(
                (np.diag([f, f, 1.0]), f"if their numbers are {unit}: write degrees")
                for unit, f in units.items()
            ),
            *signs,
        )
    foot = FOOT_M if (axes.unit_m == 1.0).all() else 1.0 / FOOT_M
    counted = "feet" if foot < 1.0 else "metres"
    return (
        (exchanged, "with easting and northing exchanged: exchange the columns"),
        (foot * np.eye(3), f"if their numbers are {counted}: name the CRS that counts in them"),
        (np.diag([1e3, 1e3, 1.0]), "if their numbers are kilometres: write metres"),
        (np.diag([1e-2, 1e-2, 1.0]), "if their numbers are centimetres: write metres"),
        (np.diag([1e-3, 1e-3, 1.0]), "if their numbers are millimetres: write metres"),
        *signs,
    )


def _subtraction_sentence(
    ground: GroundTable, axes: GroundAxes, plane: TangentPlane, eo: ExteriorOrientation
) -> str:
    """Say what was subtracted from points that lack a shift, or a false easting; else empty."""
    if axes.projection is None:
        return ""
    middle = np.median(eo.position_m, axis=0, keepdims=True)
    expected = axes.projection.forward(*plane.geodetic_from_position(middle))[0] / axes.unit_m
    lacking = (expected - np.median(ground.position_m, axis=0))[:2]
    shift = FALSE_ORIGIN * np.round(lacking / FALSE_ORIGIN)
    if float(np.abs(lacking - shift).max()) > NEAR_GROUND_M:
        if float(np.abs(ground.position_m[:, :2]).max()) > PLANE_M:
            return ""
        shift = KILOMETRE * np.round(lacking / KILOMETRE)
    e, n = (shift + 0.0).tolist()  # without a negative zero
    return f"they lie there if {e:.0f} {n:.0f} were subtracted from them: add these"


def _fitting(ground: GroundTable, plane: TangentPlane, eo: ExteriorOrientation) -> str:
    """Return in which CRSs the numbers of points lie near the images; empty if in none."""
    lat, lon, _ = plane.geodetic_from_position(np.median(eo.position_m, axis=0, keepdims=True))
    crs = fitting_crs(
        ground.position_m, float(lat[0]), float(lon[0]), NEAR_GROUND_M, eo.datum, eo.epoch
    )
    return f"their numbers fit {crs}" if crs else ""


def ground_of(path: Path, columns: Columns) -> tuple[GroundTable | None, str | None]:
    """Return ground points and their CRS from a table, or from a file of a program.

    Parameters
    ----------
    path : Path
        The file.
    columns : sequence or mapping, optional
        Columns of a table.

    Returns
    -------
    ground : GroundTable or None
        The points; None where the file has none.
    crs : str or None
        Their CRS, where the file says it.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    if path.is_dir() or recognise_format(path) not in ("image_points", "bingo"):
        source = read_measured_block(path)
        return source.ground, source.crs
    return read_ground_points(path, columns), stated_crs(path)


def _roles(file: BlockFile, ground: GroundTable) -> GroundTable:
    """Return the points without those that are left out, and with check points by name."""
    for key in ("check", "skip"):
        for name in getattr(file.ground, key):
            if name not in ground.points:
                raise InputError(
                    f"ground.{key}: {name!r} is no ground point; {near(name, ground.points[:200])}"
                )
    check = ground.check | np.array([name in file.ground.check for name in ground.points])
    keep = np.flatnonzero([name not in file.ground.skip for name in ground.points])
    names = tuple(ground.points[k] for k in keep)
    return replace(
        ground,
        points=names,
        position_m=ground.position_m[keep],
        cov=ground.cov[keep],
        check=check[keep],
    )


def _in_own_plane(
    ground: GroundTable, crs: str, geoid: Path | None, notes: list[str]
) -> GroundTable:
    """Return points of a CRS in a tangent plane at their middle, where nothing else gives one."""
    axes = GroundAxes(crs, geoid)
    notes += [axes.unit_note] if axes.unit_note else []
    lat, lon, h = axes.geodetic(ground.position_m.mean(axis=0, keepdims=True))
    plane = TangentPlane(float(lat[0]), float(lon[0]), float(h[0]))
    return ground.in_plane(axes, noted_plane(plane, "ground points", notes))
