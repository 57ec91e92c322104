"""targets.html: the contact sheet, every window with its prediction, its match and its verdict."""

import base64
import io
from collections.abc import Iterator, Sequence

import numpy as np

from ...report.document import Drawing, Marked, Section
from ...report.markup import escape
from .inputs import TargetInputs
from .windows import Window

TARGETS_PAGE = "targets.html"
MOST_WINDOWS = 3000
"""Windows on a page; beyond, those that stand are thinned out evenly, those rejected never."""
SHEET_CAPTION = (
    "yellow: where the point is expected, with the ellipse of three standard deviations. Green"
    " cross: where the target was measured; red cross: a match that was rejected, with the reason"
    " below. Grey values are stretched. The windows of a point should look alike: a target that"
    " sits beside its cross, or a cross on something else, is to be taken out of image_points.csv"
)
_STYLE = """<style>
main { max-width: none } .sheet { display: flex; flex-wrap: wrap; gap: .7rem }
.window { width: 190px; font-size: 12px; line-height: 1.3 }
.window svg { width: 190px; height: 190px; border: 3px solid var(--ok); background: #000;
  image-rendering: pixelated }
.window.bad svg { border-color: var(--bad) } .window.bad .why { color: var(--bad) }
</style>
"""


def sheet_sections(inputs: TargetInputs, windows: Sequence[Window]) -> Iterator[Section]:
    """Yield the contact sheet, a section a ground point, without scripts or outside files.

    Parameters
    ----------
    inputs : TargetInputs
        The flight and its ground points.
    windows : sequence of Window
        All windows.
    """
    good = [w for w in windows if w.measurement.accepted]
    room = max(MOST_WINDOWS - (len(windows) - len(good)), 200)
    keep = set(np.linspace(0, len(good) - 1, min(room, len(good))).astype(int).tolist())
    shown = {id(w) for k, w in enumerate(good) if k in keep}
    legend: list[str] = [Marked(SHEET_CAPTION, "text")]
    if len(good) > room:
        text = f"{room} of the {len(good)} windows with a measurement are shown"
        legend.append(Marked(text, "text"))
    yield Section("The windows", [Drawing(_STYLE), *legend], "page")
    for p, name in enumerate(inputs.ground.points):
        group = [w for w in windows if inputs.predictions.point[w.row] == p]
        stand = sum(w.measurement.accepted for w in group)
        group.sort(key=lambda w: w.measurement.accepted)
        drawn = (_window(inputs, w) for w in group if not w.measurement.accepted or id(w) in shown)
        sheet = f'<div class="sheet">\n{"".join(drawn)}</div>\n'
        title = f"{name}: measured in {stand} of {len(group)} images"
        yield Section(title, [Drawing(sheet)] if group else [], "page")


def _window(inputs: TargetInputs, window: Window) -> str:
    """One window as a drawing with its caption."""
    predictions, got = inputs.predictions, window.measurement
    uv = predictions.uv[window.row] - window.corner
    values, vectors = np.linalg.eigh(predictions.cov[window.row])
    a, b = 3.0 * np.sqrt(np.maximum(values[::-1], 0.0))
    turn = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    height, width = window.grey.shape
    stroke = max(width, height) / 190.0 * 1.6
    parts = [
        f'<image href="data:image/png;base64,{_png(window)}" width="{width}" height="{height}"/>',
        f'<ellipse cx="{uv[0]:.2f}" cy="{uv[1]:.2f}" rx="{a:.2f}" ry="{b:.2f}" fill="none"'
        f' stroke="#ffd400" stroke-width="{stroke:.2f}"'
        f' transform="rotate({turn:.1f} {uv[0]:.2f} {uv[1]:.2f})"/>',
    ]
    caption = [escape(inputs.eo.images[predictions.image[window.row]])]
    if got.match is not None:
        u, v = got.match.uv - window.corner
        colour, arm = ("#00e08a" if got.accepted else "#ff4d40"), 6.0 * stroke
        parts.append(
            f'<path d="M{u - arm:.2f} {v:.2f}H{u + arm:.2f}M{u:.2f} {v - arm:.2f}V{v + arm:.2f}"'
            f' stroke="{colour}" stroke-width="{stroke:.2f}"/>'
        )
        su, sv = np.sqrt(np.diagonal(got.match.cov))
        caption.append(
            f"{got.match.uv[0]:.2f} &plusmn; {su:.2f}, {got.match.uv[1]:.2f} &plusmn; {sv:.2f} px"
        )
    if got.rejected:
        caption.append(f'<span class="why">{escape(got.rejected)}</span>')
    if window.code is not None:
        caption.append(f"ring {window.code.number}")
    kind = "window" if got.accepted else "window bad"
    return (
        f'<div class="{kind}"><svg viewBox="0 0 {width} {height}">{"".join(parts)}</svg><br>'
        f"{'<br>'.join(caption)}</div>\n"
    )


def _png(window: Window) -> str:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(window.grey).save(out, "PNG")
    return base64.b64encode(out.getvalue()).decode("ascii")
