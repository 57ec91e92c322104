"""A base whose true position is known later: what was solved from it moves with it.

With the position r0 of the base that a solution was made with, the one r1 that it should have had,
and b the distance from the base, positions and their covariances are, in ECEF,

    x' = x + d,    d = r1 - r0                                                            (MB.1)
    P' = P + P_d + (|d| b / R)^2 I                                                        (MB.2)

P_d is the covariance of r1. The directions to the satellites, R away, were those at the wrong
position, off by up to |d| / R, which turns and scales the baseline by as much. Both terms of (MB.2)
are common to all positions, so that they are in the covariances between images as well. Fixes move
by (MB.1) alone: a filter would average what they all share.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import InputError
from ...geodesy.frames import (
    TangentPlane,
    ecef_to_geodetic,
    geodetic_to_ecef,
    rotation_em,
    rotation_en,
)
from ...records import Array, ExteriorOrientation, GnssFixes
from ...records.cameras.camera_positions import CameraPositions

Position = tuple[float, float, float]
SATELLITES_M = 2.0e7  # R of (MB.2): least distance of a satellite of GPS, m
# of a position from its base (m): PPK reaches 100 km, exchanged angles go beyond
FARTHEST_BASE_M = 3e5
SAME_M = 1.0  # between r0 and the base that a file of fixes states (m): its header has centimetres


@dataclass(frozen=True)
class MovedBase:
    """The move of a base.

    Parameters
    ----------
    old, new : tuple of float
        (3,) latitude, longitude, deg, ellipsoidal height, m.
    sigma_m : tuple of float
        (3,) standard deviations of the new position, north, east, down, m.
    """

    old: Position
    new: Position
    sigma_m: Position = (0.0, 0.0, 0.0)

    @property
    def shift(self) -> Array:
        """The shift d (3,), ECEF, m."""
        return _ecef(self.new) - _ecef(self.old)

    @property
    def sentence(self) -> str:
        """What was done, for histories and notes."""
        lat, lon = np.radians(self.new[:2])
        e, n, u = np.round(rotation_em(lat, lon).T @ self.shift, 4) + 0.0
        return (
            f"positions were moved with their base by {e:.4f} m east, {n:.4f} m north and"
            f" {u:.4f} m up"
        )

    def fixes(self, fixes: GnssFixes) -> GnssFixes:
        """Return fixes moved by (MB.1).

        Raises
        ------
        InputError
            Where they name another base, or lie too far from this one.
        """
        if fixes.base_ecef is not None:
            distance = float(np.linalg.norm(_ecef(self.old) - fixes.base_ecef))
            if distance > SAME_M:
                phi, lam, h = map(float, ecef_to_geodetic(fixes.base_ecef))
                stated = f"{np.degrees(phi):.9f},{np.degrees(lam):.9f},{h:.3f}"
                raise InputError.in_file(
                    fixes.source or "fixes",
                    f"was solved with the base at {stated}, {distance:.1f} m from the old position"
                    f" of gnss.moved_base (limit {SAME_M:g} m); give that as the old one",
                )
        ecef = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
        lat, lon, height = self._moved(ecef)
        base = None if fixes.base_ecef is None else _ecef(self.new)
        return replace(fixes, lat=lat, lon=lon, height=height, base_ecef=base)

    def positions(self, positions: CameraPositions) -> CameraPositions:
        """Return camera positions moved by (MB.1), with covariances by (MB.2)."""
        ecef = geodetic_to_ecef(positions.lat, positions.lon, positions.height)
        lat, lon, height = self._moved(ecef)
        C_en = rotation_en(lat, lon)
        cov = positions.cov_ned + C_en.swapaxes(1, 2) @ self._covariance(ecef) @ C_en
        return replace(positions, lat=lat, lon=lon, height=height, cov_ned=cov)

    def orientation(self, eo: ExteriorOrientation) -> ExteriorOrientation:
        """Return orientations moved by (MB.1), with covariances by (MB.2)."""
        plane = TangentPlane(*eo.origin)
        lat, lon, height = plane.geodetic_from_position(eo.position_m)
        added = np.zeros((6, 6))
        ecef = geodetic_to_ecef(lat, lon, height)
        added[:3, :3] = plane.C_em.T @ self._covariance(ecef) @ plane.C_em
        rig = eo.rig
        if rig is not None and rig.cross is not None:
            rig = replace(rig, cross=rig.cross + added)
        return replace(
            eo,
            position_m=eo.position_m + plane.C_em.T @ self.shift,
            cov=eo.cov + added,
            cross=None if eo.cross is None else eo.cross + added,
            rig=rig,
            history=(*eo.history, self.sentence),
        )

    def _moved(self, ecef: Array) -> tuple[Array, Array, Array]:
        """Latitude, longitude, height (n,) of places (n, 3), ECEF, m, moved by (MB.1)."""
        self._farthest(ecef)
        lat, lon, height = ecef_to_geodetic(ecef + self.shift)
        return lat, lon, height

    def _covariance(self, ecef: Array) -> Array:
        """What (MB.2) adds (3, 3), ECEF, m^2, for the farthest of places."""
        lat, lon = np.radians(self.new[:2])
        C_en = rotation_en(lat, lon)
        scaled = float(np.linalg.norm(self.shift)) * self._farthest(ecef) / SATELLITES_M
        return np.asarray(C_en @ np.diag(np.square(self.sigma_m)) @ C_en.T + scaled**2 * np.eye(3))

    def _farthest(self, ecef: Array) -> float:
        """The largest distance of places from the base, m.

        Raises
        ------
        InputError
            One that no base reaches.
        """
        farthest = float(np.linalg.norm(ecef - _ecef(self.old), axis=1).max(initial=0.0))
        if farthest > FARTHEST_BASE_M:
            raise InputError(
                f"moved base: positions lie up to {1e-3 * farthest:.0f} km from it (limit"
                f" {1e-3 * FARTHEST_BASE_M:.0f} km); check latitude and longitude of the base"
            )
        return farthest


def _ecef(position: Position) -> Array:
    """A latitude, longitude, deg, and height, m, in ECEF (3,)."""
    lat, lon = np.radians(position[:2])
    return geodetic_to_ecef(lat, lon, position[2])
