"""Scripts of the Damped Bundle Adjustment Toolbox with their tables, data_specs/dbat.md.

The script names the tables, says which parameters are estimated and what defines the datum. Object
points and images go by whole numbers.

Camera: millimetres, y up from the principal point; its *model 3* is backward, (J.5) of
`insgnss.photogrammetry.adjust` with s the pixels of a millimetre. With y down, as in the records,
P2 and the skew change their signs; K and P1 keep them. The aspect parameter is b_1: it stretches
what is left when the principal point is subtracted (an adjustment that stretches pixels before that
differs by 1e-5 of sigma_0 on DBAT's own demonstration).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, near
from ....geodesy.rotation import CV_RUB, rotation_from_opk
from ....records.block import INTERIOR, Array, BrownCamera, GroundPoints, ImageBlock
from ....records.block import ImageObservations as Observations
from ..text.columns import NamedTable, TableSpec
from ..text.layout import quote
from ..text.numbers import PLAIN, are_whole, finite, whole, whole_rows
from ..text.order import first_repeat, refuse_rows
from ..text.text import NumberTable, Source, TextTable, read_table, read_text_table
from ..text.xml import read_xml, text_of
from .measured_block import minimal_datum

IMAGE_FIELDS, IMAGE_POINT_FIELDS, POSITION, OPK_WORDS = (
    "id path",
    "im id x y",
    "x y z",
    "omega phi kappa",
)
SIGMA_FIELDS = {"sxyz": (0, 1, 2), "sxy": (0, 1), "sx": (0,), "sy": (1,), "sz": (2,)}
"""Columns and attributes of standard deviations with the coordinates that they are of."""
# standard deviation (m) of a ground point without one: DBAT holds it, 1 um does the same
FIXED_M = 1e-6
MOST_OF_ONE_KIND = 5  # zeros that stand for a missing K or P: one more than can be, to be refused
DEFAULT_SETTINGS = {"cc": "", "pp": "default", "aspect": "1", "skew": "0", "K": "", "P": ""}
"""Elements of <camera> that may lack, or be 'default'; cc is <focal> then, K and P are zeros."""
RADIANS_OF = {"degrees": np.pi / 180.0, "radians": 1.0, "gon": np.pi / 200.0}
BACKWARD_MODEL = "3"
ESTIMATED = {  # elements of <io>, and the parameters that they switch
    "cc": ("f",),
    "pp": ("cx", "cy"),
    "px": ("cx",),
    "py": ("cy",),
    "aspect": ("b1",),
    "skew": ("b2",),
    "P": ("p1", "p2"),
    "P1": ("p1",),
    "P2": ("p2",),
    "K": ("k1", "k2", "k3", "k4"),
    "K1": ("k1",),
    "K2": ("k2",),
    "K3": ("k3",),
    "K4": ("k4",),
}


@dataclass(frozen=True)
class _Document:
    """A script or a camera file of DBAT."""

    path: Path
    root: Element

    @classmethod
    def opened(cls, path: Path, version: str) -> "_Document":
        """Open a document, whose root carries an attribute with its version."""
        of = cls(path, read_xml(path))
        if of.root.tag != "document" or version not in of.root.attrib:
            raise of.error(f"no <document {version}=...>; this is another kind of XML file")
        return of

    def error(self, problem: str) -> InputError:
        """Return the refusal of the document."""
        return InputError.in_file(self.path, problem)

    @cached_property
    def inputs(self) -> Element:
        """The element that names the tables."""
        element = self.root.find(".//input")
        if element is None:
            raise self.error("no element <input>; the script is not complete")
        return element

    def beside(self, element: Element) -> Path:
        """Return the file that an element names."""
        base = (self.inputs.get("base_dir") or "$HERE").replace("$HERE", ".").lstrip("/")
        return self.path.parent / base / text_of(element)


def read_dbat(path: Source) -> ImageBlock:
    """Read a script of DBAT and the tables that it names.

    Parameters
    ----------
    path : path
        The script, an XML file.

    Returns
    -------
    ImageBlock
        The block: parameters that the script estimates are `free`, poses that define its datum are
        `held`, images without prior orientation have NaN.

    Raises
    ------
    InputError
        The script or a table is not as data_specs/dbat.md has it.
    """
    script = _Document.opened(Path(path), "dbat_script_version")
    cameras = _cameras(script)
    if len(cameras) != 1:
        raise script.error(
            f"{len(cameras)} cameras; only scripts of one camera can be read: split the script"
        )
    ids, names = _images(script)
    order = {number: row for row, number in enumerate(ids)}
    position, C_mc = _prior(script, order)
    measurements = list(_image_points(script, order))
    control, check = (_ground(script, kind) for kind in ("ctrl_pts", "check_pts"))
    every = [points for _, points, _, _ in measurements] + [control[0], check[0]]
    points, row = np.unique(np.concatenate(every), return_inverse=True)
    rows = np.split(row, np.cumsum([len(x) for x in every])[:-1])
    return ImageBlock(
        cameras=cameras,
        images=names,
        camera=np.zeros(len(ids), dtype=np.int64),
        position_m=position,
        C_mc=C_mc,
        held=_held(script, position),
        points=tuple(str(p) for p in points),
        observations=Observations(
            np.concatenate([image for image, *_ in measurements]),
            np.concatenate(rows[:-2]),
            np.concatenate([uv for _, _, uv, _ in measurements]),
            np.concatenate([sigma for *_, sigma in measurements]),
        ),
        control=GroundPoints(rows[-2], *control[1:]),
        check=GroundPoints(rows[-1], *check[1:]),
    )


def _numbers(script: _Document, text: str | None, name: str, count: int | None = None) -> Array:
    """Return the numbers of a text with commas between them, of which there are `count`."""
    values = np.array([finite(word) for word in (text or "").split(",")])
    if (count is not None and values.size != count) or np.isnan(values).any():
        raise script.error(
            f"<{name}>: {quote(text)} is not {count or 'a list of'} numbers; {PLAIN}, with commas"
            " between several"
        )
    return values


def _tables(
    script: _Document,
    name: str,
    required: str,
    read: Callable[[Path], NumberTable | TextTable] = read_table,
) -> Iterator[tuple[NamedTable, Element, Element]]:
    """Yield the tables of one kind, each with the element <file> that names it and its parent."""
    for parent in script.inputs.findall(name):
        for element in parent.findall("file"):
            columns = [c.strip() for c in (element.get("format") or "").split(",")]
            if missing := [c for c in required.split() if c not in columns]:
                raise script.error(
                    f"<{name}> {text_of(element)}: format {','.join(columns)!r} has no column"
                    f" {', '.join(missing)}; {near(missing[0], columns)}"
                )
            table = read(script.beside(element))
            if table.layout.n_fields != len(columns):
                raise InputError.at_line(
                    table.path,
                    table.layout.first_line,
                    f"{table.layout.n_fields} fields, the script names {len(columns)}"
                    f" ({','.join(columns)}); correct its format",
                )
            index = {column: k for k, column in enumerate(columns)}
            yield NamedTable(TableSpec.exactly(required), table, index), element, parent


def _images(script: _Document) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Return numbers and names of the images, in the order of the table."""
    ids, names = [], []
    for table, _, _ in _tables(script, "images", IMAGE_FIELDS, read_text_table):
        ids.append(whole_rows(table, table.floats("id"), "image"))
        names += [Path(name).name for name in table.strings("path")]
    if not ids:
        raise script.error("no <images> with a <file>; name the list of images")
    every = np.concatenate(ids)
    if (twice := np.unique(every, return_counts=True))[1].max() > 1:
        raise script.error(f"image {twice[0][twice[1].argmax()]} is listed twice; number each once")
    return every, tuple(names)


def _row_of(table: NamedTable, ids: NDArray[np.int64], order: dict[int, int]) -> NDArray[np.int64]:
    """Return the rows of images by their numbers."""
    rows = np.array([order.get(int(i), -1) for i in ids], dtype=np.int64)
    refuse_rows(table, rows < 0, "image {} is not in the list of images; add it there", ids)
    return rows


def _prior(script: _Document, order: dict[int, int]) -> tuple[Array, Array]:
    """Return first values of position (n, 3), m, and C_mc (n, 3, 3); NaN of images without."""
    position, C_mc = np.full((len(order), 3), np.nan), np.full((len(order), 3, 3), np.nan)
    for table, element, _ in _tables(script, "prior_eo", f"id {POSITION} {OPK_WORDS}"):
        unit = element.get("units", "degrees")
        if unit not in RADIANS_OF:
            raise script.error(f"prior_eo: angles in {unit!r}; {near(unit, RADIANS_OF)}")
        rows = _row_of(table, whole_rows(table, table.floats("id"), "image"), order)
        position[rows] = table.block(POSITION)
        C_mc[rows] = rotation_from_opk(RADIANS_OF[unit] * table.block(OPK_WORDS)) @ CV_RUB
    return position, C_mc


def _image_points(
    script: _Document, order: dict[int, int]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]]:
    """Yield image rows, point numbers, pixels and their standard deviations, table by table."""
    empty = True
    for table, element, _ in _tables(script, "image_pts", IMAGE_POINT_FIELDS):
        empty = False
        images = _row_of(table, whole_rows(table, table.floats("im"), "image"), order)
        points = whole_rows(table, table.floats("id"), "point")
        if (twice := first_repeat(images, points)) is not None:
            row = twice[1]
            where = f"in image {table.floats('im')[row]:.0f}; delete one of the lines"
            raise table.error_at(row, f"point {points[row]} is measured twice {where}")
        sigma = _sigma(table, np.ones((len(images), 2)))
        for name in ("sxy", "sx", "sy"):  # attributes are of the whole file, before its columns
            if (text := element.get(name)) is None:
                continue
            if np.isnan(number := finite(text)):
                problem = f"{name}={text!r} is no number of pixels; {PLAIN}"
                raise script.error(problem)
            sigma[:, SIGMA_FIELDS[name]] = number
        yield images, points, table.block("x y"), sigma
    if empty:
        raise script.error("no <image_pts> with a <file>; name the measurements")


def _sigma(table: NamedTable, sigma: Array) -> Array:
    """Return `sigma` (n, k) with the standard deviations of a table's columns."""
    for name, coordinates in SIGMA_FIELDS.items():
        if name in table:
            sigma[:, coordinates] = table.floats(name)[:, None]
    return sigma


def _ground(script: _Document, name: str) -> tuple[NDArray[np.int64], Array, Array]:
    """Return numbers (n,), coordinates (n, 3), m, and covariances (n, 3, 3) of ground points."""
    ids, position, sigma = [], [], []
    for table, _, parent in _tables(script, name, f"id {POSITION}", read_text_table):
        number = table.floats("id")
        keep = np.ones(len(number), dtype=bool)
        for rule in parent.findall("filter"):
            listed = np.isin(number, _numbers(script, rule.get("id"), "filter"))
            if (action := text_of(rule)) not in ("keep", "remove"):
                raise script.error(f"filter {action!r}; keep or remove")
            keep &= listed if action == "keep" else ~listed
        ids.append(whole_rows(table, number, "point")[keep])
        position.append(table.block(POSITION)[keep])
        stated = _sigma(table, np.zeros((len(number), 3)))[keep]
        sigma.append(np.where(stated == 0.0, FIXED_M, stated))
    if not ids:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3))
    every = np.concatenate(sigma)
    cov = every[:, :, None] ** 2 * np.eye(3)
    return np.concatenate(ids), np.concatenate(position), cov


def _cameras(script: _Document) -> tuple[BrownCamera, ...]:
    """Return the cameras of the script, or of the file that it names."""
    cameras, free, values = [], _free(script), _initial(script.root)
    for parent in script.inputs.findall("cameras"):
        for camera in parent.findall("camera"):
            _set_initial(script, camera, values)
            cameras.append(_camera(script, camera, free))
        for element in parent.findall("file"):
            file = _Document.opened(script.beside(element), "dbat_camera_version")
            for camera in file.root.iter("camera"):
                _set_initial(script, camera, values)
                cameras.append(_camera(file, camera, free))
    return tuple(cameras)


def _initial(root: Element) -> dict[str, str]:
    """Return the values that the script sets in place of those of the camera."""
    rules = [rule for io in root.iterfind(".//set_initial_values/io") for rule in [*io] or [io]]
    return {
        rule.tag: text_of(rule) for rule in rules if text_of(rule) != "loaded" and rule.tag != "c"
    }


def _set_initial(script: _Document, camera: Element, values: dict[str, str]) -> None:
    """Set numbers of a camera, and those that lack or are 'default' as DBAT does.

    InputError for other words.
    """
    usual = DEFAULT_SETTINGS | {"cc": text_of(camera.find("focal"))}
    for key in "KP":
        listed = text_of(camera.find(key))
        count = whole(camera.findtext(f"n{key}") or "0") if not listed else listed.count(",") + 1
        usual[key] = ",".join("0" * min(max(count, 0), MOST_OF_ONE_KIND))
    if "default" in (values.get("all"), values.get("io")):
        single = {key: text for key, text in values.items() if key not in ("all", "io")}
        values = dict.fromkeys(DEFAULT_SETTINGS, "default") | single
    for key, text in usual.items():
        element = camera.find(key)
        if text and element is None:
            element = SubElement(camera, key)
            element.text = "default"
        if (
            text
            and element is not None
            and values.get(key, text_of(element)) in ("default", "focal")
        ):
            element.text = text
    for key, text in values.items():
        if text in ("default", "focal") and (usual.get(key) or key in "KP"):
            continue
        element = camera.find(key)
        if element is None or np.isnan([finite(word) for word in text.split(",")]).any():
            problem = (
                f"set_initial_values: <{key}> {quote(text)} is not given as a number in <camera>"
            )
            raise script.error(f"{problem}; write the number into <camera> and 'loaded' here")
        element.text = text


def _camera(script: _Document, camera: Element, free: dict[str, bool]) -> BrownCamera:
    """Return one camera; lengths in mm become pixels."""

    def of(key: str, count: int | None = None) -> Array:
        return _numbers(script, camera.findtext(key), key, count)

    name = text_of(camera.find("name")) or text_of(camera.find("id")) or "1"
    model, unit = text_of(camera.find("model")), text_of(camera.find("unit"))
    if model != BACKWARD_MODEL or unit != "mm":
        raise script.error(
            f"camera {name}: model {model!r} in {unit!r}; only {BACKWARD_MODEL} in mm can be read:"
            " set DBAT's camera to it and adjust again"
        )
    width, height = of("image", 2)
    if not are_whole(width, height):
        problem = f"camera {name}: <image> {width:g},{height:g} is not whole pixels"
        raise script.error(f"{problem}; correct it")
    sensor = [word.strip() for word in text_of(camera.find("sensor")).split(",")]
    size = np.array([0.0 if word == "auto" else finite(word) for word in sensor])
    if size.size != 2 or not (size > 0.0).any() or not (size >= 0.0).all():
        raise script.error(
            f"camera {name}: <sensor> {','.join(sensor)!r:.60} is not width,height in mm;"
            " correct it"
        )
    per_mm = (np.array([width, height]) / np.where(size > 0.0, size, np.inf)).max()
    with np.errstate(all="ignore"):  # a size that is no number is none of the image's
        mismatch = np.abs(size * per_mm - (width, height))
    if not (mismatch[size > 0.0] <= 0.5).all():
        raise script.error(f"camera {name}: pixels are not square; give <sensor> auto,{size[1]:g}")
    aspect, skew = of("aspect", 1)[0], of("skew", 1)[0]
    K, P = (of(key) if camera.find(key) is not None else np.zeros(0) for key in "KP")
    if K.size > 4 or P.size not in (0, 2):
        raise script.error(
            f"camera {name}: {K.size} values in <K> and {P.size} in <P>; give at most 4 in <K> and"
            " 2 (or none) in <P>"
        )
    for key, count in (("nK", K.size), ("nP", P.size)):  # K of decimal commas has more of them
        if (text := camera.findtext(key)) is not None and whole(text) != count:
            raise script.error(
                f"camera {name}: <{key}> {quote(text)}, but {count} coefficients are given; correct"
                " it"
            )
    value = dict.fromkeys(INTERIOR, 0.0)
    value["f"] = per_mm * of("cc", 1)[0]
    middle = text_of(camera.find("pp")) == "default"
    value["cx"], value["cy"] = 0.5 * np.array([width, height]) if middle else per_mm * of("pp", 2)
    value |= {f"k{k}": K[k - 1] for k in range(1, K.size + 1)}
    value |= dict(zip(("p1", "p2"), P * (1.0, -1.0) if P.size == 2 else (), strict=False))
    value |= {"b1": aspect - 1.0, "b2": -skew}
    mine = [f"k{k}" for k in range(1, K.size + 1)] + (["p1", "p2"] if P.size else [])
    taken = [p for p in INTERIOR if free.get(p) and (p[0] not in "kp" or p in mine)]
    interior = np.array([value[p] for p in INTERIOR])
    return BrownCamera(name, int(width), int(height), interior, True, float(per_mm), tuple(taken))


def _free(script: _Document) -> dict[str, bool]:
    """Return which parameters of interior orientation the script estimates."""
    wanted = script.root.find(".//set_bundle_estimate_params/io")
    free = dict.fromkeys(INTERIOR, False)
    if wanted is None:
        return free
    rules = list(wanted) or [wanted]
    for rule in rules:
        on = {"true": True, "false": False}.get(text_of(rule))
        names = INTERIOR if rule.tag in ("all", "io") else ESTIMATED.get(rule.tag)
        if on is None or names is None:
            raise script.error(
                f"set_bundle_estimate_params: <{rule.tag}>{text_of(rule)}</{rule.tag}> is not"
                f" understood; give true or false for all, {', '.join(ESTIMATED)}"
            )
        free |= dict.fromkeys(names, on)
    return free


def _held(script: _Document, position: Array) -> NDArray[np.bool_]:
    """Return which components of the poses the datum holds, (n, 6).

    "depend": the pose of one image, and of another the coordinate in which it is farthest from it.
    """
    held = np.zeros((len(position), 6), dtype=bool)
    datum = script.root.find(".//set_datum")
    if datum is None:
        return held
    text, first = datum.get("ref_cam", "1"), text_of(datum)
    base = datum.get("ref_base", "longest")
    if first != "depend" or not 0 < whole(text) <= len(position):
        raise script.error(
            f"set_datum: {first!r} of camera {text!r} cannot be read; only 'depend' with the number"
            " of an image can"
        )
    reference = whole(text) - 1
    distance = np.abs(position - position[reference])
    if not np.isfinite(distance).all():
        raise script.error(
            "set_datum: 'depend' needs a prior orientation of every image; give prior_eo"
        )
    if base != "longest":
        if not 0 < whole(base) <= len(position):
            raise script.error(f"set_datum: ref_base {base!r} is no image; name one of the block")
        return minimal_datum(position, reference, whole(base) - 1)
    return minimal_datum(position, reference)


def read_dbat_cameras(path: Source) -> tuple[BrownCamera, ...]:
    """Read the cameras of a script or of a camera file of DBAT.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    tuple of BrownCamera
        As the file has them, whatever the script sets in their place.

    Raises
    ------
    InputError
        As `read_dbat`.
    """
    of = _Document(Path(path), read_xml(path))
    return tuple(_camera(of, camera, {}) for camera in of.root.iter("camera"))
