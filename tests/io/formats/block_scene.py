"""The four images of the proof scene through a camera with distortion, and the scene as programs
write it.

Nothing here shares code with the readers: projection and distortion are written in OpenCV's terms,
files by text, zipfile and struct.
"""

import io
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation

from insgnss.flight.proof.scene import HEIGHT_PX, WIDTH_PX, make_scene

SCENE = make_scene()
UTM = "EPSG:32632"
FX, FY, CX, CY = 1402.3, 1400.0, 652.75, 471.5  # pixels, from the outer corner of the first one
K1, K2, K3 = -0.08, 0.05, -0.02
P1, P2 = 9e-4, -6e-4  # OpenCV's: P2 belongs to r^2 + 2 x^2
SKEW = 0.7  # Metashape's b2
TO_ECEF = SCENE.plane.C_em
POINTS_ECEF = SCENE.plane.origin_ecef + SCENE.points @ TO_ECEF.T


def distorted_pixels(fx=FX, fy=FY, k3=K3, p=(P1, P2), skew=0.0, radial=(K1, K2)):
    """Pixels (n, m, 2) of the scene's points, OpenCV's formula."""
    eo = SCENE.eo
    q = np.einsum("nji,nmj->nmi", eo.C_mc, SCENE.points[None] - eo.position_m[:, None])
    x, y = q[..., 0] / q[..., 2], q[..., 1] / q[..., 2]
    r2 = x**2 + y**2
    d = 1 + radial[0] * r2 + radial[1] * r2**2 + k3 * r2**3
    xd = x * d + 2 * p[0] * x * y + p[1] * (r2 + 2 * x**2)
    yd = y * d + p[0] * (r2 + 2 * y**2) + 2 * p[1] * x * y
    return np.stack([fx * xd + skew * yd + CX, fy * yd + CY], axis=-1)


def observed(pixels):
    """(image, point, u, v) of what lies in the images."""
    inside = np.all((pixels > 0) & (pixels < (WIDTH_PX, HEIGHT_PX)), axis=2)
    return [(i, p, *pixels[i, p].tolist()) for i, p in np.argwhere(inside).tolist()]


def utm_points():
    """Easting, northing, height of the points by pyproj."""
    lat, lon, h = SCENE.geodetic.T
    E, N = Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(
        np.degrees(lon), np.degrees(lat)
    )
    return np.column_stack([E, N, h])


def numbers(values):
    return " ".join(repr(float(v)) for v in np.ravel(values))


@dataclass
class Metashape:
    """A chunk as XML, with a similarity to ECEF, two sensors, a disabled image, a marker that
    nobody placed, and tie points: points P6 to P9.
    """

    calibration: str = (
        f"<f>{FY!r}</f><cx>{CX - WIDTH_PX / 2!r}</cx><cy>{CY - HEIGHT_PX / 2!r}</cy>"
        f"<b1>{FX - FY!r}</b1><b2>{SKEW!r}</b2>"
        f"<k1>{K1!r}</k1><k2>{K2!r}</k2><k3>{K3!r}</k3><p1>{P2!r}</p1><p2>{P1!r}</p2>"
    )
    markers: int = 5

    def __post_init__(self):
        self.seen = observed(distorted_pixels(skew=SKEW))
        self.R = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
        self.scale, self.t = 23.5, SCENE.plane.origin_ecef + [4000.0, -2500.0, 900.0]

    def sensors(self):
        return "".join(
            f'<sensor id="{k}" label="{name}" type="frame"><resolution width="{WIDTH_PX}"'
            f' height="{HEIGHT_PX}"/>'
            '<calibration type="frame" class="initial"><f>1</f></calibration>'
            f'<calibration type="frame" class="adjusted"><resolution width="{WIDTH_PX}"'
            f' height="{HEIGHT_PX}"/>{self.calibration}</calibration></sensor>'
            for k, name in enumerate(("first", "second"))
        )

    def cameras(self):
        eo, rows = SCENE.eo, []
        for k, name in enumerate(eo.images):
            T = np.eye(4)
            T[:3, :3] = self.R.T @ TO_ECEF @ eo.C_mc[k]
            centre = SCENE.plane.origin_ecef + TO_ECEF @ eo.position_m[k]
            T[:3, 3] = self.R.T @ (centre - self.t) / self.scale
            rows.append(
                f'<camera id="{k + 10}" sensor_id="{k // 2}" component_id="0" label="{name}">'
                f"<transform>{numbers(T)}</transform></camera>"
            )
        rows.append('<camera id="90" sensor_id="0" label="off.tif" enabled="false"/>')
        return f"<group>{rows[0]}</group>{''.join(rows[1:])}"

    def ground(self):
        rows = []
        for k, place in enumerate(utm_points()[: self.markers].tolist()):
            e, n, h = (repr(x) for x in place)
            rows.append(
                f'<marker id="{k}" label="{SCENE.names[k]}"><reference x="{e}" y="{n}" z="{h}"'
                f' sxy="0.02" sz="0.05" enabled="{str(k != 1).lower()}"/></marker>'
            )
        return "".join(rows)

    def chunk(self, frame):
        """The inside of <chunk>."""
        return (
            f"<sensors>{self.sensors()}</sensors>"
            '<components active_id="0"><component id="0"><transform>'
            f"<rotation>{numbers(self.R)}</rotation><translation>{numbers(self.t)}</translation>"
            f"<scale>{self.scale}</scale></transform></component></components>"
            f"<cameras>{self.cameras()}</cameras><markers>{self.ground()}</markers>"
            f"<reference>{CRS(UTM).to_wkt('WKT1_GDAL').replace('&', '&amp;')}</reference>"
            '<settings><property name="accuracy_tiepoints" value="0.8"/>'
            '<property name="accuracy_projections" value="0.3"/></settings>'
            f"<frames>{frame}</frames>"
        )

    def projections(self):
        rows = []
        for p in range(self.markers):
            places = "".join(
                f'<location camera_id="{i + 10}" pinned="true" x="{u!r}" y="{v!r}"/>'
                for i, q, u, v in self.seen
                if p == q
            )
            extra = '<location camera_id="90" pinned="true" x="1" y="1"/>' if p == 0 else ""
            rows.append(f'<marker marker_id="{p}">{places}{extra}</marker>')
        loose = '<location camera_id="10" pinned="false" x="5" y="6"/>'
        rows[-1] = rows[-1].replace("</marker>", f"{loose}</marker>")
        return f"<markers>{''.join(rows)}</markers>"

    def tables(self):
        """PLY tables of tie points: points that have coordinates, and of every image."""
        tied = [p for p in range(len(SCENE.names)) if p >= self.markers]
        files = {"points0.ply": ply([("uint", "id")], [(p,) for p in tied])}
        columns = [("float", "x"), ("float", "y"), ("float", "size"), ("int", "id")]
        for i in range(4):
            rows = [(u, v, 2.0, p) for j, p, u, v in self.seen if i == j and p in tied]
            files[f"p{i}.ply"] = ply(columns, [*rows, (3.0, 4.0, 1.0, 999)])
        return files

    def cloud(self, prefix=""):
        projections = "".join(
            f'<projections camera_id="{i + 10}" path="{prefix}p{i}.ply" count="9"/>'
            for i in range(4)
        )
        return f'<tracks path="t.ply"/><points path="{prefix}points0.ply"/>{projections}'

    def write_xml(self, path: Path) -> Path:
        frame = f'<frame id="0">{self.projections()}</frame>'
        path.write_text(
            '<?xml version="1.0" encoding="UTF-8"?>\n<document version="1.5.0">\n'
            f'<chunk label="Chunk 1" enabled="true">{self.chunk(frame)}</chunk>\n</document>\n'
        )
        return path

    def write_psz(self, path: Path) -> Path:
        frame = (
            f'<frame id="0">{self.projections()}<point_cloud>{self.cloud()}</point_cloud></frame>'
        )
        chunk = f'<chunks><chunk id="0" label="Chunk 1">{self.chunk(frame)}</chunk></chunks>'
        document = f'<document version="1.4.0">{chunk}</document>'
        path.write_bytes(zipped({"doc.xml": document.encode(), **self.tables()}))
        return path

    def write_psx(self, path: Path) -> Path:
        files = path.with_suffix(".files")
        (files / "0" / "0" / "point_cloud").mkdir(parents=True)
        path.write_text('<document version="1.2.0" path="{projectname}.files/project.zip"/>')
        place = '<chunks active_id="0"><chunk id="0" path="0/chunk.zip"/></chunks>'
        documents = {
            "project.zip": f'<document version="1.2.0">{place}</document>',
            "0/chunk.zip": '<chunk version="1.2.0" label="Chunk 1">'
            + self.chunk('<frame id="0" path="0/frame.zip"/>')
            + "</chunk>",
            "0/0/frame.zip": f'<frame version="1.2.0">{self.projections()}'
            '<point_cloud path="point_cloud/point_cloud.zip"/></frame>',
        }
        for name, text in documents.items():
            (files / name).write_bytes(zipped({"doc.xml": text.encode()}))
        cloud = f'<point_cloud version="1.2.0">{self.cloud()}</point_cloud>'
        (files / "0/0/point_cloud/point_cloud.zip").write_bytes(
            zipped({"doc.xml": cloud.encode(), **self.tables()})
        )
        return path


def ply(columns, rows):
    """Binary PLY of rows."""
    head = "".join(f"property {kind} {name}\n" for kind, name in columns)
    kinds = {"float": "<f4", "int": "<i4", "uint": "<u4"}
    table = np.array(rows, dtype=[(name, kinds[kind]) for kind, name in columns])
    return (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{head}end_header\n"
    ).encode() + table.tobytes()


def zipped(files):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def write_opensfm(directory: Path, camera, seen, reference=True, more=()) -> Path:
    """reconstruction.json and tracks.csv, version 2."""
    eo, size = SCENE.eo, max(WIDTH_PX, HEIGHT_PX)
    C = eo.C_mc.transpose(0, 2, 1)
    shots = {
        name: {
            "rotation": Rotation.from_matrix(C[k]).as_rotvec().tolist(),
            "translation": (-C[k] @ eo.position_m[k]).tolist(),
            "camera": "v2 cam",
        }
        for k, name in enumerate(eo.images)
    }
    points = {str(100 + p): {"coordinates": x} for p, x in enumerate(SCENE.points.tolist())}
    part = {"cameras": {"v2 cam": camera}, "shots": shots, "points": points}
    lat, lon, height = eo.origin.tolist()
    if reference:
        part["reference_lla"] = {
            "latitude": np.degrees(lat),
            "longitude": np.degrees(lon),
            "altitude": height,
        }
    (directory / "reconstruction.json").write_text(json.dumps([part, *more]))
    rows = [
        f"{eo.images[i]}\t{100 + p}\t7\t{(u - WIDTH_PX / 2) / size!r}"
        f"\t{(v - HEIGHT_PX / 2) / size!r}\t{0.002 * (1 + p)!r}\t1\t2\t3\t-1\t-1\n"
        for i, p, u, v in seen
    ]
    rows.append(f"{eo.images[0]}\t777\t7\t0.1\t0.1\t0.1\t1\t2\t3\t-1\t-1\n")  # not reconstructed
    (directory / "tracks.csv").write_text("OPENSFM_TRACKS_VERSION_v2\n" + "".join(rows))
    return directory
