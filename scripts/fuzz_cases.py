"""Cases of `fuzz_readers.py` beside recordings: RINEX, blocks, orientations, settings, images.

Where a page of data_specs has a true example, that is the file.
"""

import bz2
import contextlib
import gzip
import importlib.util
import io
import json
import re
import sqlite3
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from insgnss.base.files import lines_of
from insgnss.batch.season.tables import read_season
from insgnss.flight.config.block_file import load_block
from insgnss.flight.config.load import load_flight, read_covariance
from insgnss.flight.exporting.rename import read_names
from insgnss.flight.inspection.discovery import discover
from insgnss.gnss.rinex.navigation_message import read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.formats import read_barometer, read_events
from insgnss.io.formats.blocks.bingo import read_bingo
from insgnss.io.formats.blocks.camera_toml import read_camera_toml
from insgnss.io.formats.blocks.colmap_model import read_colmap_model
from insgnss.io.formats.blocks.dbat import read_dbat
from insgnss.io.formats.blocks.gcp_list import read_gcp_list
from insgnss.io.formats.blocks.ground_points import read_ground_points
from insgnss.io.formats.blocks.image_points import read_image_points
from insgnss.io.formats.blocks.metashape_block import read_metashape_block
from insgnss.io.formats.blocks.opensfm_model import read_opensfm_model
from insgnss.io.formats.blocks.pose_table import read_pose_table
from insgnss.io.formats.bundle.colmap_database import read_colmap_database
from insgnss.io.formats.images.exif import camera_tags, time_taken
from insgnss.io.formats.imu.variances import read_variances
from insgnss.io.formats.orientation.eo_covariance import read_eo_covariance, write_eo_covariance
from insgnss.io.formats.orientation.eo_json import read_eo_json, write_eo_json
from insgnss.io.formats.orientation.eo_local_plane import read_eo_local_plane
from insgnss.io.formats.orientation.generic_ascii import read_generic_ascii
from insgnss.io.formats.orientation.mounting_file import read_mounting_file
from insgnss.io.formats.orientation.pose_covariance import (
    read_pose_covariance,
    write_pose_covariance,
)
from insgnss.io.formats.orientation.relative_csv import read_relative_csv
from insgnss.io.formats.positions.camera_positions import read_camera_positions
from insgnss.io.formats.returned.reading import read_returned_poses
from insgnss.io.formats.returned.tables import read_metashape_reference
from insgnss.io.formats.trajectory.trajectory_csv import read_trajectory_csv
from insgnss.io.formats.vehicle.target_positions import read_target_positions
from insgnss.io.formats.vehicle.target_sizes import read_target_sizes
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.prepare.calibration import load_calibration
from insgnss.photogrammetry.comparison.reading import read_poses
from insgnss.records import ExteriorOrientation
from insgnss.records.strips import StripCovariance

SPECS = Path(__file__).parents[1] / "data_specs"
Read = Callable[[Path], object]


@dataclass(frozen=True)
class Case:
    """A reader and a file that it reads.

    Name of the file, its bytes, the places where a cut leaves whole rows, files beside it.
    """

    name: str
    file: str
    data: bytes
    read: Read
    text: bool = True
    borders: frozenset[int] = frozenset()
    beside: dict[str, bytes] = field(default_factory=dict)
    cuts: bool = True
    """Whether a reader has to notice that a file is cut within a row."""

    def looks_whole(self, size: int) -> bool:
        """Whether the first `size` bytes end where a row ends."""
        if not self.cuts:
            return True
        if not self.text:
            return size in self.borders
        return (
            size >= len(self.data)
            or self.data[size - 1 : size] == b"\n"
            or self.data[size : size + 1] in b"\r\n"
        )


def on_page(name: str, kind: str = "true") -> bytes:
    """The example of a page of data_specs."""
    text = (SPECS / f"{name}.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{kind}\b[^\n]*\n(.*?)```", text, re.DOTALL | re.MULTILINE)[0].encode()


PAGES: dict[str, tuple[str, Read]] = {
    "barometer": ("x.txt", read_barometer),
    "event_dates": ("images.csv", read_events),
    "events_pos": ("x_events.pos", read_events),
    "camera_positions": ("camera_positions.csv", read_camera_positions),
    "eo_local_plane": ("EO_local-plane.txt", read_eo_local_plane),
    "metashape": ("metashape.csv", read_metashape_reference),
    "trajectory_csv": ("trajectory.csv", read_trajectory_csv),
    "variances": ("x.txt", read_variances),
    "relative_csv": ("relative.csv", read_relative_csv),
    "rinex": ("x.18o", read_observations),
    "image_points": ("x.csv", read_image_points),
    "ground_points": ("x.csv", read_ground_points),
    "target_positions": ("x.csv", read_target_positions),
    "target_sizes": ("x.csv", read_target_sizes),
    "gcp_list": ("x.txt", read_gcp_list),
    "pose_table": ("x.csv", read_pose_table),
    "generic_ascii": ("x.txt", read_generic_ascii),
    "bingo": ("x.dat", lambda path: read_bingo(path, pixel_um=1.55, width=5456, height=3632)),
}
SETTINGS: dict[str, tuple[str, Read]] = {
    "camera_toml": ("camera.toml", read_camera_toml),
    "noise_model": ("noise.toml", load_noise_model),
    "imu_calibration": ("imu.toml", load_calibration),
    "mounting_file": ("mounting.toml", lambda path: read_mounting_file(path, np.eye(3))),
}
NAVIGATION = """\
     3.04           N: GNSS NAV DATA    M: MIXED            RINEX VERSION / TYPE
                                                            END OF HEADER
G05 2018 10 04 14 00 00-1.000000000000D-04 1.000000000000D-12 0.000000000000D+00
     6.000000000000D+01 2.000000000000D+01 4.500000000000D-09 1.000000000000D+00
     1.000000000000D-06 5.000000000000D-03 8.000000000000D-06 5.153700000000D+03
     3.924000000000D+05 1.000000000000D-07-1.500000000000D+00-5.000000000000D-08
     9.600000000000D-01 2.000000000000D+02 5.000000000000D-01-8.000000000000D-09
     3.000000000000D-10 1.000000000000D+00 2.021000000000D+03 0.000000000000D+00
     2.000000000000D+00 0.000000000000D+00-1.000000000000D-08 6.000000000000D+01
     3.918000000000D+05 4.000000000000D+00
E05 2018 10 04 14 00 00-1.000000000000D-04 1.000000000000D-12 0.000000000000D+00
     6.000000000000D+01 2.000000000000D+01 4.500000000000D-09 1.000000000000D+00
     1.000000000000D-06 5.000000000000D-03 8.000000000000D-06 5.440600000000D+03
     3.924000000000D+05 1.000000000000D-07-1.500000000000D+00-5.000000000000D-08
     9.600000000000D-01 2.000000000000D+02 5.000000000000D-01-8.000000000000D-09
     3.000000000000D-10 5.170000000000D+02 2.021000000000D+03 0.000000000000D+00
     3.000000000000D+00 0.000000000000D+00-1.000000000000D-08 0.000000000000D+00
     3.918000000000D+05
R05 2018 10 04 13 45 00 1.000000000000D-04 0.000000000000D+00 4.000000000000D+05
     2.550000000000D+04 0.000000000000D+00 0.000000000000D+00 0.000000000000D+00
     0.000000000000D+00 0.000000000000D+00 0.000000000000D+00-4.000000000000D+00
     0.000000000000D+00 3.000000000000D+00 0.000000000000D+00 0.000000000000D+00
"""
PLANES = 'name = "f"\ngps_week = 2008\n[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
FLIGHT = f"""{PLANES}sigma_m = [0.02, 0.02, 0.03]
[camera]
events = "gnss.txt"
[mounting]
antenna_m = [0.462, -0.001, -0.065]
camera_from_body = [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]
[tangent_plane]
origin = [46.57, 6.54, 0.0]
[output]
formats = ["eo_local_plane", "metashape"]
trajectory_hz = 10
"""
SHOT = {"rotation": [3.0, 0.1, 0.0], "translation": [1.0, 2.0, 90.0], "camera": "c"}
MODEL = [
    {
        "cameras": {
            "c": {
                "projection_type": "brown",
                "width": 4000,
                "height": 3000,
                **dict.fromkeys(("focal_x", "focal_y"), 0.9),
                **dict.fromkeys(("c_x", "c_y", "k1", "k2", "p1", "p2", "k3"), 0.001),
            }
        },
        "shots": {"8001.tif": SHOT, "8002.tif": SHOT},
        "points": {"17": {"coordinates": [0, 0, 0]}},
        "reference_lla": {"latitude": 46.57, "longitude": 6.54, "altitude": 400.0},
    }
]
TRACKS = (
    "OPENSFM_TRACKS_VERSION_v2\n8001.tif\t17\t411\t-0.125\t0.0625\t0.002\t90\t91\t88\t-1\t-1\n"
    "8002.tif\t17\t412\t-0.025\t0.0625\t0.002\t90\t91\t88\t-1\t-1\n"
)


def further_cases() -> list[Case]:
    """One case a reader, as far as its library is there."""
    cases = [
        Case(name, file, on_page(name), read, cuts=False) for name, (file, read) in PAGES.items()
    ]
    cases += [
        Case(name, file, on_page(name), read, cuts=False) for name, (file, read) in SETTINGS.items()
    ]
    return [*cases, *_rinex(), *_blocks(), *_of_toml(), *_orientations(), *_images(), *_returned()]


def _zip(content: bytes, name: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return stream.getvalue()


def _rinex() -> list[Case]:
    packers: dict[str, Callable[[bytes], bytes]] = {
        "gzip": gzip.compress,
        "bzip2": bz2.compress,
        "zip": lambda data: _zip(data, "x"),
    }
    text = NAVIGATION.encode()
    cases = [Case("navigation", "x.nav", text, read_navigation, cuts=False)]
    cases += [
        Case(f"navigation {name}", f"x.nav.{name}", pack(text), read_navigation, False, cuts=False)
        for name, pack in packers.items()
    ]
    if importlib.util.find_spec("hatanaka"):
        import hatanaka
        import ncompress

        lines = lines_of(on_page("rinex").decode())  # compact RINEX has no events
        plain = "\n".join([*lines[:10], lines[13]] + lines[14:]) + "\n"
        packed = ncompress.compress(plain.encode())
        cases.append(
            Case("observations Z", "x.18o.Z", packed, read_observations, False, cuts=False)
        )
        compact = hatanaka.rnx2crx(plain.encode())
        cases.append(Case("compact RINEX", "x.18d", compact, read_observations, cuts=False))
    return cases


def _beside(name: str, read: Read) -> Read:
    """Read the file of that name beside the one that is changed, or their directory."""
    return lambda path: read(path.parent / name)


def _blocks() -> list[Case]:
    model = json.dumps(MODEL, indent=1).encode()
    xml = on_page("metashape_block")
    script = on_page("dbat", "script").replace(b"$HERE", b".")
    beside = {"images.txt": on_page("dbat", "images"), "eo.txt": on_page("dbat", "eo")}
    dbat = beside | {"points.txt": on_page("dbat"), "dbat.xml": script}
    colmap = {"cameras.txt": on_page("colmap_model"), "images.txt": b"", "points3D.txt": b""}
    colmap["images.txt"] = (
        b"1 0.5 0.5 -0.5 0.5 1.5 -2.25 90.5 1 8001.tif\n10.5 20.25 17 30.5 40.5 -1\n"
        b"2 0.5 0.5 -0.5 0.5 2.5 -2.25 90.5 1 8002.tif\n11.5 21.25 17 31.5 41.5 18\n"
    )
    colmap["points3D.txt"] = b"17 1.5 2.5 3.5 9 9 9 0.5 1 0 2 0\n18 1.5 2.5 3.5 9 9 9 0.5 2 1\n"
    return [
        *(
            Case(
                f"dbat {name}",
                name,
                dbat[name],
                _beside("dbat.xml", read_dbat),
                True,
                frozenset(),
                {key: data for key, data in dbat.items() if key != name},
                False,
            )
            for name in (*beside, "points.txt")
        ),
        *(
            Case(
                f"colmap {name}",
                name,
                colmap[name],
                _beside("", read_colmap_model),
                True,
                frozenset(),
                {key: data for key, data in colmap.items() if key != name},
                False,
            )
            for name in colmap
        ),
        Case(
            "opensfm tracks",
            "tracks.csv",
            TRACKS.encode(),
            _beside("reconstruction.json", read_opensfm_model),
            beside={"reconstruction.json": model},
            cuts=False,
        ),
        Case(
            "opensfm model",
            "reconstruction.json",
            model,
            read_opensfm_model,
            beside={"tracks.csv": TRACKS.encode()},
            cuts=False,
        ),
        Case("metashape xml", "x.xml", xml, read_metashape_block, cuts=False),
        Case(
            "metashape psz", "x.psz", _zip(xml, "doc.xml"), read_metashape_block, False, cuts=False
        ),
        Case(
            "dbat",
            "dbat.xml",
            script,
            read_dbat,
            beside=beside | {"points.txt": on_page("dbat")},
            cuts=False,
        ),
    ]


def _database() -> Case:
    """A database of COLMAP with one camera and two images."""
    with contextlib.closing(sqlite3.connect(":memory:")) as db:
        db.execute("CREATE TABLE images (image_id, name, camera_id)")
        db.execute("CREATE TABLE cameras (camera_id, model, width, height, params)")
        db.executemany("INSERT INTO images VALUES (?, ?, 1)", [(1, "8001.tif"), (2, "8002.tif")])
        parameters = np.array([900.0, 500.0, 400.0]).tobytes()
        db.execute("INSERT INTO cameras VALUES (1, 0, 1000, 800, ?)", (parameters,))
        db.commit()
        data = db.serialize()
    names = ("8001.tif", "8002.tif")
    return Case(
        "colmap database", "x.db", data, lambda p: read_colmap_database(p, names), False, cuts=False
    )


def _returned() -> list[Case]:
    """Adjusted poses, tables of images' names and of flights."""
    wkt = 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM['
    wkt += '"Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]]'
    columns = "X_est,Y_est,Z_est,Yaw_est,Pitch_est,Roll_est"
    reference = f"# CoordinateSystem: {wkt}\n#Label,{columns}\n"
    pix4d = "fileName imageWidth imageHeight \ncamera matrix K [3x3]\nradial distortion [3x1]\n"
    pix4d += "tangential distortion [2x1]\ncamera position t [3x1]\ncamera rotation R [3x3]\n"
    pix4d += "camera model m = K [R|-Rt] X\n\n"
    for k in range(3):
        reference += f"800{k}.tif,6.54{k},46.57,630.5,12.5,-0.25,1.75\n"
        pix4d += f"800{k}.tif 5120 3840\n5607 0 2560\n0 5607 1920\n0 0 1\n0.1 0.2 0.3\n"
        pix4d += f"0.01 0.02\n{k}.5 2.25 90.75\n1 0 0\n0 -1 0\n0 0 -1\n"
    texts = {
        "metashape_opk_text": on_page("returned", "metashape_opk_text"),
        "metashape_reference": reference.encode(),
        "pix4d_external": on_page("returned", "pix4d_external"),
        "pix4d_camera": pix4d.encode(),
        "bentley": on_page("bentley"),
        "inpho_prj": on_page("inpho"),
        "micmac_xml": on_page("micmac", "xml"),
    }
    files = {"micmac_xml": "Orientation-8001.tif.xml"}

    def read(form: str) -> Read:
        of_directory = form in files
        return lambda path: read_returned_poses(path.parent if of_directory else path, form)

    return [
        _database(),
        *(
            Case(f"returned {form}", files.get(form, "x.txt"), text, read(form), cuts=False)
            for form, text in texts.items()
        ),
        Case("season", "season.csv", on_page("season"), read_season, cuts=False),
        Case("names", "x.csv", b'old,new\na.tif,b.tif\n"c,d.tif",e.tif\n', read_names, cuts=False),
    ]


def _of_toml() -> list[Case]:
    rows = b"1 2 3\n"
    block = on_page("block_file")
    inputs = dict.fromkeys(re.findall(r'"([\w./-]+\.\w+)"', block.decode()), rows)
    flat = {name: data for name, data in inputs.items() if "/" not in name}
    return [
        Case(
            "flight file",
            "flight.toml",
            FLIGHT.encode(),
            load_flight,
            beside={"imu.csv": rows, "gnss.txt": rows},
            cuts=False,
        ),
        Case("block file", "block.toml", block, load_block, beside=flat, cuts=False),
        Case(
            "covariance model",
            "covariance.toml",
            b"ppm = [1, 1, 2]\ngate = 20\n[floor_m]\nfixed = [0.002, 0.003, 0.004]\n",
            read_covariance,
            cuts=False,
        ),
    ]


def _orientation(count: int = 4) -> ExteriorOrientation:
    return ExteriorOrientation(
        images=tuple(f"{8001 + k}.tif" for k in range(count)),
        time=200000.0 + 2.0 * np.arange(count),
        gps_week=2008,
        origin=np.array([0.81, 0.11, 400.0]),
        position_m=10.0 * np.arange(3.0 * count).reshape(count, 3),
        C_mc=np.tile(np.diag([1.0, -1.0, -1.0]), (count, 1, 1)),
        cov=np.tile(1e-4 * np.eye(6), (count, 1, 1)),
        cross=np.tile(1e-5 * np.eye(6), (count - 1, 1, 1)),
        boresight=np.eye(3),
        camera_from_body=np.eye(3),
        history=("smoothed",),
    )


def _orientations() -> list[Case]:
    eo = _orientation()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "eo.json"
        write_eo_json(eo, path)
        master = path.read_bytes()
        write_pose_covariance(eo.images, 1e-4 * np.eye(24), path)
        covariance = path.read_bytes()
        write_eo_covariance(eo, (StripCovariance(np.arange(4), 1e-4 * np.eye(24)),), path)
        strips = path.read_bytes()
    compared = ("eo_local_plane", "metashape", "trajectory_csv", "rtklib_pos", "odyn")
    compared += ("tum", "pix4d", "realitycapture")
    cases = [
        Case("eo.json", "eo.json", master, read_eo_json, cuts=False),
        Case(
            "pose covariance",
            "poses_covariance.npz",
            covariance,
            lambda path: read_pose_covariance(path, eo.images),
            False,
            cuts=False,
        ),
    ]
    cases.append(
        Case(
            "eo covariance",
            "eo_covariance.npz",
            strips,
            lambda path: read_eo_covariance(path, eo),
            False,
            cuts=False,
        )
    )
    return cases + [
        Case(f"compared {name}", f"{name}.txt", on_page(name), read_poses, cuts=False)
        for name in compared
    ]


def _images() -> list[Case]:
    from PIL import Image

    cases = []
    for form in ("jpeg", "tiff"):
        stream = io.BytesIO()
        picture = Image.new("L", (16, 12))
        tags = picture.getexif()
        tags[271], tags[272], tags[306] = "maker", "model", "2018:07:03 13:05:00"
        tags.get_ifd(34665).update({36867: "2018:07:03 13:05:00", 37386: 35.0, 41989: 35})
        picture.save(stream, form, exif=tags)
        for name, read in (("time", time_taken), ("camera", camera_tags)):

            def opened(path: Path, read: Callable[..., object] = read) -> object:
                with path.open("rb") as file:
                    try:
                        return read(file, path.name)
                    except ValueError:  # no time there, as `io.exposures.images` takes it
                        return None

            cases.append(
                Case(f"{form} {name}", f"x.{form}", stream.getvalue(), opened, False, cuts=False)
            )
    return cases


def static_cases() -> list[Case]:
    """Cases of what only tuning and inspection read."""
    inspected = [
        Case(f"inspected {name}", "x.txt", on_page(name), lambda p: discover([p]), cuts=False)
        for name in ("imu_csv", "gnss_text", "nmea", "events")
    ]
    return [
        Case("variances json", "x.json", on_page("variances", "json"), read_variances, cuts=False),
        *inspected,
    ]
