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
DOCUMENT = """<?xml version="1.0" encoding="UTF-8"?>
<document version="{version}">
  <chunk label="targets" enabled="true">
    <sensors next_id="1">
      <sensor id="0" label="{sensor}" type="frame">
        {size}
        <calibration type="frame" class="initial">
          {size}<f>{focal:.6f}</f>
        </calibration>
      </sensor>
    </sensors>
    <cameras next_id="{camera_count}" next_group_id="0">
{cameras}
    </cameras>
    <markers next_id="{marker_count}" next_group_id="0">
{markers}
    </markers>
    <reference>{reference}</reference>
    <settings>
      <property name="accuracy_projections" value="{accuracy:.4g}"/>
    </settings>
    <frames next_id="1">
      <frame id="0">
        <markers>
{locations}
        </markers>
      </frame>
    </frames>
  </chunk>
</document>
"""


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
    wkt = first_wkt(crs_of(crs).to_2d(), "metashape_markers")
    accuracy_px = float(np.sqrt(np.mean(measured.observations.sigma_px**2)))
    size = f'<resolution width="{camera.width}" height="{camera.height}"/>'
    text = DOCUMENT.format(
        version=MARKERS_VERSION,
        sensor=xml_text(camera.name, quotes=True),
        size=size,
        focal=camera.of("f"),
        camera_count=len(measured.images),
        cameras="\n".join(_cameras(measured)),
        marker_count=len(measured.points),
        markers="\n".join(_markers(measured, ground)),
        reference=xml_text(wkt),
        accuracy=accuracy_px,
        locations="\n".join(_locations(measured)),
    )
    atomic_write(path, text)


def _cameras(measured: ImagePoints) -> Iterator[str]:
    """Yield the lines of the images, labelled by their file names without ending."""
    for number, name in enumerate(measured.images):
        label = xml_text(PurePosixPath(name.replace("\\", "/")).stem, quotes=True)
        yield f'      <camera id="{number}" sensor_id="0" label="{label}"/>'


def _markers(measured: ImagePoints, ground: GroundTable) -> Iterator[str]:
    """Yield the lines of the points, with coordinates and sigmas (m) of those in `ground`."""
    rows = {name: row for row, name in enumerate(ground.points)}
    sigma = np.sqrt(np.diagonal(ground.cov, axis1=1, axis2=2))
    for number, name in enumerate(measured.points):
        yield f'      <marker id="{number}" label="{xml_text(name, quotes=True)}">'
        if (row := rows.get(name)) is not None:
            x, y, z = ground.position_m[row].tolist()
            sx, sy, sz = sigma[row].tolist()
            use = "false" if ground.check[row] else "true"
            yield (
                f'        <reference x="{x:.13g}" y="{y:.13g}" z="{z:.4f}" sx="{sx:.5g}"'
                f' sy="{sy:.5g}" sz="{sz:.5g}" enabled="{use}"/>'
            )
        yield "      </marker>"


def _locations(measured: ImagePoints) -> Iterator[str]:
    """Yield the lines of the image observations (px), marker by marker."""
    observed = measured.observations
    order = np.argsort(observed.point, kind="stable")
    first_rows = np.searchsorted(observed.point[order], np.arange(1, len(measured.points)))
    for number, rows in enumerate(np.split(order, first_rows)[: len(measured.points)]):
        yield f'          <marker marker_id="{number}">'
        for row in rows.tolist():
            u, v = observed.uv[row]
            yield (
                f'            <location camera_id="{observed.image[row]}" pinned="true"'
                f' x="{u:.4f}" y="{v:.4f}"/>'
            )
        yield "          </marker>"
