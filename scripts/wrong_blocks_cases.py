"""The cases of wrong_blocks.py: what is planted in the files of a block, and what names it.

A plant changes a `Scene`, the content of the files that `insgnss adjust` reads, before they are
written; what has to reach the flight file before that is in its `mounting`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from insgnss import read_eo
from insgnss.geodesy.frames import TangentPlane, ecef_to_geodetic
from insgnss.geodesy.projection import MapProjection
from insgnss.geodesy.rotation import CV_RUB, opk_from_rotation, rotation_from_vector
from insgnss.io.formats.blocks.camera_toml import read_camera_toml, write_camera_toml
from insgnss.io.formats.blocks.ground_points import read_ground_points
from insgnss.io.formats.blocks.image_points import read_image_points
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.records.block import INTERIOR

BLOCK = Path("01_Observations/Camera/Block")
EO = Path("02_Processed/GPS-INS/eo.json")
FOOT_M, PITCH_MM, GEOID_M = 0.3048, 0.0039, 50.0
PARTS = ("_a.tif", "_b.tif")


@dataclass
class Scene:
    """Content of the files of a block.

    `text` holds files, by their name, that are written as they are; `options` are lines of tables
    of block.toml.
    """

    directory: Path
    flights: Path
    flight: str
    images: list[str]
    points: list[str]
    uv: np.ndarray
    sigma: np.ndarray
    ground: Any
    camera: Any
    eo: Any
    options: dict[str, list[str]] = field(default_factory=dict)
    text: dict[str, str] = field(default_factory=dict)
    with_eo: bool = True

    @classmethod
    def of(cls, directory: Path, flights: Path, flight: str) -> "Scene":
        """The content of a processed flight, `flight` of those in the directory `flights`."""
        table = read_image_points(directory / BLOCK / "image_points.csv")
        seen = table.observations
        return cls(
            directory,
            flights,
            flight,
            [table.images[k] for k in seen.image],
            [table.points[k] for k in seen.point],
            np.array(seen.uv),
            np.array(seen.sigma_px[:, 0]),
            read_ground_points(directory / BLOCK / "ground_points.csv"),
            read_camera_toml(directory / BLOCK / "camera.toml"),
            read_eo(directory / EO),
        )

    def write(self) -> None:
        """Write the files over those of the directory."""
        folder = self.directory / BLOCK
        rows = [
            f"{i},{p},{u:.4f},{v:.4f},{s:.6g}"
            for i, p, (u, v), s in zip(self.images, self.points, self.uv, self.sigma, strict=True)
        ]
        (folder / "image_points.csv").write_text("\n".join(["image,point,x,y,sigma", *rows, ""]))
        g = self.ground
        sigma = np.sqrt(np.diagonal(g.cov, axis1=1, axis2=2))
        rows = [
            f"{n},{x:.4f},{y:.4f},{z:.4f},{a:.5f},{b:.5f},{c:.5f},{'check' if k else 'control'}"
            for n, (x, y, z), (a, b, c), k in zip(
                g.points, g.position_m, sigma, g.check, strict=True
            )
        ]
        head = "point,x,y,z,sigma_x,sigma_y,sigma_z,role"
        (folder / "ground_points.csv").write_text("\n".join([head, *rows, ""]))
        write_camera_toml(self.camera, folder / "camera.toml")
        write_eo_json(self.eo, self.directory / EO)
        tables = {
            "images": [f'file = "{BLOCK}/image_points.csv"'],
            "camera": [f'file = "{BLOCK}/camera.toml"'],
            **({"aerial_control": [f'file = "{EO}"']} if self.with_eo else {}),
            "ground": [f'file = "{BLOCK}/ground_points.csv"'],
            "output": ['directory = "out"'],
        }
        for name, lines in self.options.items():
            tables[name] = [*tables.get(name, []), *lines]
        text = "\n".join("\n".join([f"[{name}]", *lines]) for name, lines in tables.items())
        (self.directory / "block.toml").write_text(text + "\n")
        for name, content in self.text.items():
            (folder / name).write_text(content)

    @property
    def size(self) -> np.ndarray:
        """Width and height, px."""
        return np.array([self.camera.width, self.camera.height], dtype=float)

    def names(self) -> list[str]:
        """Names of the images, in the order of time."""
        there = set(self.images)
        return [name for name in self.eo.images if name in there]

    def of_camera(self, **values: float) -> None:
        """Give parameters of the camera other values."""
        interior = np.array(self.camera.interior)
        for name, value in values.items():
            interior[INTERIOR.index(name)] = value
        self.camera = replace(self.camera, interior=interior)

    def of_ground(self, position: np.ndarray) -> None:
        """Give the ground points other coordinates."""
        self.ground = replace(self.ground, position_m=position)

    def keep(self, rows: np.ndarray) -> None:
        """Keep some image observations."""
        rows = np.flatnonzero(rows)
        self.images = [self.images[k] for k in rows]
        self.points = [self.points[k] for k in rows]
        self.uv, self.sigma = self.uv[rows], self.sigma[rows]


Plant = Callable[[Scene, np.random.Generator], None]


@dataclass(frozen=True)
class Case:
    """A fault: `plant` changes the files, `culprit` is the pattern of messages that name it.

    `harmless` : the result must be consistent and cover the truth. `mounting` : tables with which
    the flight is processed again before. `flights` : where it can be planted. `beyond` : why no
    data can tell it; such a case is not judged.
    """

    name: str
    plant: Plant = lambda scene, draw: None
    culprit: str = "(?!)"
    harmless: bool = False
    mounting: str = ""
    flights: tuple[str, ...] = ("ign8", "ign6x1")
    beyond: str = ""


WITH_CONTROL = ("ign8",)
ORIGIN = r"\[images\]|pixel|axes|origin|right and down"


def uv_of(change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Plant:
    """Change all image coordinates."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        scene.uv = change(scene.uv, scene.size)

    return plant


def renamed(change: Callable[[str], str]) -> Plant:
    """Change the names of the images."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        scene.images = [change(name) for name in scene.images]

    return plant


def neighbours(scene: Scene, draw: np.random.Generator) -> None:
    """Every image has the observations of the one before."""
    names = scene.names()
    after = dict(zip(names, [*names[1:], names[0]], strict=True))
    scene.images = [after[name] for name in scene.images]


def reverse_order(scene: Scene, draw: np.random.Generator) -> None:
    """Images are numbered from the last to the first."""
    names = scene.names()
    other = dict(zip(names, names[::-1], strict=True))
    scene.images = [other[name] for name in scene.images]


def two_images(scene: Scene, draw: np.random.Generator) -> None:
    """Two images are exchanged."""
    names = scene.names()
    pair = {names[10]: names[20], names[20]: names[10]}
    scene.images = [pair.get(name, name) for name in scene.images]


def foreign_points(scene: Scene, draw: np.random.Generator) -> None:
    """The observations of one image are random."""
    mine = np.array([name == scene.names()[10] for name in scene.images])
    scene.uv[mine] = draw.uniform(0.0, 1.0, (int(mine.sum()), 2)) * scene.size


def eo_of_one(scene: Scene, draw: np.random.Generator) -> None:
    """One image has the pose of a second later."""
    k = list(scene.eo.images).index(scene.names()[10])
    position = np.array(scene.eo.position_m)
    position[k] += scene.eo.velocity_mps[k]
    scene.eo = replace(scene.eo, position_m=position)


def delay(seconds: float) -> Plant:
    """All exposures lag behind their stamps."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        eo = scene.eo
        C = rotation_from_vector(-seconds * eo.rate_radps) @ eo.C_mc
        scene.eo = replace(eo, position_m=eo.position_m - seconds * eo.velocity_mps, C_mc=C)

    return plant


def eo_shifted(*metres: float) -> Plant:
    """The whole orientation is shifted, such as by the base of another datum."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        scene.eo = replace(scene.eo, position_m=scene.eo.position_m + np.array(metres))

    return plant


def lever(*metres: float) -> Plant:
    """The lever arm is another, camera axes."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        eo = scene.eo
        scene.eo = replace(eo, position_m=eo.position_m + eo.C_mc @ np.array(metres))

    return plant


def attitude(change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    """Change the attitudes of the orientation."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        scene.eo = replace(scene.eo, C_mc=change(scene.eo.C_mc))

    return plant


def from_opk(opk: np.ndarray, order: str) -> np.ndarray:
    """Attitudes of omega, phi, kappa that somebody composed in an order of their own."""
    turns = {
        axis: rotation_from_vector(np.eye(3)[k] * opk[:, k : k + 1]) for k, axis in enumerate("opk")
    }
    C = turns[order[0]] @ turns[order[1]] @ turns[order[2]]
    return C @ CV_RUB.T


def another_flight(scene: Scene, draw: np.random.Generator) -> None:
    """The poses are those of another flight over the area, with the same names."""
    eo = scene.eo
    other = "ign6x1" if scene.flight == "ign8" else "ign8"
    other_eo = read_eo(scene.flights / other / EO)
    rows = np.arange(len(eo.images)) % len(other_eo.images)
    scene.eo = replace(eo, position_m=other_eo.position_m[rows], C_mc=other_eo.C_mc[rows])


def small_covariance(scene: Scene, draw: np.random.Generator) -> None:
    """The orientation says a tenth of its standard deviations."""
    scene.eo = replace(scene.eo, cov=scene.eo.cov / 100.0, cross=scene.eo.cross / 100.0)
    scene.options["aerial_control"] = ['covariance = "chain"']


def covariance_of_another_run(scene: Scene, draw: np.random.Generator) -> None:
    """eo_covariance.npz is of another run."""
    scene.eo = replace(scene.eo, cov=scene.eo.cov * 1.3)


def sigma_times(factor: float) -> Plant:
    """Standard deviations of image observations are others."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        scene.sigma = scene.sigma * factor

    return plant


def gross(share: float) -> Plant:
    """Some observations are off by 10 to 100 px."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        n = len(scene.uv)
        off = draw.uniform(10.0, 100.0, n) * (draw.random(n) < share)
        angle = draw.uniform(0.0, 2.0 * np.pi, n)
        moved = scene.uv + off[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        scene.uv = np.clip(moved, 0.0, scene.size)

    return plant


def seen_once(scene: Scene, draw: np.random.Generator) -> None:
    """No two images have a tie point in common."""
    scene.points = [
        p if p in scene.ground.points else f"{p}_{i}"
        for i, p in zip(scene.images, scene.points, strict=True)
    ]


def targets_only(scene: Scene, draw: np.random.Generator) -> None:
    """No tie points."""
    scene.keep(np.array([name in scene.ground.points for name in scene.points]))


def in_two(scene: Scene, draw: np.random.Generator) -> None:
    """Two halves have no point in common."""
    names = scene.names()
    first = set(names[: len(names) // 2])
    scene.points = [
        p if p in scene.ground.points else f"{p}{PARTS[i in first][1]}"
        for i, p in zip(scene.images, scene.points, strict=True)
    ]


def without_eo(scene: Scene, draw: np.random.Generator) -> None:
    """No aerial control."""
    scene.with_eo = False


def apart_without_eo(scene: Scene, draw: np.random.Generator) -> None:
    """Two parts, of which one has no ground control, and no aerial control."""
    in_two(scene, draw)
    names = scene.names()
    second = set(names[len(names) // 2 :])
    scene.keep(
        np.array(
            [
                not (p in scene.ground.points and i in second)
                for i, p in zip(scene.images, scene.points, strict=True)
            ]
        )
    )
    scene.with_eo = False


def few_images(n: int) -> Plant:
    """Some images alone have observations."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        some = scene.names()[10 : 10 + n]
        scene.keep(np.array([name in some for name in scene.images]))

    return plant


def one_row(scene: Scene, draw: np.random.Generator) -> None:
    """Measured in a narrow band across the middle of every image."""
    scene.keep(np.abs(scene.uv[:, 1] - 1920.0) < 150.0)


def few_ties(scene: Scene, draw: np.random.Generator) -> None:
    """One point in five."""
    names = sorted(set(scene.points) - set(scene.ground.points))
    some = set(draw.permutation(names)[: len(names) // 5]) | set(scene.ground.points)
    scene.keep(np.array([name in some for name in scene.points]))


def camera_of(change: Callable[[Scene], None], hold: bool = False) -> Plant:
    """Change the camera."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        change(scene)
        if hold:
            scene.camera = replace(scene.camera, free=())

    return plant


def interior(hold: bool = False, **factor: float) -> Plant:
    """Parameters of the camera times a factor."""

    def change(scene: Scene) -> None:
        scene.of_camera(**{k: scene.camera.of(k) * f for k, f in factor.items()})

    return camera_of(change, hold)


def swapped_decentring(scene: Scene) -> None:
    """p1 and p2 are exchanged, and large enough to matter."""
    scene.of_camera(p1=scene.camera.of("p2"), p2=scene.camera.of("p1"))


def from_centre(scene: Scene) -> None:
    """The principal point counts from the middle of the image."""
    half = scene.size / 2.0
    scene.of_camera(cx=scene.camera.of("cx") - half[0], cy=scene.camera.of("cy") - half[1])


def other_size(factor: float, turn: bool = False) -> Callable[[Scene], None]:
    """The camera of another format."""

    def change(scene: Scene) -> None:
        c = scene.camera
        width, height = int(c.width * factor), int(c.height * factor)
        scene.camera = replace(c, width=height if turn else width, height=width if turn else height)
        if turn:
            scene.of_camera(cx=c.of("cy"), cy=c.of("cx"))
        else:
            scene.of_camera(**{k: factor * c.of(k) for k in ("f", "cx", "cy")})

    return change


def backward(scene: Scene) -> None:
    """The polynomial of a forward camera as that of a backward one."""
    c = scene.camera
    scene.camera = replace(c, backward=True, unit_px=c.of("f"))
    scene.of_camera(b1=0.0, b2=0.0)


def ground_of(change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    """Change the coordinates of all ground points."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        scene.of_ground(change(np.array(scene.ground.position_m)))

    return plant


def one_point(*metres: float) -> Plant:
    """One ground control point is off."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        position = np.array(scene.ground.position_m)
        position[2] += metres
        scene.of_ground(position)

    return plant


def two_points(scene: Scene, draw: np.random.Generator) -> None:
    """Two ground points have each other's names."""
    names = list(scene.ground.points)
    names[1], names[2] = names[2], names[1]
    scene.ground = replace(scene.ground, points=tuple(names))


def marked_wrong(scene: Scene, draw: np.random.Generator) -> None:
    """A target is marked 30 px off in one image."""
    scene.uv[scene.points.index("G03")] += [24.0, 18.0]


def targets_off(scene: Scene, draw: np.random.Generator) -> None:
    """Targets were measured by a program of another pixel origin: 4 px, a frame of the sensor."""
    mine = np.array([name in scene.ground.points for name in scene.points])
    scene.uv[mine] += 4.0


def poor_survey(scene: Scene, draw: np.random.Generator) -> None:
    """Ground points are good to 3 cm and say 1 mm."""
    shape = scene.ground.position_m.shape
    scene.ground = replace(
        scene.ground,
        position_m=scene.ground.position_m + 0.03 * draw.standard_normal(shape),
        cov=np.broadcast_to(1e-6 * np.eye(3), (*shape, 3)).copy(),
    )


def in_crs(stated: str, crs: str = "EPSG:32632", **change: float) -> Plant:
    """Ground points stand in a CRS, and another one is stated."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        plane = TangentPlane(*scene.eo.origin)
        ecef = plane.origin_ecef + scene.ground.position_m @ plane.C_em.T
        position = np.array(MapProjection(crs).forward(*ecef_to_geodetic(ecef)))
        position[:, 2] += change.get("up", 0.0)
        if change.get("exchanged"):
            position = position[:, [1, 0, 2]]
        scene.of_ground(position)
        if stated:
            scene.options["ground"] = [f'crs = "{stated}"']

    return plant


def all_check(scene: Scene, draw: np.random.Generator) -> None:
    """No ground control."""
    scene.ground = replace(scene.ground, check=np.ones(len(scene.ground.points), dtype=bool))


def no_check(scene: Scene, draw: np.random.Generator) -> None:
    """All points are ground control."""
    scene.ground = replace(scene.ground, check=np.zeros(len(scene.ground.points), dtype=bool))


def some_control(n: int) -> Plant:
    """Only some points are control."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        check = np.array(scene.ground.check)
        check[n:] = True
        scene.ground = replace(scene.ground, check=check)

    return plant


def table(change: Callable[[list[str]], list[str]], name: str = "image_points.csv") -> Plant:
    """Change the lines of a table."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        scene.write()
        lines = (scene.directory / BLOCK / name).read_text().splitlines()
        scene.text[name] = "\n".join(change(lines)) + "\n"

    return plant


def both(*plants: Plant) -> Plant:
    """Several faults."""

    def plant(scene: Scene, draw: np.random.Generator) -> None:
        for one in plants:
            one(scene, draw)

    return plant


def held(scene: Scene, draw: np.random.Generator) -> None:
    """The camera is held."""
    scene.camera = replace(scene.camera, free=())


def true_camera_held(scene: Scene, draw: np.random.Generator) -> None:
    """The camera is the true one and is held."""
    scene.camera = replace(read_camera_toml(scene.directory / "truth/camera.toml"), free=())


NAMES, ORDER = r"no image of", r"images? .*(another|each other|next|exchanged|order)"
CAMERA_WRONG = r"interior orientation|camera"
CASES = (
    Case("nothing wrong", harmless=True),
    Case("names in upper case", renamed(str.upper), harmless=True),
    Case("names as paths of Windows", renamed(lambda n: f"D:\\f\\{n}"), harmless=True),
    Case("names without ending", renamed(lambda n: n.split(".")[0]), harmless=True),
    Case("true camera, held", true_camera_held, harmless=True),
    Case("no ground control", all_check, harmless=True),
    Case("three control points", some_control(3), harmless=True, flights=WITH_CONTROL),
    Case("one tie point in five", few_ties, harmless=True),
    Case("2 % gross errors", gross(0.02), harmless=True),
    Case("two images alone", few_images(2), harmless=True),
    Case("six images alone", few_images(6), harmless=True),
    Case("two parts without a common point", in_two, harmless=True),
    Case("targets alone, no tie point", targets_only, harmless=True),
    Case("points in a band of each image", one_row, harmless=True),
    Case("image sigmas 10 times too large", sigma_times(10.0), harmless=True),
    Case("image sigmas a third of the truth", sigma_times(1 / 3.0), harmless=True),
    Case("CRS stated", in_crs("EPSG:32632"), harmless=True),
    Case(
        "bore-sight 2 deg wrong",
        mounting="boresight_deg = { opk = [2.0, -1.0, 1.5] }",
        culprit=r"bore-sight differs",
    ),
    Case(
        "bore-sight turned by 180 deg",
        attitude(lambda C: C @ np.diag([-1.0, -1.0, 1.0])),
        culprit=r"bore-sight|turned by 180|rotated by 180",
    ),
    Case("lever arm 20 cm wrong along the flight", lever(0.2, 0.0, 0.0), culprit="lever arm"),
    Case(
        "lever arm 20 cm wrong upwards",
        lever(0.0, 0.0, 0.2),
        culprit="lever arm|check points lie",
        flights=WITH_CONTROL,
    ),
    Case("exposures 10 ms late", delay(0.010), culprit="delay"),
    Case("exposures 50 ms late", delay(0.050), culprit="delay"),
    Case("exposures 200 ms late", delay(0.200), culprit="delay"),
    Case("exposures 1 s late", delay(1.0), culprit="delay"),
    Case("unknown image names", renamed(lambda n: f"DSC_{n}"), culprit="no image of"),
    Case("each image named as its neighbour", neighbours, culprit=ORDER),
    Case("images numbered backwards", reverse_order, culprit=ORDER),
    Case("two images exchanged", two_images, culprit=r"[68]0\d\d\.tif"),
    Case("one image with points of another scene", foreign_points, culprit=r"[68]0\d\d\.tif"),
    Case("one image's pose off by 1 s", eo_of_one, culprit=r"[68]0\d\d\.tif"),
    Case(
        "eo.json of another flight",
        another_flight,
        culprit="another flight|none of .* fits|do not belong",
    ),
    Case(
        "eo.json in camera axes right up back",
        attitude(lambda C: C @ CV_RUB),
        culprit="attitude|axes|about its x axis",
    ),
    Case(
        "eo.json with transposed matrices",
        attitude(lambda C: C.swapaxes(1, 2)),
        culprit="attitude|axes|transposed",
    ),
    Case(
        "omega phi kappa composed backwards",
        attitude(lambda C: from_opk(opk_from_rotation(C @ CV_RUB), "kpo")),
        culprit="attitude|axes|kappa",
    ),
    Case(
        "omega phi kappa in degrees for radians",
        attitude(lambda C: from_opk(np.degrees(opk_from_rotation(C @ CV_RUB)), "opk")),
        culprit="attitude|axes|degrees",
    ),
    Case(
        "eo.json 0.5 m off in height",
        eo_shifted(0, 0, 0.5),
        culprit="shift|check points lie",
        flights=WITH_CONTROL,
    ),
    Case("eo.json says a tenth of its sigmas", small_covariance, culprit="aerial control"),
    Case(
        "eo_covariance.npz of another run",
        covariance_of_another_run,
        culprit="does not belong to this eo.json",
    ),
    Case(
        "y mirrored",
        uv_of(lambda uv, s: np.column_stack([uv[:, 0], s[1] - uv[:, 1]])),
        culprit="y counted upwards",
    ),
    Case(
        "x mirrored",
        uv_of(lambda uv, s: np.column_stack([s[0] - uv[:, 0], uv[:, 1]])),
        culprit="x counted from the right",
    ),
    Case(
        "x and y exchanged, square part",
        both(
            lambda scene, draw: scene.keep(scene.uv[:, 0] < 3840.0),
            uv_of(lambda uv, s: uv[:, ::-1]),
        ),
        culprit="exchanged",
    ),
    Case("x and y exchanged", uv_of(lambda uv, s: uv[:, ::-1]), culprit="exchanged"),
    Case("images turned by 180 deg", uv_of(lambda uv, s: s - uv), culprit=r"180|turned|mirrored"),
    Case(
        "images turned by 90 deg",
        uv_of(lambda uv, s: np.column_stack([s[1] - uv[:, 1], uv[:, 0]])),
        culprit=r"exchanged|turned",
    ),
    Case("pixels from the middle", uv_of(lambda uv, s: uv - s / 2.0), culprit="middle|centre"),
    Case(
        "pixels from the middle, y up",
        uv_of(lambda uv, s: (uv - s / 2.0) * [1, -1]),
        culprit="middle|centre",
    ),
    Case("pixel origin off by a half", uv_of(lambda uv, s: uv - 0.5), harmless=True),
    Case(
        "pixel origin off by a half, camera held",
        both(true_camera_held, uv_of(lambda uv, s: uv - 0.5)),
        beyond="the bore-sight takes it: attitudes are those of the camera that is stated",
        flights=WITH_CONTROL,
    ),
    Case(
        "millimetres for pixels", uv_of(lambda uv, s: uv * PITCH_MM), culprit="pixels|mm|millimet"
    ),
    Case(
        "millimetres from the middle, y up",
        uv_of(lambda uv, s: (uv - s / 2.0) * [PITCH_MM, -PITCH_MM]),
        culprit="middle|mm|millimet",
    ),
    Case("normalised from 0 to 1", uv_of(lambda uv, s: uv / s), culprit="pixels|normalised"),
    Case(
        "image sigmas 10 times too small",
        sigma_times(0.1),
        culprit="image observations have .* times",
    ),
    Case("30 % gross errors", gross(0.3), culprit="rejected as gross errors"),
    Case("points seen once", seen_once, culprit="once|two images|in common"),
    Case(
        "table lines twice", table(lambda rows: [*rows, rows[7]]), culprit=r":\d+: .*measured twice"
    ),
    Case("empty table", table(lambda rows: rows[:1]), culprit="image_points.csv"),
    Case(
        "NaN in the table",
        table(
            lambda rows: [*rows[:9], ",".join([*rows[9].split(",")[:2], "nan,nan,0.5"]), *rows[10:]]
        ),
        culprit=r"image_points.csv:\d+",
    ),
    Case(
        "text in a number",
        table(lambda rows: [*rows[:9], rows[9].replace(".", "o"), *rows[10:]]),
        culprit=r"image_points.csv:\d+",
    ),
    Case(
        "column missing",
        table(lambda rows: [",".join(r.split(",")[:3]) for r in rows]),
        culprit="image_points.csv",
    ),
    Case("camera constant in mm", interior(f=PITCH_MM), culprit=r"f 21|camera constant|mm"),
    Case("principal point from the middle", camera_of(from_centre), culprit="principal point|cx"),
    Case("camera constant 20 % off, held", interior(f=1.2, hold=True), culprit=CAMERA_WRONG),
    Case(
        "camera constant 20 % off, estimated", interior(f=1.2), harmless=True, flights=WITH_CONTROL
    ),
    Case("k1 with the other sign, held", interior(k1=-1.0, hold=True), culprit=CAMERA_WRONG),
    Case(
        "p1 and p2 exchanged, held", camera_of(swapped_decentring, hold=True), culprit=CAMERA_WRONG
    ),
    Case(
        "forward for backward polynomial, held",
        camera_of(backward, hold=True),
        culprit=CAMERA_WRONG,
    ),
    Case(
        "camera file of half the size",
        camera_of(other_size(0.5)),
        culprit="half|outside the image|size",
    ),
    Case(
        "camera file of twice the size",
        camera_of(other_size(2.0)),
        culprit="camera .*(size|format|other)|part of the image",
    ),
    Case(
        "camera file of turned images",
        camera_of(other_size(1.0, True)),
        culprit="outside the image|turned|exchanged",
    ),
    Case(
        "easting and northing exchanged",
        ground_of(lambda X: X[:, [1, 0, 2]]),
        culprit="exchanged|ground",
    ),
    Case(
        "easting and northing exchanged in a CRS",
        in_crs("EPSG:32632", exchanged=1.0),
        culprit="exchanged",
    ),
    Case("CRS not stated", in_crs(""), culprit="CRS"),
    Case("zone of another CRS", in_crs("EPSG:32633"), culprit="CRS"),
    Case(
        "heights by the geoid, 50 m",
        ground_of(lambda X: X - [0.0, 0.0, GEOID_M]),
        culprit="heights?|geoid",
    ),
    Case(
        "ground 0.5 m off in a CRS",
        ground_of(lambda X: X + [0.4, -0.3, 0.0]),
        culprit="shift of (ground|check)",
    ),
    Case(
        "ground 0.5 m off in a CRS, no check points",
        both(ground_of(lambda X: X + [0.4, -0.3, 0.0]), no_check),
        culprit="shift of ground|ground control",
        flights=WITH_CONTROL,
    ),
    Case("feet for metres", ground_of(lambda X: X / FOOT_M), culprit="feet|scale|unit"),
    Case("heights in feet", ground_of(lambda X: X / [1, 1, FOOT_M]), culprit="feet|height|scale"),
    Case("up is down", ground_of(lambda X: X * [1, 1, -1]), culprit="height|sign"),
    Case("two ground points exchanged", two_points, culprit="G02|G03"),
    Case("a ground control point 0.5 m off", one_point(0.3, 0.4, 0.0), culprit="G03"),
    Case("a ground control point 10 cm off in height", one_point(0.0, 0.0, 0.1), culprit="G03"),
    Case("a target marked 30 px off in one image", marked_wrong, culprit="G03"),
    Case(
        "targets measured from another pixel origin, 4 px",
        targets_off,
        culprit="ground control|check points lie",
    ),
    Case(
        "survey good to 3 cm says 1 mm",
        poor_survey,
        culprit="ground control contradicts|check points lie",
    ),
    Case(
        "two parts, one without control, no eo.json",
        apart_without_eo,
        culprit=r"image \S+ and|initial position and attitude",
        flights=WITH_CONTROL,
    ),
    Case(
        "no eo.json, few control points",
        without_eo,
        culprit="initial position and attitude",
        flights=WITH_CONTROL,
    ),
    Case(
        "no eo.json, no control",
        both(without_eo, all_check),
        culprit="neither aerial control nor ground control",
    ),
)
