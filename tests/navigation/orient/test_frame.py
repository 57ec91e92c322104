"""The orientation in other frames: against pyproj and against points seen from the camera."""

import numpy as np
import pytest

from insgnss.base.errors import UsageError
from insgnss.geodesy.crs import above_ellipsoid, source_crs
from insgnss.geodesy.datums import code_of, datum_words
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.projection import MapProjection
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.navigation.orient.frame import _Wgs84, in_frame
from insgnss.records import ExteriorOrientation

ORIGIN = np.array([np.radians(46.57), np.radians(6.54), 0.0])


def master(n: int = 4) -> ExteriorOrientation:
    """n images up to 2 km from the origin, with correlated errors."""
    rng = np.random.default_rng(5)
    L = rng.normal(size=(6 * n, 6 * n)) * np.tile([0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3], n)[:, None]
    P = (L @ L.T).reshape(n, 6, n, 6).swapaxes(1, 2)
    down = np.diag([1.0, -1.0, -1.0])
    return ExteriorOrientation(
        tuple(f"{8001 + k}.tif" for k in range(n)),
        1000.0 + 2.0 * np.arange(n),
        2008,
        ORIGIN,
        np.column_stack([rng.uniform(-2000, 2000, (n, 2)), rng.uniform(600, 700, n)]),
        rotation_from_vector(rng.normal(scale=[0.05, 0.05, 2.0], size=(n, 3))) @ down,
        P[np.arange(n), np.arange(n)],
        P[np.arange(n - 1), np.arange(1, n)],
        np.eye(3),
        np.diag([-1.0, -1.0, 1.0]),
    )


def ground_in_camera(eo: ExteriorOrientation) -> tuple[np.ndarray, np.ndarray]:
    """Points 50 m around each nadir point at the ground, in the tangent plane, and where the camera
    sees them.
    """
    X = eo.position_m + np.array([30.0, -40.0, -120.0])
    x = np.einsum("nji,nj->ni", eo.C_mc, X - eo.position_m)
    return X, x[:, :2] / x[:, 2:]


def geodetic(eo: ExteriorOrientation, X: np.ndarray) -> tuple[np.ndarray, ...]:
    return TangentPlane(*eo.origin).geodetic_from_position(X)


def test_geocentric() -> None:
    """Oracle: pyproj's geocentric coordinates of the ground points, which the camera must see where
    it does in the tangent plane.
    """
    from pyproj import Transformer

    eo = master()
    X, seen = ground_in_camera(eo)
    framed = in_frame(eo, "geocentric")
    lat, lon, h = geodetic(eo, X)
    ecef = np.column_stack(
        Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(
            np.degrees(lon), np.degrees(lat), h
        )
    )
    x = np.einsum("nji,nj->ni", framed.C_fc, ecef - framed.coordinates)
    assert np.abs(x[:, :2] / x[:, 2:] - seen).max() < 1e-10


@pytest.mark.parametrize(
    ("code", "limit"), [("EPSG:2056", 4e-3), ("EPSG:32632", 5e-4), ("EPSG:32631", 5e-4)]
)
def test_projected(code: str, limit: float) -> None:
    """Oracle: pyproj's grid coordinates of ground points 120 m below, whose rays must not be off by
    more than `limit` m there.

    Half a millimetre is what Earth curvature leaves (formats.md C3); the normals of LV95's
    ellipsoid and WGS84 are 5 seconds of arc apart.
    """
    from pyproj import CRS, Transformer

    eo = master()
    X, seen = ground_in_camera(eo)
    lat, lon, h = geodetic(eo, X)
    E, N, _ = Transformer.from_crs("EPSG:4979", CRS(code).to_3d(), always_xy=True).transform(
        np.degrees(lon), np.degrees(lat), h
    )
    framed = in_frame(eo, "projected", MapProjection(code))
    m = MapProjection(code).ground_scale(lat, lon, h)
    off = np.column_stack([E, N, h]) - framed.coordinates
    off[:, :2] /= m[:, None]
    x = np.einsum("nji,nj->ni", framed.C_fc, off)
    assert np.abs(x[:, :2] / x[:, 2:] - seen).max() * 120.0 < limit


def test_heights_scaled_from_the_ground() -> None:
    """Oracle: similar triangles; a camera whose height above ground is scaled like the plan sees
    the ground points where it did.
    """
    from pyproj import Transformer

    eo, code = master(), "EPSG:32631"
    X = eo.position_m + np.array([60.0, 45.0, -120.0])
    lat, lon, h = geodetic(eo, X)
    ground = 520.0
    X = TangentPlane(*eo.origin).position_from_geodetic(lat, lon, np.full(h.shape, ground))
    seen = np.einsum("nji,nj->ni", eo.C_mc, X - eo.position_m)
    E, N = Transformer.from_crs("EPSG:4326", code, always_xy=True).transform(
        np.degrees(lon), np.degrees(lat)
    )
    off = []
    for ground_m in (None, ground):
        framed = in_frame(eo, "projected", MapProjection(code), ground_m)
        x = np.einsum(
            "nji,nj->ni",
            framed.C_fc,
            np.column_stack([E, N, np.full(h.shape, ground)]) - framed.coordinates,
        )
        off.append(np.abs(x[:, :2] / x[:, 2:] - seen[:, :2] / seen[:, 2:]).max() * 120.0)
    assert off[1] < 2e-3 < 20e-3 < off[0]
    assert framed.frame.scaled_from_m == ground


def test_geographic_is_true_north_whatever_the_frame() -> None:
    """Oracle: the other frames, whose true-north attitudes must be the same."""
    eo = master()
    C_Ec = in_frame(eo, "geographic").C_fc
    for framed in (
        in_frame(eo, "tangent plane"),
        in_frame(eo, "geocentric"),
        in_frame(eo, "projected", MapProjection("EPSG:2056")),
    ):
        assert np.abs(framed.C_Ec - C_Ec).max() < 1e-12


@pytest.mark.parametrize("kind", ["geocentric", "geographic", "projected"])
def test_covariance_turns_with_the_axes(kind: str) -> None:
    """Oracle: errors drawn in the tangent plane, turned one by one; the moments of linear images
    are exact.
    """
    eo = master(2)
    framed = in_frame(eo, kind, MapProjection("EPSG:2056") if kind == "projected" else None)
    C_fm = framed.C_fc @ np.swapaxes(eo.C_mc, 1, 2)
    joint = np.block([[eo.cov[0], eo.cross[0]], [eo.cross[0].T, eo.cov[1]]])
    values, vectors = np.linalg.eigh(joint)
    errors = vectors * np.sqrt(
        np.maximum(values, 0.0)
    )  # columns whose outer products sum to the covariance
    turned = np.vstack(
        [C_fm[k] @ errors[6 * k + i : 6 * k + i + 3] for k in (0, 1) for i in (0, 3)]
    )
    P = turned @ turned.T
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    got = np.block([[framed.cov[0], framed.cross[0]], [framed.cross[0].T, framed.cov[1]]])
    assert (np.abs(got - P) / scale).max() < 1e-9


@pytest.mark.parametrize(
    ("kind", "code", "ground", "why"),
    [
        ("plane", None, None, "it is one of tangent plane"),
        ("projected", None, None, "a CRS belongs to a projected frame"),
        ("geographic", "EPSG:2056", None, "a CRS belongs to a projected frame"),
        ("geocentric", None, 500.0, "heights are scaled only in a projected CRS"),
    ],
)
def test_refusals(kind: str, code: str | None, ground: float | None, why: str) -> None:
    """Oracle: what the frames are."""
    with pytest.raises(UsageError, match=why):
        in_frame(master(), kind, MapProjection(code) if code else None, ground)


def test_names_of_wgs84_are_those_of_proj() -> None:
    """Oracle: pyproj; a frame without a stated datum is named without loading it."""
    proj, own = source_crs(None, None), _Wgs84()
    assert above_ellipsoid(own) == above_ellipsoid(proj)
    assert code_of(own) == code_of(proj)
    assert datum_words(own, None) == datum_words(proj, None)
