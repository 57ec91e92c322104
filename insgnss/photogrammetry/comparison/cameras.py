"""Calibrations held against each other: how far they move the pixels of the same rays.

Of one ray, camera b sees a pixel that differs from that of camera a by

    d = pixel_b(ray_a(pixel)) - pixel                                                       (C.1)

over a grid of a's image. A part of d is a small rotation of the camera, which every image's
attitude takes up in an adjustment: of principal points that differ by 5 px nothing remains but what
the corners show. What remains after the best rotation is what the calibrations truly disagree in.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, UsageError, near
from ...base.files import pick_attributes
from ...base.output.staging import together
from ...io.formats.blocks.camera_files import CAMERA_FORMS, write_cameras
from ...io.formats.blocks.camera_toml import write_camera_toml
from ...io.formats.returned.cameras import read_cameras, recognised_camera
from ...records.block import INTERIOR, BrownCamera
from ...records.cameras.camera import equidistant, pixels_of, rays_of
from ...report.document import Document, Section, Table
from ...report.notebook import Documented
from ...report.verdict import worst_of

GRID = 25  # points along each side of the image
# px: what remains of two calibrations of one camera; images are measured to some tenths of a pixel
ALIKE_PX = 0.5
LEAST_SHARE = 0.5  # of the grid that both polynomials reach: fewer points say little of the image
TEMPERATE = 1e-12  # ridge of the rotation's normal equations, beside their diagonal of about f^2


@dataclass(frozen=True, eq=False)
class CameraFile:
    """The calibrated cameras of a file.

    Parameters
    ----------
    path : Path
        The file.
    form : str
        Its format.
    cameras : tuple of BrownCamera
        Those that were asked for.
    """

    path: Path
    form: str
    cameras: tuple[BrownCamera, ...]


@dataclass(frozen=True)
class PixelDifference:
    """By how much two cameras differ over the image, px.

    Parameters
    ----------
    rms, largest : float
        Of the differences (C.1).
    rms_after_rotation, largest_after_rotation : float
        After the best rotation.
    rotation_deg : tuple of float
        That rotation of the first camera's rays about x (right), y (down), viewing direction.
    """

    rms: float
    largest: float
    rms_after_rotation: float
    largest_after_rotation: float
    rotation_deg: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class CameraReport(Documented):
    """One or two files of cameras, and what differs.

    Parameters
    ----------
    files : tuple of CameraFile
        One or two.
    difference : PixelDifference or None
        Of two files.
    notes : tuple of str
        What was scaled, written or lost.
    written : Path or None
        The file that was converted to.
    """

    files: tuple[CameraFile, ...]
    difference: PixelDifference | None
    notes: tuple[str, ...]
    written: Path | None

    def document(self) -> Document:
        """Return parameters and differences, for terminal and page."""
        names = [f"{file.path.name}: {c.name}" for file in self.files for c in file.cameras]
        cameras = [camera for file in self.files for camera in file.cameras]
        rows: list[tuple[str, ...]] = [
            ("image", *(f"{c.width} x {c.height}" for c in cameras)),
            ("polynomial", *(c.model for c in cameras)),
            *((key, *(f"{c.of(key):.8g}" for c in cameras)) for key in INTERIOR),
        ]
        d, verdict = self.difference, worst_of("the file can be used with --camera", [])
        head = "; ".join(f"{file.path.name} ({file.form})" for file in self.files)
        sections = [Section("Interior orientation, px", [Table(rows, ("", *names), numbers=True)])]
        if d is not None:
            first = f"{d.rms:.3f} px rms, {d.largest:.3f} px at most"
            head = f"the same rays differ by {first}"
            remaining = (
                f"{d.rms_after_rotation:.3f} px rms, {d.largest_after_rotation:.3f} px at most"
            )
            about = ", ".join(f"{angle:.4f}" for angle in d.rotation_deg)
            sections.append(
                Section(
                    "Differences over the image, second minus first",
                    [
                        first,
                        f"after a rotation by {about} deg, which the attitudes of the images"
                        f" absorb: {remaining}",
                    ],
                )
            )
            disagree = (
                f"after the best rotation {d.rms_after_rotation:.3g} px rms remain"
                f" (limit {ALIKE_PX:g} px)"
            )
            verdict = worst_of(
                f"the calibrations agree to {ALIKE_PX:g} px rms, apart from a rotation that the"
                " attitudes of the images absorb",
                [disagree] if d.rms_after_rotation > ALIKE_PX else [],
            )
        notes = list(self.notes)
        if self.written is not None:
            notes.append(f"wrote {self.written}")
        sections.append(Section("Notes", notes))
        files = [file.path for file in self.files]
        title = " and ".join(path.name for path in files)
        return Document(f"{title}: cameras", head, verdict, tuple(sections), files)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able; pixels and degrees."""
        return {
            "files": [
                {
                    "file": str(file.path),
                    "format": file.form,
                    "cameras": [
                        pick_attributes(camera, "name", "width", "height", "model", "unit_px")
                        | {key: camera.of(key) for key in INTERIOR}
                        for camera in file.cameras
                    ],
                }
                for file in self.files
            ],
            "difference_px": self.difference and asdict(self.difference),
            **pick_attributes(self, "notes", "written"),
        }


def report_cameras(
    first: Path,
    second: Path | None = None,
    name: str | None = None,
    form: str | None = None,
    out: Path | None = None,
    force: bool = False,
    direction: str | None = None,
) -> CameraReport:
    """Read, compare and convert calibrated cameras.

    Parameters
    ----------
    first, second : files of any format of `io.formats.returned.cameras.READERS`.
    name : of the camera that is taken from files with several.
    form : that the first is written in.
    out : the file that is written.
    force : whether a file that is there and differs is replaced.
    direction : of the distortion of Inpho's projects, as `io.formats.returned.inpho` takes it.

    Raises
    ------
    InputError
        What a reader refuses.
    UsageError
        A name or format that is unknown, options that do not go together, or a file that would
        be replaced.
    DataError
        Cameras that cannot be compared.
    """
    if (form is None) != (out is None):
        raise UsageError("camera: --as and --out belong together; give the format and the file")
    if form is not None and form not in (written := ("toml", *CAMERA_FORMS)):
        raise UsageError(f"camera: --as {form!r}; {near(form, written)}")
    files = tuple(_file(path, name, direction) for path in (first, second) if path is not None)
    if direction is not None and all(file.form != "inpho" for file in files):
        raise UsageError("camera: --distortion belongs to a project of Inpho; leave it out")
    notes: list[str] = []
    difference = None
    if second is not None:
        for file in files:
            if len(file.cameras) > 1:
                raise UsageError(
                    f"camera: {file.path} has {len(file.cameras)} cameras; name one: --name"
                )
        difference = _difference(files[0].cameras[0], files[1].cameras[0], notes)
    if form is not None and out is not None:
        cameras = files[0].cameras
        if form == "toml" and len(cameras) > 1:
            raise UsageError(f"camera: {first} has {len(cameras)} cameras; name one: --name")
        with together() as staging:
            if form == "toml":
                write_camera_toml(cameras[0], out)
            else:
                notes += write_cameras(cameras, out, form)
            if not force and any(staging.changed()):
                raise UsageError(
                    f"camera: {out} is there and differs; give another file, or --force"
                )
    return CameraReport(files, difference, tuple(notes), out)


def _file(path: Path, name: str | None, direction: str | None) -> CameraFile:
    file = path / "cameras.txt" if path.is_dir() else path
    form = recognised_camera(file)
    cameras = read_cameras(file, form, direction)
    if name is not None and len(cameras) > 1:
        names = [camera.name for camera in cameras]
        if name not in names:
            raise UsageError(f"camera: {path} has no camera {name!r}; {near(name, names)}")
        cameras = (cameras[names.index(name)],)
    return CameraFile(path, form, cameras)


def _difference(a: BrownCamera, b: BrownCamera, notes: list[str]) -> PixelDifference:
    """Differences of b from a over the image of a, px."""
    if (a.width, a.height) != (b.width, b.height):
        factor = a.width / b.width
        if abs(b.height * factor - a.height) > 1.0 or b.backward:
            raise DataError(
                f"cameras of {a.width} x {a.height} and {b.width} x {b.height} pixels are not of"
                " one image format; compare calibrations of the same images"
            )
        lengths = [factor if key in INTERIOR[:5] else 1.0 for key in INTERIOR]
        b = replace(b.with_(b.interior * lengths), width=a.width, height=a.height)
        notes.append(f"the second camera is scaled by {factor:.6g} to the image of the first")
    axes = [np.linspace(0.0, size, GRID) for size in (a.width, a.height)]
    uv = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    rays = rays_of(a, uv)
    d = pixels_of(b, rays) - uv
    inside = np.isfinite(d).all(axis=1)
    if inside.mean() < LEAST_SHARE:
        raise DataError(
            f"the cameras see {100.0 * inside.mean():.0f} % of the image in common: their"
            " distortion polynomials fold back inside the image; calibrate again with more points"
            " near the corners"
        )
    if not inside.all():
        notes.append(
            f"{(~inside).sum()} of {inside.size} points lie beyond the radius where a distortion"
            " polynomial folds back"
        )
    d, (x, y) = d[inside], rays[inside].T
    f = b.of("f")
    # derivatives of pixels by a small rotation of the rays about x, y and the viewing direction
    J = f * np.stack(
        [
            np.stack([-x * y, 1.0 + x * x, -y], axis=1),
            np.stack([-1.0 - y * y, x * y, x], axis=1),
        ],
        axis=1,
    )
    if b.fisheye:
        J = equidistant(rays[inside])[1] @ J
    J = J.reshape(-1, 3)
    angles = np.linalg.solve(J.T @ J + TEMPERATE * f * f * np.eye(3), J.T @ d.ravel())
    remaining = (d.ravel() - J @ angles).reshape(-1, 2)
    sizes = [np.linalg.norm(pixels, axis=1) for pixels in (d, remaining)]
    rms = [float(np.sqrt(np.mean(size**2))) for size in sizes]
    about = np.degrees(angles).tolist()
    return PixelDifference(
        rms[0], float(sizes[0].max()), rms[1], float(sizes[1].max()), (about[0], about[1], about[2])
    )
