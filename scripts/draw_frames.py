"""Draw docs/images/frames_*.svg: frames, angles, lever arms, with the signs of the package.

    python scripts/draw_frames.py [--out docs/images]

No direction is drawn by hand: every arrow is what `insgnss` computes for an example (`directions`,
`turns`), and the pictures only look at it from above, from behind or from the side. A test holds
both against words.
"""

import argparse
from pathlib import Path

import numpy as np

from insgnss import Mounting, boresight_from_angles
from insgnss.geodesy.frames import rotation_em, rotation_en
from insgnss.geodesy.rotation import rotation_from_opk, rotation_from_rpy, rotation_from_ypr

OUT = Path(__file__).resolve().parents[1] / "docs" / "images"
TOP_TO_RIGHT_WING = ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
TOP_FORWARD = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
SMALL = np.radians(25.0)
BODY, CAMERA, MAP, LEVER = "#0b6fb8", "#b8480b", "#3d7a2e", "#7a2e78"


def example() -> Mounting:
    """Return the mounting of the sample data."""
    return Mounting([0.462, -0.001, -0.065], [0.113, 0.020, 0.0], TOP_TO_RIGHT_WING)


def directions(camera_from_body: object) -> dict[str, np.ndarray]:
    """Return where the camera's x, y, z point, in body axes (forward, right, down)."""
    C_cb = Mounting([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], camera_from_body).C_cb
    return {name: C_cb.T @ axis for name, axis in zip("xyz", np.eye(3), strict=True)}


def levers() -> dict[str, np.ndarray]:
    """Return places about the camera, in body axes, m: of the IMU, and of the antenna."""
    mounting = example()
    imu = -mounting.camera_lever_b
    return {"IMU": imu, "antenna": imu + mounting.antenna_lever_b, "camera": np.zeros(3)}


def turns() -> dict[str, np.ndarray]:
    """Return where a positive angle takes an axis: of roll, pitch, yaw in north, east, down; of
    omega, phi, kappa and Metashape's yaw, pitch, roll in east, north, up.
    """
    one = SMALL * np.eye(3)
    forward, right, _ = np.eye(3)
    return {
        "roll": rotation_from_rpy(one[0]) @ right,
        "pitch": rotation_from_rpy(one[1]) @ forward,
        "yaw": rotation_from_rpy(one[2]) @ forward,
        "omega": rotation_from_opk(one[0]) @ np.eye(3)[1],
        "phi": rotation_from_opk(one[1]) @ np.eye(3)[0],
        "kappa": rotation_from_opk(one[2]) @ np.eye(3)[0],
        "Metashape yaw": rotation_from_ypr(one[0]) @ np.eye(3)[1],
        "Metashape pitch": rotation_from_ypr(one[1]) @ np.eye(3)[1],
        "Metashape roll": rotation_from_ypr(one[2]) @ np.eye(3)[0],
    }


def boresight_turns() -> dict[str, np.ndarray]:
    """Return where the camera's viewing direction is in body axes, by a bore-sight of one angle."""
    axes = {}
    for k, name in enumerate(("roll", "pitch", "yaw")):
        angles = np.zeros(3)
        angles[k] = np.degrees(SMALL)
        B = boresight_from_angles("rpy", angles)
        axes[name] = Mounting([0, 0, 0], [0, 0, 0], TOP_TO_RIGHT_WING, B).C_cb.T[:, 2]
    return axes


# The views: body axes (forward, right, down) on paper; map axes (east, north, up) likewise.
ABOVE = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # forward is up on paper
FROM_LEFT = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # forward is left on paper
FROM_BEHIND = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
MAP_ABOVE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
MAP_FROM_SOUTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
MAP_FROM_EAST = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


class Panel:
    """One view: arrows of three components, drawn as they look from there."""

    def __init__(self, axes, view, title, limit=1.35):
        self.axes, self.view = axes, np.asarray(view)
        axes.set(aspect="equal", xlim=(-limit, limit), ylim=(-limit, limit))
        axes.set_title(title, fontsize=11)
        axes.axis("off")

    def arrow(self, vector, label, colour, start=(0.0, 0.0, 0.0), width=1.8, style="-"):
        a = self.view @ np.asarray(start, dtype=float)
        d = self.view @ np.asarray(vector, dtype=float)
        if np.hypot(*d) < 1e-6:
            self.axes.plot(*a, "o", ms=9, mfc="none", color=colour)
            self.axes.plot(*a, ".", ms=4, color=colour)
        else:
            properties = {"arrowstyle": "-|>", "color": colour, "lw": width, "linestyle": style}
            self.axes.annotate("", a + d, a, arrowprops=properties | {"shrinkA": 0, "shrinkB": 0})
        away = d / max(np.hypot(*d), 1e-9) if np.hypot(*d) > 1e-6 else np.array([-0.7, -0.7])
        self.axes.text(
            *(a + d + 0.16 * away), label, color=colour, ha="center", va="center", fontsize=9
        )

    def turn(self, start, end, label, colour, radius=0.72):
        """Draw the arc from one direction to another, the short way."""
        a, b = (np.arctan2(*(self.view @ v)[::-1]) for v in (start, end))
        by = (b - a + np.pi) % (2.0 * np.pi) - np.pi
        angle = a + np.linspace(0.0, by * 1.6, 40)
        path = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        self.axes.plot(*path[:-3].T, color=colour, lw=1.5)
        properties = {"arrowstyle": "-|>", "color": colour, "lw": 1.5, "shrinkA": 0, "shrinkB": 0}
        self.axes.annotate("", path[-1], path[-4], arrowprops=properties)
        self.axes.text(*(1.32 * path[-1]), label, color=colour, ha="center", fontsize=9)

    def polygon(self, points, colour="0.85", **more):
        self.axes.fill(
            *(self.view @ np.asarray(points, dtype=float).T), color=colour, zorder=0, **more
        )


PLANE = [
    (1.0, 0.0, 0.0),
    (0.75, 0.1, 0.0),
    (0.3, 0.12, 0.0),
    (0.05, 1.0, 0.0),
    (-0.15, 1.0, 0.0),
    (-0.15, 0.12, 0.0),
    (-0.75, 0.08, 0.0),
    (-0.8, 0.35, 0.0),
    (-0.95, 0.35, 0.0),
]
PLANE = [*PLANE, *[(x, -y, z) for x, y, z in PLANE[::-1]]]
SIDE = [(1.0, 0, 0.05), (0.7, 0, -0.1), (-0.7, 0, -0.08), (-0.95, 0, -0.4), (-0.95, 0, 0.06)]
BEHIND = [(0, -1, 0.03), (0, -1, -0.03), (0, 1, -0.03), (0, 1, 0.03)]


def body(plt):
    """Body axes and roll, pitch, yaw."""
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.9), layout="constrained")
    forward, right, down = np.eye(3)
    done = turns()
    above = Panel(axes[0], ABOVE, "from above: yaw (heading)")
    above.polygon(PLANE)
    above.arrow(forward, "x forward", BODY)
    above.arrow(right, "y right", BODY)
    above.arrow(down, "z down (into the page)", BODY)
    above.turn(forward, done["yaw"], "yaw +", MAP)
    side = Panel(axes[1], FROM_LEFT, "from the left: pitch")
    side.polygon(SIDE)
    side.arrow(forward, "x forward", BODY)
    side.arrow(down, "z down", BODY)
    side.turn(forward, done["pitch"], "pitch +", MAP)
    behind = Panel(axes[2], FROM_BEHIND, "from behind: roll")
    behind.polygon(BEHIND)
    behind.arrow(right, "y right", BODY)
    behind.arrow(down, "z down", BODY)
    behind.turn(right, done["roll"], "roll +", MAP)
    return figure


def camera(plt):
    """Camera axes in the aircraft, for two ways to build it in."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.8), layout="constrained")
    for ax, T, title in (
        (axes[0], TOP_TO_RIGHT_WING, "sample data (default): image top to the right wing"),
        (axes[1], TOP_FORWARD, "image top forward"),
    ):
        panel = Panel(ax, ABOVE, f"{title}\ncamera_from_body = {np.array(T).astype(int).tolist()}")
        panel.polygon(PLANE)
        to = directions(T)
        corners = [0.34 * i * to["x"] + 0.25 * j * to["y"] for i, j in _CORNERS]
        panel.polygon(corners, "#f3c9ae", alpha=0.9)
        panel.arrow(0.75 * to["x"], "x\nimage right", CAMERA)
        panel.arrow(0.75 * to["y"], "y\nimage down", CAMERA)
        panel.arrow(0.3 * to["z"], "z", CAMERA)
        panel.arrow(-0.42 * to["y"], "top", "0.3", width=1.0)
        panel.axes.text(0, 1.2, "nose", ha="center", color=BODY, fontsize=9)
    return figure


_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def lever_arms(plt):
    """Lever arms of the sample data, as entered and as the filter has them."""
    figure, axes = plt.subplots(2, 1, figsize=(9, 7.4), layout="constrained")
    places, to = levers(), directions(TOP_TO_RIGHT_WING)
    up = np.array([0.0, 0.0, -0.2])
    for ax, view, title in (
        (axes[0], np.array([[-1.0, 0, 0], [0, 1.0, 0]]), "from above, nose to the left"),
        (axes[1], FROM_LEFT, "from the left, nose to the left"),
    ):
        panel = Panel(ax, view, title)
        ax.set(xlim=(-0.3, 0.72), ylim=(-0.22, 0.28))
        for name in places:
            ax.plot(*(view @ places[name]), "o", color="black", ms=6)
            ax.text(*(view @ places[name] + [0.0, -0.035]), name, ha="center", fontsize=10)
        side = 0.05 * (to["y"] if view is not FROM_LEFT else up * 5)
        panel.arrow(0.13 * to["x"] - 2.6 * side * 0, "", CAMERA, width=1.0)
        panel.arrow(0.13 * (to["y"] if view is not FROM_LEFT else to["z"]), "", CAMERA, width=1.0)
        x_text = view @ (0.15 * to["x"])
        ax.text(*(x_text + [0.0, 0.018]), "x", color=CAMERA, fontsize=9)
        y_text = view @ (0.145 * (to["y"] if view is not FROM_LEFT else to["z"]))
        ax.text(*y_text, "y" if view is not FROM_LEFT else "z", color=CAMERA, fontsize=9)
        ax.annotate("", (-0.28, 0), (-0.14, 0), arrowprops={"arrowstyle": "-|>", "color": BODY})
        ax.text(-0.21, 0.015, "x forward", color=BODY, ha="center", fontsize=9)
        for k, (name, label, colour) in enumerate(
            (
                ("imu", "imu_m = [0.113, 0.020, 0.000]", CAMERA),
                ("antenna", "antenna_m = [0.462, -0.001, -0.065]", CAMERA),
                ("lever", "from IMU to antenna, body axes: [-0.349, 0.021, -0.065]", LEVER),
            )
        ):
            a, b = {
                "imu": (places["camera"], places["IMU"]),
                "antenna": (places["camera"], places["antenna"]),
                "lever": (places["IMU"], places["antenna"]),
            }[name]
            bend = {"imu": 0.0, "antenna": -0.25, "lever": 0.3}[name]
            properties = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 4}
            properties["connectionstyle"] = f"arc3,rad={bend}"
            ax.annotate("", view @ b, view @ a, arrowprops=properties)
            ax.text(0.02 + 0.0 * k, 0.25 - 0.035 * k, label, color=colour, fontsize=9)
    return figure


def earth(plt):
    """ECEF, north-east-down and east-north-up at one point, in the plane of its meridian."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.6), layout="constrained")
    lat = np.radians(46.5)
    panel = Panel(axes[0], [[1.0, 0, 0], [0, 0, 1.0]], "the plane of a meridian (longitude 0)", 1.7)
    t = np.linspace(0, 2 * np.pi, 200)
    panel.axes.plot(np.cos(t), 0.93 * np.sin(t), color="0.6", lw=1)
    panel.arrow([1.35, 0, 0], "X", "0.35")
    panel.arrow([0, 0, 1.35], "Z", "0.35")
    panel.arrow([0, 0.0, 0], "Y into\nthe page", "0.35")
    n = np.array([np.cos(lat), 0.0, np.sin(lat)])
    point = np.array([np.cos(lat), 0.0, 0.93 * np.sin(lat)])
    C_en, C_em = rotation_en(lat, 0.0), rotation_em(lat, 0.0)
    panel.axes.plot(*(panel.view @ np.column_stack([point - 1.0 * n, point])), ":", color="0.5")
    panel.arrow(0.55 * C_en[:, 0], "north", MAP, point)
    panel.arrow(0.55 * C_en[:, 2], "down", BODY, point)
    panel.arrow(0.55 * C_em[:, 2], "up", MAP, point)
    panel.axes.text(0.42, 0.12, "latitude", color="0.4", fontsize=9)
    plan = Panel(axes[1], MAP_ABOVE, "local axes from above")
    plan.arrow([1, 0, 0], "east\ntangent plane x, NED y", MAP)
    plan.arrow([0, 1, 0], "north: tangent plane y, NED x", MAP)
    plan.arrow([0, 0, 0], "up: tangent plane z\ndown: NED z", MAP)
    gamma = np.radians(12.0)
    grid = [np.sin(gamma), np.cos(gamma), 0]
    plan.arrow(0.8 * np.array(grid), "grid north", "0.4", width=1.0, style="--")
    plan.axes.text(0.42, 0.52, "meridian convergence", color="0.4", fontsize=9)
    return figure


def angles(plt):
    """Omega, phi, kappa and the yaw, pitch, roll of Metashape: where a positive angle turns."""
    figure, axes = plt.subplots(2, 3, figsize=(11, 7.6), layout="constrained")
    done, (x, y, _) = turns(), np.eye(3)
    rows = (
        ("omega", MAP_FROM_EAST, y, "seen from the east", ("north", "up")),
        ("phi", MAP_FROM_SOUTH, x, "seen from the south", ("east", "up")),
        ("kappa", MAP_ABOVE, x, "from above", ("east", "north")),
        ("Metashape yaw", MAP_ABOVE, y, "from above", ("east", "north")),
        ("Metashape pitch", MAP_FROM_EAST, y, "seen from the east", ("north", "up")),
        ("Metashape roll", MAP_FROM_SOUTH, x, "seen from the south", ("east", "up")),
    )
    for ax, (name, view, start, where, names) in zip(axes.flat, rows, strict=True):
        panel = Panel(ax, view, f"{name}: {where}")
        for axis, word in zip(view, names, strict=True):
            panel.arrow(axis, word, "0.6", width=1.0)
        axis = "image right" if start[0] else "image top"
        panel.arrow(done[name] * 0.95, axis, CAMERA)
        panel.turn(start, done[name], f"{name} +", MAP, 0.6)
    return figure


DRAWINGS = {
    "frames_body": body,
    "frames_camera": camera,
    "frames_lever_arms": lever_arms,
    "frames_earth": earth,
    "frames_angles": angles,
}


def main() -> None:
    """Draw them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=OUT)
    out = parser.parse_args().out
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams |= {"svg.hashsalt": "insgnss", "svg.fonttype": "none"}
    matplotlib.rcParams["font.family"] = "sans-serif"
    import matplotlib.pyplot as plt

    for name, drawn in DRAWINGS.items():
        figure = drawn(plt)
        figure.savefig(out / f"{name}.svg", metadata={"Date": None}, facecolor="white")
        plt.close(figure)
        print(f"wrote {out / name}.svg")


if __name__ == "__main__":
    main()
