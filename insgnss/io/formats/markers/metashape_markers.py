"""Markers for Metashape, an XML file that it imports, data_specs/metashape_markers.md."""

from collections.abc import Iterator
from pathlib import PurePosixPath

import numpy as np

from ....base.files import atomic_write
from ....geodesy.crs import crs_of, first_wkt
from ....records.block import BrownCamera
from ..blocks.ground_points import GroundTable
from ..blocks.image_points import ImagePoints
from ..orientation.exported import check_characters, xml_text
from ..text.text import Source

MARKERS_VERSION = "1.5.0"


def write_metashape_markers(
    measured: ImagePoints, ground: GroundTable, crs: str, camera: BrownCamera, path: Source
) -> None:
    """Write markers with their coordinates and where images show them.

    Parameters
    ----------
    measured : ImagePoints
        Image observations of ground points.
    ground : GroundTable
        The points, in the axes of `crs`.
    crs : str
        CRS of the points, as pyproj takes it.
    camera : BrownCamera
        The camera, of which size and camera constant are written.
    path : path
        The file, written whole or not at all.

    Raises
    ------
    InputError
        A name has a control character.
    UsageError
        The file cannot be written.
    """
    check_characters(measured.images)
    check_characters(measured.points, "point")
    rows = {name: k for k, name in enumerate(ground.points)}
    sigma = np.sqrt(np.diagonal(ground.cov, axis1=1, axis2=2))
    marks = measured.observations
    wkt = first_wkt(crs_of(crs).to_2d(), "metashape_markers")

    def lines() -> Iterator[str]:
        yield '<?xml version="1.0" encoding="UTF-8"?>'
        yield f'<document version="{MARKERS_VERSION}">'
        yield '  <chunk label="targets" enabled="true">'
        yield '    <sensors next_id="1">'
        resolution = f'<resolution width="{camera.width}" height="{camera.height}"/>'
        yield f'      <sensor id="0" label="{xml_text(camera.name, quotes=True)}" type="frame">'
        yield f"        {resolution}"
        yield '        <calibration type="frame" class="initial">'
        yield f"          {resolution}<f>{camera.of('f'):.6f}</f>"
        yield "        </calibration>"
        yield "      </sensor>"
        yield "    </sensors>"
        yield f'    <cameras next_id="{len(measured.images)}" next_group_id="0">'
        for k, name in enumerate(measured.images):
            label = xml_text(PurePosixPath(name.replace("\\", "/")).stem, quotes=True)
            yield f'      <camera id="{k}" sensor_id="0" label="{label}"/>'
        yield "    </cameras>"
        yield f'    <markers next_id="{len(measured.points)}" next_group_id="0">'
        for k, name in enumerate(measured.points):
            yield f'      <marker id="{k}" label="{xml_text(name, quotes=True)}">'
            if (row := rows.get(name)) is not None:
                x, y, z = ground.position_m[row].tolist()
                sx, sy, sz = sigma[row].tolist()
                use = "false" if ground.check[row] else "true"
                yield (
                    f'        <reference x="{x:.13g}" y="{y:.13g}" z="{z:.4f}" sx="{sx:.5g}"'
                    f' sy="{sy:.5g}" sz="{sz:.5g}" enabled="{use}"/>'
                )
            yield "      </marker>"
        yield "    </markers>"
        yield f"    <reference>{xml_text(wkt)}</reference>"
        accuracy = float(np.sqrt(np.mean(marks.sigma_px**2)))
        yield "    <settings>"
        yield f'      <property name="accuracy_projections" value="{accuracy:.4g}"/>'
        yield "    </settings>"
        yield '    <frames next_id="1">'
        yield '      <frame id="0">'
        yield "        <markers>"
        for k in range(len(measured.points)):
            yield f'          <marker marker_id="{k}">'
            for row in np.flatnonzero(marks.point == k).tolist():
                u, v = marks.uv[row]
                yield (
                    f'            <location camera_id="{marks.image[row]}" pinned="true"'
                    f' x="{u:.4f}" y="{v:.4f}"/>'
                )
            yield "          </marker>"
        yield "        </markers>"
        yield "      </frame>"
        yield "    </frames>"
        yield "  </chunk>"
        yield "</document>"

    atomic_write(path, "\n".join(lines()) + "\n")
