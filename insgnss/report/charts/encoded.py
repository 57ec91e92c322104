"""Charts as the text of a page: JSON whose arrays are float32 or steps of uint16 in base64.

    {"report_sha256": "...", "arrays": ["...", {"low": 0.1, "step": 2e-5, "steps": "..."}, ...],
     "texts": [["...", ...], ...],
     "charts": [{"name": ..., "panels": [{"label": ..., "layers": [{"kind": ..., "x": 0, ...}]}]}]}

x, y, x2, y2, value and texts of a layer are places in the two lists, in which each array and each
list of texts stands once. Fields that have their default are left out. float32 resolves a day of
minutes to 4 ms, and 10 km to 1 mm. Long arrays are 65 534 equal steps from their smallest to their
largest value (65 535 for what is not a number) where such a step is a thousandth of what half of
the values span, and, where all are positive, half a percent of the smallest: a twentieth of a
pixel, on a logarithmic scale a tenth. It halves the page.

The text may stand within a script element as it is: no character in it has a meaning to HTML.
"""

import base64
import io
import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from ...base.errors import InputError
from .chart import Array, Background, Chart, Layer, Panel, Shade

CHARTS_KEY = "charts"  # id of the script element that holds the text
LONG = 64  # values: shorter arrays are float32
NOT_FINITE = 65535  # code of a value that is not finite; the others count steps from the lowest
FINE_STEP, FINE_SHARE = 1e-3, 5e-3  # of the span of half of the values; of the smallest one
# bytes of the JPEG below a map: more than the rest of the page would make it slow to send by mail
LARGEST_JPEG_BYTES = 500_000
# of the JPEG, the first that is small enough: 1600 x 840 pixels of noise have 340 kB at the last
JPEG_QUALITIES = (80, 60, 40, 20)
_ARRAYS = ("x", "y", "x2", "y2", "value")
_UNSAFE_IN_SCRIPT = {ord(c): f"\\u{ord(c):04x}" for c in "<>&'\u2028\u2029"}


def encode_charts(charts: Iterable[Chart], report_sha256: str = "") -> str:
    """Return charts as JSON.

    Parameters
    ----------
    charts : iterable of Chart
        What a page shows.
    report_sha256 : str
        SHA-256 of the text of report.json that was written in the same run; may be empty.

    Returns
    -------
    str
        One line, safe within a script element.
    """
    arrays: dict[bytes, int] = {}
    packs: list[str | dict[str, Any]] = []
    texts: dict[tuple[str, ...], int] = {}

    def layer(of: Layer) -> dict[str, Any]:
        out = _plain(of, (*_ARRAYS, "texts"))
        for name in _ARRAYS:
            value = getattr(of, name)
            if value is not None:
                out[name] = arrays.setdefault(_bytes(value), len(arrays))
                if out[name] == len(packs):
                    packs.append(_quantised(value) or pack_array(value))
        if of.texts:
            out["texts"] = texts.setdefault(tuple(map(str, of.texts)), len(texts))
        return out

    listed = [
        _plain(chart, ("panels", "shades", "background"))
        | {
            "panels": [
                _plain(panel, ("layers",)) | {"layers": [layer(of) for of in panel.layers]}
                for panel in chart.panels
            ]
        }
        | ({"shades": [_plain(shade) for shade in chart.shades]} if chart.shades else {})
        | ({"background": _plain(chart.background)} if chart.background else {})
        for chart in charts
    ]
    content = {
        "report_sha256": report_sha256,
        "arrays": packs,
        "texts": list(texts),
        "charts": listed,
    }
    return script_safe(content)


def decode_charts(text: str) -> tuple[Chart, ...]:
    """Return the charts of a text that `encode_charts` made; their arrays have the digits of those.

    Raises
    ------
    InputError
        Where the text is none of that kind.
    """
    try:
        return _charts(json.loads(text))
    except (ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        raise InputError(f"the charts of the page cannot be read: {error!r}") from None


def in_page(page: str) -> tuple[tuple[Chart, ...], str]:
    """Return the charts of a page, and the SHA-256 of the report.json that belongs to it.

    Parameters
    ----------
    page : str
        The HTML.

    Raises
    ------
    InputError
        Where it holds no charts.
    """
    match = re.search(
        rf'<script type="application/json" id="{CHARTS_KEY}">(.*?)</script>', page, re.S
    )
    if match is None:
        raise InputError("the page holds no charts; process the flight again")
    text = match.group(1)
    return decode_charts(text), str(json.loads(text)["report_sha256"])


def pack_array(x: Array) -> str:
    """Return an array as float32, little endian, in base64."""
    return base64.b64encode(_bytes(x)).decode("ascii")


def background_of(pixels: Any, edges: tuple[float, float, float, float], name: str) -> Background:
    """Return a picture as a JPEG of at most `LARGEST_JPEG_BYTES`.

    Parameters
    ----------
    pixels : ndarray of uint8, (h, w, 3)
        The picture.
    edges : tuple of float
        West, south, east and north in the map's axes.
    name : str
        What it shows, or its file.
    """
    from PIL import Image

    picture, stream = Image.fromarray(pixels), io.BytesIO()
    for quality in JPEG_QUALITIES:
        stream = io.BytesIO()
        picture.save(stream, "JPEG", quality=quality)
        if stream.tell() <= LARGEST_JPEG_BYTES:
            break
    return Background(base64.b64encode(stream.getvalue()).decode("ascii"), *edges, name)


def is_jpeg(text: str) -> bool:
    """Tell whether a text is a JPEG in base64 that can be read."""
    from PIL import Image

    try:
        with Image.open(
            io.BytesIO(base64.b64decode(text, validate=True)), formats=["JPEG"]
        ) as image:
            image.load()
    except (OSError, SyntaxError, ValueError, TypeError, Image.DecompressionBombError):
        return False
    return True


def _bytes(x: Array) -> bytes:
    return np.ascontiguousarray(x, dtype="<f4").tobytes()


def _quantised(x: Array) -> dict[str, Any] | None:
    """Return an array in steps of uint16; None where it is short or they are too coarse."""
    finite = x[np.isfinite(x)]
    if finite.size < LONG or np.isinf(x).any():
        return None
    low, quarter, three, high = np.percentile(finite, (0.0, 25.0, 75.0, 100.0))
    step = float(high - low) / (NOT_FINITE - 1)
    fine_enough = step <= FINE_STEP * (three - quarter) and (low <= 0.0 or step <= FINE_SHARE * low)
    if not fine_enough or step == 0.0:
        return None
    steps = np.where(np.isfinite(x), np.rint((x - low) / step), NOT_FINITE).astype("<u2")
    packed_steps = base64.b64encode(steps.tobytes()).decode("ascii")
    return {"low": float(low), "step": step, "steps": packed_steps}


def _unpacked(packed: str | Mapping[str, Any]) -> Array:
    if isinstance(packed, str):
        return np.frombuffer(base64.b64decode(packed), dtype="<f4").astype(np.float64)
    steps = np.frombuffer(base64.b64decode(packed["steps"]), dtype="<u2")
    values = packed["low"] + packed["step"] * steps.astype(np.float64)
    return np.where(steps == NOT_FINITE, np.nan, values)


def script_safe(value: Any) -> str:
    """Return JSON that may stand within a script element."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.translate(_UNSAFE_IN_SCRIPT)


def _plain(of: Any, but: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the fields of a record that are not those of `but` and not their defaults."""
    out = {}
    for f in fields(of):
        value = getattr(of, f.name)
        default = f.default_factory() if f.default_factory is not MISSING else f.default
        if f.name not in but and not (default is not MISSING and value == default):
            out[f.name] = _builtin(value)
    return out


def _builtin(value: Any) -> Any:
    """Return numbers of numpy as those of Python, float64 with the digits of float32."""
    if isinstance(value, tuple | list):
        return [_builtin(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{float(value):.9g}")
    return value.item() if isinstance(value, np.generic) else value


def _charts(content: Mapping[str, Any]) -> tuple[Chart, ...]:
    """Return the charts as the page's script reads them."""
    arrays = [_unpacked(packed) for packed in content["arrays"]]
    texts = [tuple(listed) for listed in content["texts"]]

    def layer(of: Mapping[str, Any]) -> Layer:
        placed = {name: arrays[of[name]] for name in _ARRAYS if name in of}
        if "texts" in of:
            placed["texts"] = texts[of["texts"]]
        return Layer(**{**of, **placed})

    return tuple(_chart(chart, layer) for chart in content["charts"])


def _chart(chart: Mapping[str, Any], layer: Callable[[Mapping[str, Any]], Layer]) -> Chart:
    panels = tuple(
        Panel(**{**panel, "layers": tuple(map(layer, panel["layers"]))} | _limits(panel))
        for panel in chart["panels"]
    )
    shades = tuple(Shade(**shade) for shade in chart.get("shades", ()))
    below = {"background": Background(**chart["background"])} if "background" in chart else {}
    return Chart(**{**chart, "panels": panels, "shades": shades} | below | _limits(chart))


def _limits(of: Mapping[str, Any]) -> dict[str, Any]:
    return {"limits": tuple(of["limits"])} if of.get("limits") is not None else {}
