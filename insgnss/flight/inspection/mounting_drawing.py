"""A drawing of the mounting: axes of body and camera, and the lever arms, from above and the side.

The draft of a flight file has it as a comment in letters, the page of the inspection as a picture.
Both are drawn of the numbers themselves: camera axis i in body axes is row i of `camera_from_body`
T, and a vector a of the camera is T^T a in body axes (forward, right, down).
"""

import numpy as np
from numpy.typing import ArrayLike

from ...records import Array

BODY_DIRECTIONS = ("forward", "backward", "right", "left", "down", "up")
DRAWN_CAMERA_AXES = ("x, image right", "y, image down", "z, view")
COLOURS = {"axes": "#888888", "camera": "#0b6fc2", "antenna": "#c2410b", "imu": "#2e8b57"}
VIEW_PX, MARGIN = 260, 40  # of one view, pixels
ARROW = 0.32  # of a view's size, of the axes
MARKER = 5  # radius of a mark, pixels
REACH = 0.38  # of a view's size, of the longest lever arm


def direction_of(vector: ArrayLike) -> str:
    """Return the direction of the body that a vector in body axes is nearest to."""
    v = np.asarray(vector, dtype=np.float64)
    k = int(np.argmax(np.abs(v)))
    return BODY_DIRECTIONS[2 * k + (0 if v[k] > 0.0 else 1)]


def camera_axes(camera_from_body: ArrayLike) -> dict[str, str]:
    """Return the direction of each axis of the camera in words, by its name."""
    rows = np.asarray(camera_from_body, dtype=np.float64)
    return {name: direction_of(row) for name, row in zip(DRAWN_CAMERA_AXES, rows, strict=True)}


def drawn_in_letters(
    camera_from_body: ArrayLike, antenna_m: ArrayLike, imu_m: ArrayLike
) -> tuple[str, ...]:
    """Return the drawing as lines of text.

    Parameters
    ----------
    camera_from_body : array_like, shape (3, 3)
        T.
    antenna_m, imu_m : array_like, shape (3,)
        From the camera's projection centre, camera axes, m.
    """
    axes = {direction: name for name, direction in camera_axes(camera_from_body).items()}
    axis_of = {name: f"[{axes[name]}]" if name in axes else "" for name in BODY_DIRECTIONS}
    vertical = next((name for name in ("down", "up") if axis_of[name]), "")
    lines = [
        "Seen from above; C is the camera's projection centre, [] are axes of the camera:",
        "",
        f"                    forward    {axis_of['forward']}",
        "                       ^",
        "                       |",
        f"{axis_of['left']:>16}  <----C---->  {axis_of['right']}",
        "             left      |      right",
        "                       v",
        f"                    backward   {axis_of['backward']}",
        "",
        f"{axis_of[vertical]} points {vertical}."
        if vertical
        else "No axis of the camera is vertical.",
    ]
    for name, vector in (("antenna_m", antenna_m), ("imu_m", imu_m)):
        lines.append(f"{name}: {in_words(camera_from_body, vector)}")
    return tuple(line.rstrip() for line in lines)


def in_words(camera_from_body: ArrayLike, vector: ArrayLike) -> str:
    """Return how far a place is forward, right and down of the camera, in words."""
    T, a = (np.asarray(values, dtype=np.float64) for values in (camera_from_body, vector))
    if not a.any():
        return "at the camera, as no value is given; measure the vector from the lens"
    b = T.T @ a
    sentences = [
        f"{abs(x):.3f} m {BODY_DIRECTIONS[2 * k + (0 if x > 0.0 else 1)]}"
        for k, x in enumerate(b)
        if abs(x) >= 5e-4
    ]
    return f"{', '.join(sentences) or '0 m'} of the camera"


def drawn_as_svg(camera_from_body: ArrayLike, antenna_m: ArrayLike, imu_m: ArrayLike) -> str:
    """Return the drawing as SVG: the view from above and the view from the right side.

    Parameters
    ----------
    camera_from_body : array_like, shape (3, 3)
        T.
    antenna_m, imu_m : array_like, shape (3,)
        From the camera's projection centre, camera axes, m.
    """
    T = np.asarray(camera_from_body, dtype=np.float64)
    places = {
        "antenna": T.T @ np.asarray(antenna_m, dtype=np.float64),
        "imu": T.T @ np.asarray(imu_m, dtype=np.float64),
    }
    longest = max(float(np.linalg.norm(b)) for b in places.values())
    scale = REACH * VIEW_PX / longest if longest > 0.0 else 0.0
    # rows: how pixels go right and down with forward, right, down
    above = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    side = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    width, height = 2 * VIEW_PX + 3 * MARGIN, VIEW_PX + 2 * MARGIN
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img"'
        f' width="{width}" height="{height}" font-family="sans-serif" font-size="11"'
        f' aria-label="mounting of camera, antenna and IMU">'
    ]
    for k, (title, view) in enumerate((("from above", above), ("from the right side", side))):
        centre = np.array([MARGIN + k * (VIEW_PX + MARGIN) + VIEW_PX / 2, MARGIN + VIEW_PX / 2])
        parts += _view(title, view, centre, T, places, scale)
    return "".join([*parts, "</svg>\n"])


def _view(
    title: str, view: Array, centre: Array, T: Array, places: dict[str, Array], scale: float
) -> list[str]:
    """Return the SVG elements of one view: axes, camera axes and mounted sensors."""
    centre_x, centre_y = centre
    elements = [f'<text x="{centre_x:.0f}" y="16" text-anchor="middle">{title}</text>']
    for k, name in enumerate(("forward", "right", "down")):
        elements += _arrow(view @ np.eye(3)[k], centre, name, COLOURS["axes"], 1.25)
    for row, name in zip(T, "xyz", strict=True):
        elements += _arrow(view @ row, centre, f"{name} camera", COLOURS["camera"], 0.75)
    for name, position_b in places.items():
        end_x, end_y = centre + scale * (view @ position_b)
        elements.append(
            f'<line x1="{centre_x:.1f}" y1="{centre_y:.1f}" x2="{end_x:.1f}" y2="{end_y:.1f}"'
            f' stroke="{COLOURS[name]}" stroke-dasharray="3 3"/>'
            f'<circle cx="{end_x:.1f}" cy="{end_y:.1f}" r="{MARKER}" fill="{COLOURS[name]}"/>'
            f'<text x="{end_x + 8:.1f}" y="{end_y + (14 if name == "imu" else -6):.1f}"'
            f' fill="{COLOURS[name]}">{name} {np.linalg.norm(position_b):.3f} m</text>'
        )
    return elements


def _arrow(direction: Array, centre: Array, name: str, colour: str, length: float) -> list[str]:
    """A line from the centre with its name; nothing for what points along the view."""
    if np.linalg.norm(direction) < 0.2:
        return []
    (x, y), (px, py) = centre, centre + length * ARROW * VIEW_PX * direction
    return [
        f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{px:.1f}" y2="{py:.1f}" stroke="{colour}"'
        ' stroke-width="2"/>',
        f'<circle cx="{px:.1f}" cy="{py:.1f}" r="2.5" fill="{colour}"/>',
        f'<text x="{px + 5:.1f}" y="{py - 4:.1f}" fill="{colour}">{name}</text>',
    ]
