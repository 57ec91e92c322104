"""What is written beside an export so that its program reads it: the script runs against a record
of Metashape's calls, the descriptions against the columns of the file.
"""

import csv
import sys
import types
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import CRS

from insgnss.cli import main
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.flight.proof.scene import make_scene
from insgnss.io.formats.exports import EXPORTS
from insgnss.io.formats.orientation.eo_json import write_eo_json


def run_in_metashape(script: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The calls of a script, by a module that has what Metashape's reference lists of them."""
    calls: dict[str, Any] = {}
    reference = types.SimpleNamespace(rotation=(1.0, 2.0, 3.0), location=(1.0, 2.0, 3.0))
    camera = types.SimpleNamespace(reference=reference)
    chunk = types.SimpleNamespace(cameras=[camera], crs=None, euler_angles=None)
    chunk.importReference = lambda **given: calls.update(given)
    module: Any = types.ModuleType("Metashape")
    module.app = types.SimpleNamespace(document=types.SimpleNamespace(chunk=chunk))
    module.CoordinateSystem = lambda text: ("CRS", text)
    for name in ("ReferenceFormatCSV", "ReferenceItemsCameras", "EulerAnglesYPR", "EulerAnglesOPK"):
        setattr(module, name, name)
    monkeypatch.setitem(sys.modules, "Metashape", module)
    code = compile(script.read_text(), str(script), "exec")
    exec(code, {"__file__": str(script), "__name__": "__main__"})
    return calls | {"chunk_crs": chunk.crs, "angles": chunk.euler_angles}


@pytest.mark.parametrize(
    ("name", "target", "crs", "angles"),
    [
        ("metashape", ExportFrame(), "EPSG::4979", "EulerAnglesYPR"),
        ("metashape", ExportFrame("EPSG:32632"), "EPSG::32632", "EulerAnglesYPR"),
        ("metashape_opk", ExportFrame("EPSG:32632"), "EPSG::32632", "EulerAnglesOPK"),
        ("metashape_offset", ExportFrame(frame="tangent plane"), "LOCAL_CS", "EulerAnglesYPR"),
    ],
)
def test_the_script_imports_the_file_beside_it(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    target: ExportFrame,
    crs: str,
    angles: str,
) -> None:
    """Oracle: the letters of Metashape's importReference (n label, x y z, a b c, X Y Z, A B C) over
    the columns of the csv, and its header.
    """
    done = export(make_scene().eo, name, tmp_path / "m.csv", target)
    assert done.helpers == (tmp_path / "m_import.py",)
    calls = run_in_metashape(done.helpers[0], monkeypatch)
    assert Path(calls["path"]) == tmp_path / "m.csv"
    assert calls["crs"] == calls["chunk_crs"]
    assert calls["crs"][1].startswith(crs)
    assert calls["angles"] == angles
    assert calls["items"] == "ReferenceItemsCameras"
    with (tmp_path / "m.csv").open() as stream:
        header, first, *_ = csv.reader(stream, delimiter=calls["delimiter"])
    assert header[0].startswith("#")
    assert calls["skip_rows"] == 1
    assert len(calls["columns"]) == len(first)
    letters = {"n": "#Label", "a": ("Yaw", "Omega", "Nominal_yaw"), "A": ("Yaw_acc", "Omega_acc")}
    assert header[calls["columns"].index("n")] == letters["n"]
    assert header[calls["columns"].index("a")] in letters["a"]
    assert header[calls["columns"].index("X")] == "X_acc"
    assert calls["columns"].index("A") == 10


@pytest.mark.parametrize(
    ("name", "target", "variables"),
    [
        ("realitycapture", ExportFrame(), "Image Latitude Longitude Altitude Yaw Pitch Roll"),
        ("realitycapture", ExportFrame(frame="tangent plane"), "Image X Y Altitude Yaw Pitch Roll"),
        (
            "realitycapture_accuracy",
            ExportFrame(),
            "Image Latitude Longitude Altitude Yaw Pitch Roll LongitudeAccuracy LatitudeAccuracy"
            " AltitudeAccuracy YawAccuracy PitchAccuracy RollAccuracy",
        ),
        (
            "realitycapture_accuracy",
            ExportFrame(frame="tangent plane"),
            "Image X Y Altitude Yaw Pitch Roll XAccuracy YAccuracy AltitudeAccuracy YawAccuracy"
            " PitchAccuracy RollAccuracy",
        ),
    ],
)
def test_the_description_names_the_columns_of_the_flight_log(
    tmp_path: Path, name: str, target: ExportFrame, variables: str
) -> None:
    """Oracle: the vocabulary of RealityScan's help (Customize Import Formats, Flight Log), and the
    numbers: the latitude is 46.57 deg and stands in the column of that name; accuracies to the
    east are those of the longitude.
    """
    done = export(make_scene().eo, name, tmp_path / "log.csv", target)
    root = ET.parse(tmp_path / "log_format.xml").getroot()
    assert root.tag == "FlightLogs"
    form = root[0]
    assert form.get("reader") == "RealityScan.Import.CSVFlightLog"
    parser = form[0]
    assert (parser.get("separator"), parser.get("comment")) == (",", "#")
    columns = {variable.tag: int(variable.get("index", "")) for variable in parser}
    assert " ".join(columns) == variables
    rows = [
        line.split(",") for line in done.file.read_text().splitlines() if not line.startswith("#")
    ]
    assert {len(row) for row in rows} == {len(columns)}
    assert rows[0][columns["Image"]] == make_scene().eo.images[0]
    if "Latitude" in columns:
        assert float(rows[0][columns["Latitude"]]) == pytest.approx(46.57, abs=0.1)
        assert float(rows[0][columns["Longitude"]]) == pytest.approx(6.54, abs=0.1)


@pytest.mark.parametrize(("name", "product"), [("micmac", "e.txt"), ("micmac_xml", "Ori-Nav")])
def test_the_tangent_plane_of_micmac(tmp_path: Path, name: str, product: str) -> None:
    """Oracle: MicMac's wiki (eTC_RTL, its centre in eTC_GeoCentr); pyproj's ECEF of the origin."""
    from pyproj import Transformer

    eo = make_scene().eo
    done = export(eo, name, tmp_path / product)
    root = ET.parse(done.helpers[0]).getroot()
    assert [e.text for e in root.iter("TypeCoord")] == ["eTC_RTL", "eTC_GeoCentr"]
    centre = [float(e.text or "") for e in root.iter("AuxR")]
    lat, lon = np.degrees(eo.origin[:2])
    to_ecef = Transformer.from_crs(CRS.from_epsg(4979), CRS.from_epsg(4978), always_xy=True)
    assert centre == pytest.approx(list(to_ecef.transform(lon, lat, eo.origin[2])), abs=1e-3)
    assert export(eo, name, tmp_path / "g", ExportFrame(frame="geocentric")).helpers == ()


def test_helpers_are_listed_by_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the files that are there."""
    write_eo_json(make_scene().eo, tmp_path / "eo.json")
    assert main(["export", str(tmp_path / "eo.json"), "metashape", "-q"]) == 0
    assert "metashape_import.py" in capsys.readouterr().out
    with_helpers = {name for name, form in EXPORTS.items() if form.helper}
    assert {"metashape", "realitycapture", "micmac"} <= with_helpers
