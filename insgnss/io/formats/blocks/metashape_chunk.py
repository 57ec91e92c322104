"""Chunks of Metashape projects: their accuracies, and poses and reference coordinates of images.

The transform of a camera takes it (x right, y down, z viewing direction) to the axes of its chunk,
that of the chunk, X = t + s R x, to geocentric axes, or to the coordinates of a local CRS. A camera
of a rig that has none stands at its master's, T_slave = T_master [R t] with what its sensor has.
Covariances of a location stand in the axes and the unit of the chunk, those of a rotation, rad^2,
in the camera's axes.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....base.errors import near
from ....records.block import Array
from ..text.layout import quote
from ..text.numbers import PLAIN, finite
from ..text.text import Source
from ..text.xml import text_of
from .ground_points import GroundTable
from .measured_block import file_names, no_poses
from .metashape_project import Element, ProjectFile, opened_project

# accuracy of image references (m) where the project states none: Metashape's default
CAMERA_M = 10.0
BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


@dataclass(frozen=True, eq=False)
class Chunk:
    """A chunk and its first frame, with the files that they stand in."""

    element: Element
    source: ProjectFile
    frame: Element | None
    frame_source: ProjectFile

    def all(self, group: str, kind: str) -> list[Element]:
        """Elements of a group of the chunk, those inside folders too."""
        parent = self.element.find(group)
        return [] if parent is None else list(parent.iter(kind))

    def setting(self, name: str, default: float) -> float:
        """An accuracy of the chunk's settings."""
        for element in self.element.findall("./settings/property"):
            if element.get("name") == name:
                return positive(self.source, element.get("value"), f"setting {name}")
        return default

    def accuracies(self, kind: str, default: float, reference: Element, of: str) -> list[float]:
        """Accuracies of reference coordinates x, y, z: their own, else those of the settings.

        Parameters
        ----------
        kind : str
            "cameras" or "markers".
        default : float
            Where the settings have none, m.
        reference : Element
            The coordinates.
        of : str
            Whose accuracy it is, for the message.
        """
        common = self.setting(f"accuracy_{kind}", default)
        plan, height = (self.setting(f"accuracy_{kind}_{axes}", common) for axes in ("xy", "z"))
        whole = reference.get("sxyz")
        of_plan = reference.get("sxy", whole)
        stated = [reference.get("sx", of_plan), reference.get("sy", of_plan)]
        stated.append(reference.get("sz", whole))
        return [
            usual if text is None else positive(self.source, text, of)
            for text, usual in zip(stated, (plan, plan, height), strict=True)
        ]

    def references(
        self, kind: str, default: float, named: Sequence[tuple[str, Element]]
    ) -> GroundTable | None:
        """Reference coordinates of elements by names, of those that have all three; None: of none.

        What is not enabled is a check point. Kind and default are those of `accuracies`.
        """
        names, position, sigma, check = [], [], [], []
        for name, element in named:
            reference = element.find("reference")
            if reference is None or None in map(reference.get, "xyz"):
                continue
            who = f"{kind.removesuffix('s')} {name}"
            names.append(name)
            position.append(
                [number_of(self.source, reference.get(k), f"{who}: {k}") for k in "xyz"]
            )
            sigma.append(self.accuracies(kind, default, reference, f"{who}: accuracy"))
            check.append(not flag(self.source, reference, "enabled"))
        if not names:
            return None
        cov = np.array(sigma)[:, :, None] ** 2 * np.eye(3)
        return GroundTable(tuple(names), np.array(position), cov, np.array(check))

    def crs(self, kind: str = "") -> str:
        """CRS of the chunk, or of "camera" or "marker" references; empty where it has none."""
        stated = text_of(self.element.find(f"{kind}_reference")) if kind else ""
        return stated or text_of(self.element.find("reference"))

    def names(self, images: Sequence[Element]) -> tuple[str, ...]:
        """Names of images: their labels; of those with one label, behind that of their sensor.

        Cameras of a rig may number their images alike: Metashape tells them apart by sensors.

        Raises
        ------
        InputError
            Two images of one sensor have one label.
        """
        count = Counter(image.get("label") or "" for image in self.all("cameras", "camera"))
        sensors = {s.get("id"): s.get("label") for s in self.all("sensors", "sensor")}
        alike = Counter(sensors.values())
        names = []
        for image in images:
            label, number = image.get("label") or "", image.get("sensor_id")
            if count[label] > 1 and number in sensors:
                title = sensors[number]
                label = f"{title if title and alike[title] == 1 else f'sensor {number}'}/{label}"
            names.append(label)
        return file_names(names, self.source.path)

    def images(self, notes: list[str]) -> tuple[list[Element], list[Element]]:
        """Images that are enabled, and the others."""
        cameras = [c for c in self.all("cameras", "camera") if c.get("id") is not None]
        disabled = [c for c in cameras if not flag(self.source, c, "enabled")]
        if disabled:
            notes.append(f"{len(disabled)} disabled images left out")
        return [c for c in cameras if c not in disabled], disabled


@dataclass(frozen=True, eq=False)
class ChunkPoses:
    """Poses of the images of a chunk, NaN of images without.

    Parameters
    ----------
    position, C_mc : ndarray, (n, 3) and (n, 3, 3)
        Projection centres, and camera (x right, y down, z viewing direction) to the axes.
    cov_position, cov_attitude : ndarray, (n, 3, 3)
        In these axes; NaN where the file has none.
    local : bool
        Whether the axes are the chunk's own, of no place and scale.
    """

    position: Array
    C_mc: Array
    cov_position: Array
    cov_attitude: Array
    local: bool


def _similarity(source: ProjectFile, element: Element | None) -> tuple[Array, Array, float] | None:
    """Return R (3, 3), t (3,) and s of a transform; None where it is not complete."""
    transform = None if element is None else element.find("transform")
    parts = [None if transform is None else transform.find(k) for k in ("rotation", "translation")]
    if transform is None or parts[0] is None or parts[1] is None:
        return None
    scale = transform.find("scale")
    return (
        _numbers(source, parts[0], 9, "rotation of the chunk").reshape(3, 3),
        _numbers(source, parts[1], 3, "translation of the chunk"),
        1.0 if scale is None else float(_numbers(source, scale, 1, "scale of the chunk")[0]),
    )


def chunk_poses(of: Chunk, images: Sequence[Element], notes: list[str]) -> ChunkPoses:
    """Return the poses of images.

    Components that are not aligned with each other have axes of their own: those without transform
    are left out where others have one, else all but the largest.
    """
    position, C_mc = no_poses(len(images))
    covariances = np.full((2, len(images), 3, 3), np.nan)
    transform = _camera_transforms(of, images)
    posed = list(transform)
    component = [transform[k][1] for k in posed]
    whole = _similarity(of.source, of.element)
    parts = {c.get("id"): _similarity(of.source, c) for c in of.all("components", "component")}
    parent = of.element.find("components")
    active = None if parent is None else parent.get("active_id")
    similar = {
        number: parts.get(number) or (whole if number in (None, active) or len(parts) < 2 else None)
        for number in dict.fromkeys(component)
    }
    local = not any(similar.values())
    largest = max(dict.fromkeys(component), key=component.count) if component else None
    for k, number in zip(posed, component, strict=True):
        T = transform[k][0]
        if local and number == largest:
            R, t, s = np.eye(3), np.zeros(3), 1.0
        elif (similarity := similar[number]) is not None:
            R, t, s = similarity
        else:
            continue
        C_mc[k], position[k] = R @ T[:3, :3], t + s * R @ T[:3, 3]
        for cov, key, A in zip(
            covariances, ("location", "rotation"), (s * R, C_mc[k]), strict=True
        ):
            if (element := images[k].find(f"{key}_covariance")) is not None:
                description = f"{key} covariance of image {images[k].get('label')}"
                cov[k] = A @ _numbers(of.source, element, 9, description).reshape(3, 3) @ A.T
    if loose := int(np.isnan(position[posed, 0]).sum()):
        notes.append(
            f"{loose} poses left out: they belong to components that are not connected to the block"
        )
    return ChunkPoses(position, C_mc, covariances[0], covariances[1], local)


def _camera_transforms(of: Chunk, images: Sequence[Element]) -> dict[int, tuple[Array, str | None]]:
    """Return transforms (4, 4), camera to chunk, and components of images that have one, by rows.

    A slave camera without one has that of its master, and its sensor's place on the rig.
    """
    sensors = {s.get("id"): s for s in of.all("sensors", "sensor")}
    cameras = {c.get("id"): c for c in of.all("cameras", "camera")}
    transforms: dict[int, tuple[Array, str | None]] = {}
    for k, image in enumerate(images):
        if image.find("transform") is not None:
            transforms[k] = _camera_to_chunk(of.source, image), image.get("component_id")
            continue
        master, sensor = cameras.get(image.get("master_id")), sensors.get(image.get("sensor_id"))
        if master is None or sensor is None or master.find("transform") is None:
            continue
        on_rig = np.eye(4)
        for key, block in (("rotation", np.s_[:3, :3]), ("location", np.s_[:3, 3])):
            if (element := sensor.find(key)) is not None:
                size = on_rig[block].size
                values = _numbers(of.source, element, size, f"{key} of {sensor.get('label')}")
                on_rig[block] = values.reshape(on_rig[block].shape)
        T = _camera_to_chunk(of.source, master) @ on_rig
        transforms[k] = T, image.get("component_id", master.get("component_id"))
    return transforms


def _camera_to_chunk(source: ProjectFile, image: Element) -> Array:
    """Return the transform (4, 4) of an image that has one, camera to chunk."""
    transform = image.find("transform")
    assert transform is not None
    description = f"transform of image {image.get('label')}"
    T = _numbers(source, transform, 16, description).reshape(4, 4)
    e = max(np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max(), np.abs(T[3] - np.eye(4)[3]).max())
    if e > 1e-6 or np.linalg.det(T[:3, :3]) < 0.0:
        raise source.error(f"{description}: is no rotation; export the cameras again")
    return T


def opened_chunk(path: Source, chunk: str | None = None) -> Chunk:
    """Open a project or an exported file at the chunk that is asked for, or the only one."""
    return chunk_of(*opened_project(path), chunk)


def on_globe(of: Chunk, local: bool) -> bool:
    """Whether transforms of a chunk lead to geocentric axes."""
    crs = of.crs()
    return bool(crs) and not local and "LOCAL_CS" not in crs and "ENGCRS" not in crs


def read_metashape_references(path: Source) -> tuple[GroundTable, str]:
    """Read the reference coordinates of images: GNSS positions as they were imported.

    Parameters
    ----------
    path : path
        As of `read_metashape_block`.

    Returns
    -------
    references : GroundTable
        By the labels of images, with the accuracies of each or of the settings (10 m without).
    crs : str
        Their CRS; empty where the file has none.

    Raises
    ------
    InputError
        As there, or no image has a reference.
    """
    of = opened_chunk(path)
    images = [i for i in of.all("cameras", "camera") if i.find("reference") is not None]
    named = list(zip(of.names(images), images, strict=True))
    references = of.references("cameras", CAMERA_M, named)
    if references is None:
        raise of.source.error(
            "no image has reference coordinates; import them in Metashape, or give a table of "
            "positions"
        )
    no_checks = np.zeros(len(references.points), dtype=bool)
    return replace(references, check=no_checks), of.crs("camera")


def number_of(source: ProjectFile, text: str | None, description: str) -> float:
    """Return a finite number; the error says of what it is."""
    value = finite(text)
    if np.isnan(value):
        raise source.error(f"{description}: {quote(text)} is no number; {PLAIN}, or export again")
    return value


def positive(source: ProjectFile, text: str | None, description: str) -> float:
    """Return a number greater than zero."""
    value = number_of(source, text, description)
    if value <= 0.0:
        raise source.error(f"{description}: {value:g}; it must be greater than zero")
    return value


def flag(source: ProjectFile, element: Element, key: str) -> bool:
    """Return an attribute that is true or false; true where it is missing."""
    text = element.get(key, "true")
    if (value := BOOLEANS.get(text.lower())) is None:
        raise source.error(f"<{element.tag}> {key}={quote(text)}; it is true or false")
    return value


def _numbers(source: ProjectFile, element: Element, count: int, description: str) -> Array:
    fields = text_of(element).split()
    if len(fields) != count:
        raise source.error(f"{description}: {len(fields)} numbers, expected {count}")
    return np.array([number_of(source, word, description) for word in fields])


def chunk_of(root: Element, source: ProjectFile, wanted: str | None) -> Chunk:
    """Return the chunk that is asked for, or the only one with cameras or markers."""
    elements = [root] if root.tag == "chunk" else list(root.iter("chunk"))
    if root.tag not in ("document", "chunk") or not elements:
        raise source.error(
            "no <document> with a <chunk>; give a .psx, .psz or an exported XML file"
        )
    opened = [source.opened(element) for element in elements]
    chunks = [
        (element.get("label") or outer.get("id") or "", outer.get("id"), element, where)
        for outer, (element, where) in zip(elements, opened, strict=True)
    ]
    if wanted is not None:
        chosen = [row for row in chunks if wanted in row[:2]]
        if not chosen:
            raise source.error(f"no chunk {wanted!r}; {near(wanted, [row[0] for row in chunks])}")
    else:
        chosen = [row for row in chunks if row[2].find(".//camera") is not None]
    if len(chosen) != 1:
        labels = ", ".join(quote(row[0]) for row in chunks)
        raise source.error(
            f"{len(chosen)} chunks have images, of {labels}; name one by chunk"
            if chosen
            else f"no chunk has images ({labels}), so no poses and no image observations; align"
            " the images and export the cameras (Agisoft XML), or save the project"
        )
    _, _, element, where = chosen[0]
    frames = element.findall("./frames/frame")
    if len(frames) > 1:
        raise where.error(f"{len(frames)} frames (a moving object); export only the first frame")
    if not frames:
        return Chunk(element, where, None, where)
    return Chunk(element, where, *where.opened(frames[0]))
