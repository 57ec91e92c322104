r"""The exterior orientation in the frame that its user works in: tangent plane, geocentric,
geographic or a projected CRS.

With m the tangent plane, n north-east-down at the projection centre (E its east-north-up, S between
them), G of `geodesy.projection`:

    tangent plane    coordinates E N U of m         axes of m
    geocentric       X Y Z of ECEF                  C_em
    geographic       longitude, latitude, height    east north up at the centre: C_Em = S C_mn^T
    projected        easting, northing, height      grid axes at the centre: G C_Em            (W.1)

The attitude is C_fm C_mc, and the 6x6 covariance moves with diag(C_fm, C_fm), the cross-covariance
of neighbours with that of each. What a projected frame does to lengths (100 ppm) and to the horizon
within an image is not in a covariance.

A projected frame is a Cartesian one for the programs that read it, of another scale horizontally, m
of (G.1), than vertically. Without control points, footprints come out 1/m too large. `ground_m`,
the height of the ground, moves the centres to where they do not: H_g + (H - H_g) m.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ...base.errors import UsageError
from ...geodesy.crs import above_ellipsoid, source_crs
from ...geodesy.datums import at_epoch, between_datums, code_of, datum_words, sibling_code
from ...geodesy.frames import TangentPlane
from ...geodesy.projection import MapProjection
from ...geodesy.rotation import NED_ENU
from ...records import Array, ExteriorOrientation, FramedOrientation, MapFrame
from ...records.cameras.rig import RigImages
from ...records.framed import FRAME_KINDS, GEOCENTRIC, GEOGRAPHIC, PROJECTED, TANGENT


def in_frame(
    eo: ExteriorOrientation,
    kind: str,
    projection: MapProjection | None = None,
    ground_m: float | None = None,
) -> FramedOrientation:
    """Move an exterior orientation into another frame (W.1).

    Parameters
    ----------
    eo : ExteriorOrientation
        The orientation in its tangent plane.
    kind : str
        One of `records.framed.KINDS`.
    projection : MapProjection, optional
        The projection of a projected frame, and of no other.
    ground_m : float, optional
        Height of the ground in that frame's heights, m, for centres that are to be scaled.

    Returns
    -------
    FramedOrientation
        Coordinates, attitudes and covariances in the axes of the frame.

    Raises
    ------
    UsageError
        For another kind, a projected frame without projection, and a ground in a frame that is not
        projected or not below the cameras.
    """
    if kind not in FRAME_KINDS:
        raise UsageError(f"frame {kind!r} is unknown; it is one of {', '.join(FRAME_KINDS)}")
    if (projection is not None) != (kind == PROJECTED):
        raise UsageError(f"frame {kind!r}: a CRS belongs to a projected frame, and to no other")
    if ground_m is not None and projection is None:
        raise UsageError(
            f"frame {kind!r}: heights are scaled only in a projected CRS; leave the height of the "
            "ground out"
        )
    if ground_m is not None and not np.isfinite(ground_m):
        raise UsageError(f"ground {ground_m:g} m is no height")
    plane = TangentPlane(*eo.origin)
    lat, lon, h = plane.geodetic_from_position(eo.position_m)
    unnamed = kind in (TANGENT, GEOGRAPHIC) and eo.datum is None and eo.epoch is None
    globe = _Wgs84() if unnamed else source_crs(eo.datum, eo.epoch)
    C_fm, x, frame = _axes(eo, plane, (lat, lon, h), kind, projection, globe)
    datum = "WGS84" if eo.datum is None else datum_words(globe, eo.epoch)
    frame = replace(frame, datum=code_of(globe), datum_name=datum)
    history = eo.history
    if projection is not None and ground_m is not None:
        if (x[:, 2] <= ground_m).any():
            raise UsageError(
                f"ground at {ground_m:g} m is not below the cameras, the lowest of which is at"
                f" {x[:, 2].min():.1f} m; give its height"
            )
        x[:, 2] = ground_m + (x[:, 2] - ground_m) * projection.ground_scale(
            lat, lon, np.full(h.shape, ground_m)
        )
        frame = replace(frame, scaled_from_m=ground_m)
        history = (
            *history,
            f"heights above the ground at {ground_m:.2f} m multiplied by the map scale factor",
        )
    J = np.zeros((len(eo.images), 6, 6))
    J[:, :3, :3] = J[:, 3:, 3:] = C_fm
    J_t = np.swapaxes(J, 1, 2)
    return FramedOrientation(
        images=eo.images,
        time=eo.time,
        gps_week=eo.gps_week,
        frame=frame,
        coordinates=x,
        C_fc=C_fm @ eo.C_mc,
        cov=J @ eo.cov @ J_t,
        cross=(
            J[:-1] @ eo.cross @ J_t[1:] if eo.cross is not None and len(eo.images) > 1 else eo.cross
        ),
        geodetic=np.column_stack([lat, lon, h]),
        C_fE=C_fm @ plane.C_mn(lat, lon) @ NED_ENU,
        boresight=eo.boresight,
        camera_from_body=eo.camera_from_body,
        history=history,
        rig=_rig(eo, J),
    )


def in_datum(eo: ExteriorOrientation, datum: str) -> ExteriorOrientation:
    """Move an exterior orientation into another datum.

    Parameters
    ----------
    eo : ExteriorOrientation
        The orientation.
    datum : str
        Geographic CRS; where it moves, positions stay of their epoch.

    Returns
    -------
    ExteriorOrientation
        Positions about an origin that moved along. Attitudes and covariances stay: datums of
        today's ellipsoids are turned by less than 1e-5 deg against each other.

    Raises
    ------
    UsageError, InputError
        As `between_datums`.
    """
    new = at_epoch(datum, eo.epoch)
    plane = TangentPlane(*eo.origin)
    places = np.vstack([np.zeros(3), eo.position_m])
    lat, lon, h = between_datums(*plane.geodetic_from_position(places), (eo.datum, eo.epoch), new)
    origin = np.array([lat[0], lon[0], h[0]])
    position = TangentPlane(*origin).position_from_geodetic(lat[1:], lon[1:], h[1:])
    return replace(eo, origin=origin, position_m=position, datum=new[0], epoch=new[1])


class _Wgs84:
    """What names WGS 84 needs of its CRS, without PROJ, which takes 60 ms and 20 MB to load."""

    name = "WGS 84"

    def to_authority(self) -> tuple[str, str]:
        """Return authority and number."""
        return "EPSG", "4979"


def _rig(eo: ExteriorOrientation, J: Array) -> RigImages | None:
    """The cameras, with what neighbours of one share in the axes of the frame."""
    if eo.rig is None or eo.rig.cross is None:
        return eo.rig
    after = eo.rig.next_of_camera
    return replace(eo.rig, cross=J @ eo.rig.cross @ np.swapaxes(J[after], 1, 2))


def _axes(
    eo: ExteriorOrientation,
    plane: TangentPlane,
    geodetic: tuple[Array, Array, Array],
    kind: str,
    projection: MapProjection | None,
    globe: Any,
) -> tuple[Array, Array, MapFrame]:
    """C_fm (n, 3, 3), coordinates (n, 3) and the frame (W.1)."""
    lat, lon, h = geodetic
    n = len(eo.images)
    datum, code = datum_words(globe, eo.epoch), code_of(globe)
    if kind == TANGENT:
        lat_d, lon_d = np.degrees(eo.origin[:2])
        axis_names = (
            f"tangent plane of {'WGS84' if eo.datum is None else datum} at latitude"
            f" {lat_d:.10f} deg, longitude {lon_d:.10f} deg, {plane.height:.4f} m"
        )
        frame = MapFrame(
            kind,
            axis_names,
            "along the vertical of the origin",
            origin=tuple(eo.origin.tolist()),
        )
        return np.broadcast_to(np.eye(3), (n, 3, 3)), eo.position_m.copy(), frame
    if kind == GEOCENTRIC:
        C_em = plane.C_em
        x = plane.origin_ecef + eo.position_m @ C_em.T
        geocentric = sibling_code(globe, "GEOCENTRIC_CRS")
        name = f"{geocentric} {datum} (geocentric)".strip()
        return np.broadcast_to(C_em, (n, 3, 3)), x, MapFrame(kind, name, "", geocentric)
    C_Em = NED_ENU @ np.swapaxes(plane.C_mn(lat, lon), 1, 2)
    if projection is None:
        frame = MapFrame(
            kind,
            f"{code} {datum}".strip(),
            above_ellipsoid(globe),
            crs=code,
            wkt="" if code else globe.to_wkt(),
            northing_first=True,
        )
        return C_Em, np.column_stack([lon, lat, h]), frame
    x = projection.forward(lat, lon, h)
    wkt, name = projection.crs.to_wkt(), projection.name
    frame = MapFrame(
        kind,
        name,
        projection.heights,
        crs=projection.code,
        wkt=wkt,
        northing_first=projection.northing_first,
        units=projection.units,
    )
    return projection.axes(lat, lon, h) @ C_Em, x, frame
