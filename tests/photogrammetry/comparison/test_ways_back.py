"""Each target of an export has a way back: exported, written by its program, compared with zero."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS
from scipy.spatial.transform import Rotation
from sites import orientation_at

from insgnss.base.errors import InputError
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.flight.exporting.positions import export_positions
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.projection import MapProjection
from insgnss.io.formats.exports import EXPORTS
from insgnss.io.formats.positions.position_references import POSITION_FORMATS
from insgnss.navigation.orient.frame import in_frame
from insgnss.photogrammetry.comparison.compare import compare_files
from insgnss.photogrammetry.comparison.of_records import poses_of, positions_of
from insgnss.records import ExteriorOrientation, FramedOrientation

D = np.diag([1.0, -1.0, -1.0])  # camera right, down, forward to right, up, back
DIGITS_M, DIGITS_DEG = 1.5e-4, 1e-4  # the bar, and four decimals of a metre
SITES = {  # latitude, longitude, ground, datum; CRS; one in metres for programs that know no feet
    "Lausanne": ((46.52, 6.63, 400.0, None), "EPSG:2056", "EPSG:2056"),
    "Sydney": ((-33.87, 151.2, 30.0, "EPSG:7843"), "EPSG:7856", "EPSG:7856"),
    "Denver": ((39.74, -105.0, 1600.0, "EPSG:6319"), "EPSG:6428", "EPSG:6427"),
    "Kamchatka": ((62.0, 177.0, 100.0, None), "EPSG:32660", "EPSG:32660"),
    "Paris": ((48.85, 2.35, 80.0, None), "EPSG:2154", "EPSG:2154"),
    "geoid": ((46.52, 6.63, 400.0, None), "EPSG:32632", "EPSG:32632"),
}


METRIC = "colmap", "odm", "tum"  # exports that know no feet
ON_THE_GLOBE = "eo_local_plane", "eo_json", "rtklib_pos", "geojson", "opensfm"  # of their own frame


@dataclass
class Site:
    """An orientation, its CRS, the grid of a geoid, and where files go."""

    eo: ExteriorOrientation
    crs: str
    metric: str
    geoid: Path | None
    root: Path

    @property
    def framed(self) -> FramedOrientation:
        eo = self.eo
        projection = MapProjection(self.crs, self.geoid, eo.datum, any_unit=True)
        return in_frame(eo, "projected", projection)

    @property
    def rows(self) -> list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
        """Name, coordinates in the unit of the CRS, omega, phi, kappa, deg, and the matrix."""
        framed = self.framed
        x = framed.coordinates / framed.frame.unit_m
        opk = Rotation.from_matrix(framed.C_fc @ D).as_euler("XYZ", degrees=True)
        return list(zip(framed.images, x, opk, framed.C_fc, strict=True))

    @property
    def wkt(self) -> str:
        return CRS(self.crs).to_wkt("WKT1_GDAL")

    def write(self, name: str, text: str) -> Path:
        (self.root / name).write_text(text)
        return self.root / name

    def export(self, form: str, name: str, **options: object) -> Path:
        metric = form in METRIC
        if form.startswith(("micmac", "realitycapture")) or form in ON_THE_GLOBE:
            target = ExportFrame()
        else:
            target = ExportFrame(self.metric if metric else self.crs, self.geoid)
        return export(self.eo, form, self.root / name, target, **options).file

    def export_positions(self, form: str) -> Path:
        """Those that a drone without an IMU log has; nowhere do they stand in feet."""
        plain = form == "geojson"
        target = ExportFrame() if plain else ExportFrame(self.metric, self.geoid)
        return export_positions(
            positions_of(poses_of(self.eo)),
            form,
            self.root / POSITION_FORMATS[form].product,
            target,
        ).file


def line(*values: object, by: str = " ") -> str:
    return by.join(v if isinstance(v, str) else f"{v:.10f}" for v in values) + "\n"


def metashape_opk_text(site: Site) -> Path:
    text = "# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33\n"
    for name, x, opk, C in site.rows:
        text += line(name[:-4], *x, *opk, *(C @ D).T.ravel(), by="\t")
    return site.write("cameras.txt", text)


def metashape_reference(site: Site) -> Path:
    text = f"# CoordinateSystem: {site.wkt}\n#Label,X/Easting,Y/Northing,Z/Altitude,Omega,Phi,"
    text += "Kappa,X_est,Y_est,Z_est,Omega_est,Phi_est,Kappa_est\n"
    for name, x, opk, _ in site.rows:
        text += line(name, *(x + 3.0), 1.0, 2.0, 3.0, *x, *opk, by=",")
    return site.write("reference.csv", text)


def potree(site: Site) -> Path:
    text = f"# CoordinateSystem: {site.wkt}\n"
    text += "#Label X Y Z Omega Phi Kappa X_est Y_est Z_est Omega_est Phi_est Kappa_est\n"
    for name, x, opk, _ in site.rows:
        text += line(name, *x, *opk)
    return site.write("orientedimages.txt", text)


def pix4d_external(site: Site) -> Path:
    offset = np.round(np.mean([x for _, x, *_ in site.rows], axis=0), -3)
    text = "imageName X Y Z Omega Phi Kappa\n"
    for name, x, opk, _ in site.rows:
        text += line(name, *(x - offset), *opk)
    site.write("p_offset.xyz", line(*offset))
    site.write("p_wkt.prj", site.wkt)
    return site.write("p_calibrated_external_camera_parameters.txt", text)


def pix4d_camera(site: Site) -> Path:
    offset = np.round(np.mean([x for _, x, *_ in site.rows], axis=0), -3)
    text = "camera model m = K [R|-Rt] X\n\n"
    for name, x, _, C in site.rows:
        lines = ["5607 0 2560", "0 5607 1920", "0 0 1", "0 0 0", "0 0"]
        lines += [line(*row).rstrip() for row in (x - offset, *C.T)]
        text += f"{name} 5120 3840\n" + "\n".join(lines) + "\n"
    site.write("p_offset.xyz", line(*offset))
    site.write("p_wkt.prj", site.wkt)
    return site.write("p_calibrated_camera_parameters.txt", text)


def metashape_xml(site: Site) -> Path:
    """Cameras of a chunk whose transform leads to geocentric axes."""
    eo, plane = site.eo, TangentPlane(*site.eo.origin)
    X = plane.origin_ecef + eo.position_m @ plane.C_em.T
    R, t, s = Rotation.from_rotvec([0.3, -0.4, 1.2]).as_matrix(), X.mean(axis=0) + 7.0, 2.5
    root = '<document version="2.0.0"><chunk label="c" enabled="true"><sensors/><components>'
    root += f'<component id="0"><transform><rotation>{line(*R.ravel())}</rotation>'
    root += f"<translation>{line(*t)}</translation><scale>{s}</scale></transform></component>"
    root += "</components><cameras>"
    for k, name in enumerate(eo.images):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R.T @ plane.C_em @ eo.C_mc[k], R.T @ (X[k] - t) / s
        root += f'<camera id="{k}" component_id="0" label="{name[:-4]}" enabled="true">'
        root += f"<transform>{line(*T.ravel())}</transform></camera>"
    wkt = CRS("EPSG:4326").to_wkt("WKT1_GDAL").replace('"', "&quot;")
    return site.write("a.xml", f"{root}</cameras><reference>{wkt}</reference></chunk></document>")


def opf(site: Site) -> Path:
    """Scaled to metres, and then shifted, as pyopf's matrix has it."""
    scale = site.framed.frame.unit_m
    shift = -np.round(np.mean([scale * x for _, x, *_ in site.rows], axis=0), -2)
    cameras, uris = [], []
    for k, (name, x, opk, _) in enumerate(site.rows):
        uris.append({"id": 7 + k, "uri": f"../my%20images/{name}"})
        pose = {"position": (scale * x + shift).tolist(), "orientation_deg": opk.tolist()}
        cameras.append({"id": 7 + k, "sensor_id": 1, **pose})
    base = {"scale": scale.tolist(), "shift": shift.tolist(), "swap_xy": False}
    frame = {"base_to_canonical": base}
    site.write("scene_reference_frame.json", json.dumps(frame | {"crs": {"definition": site.crs}}))
    site.write("camera_list.json", json.dumps({"cameras": uris}))
    head = {"format": "application/opf-calibrated-cameras+json", "version": "1.0"}
    site.write("calibrated_cameras.json", json.dumps(head | {"cameras": cameras}))
    return site.root


def ign_opk(site: Site) -> Path:
    text = "NOM X Y Z O P K CAMERA\n"
    return site.write(
        "a.OPK", text + "".join(line(n, *x, *opk, "cam1") for n, x, opk, _ in site.rows)
    )


def bentley(site: Site) -> Path:
    """Adjusted poses: not under Metadata, where those that were imported stand."""
    text = site.export("bentley", "blocks.xml").read_text()
    for tag in ("<Metadata>", "</Metadata>"):
        text = text.replace(tag, "")
    return site.write("adjusted.xml", text)


def realitycapture_camera(site: Site) -> Path:
    framed = site.framed
    text = "#cameras 12\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n"
    angles = Rotation.from_matrix(framed.C_Ec @ D).as_euler("ZXY", degrees=True)
    for (name, x, *_), (a, p, r) in zip(site.rows, angles, strict=True):
        text += line(name, *x, -a, p, r, 35.0, *[0.0] * 8, by=",")
    return site.write("cameras.csv", text)


def realitycapture_chosen(site: Site) -> Path:
    """The same table with fewer columns, as its users may choose them."""
    path = realitycapture_camera(site)
    rows = path.read_text().replace("k3,k4,t1,t2", "t1,t2").splitlines()
    rows[2:] = [",".join(row.split(",")[:14]) for row in rows[2:]]
    path.write_text("\n".join(rows) + "\n")
    return path


def colmap(site: Site) -> Path:
    """What COLMAP writes: without our comments."""
    folder = site.export("colmap", "model", camera="PINHOLE,5120,3840,5607,5607,2560,1920")
    for file in folder.glob("*.txt"):
        rows = file.read_text().splitlines(keepends=True)
        file.write_text("".join(row for row in rows if not row.startswith("#")))
    return folder


def odm_shots(site: Site) -> Path:
    """Rotations of the reconstruction's axes, which are east, north, up at the block's middle."""
    eo = site.eo
    lat, lon, h = TangentPlane(*eo.origin).geodetic_from_position(eo.position_m)
    middle = TangentPlane(float(lat.mean()), float(lon.mean()), 0.0)
    C = middle.C_em.T @ TangentPlane(*eo.origin).C_em @ eo.C_mc
    shots = [
        {
            "type": "Feature",
            "properties": {
                "filename": eo.images[k],
                "translation": [0.0, 0.0, 0.0],
                "rotation": Rotation.from_matrix(C[k].T).as_rotvec().tolist(),
            },
            "geometry": {
                "type": "Point",
                "coordinates": [*np.degrees([lon[k], lat[k]]).tolist(), float(h[k])],
            },
        }
        for k in range(len(eo.images))
    ]
    return site.write("shots.geojson", json.dumps({"type": "FeatureCollection", "features": shots}))


def opensfm(site: Site) -> Path:
    """Axes of reference_lla.json, which the export wrote; their origin is that of the site."""
    beside = site.export("opensfm", "exif_overrides.json").with_name("reference_lla.json")
    lla = json.loads(beside.read_text())
    plane = TangentPlane(*np.radians([lla["latitude"], lla["longitude"]]), lla["altitude"])
    shots = {}
    for name, x, C in zip(site.eo.images, site.eo.position_m, site.eo.C_mc, strict=True):
        at = TangentPlane(*site.eo.origin)
        x = plane.position_from_geodetic(*at.geodetic_from_position(x[None]))[0]
        R = (plane.C_em.T @ at.C_em @ C).T
        turn = Rotation.from_matrix(R).as_rotvec().tolist()
        shots[name] = {"camera": "c", "rotation": turn, "translation": (-R @ x).tolist()}
    lens = {"projection_type": "perspective", "width": 5120, "height": 3840, "focal": 1.1}
    camera = {"c": lens | {"k1": 0.0, "k2": 0.0}}
    model = {"cameras": camera, "shots": shots, "points": {}, "reference_lla": lla}
    return site.write("reconstruction.json", json.dumps([model]))


WAYS: dict[str, Callable[[Site], Path]] = {
    "metashape": lambda site: site.export("metashape", "metashape.csv"),
    "metashape_opk": lambda site: site.export("metashape_opk", "metashape_opk.csv"),
    "metashape_opk_text": metashape_opk_text,
    "metashape_reference": metashape_reference,
    "potree": potree,
    "pix4d_matic": lambda site: site.export("pix4d_matic", "pix4d_matic.csv"),
    "pix4d_mapper": lambda site: site.export("pix4d_mapper", "pix4d_mapper.csv"),
    "pix4d_external": pix4d_external,
    "pix4d_camera": pix4d_camera,
    "metashape_xml": metashape_xml,
    "realitycapture": lambda site: site.export("realitycapture", "flight.csv"),
    "opf": opf,
    "odm": lambda site: site.export("odm", "geo.txt"),
    "odm_shots": odm_shots,
    "realitycapture_camera": realitycapture_camera,
    "realitycapture_chosen": realitycapture_chosen,
    "micmac": lambda site: site.export("micmac", "micmac.txt"),
    "micmac_xml": lambda site: site.export("micmac_xml", "Ori-Nav"),
    "bentley": bentley,
    "inpho_prj": lambda site: site.export("inpho_prj", "a.prj", focal_mm=35.0, ground_m=0.0),
    "inpho_ascii": lambda site: site.export("inpho_ascii", "inpho.txt"),
    "ign_opk": ign_opk,
    "colmap": colmap,
    "eo_local_plane": lambda site: site.export("eo_local_plane", "EO_local-plane.txt"),
    "eo_json": lambda site: site.export("eo_json", "eo.json"),
    "generic_ascii": lambda site: site.export("generic_ascii", "eo_table.txt"),
    "tum": lambda site: site.export("tum", "eo.tum"),
    "geojson": lambda site: site.export("geojson", "eo.geojson"),
    "rtklib_pos": lambda site: site.export("rtklib_pos", "antenna.pos", lever_m=(0.0, 0.0, 0.0)),
    "opensfm": opensfm,
    **{
        f"{form} positions": lambda site, form=form: site.export_positions(form)
        for form in POSITION_FORMATS
    },
}
WAYS_OF = {  # what comes back of an export, where its name is no way
    "metashape_offset": ("metashape_reference", "metashape_xml"),
    "realitycapture_accuracy": ("realitycapture", "realitycapture_camera"),
    "colmap_priors": ("colmap",),
}
NO_WAY = {
    "g2o": "optimisers write vertices by number, without names of images or times, as tum has",
    "relative": "differences between neighbours, no positions",
    "kml": "a map to look at, which no program gives back",
    "geopackage": "a map to look at, which no program gives back",
    "image_tags": "tags inside photographs: the program that reads them gives back its own poses",
}


def test_every_export_has_a_way_back_or_says_why() -> None:
    """Oracle: the registries of exports; a new one is in one of the three."""
    for form in EXPORTS:
        assert sum((form in WAYS, form in WAYS_OF, form in NO_WAY)) == 1, form
    assert set(WAYS_OF) | set(NO_WAY) <= set(EXPORTS)
    assert {way for ways in WAYS_OF.values() for way in ways} <= set(WAYS)
    assert {f"{form} positions" for form in POSITION_FORMATS} <= set(WAYS)


def site_at(name: str, root: Path) -> Site:
    place, crs, metric = SITES[name]
    geoid = None
    if name == "geoid":  # 48 m everywhere from 40 to 60 N, 0 to 20 E
        geoid = root / "geoid.gtx"
        head = np.array([40.0, 0.0, 1.0, 1.0]).astype(">f8").tobytes()
        head += np.array([20, 20]).astype(">i4").tobytes()
        geoid.write_bytes(head + np.full(400, 48.0).astype(">f4").tobytes())
    return Site(orientation_at(*place), crs, metric, geoid, root)


@pytest.mark.parametrize("name", SITES)
@pytest.mark.parametrize("way", WAYS)
def test_a_way_back(way: str, name: str, tmp_path: Path) -> None:
    """Oracle: the orientation itself; what the program writes is put together with scipy."""
    site = site_at(name, tmp_path)
    file = WAYS[way](site)
    alone = way.endswith("positions") or way in ("odm", "rtklib_pos")
    crs = site.metric if way in METRIC or alone else site.crs
    if way.startswith("micmac") or way.removesuffix(" positions") in (
        *ON_THE_GLOBE,
        *("odm_shots", "realitycapture", "metashape_xml"),
    ):
        done = compare_files(site.eo, file)
    else:
        done = compare_files(site.eo, file, crs=crs, geoid=site.geoid)
    assert done.n == len(site.eo.images)
    assert done.findings == ()
    moved = [np.abs(part.difference).max() for part in done.components]
    assert max(moved[:3]) < DIGITS_M
    assert len(moved) == (3 if alone else 6)
    assert np.degrees(max(moved[3:], default=0.0)) < DIGITS_DEG


@pytest.mark.parametrize("shift", ["metres", "few"])
def test_a_shift_that_is_not_told_is_asked_for(shift: str, tmp_path: Path) -> None:
    """Oracle: half a kilometre more is as near to two of them; two images are too few."""
    site = site_at("Lausanne", tmp_path)
    folder = colmap(site)
    eo = site.eo
    if shift == "few":
        eo = eo[:2]
    else:
        rows = (folder / "images.txt").read_text().splitlines()
        rows[::2] = [_moved(row, np.array([500.0, 0.0, 0.0])) for row in rows[::2]]
        (folder / "images.txt").write_text("\n".join(rows) + "\n")
    with pytest.raises(InputError, match="what was subtracted from them"):
        compare_files(eo, folder, crs=site.crs)


def _moved(row: str, x: np.ndarray) -> str:
    """A row of images.txt whose centre is moved by x."""
    words = row.split()
    R = Rotation.from_quat(np.array(words[1:5], dtype=float)[[1, 2, 3, 0]]).as_matrix()
    t = np.array(words[5:8], dtype=float) - R @ x
    return " ".join([*words[:5], *(f"{v:.9f}" for v in t), *words[8:]])


def test_a_geocentric_model_without_its_shift(tmp_path: Path) -> None:
    """Oracle: the orientation itself; by name of the CRS, and without it by the positions."""
    eo = site_at("Lausanne", tmp_path).eo
    options = {"camera": "PINHOLE,5120,3840,5607,5607,2560,1920"}
    folder = export(
        eo, "colmap", tmp_path / "model", ExportFrame(frame="geocentric"), **options
    ).file
    text = (folder / "images.txt").read_text().splitlines(keepends=True)
    (folder / "images.txt").write_text("".join(row for row in text if row[0] != "#"))
    for crs in ("EPSG:4978", None):
        done = compare_files(eo, folder, crs=crs)
        assert max(np.abs(part.difference).max() for part in done.components[:3]) < DIGITS_M
        assert "whole kilometres, found from the positions" in " ".join(done.notes)
