"""Charts as the text of a page: the same again, small, safe within a script element."""

import base64
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.records import GnssFixes
from insgnss.report.charts.chart import Chart, Layer, Panel, Shade
from insgnss.report.charts.encoded import (
    LARGEST_JPEG_BYTES,
    background_of,
    decode_charts,
    encode_charts,
    in_page,
    is_jpeg,
)
from insgnss.report.charts.gnss import fix_series
from insgnss.report.page import write_report

SMALL = 1.5e6  # bytes of a page: what one sends by mail, and opens at once on a phone


def _chart(texts: tuple[str, ...] = ("a", "b", "c")) -> Chart:
    x = np.array([0.0, 1.0 / 3.0, 2700.0])
    layers = (
        Layer("line", x, np.array([1.0, np.nan, 3.0]), "north", "second", dashed=True, width=2.0),
        Layer("band", x, x - 1.0, y2=x + 1.0, faint=True),
        Layer("points", x, x, "image", mark="ring", value=x, value_name="sigma", texts=texts),
        Layer("rules", np.zeros(0), np.array([3.0])),
        Layer("arrows", x, x, x2=x + 1.0, y2=x - 1.0),
    )
    panel = Panel("north, mm", layers, scale="log", limits=(0.1, 10.0))
    shades = (Shade(0.0, 1.5, "line", "1"), Shade(2.0, 3.0, "outage"))
    return Chart(
        *("motion", "How it <moved>", "Read & see.", (panel,), "minutes"),
        link="time",
        shades=shades,
        limits=(0.0, 5.0),
        columns=2,
        background=background_of(np.zeros((2, 3, 3), np.uint8), (-5.5, 0.0, 9.0, 7.0), "g.tif"),
    )


def test_charts_come_back_as_they_were() -> None:
    """Oracle: the charts themselves, numbers to the digits of float32."""
    chart = _chart()
    (back,) = decode_charts(encode_charts([chart], "ab"))
    for f in dataclasses.fields(Chart):
        if f.name != "panels":
            assert getattr(back, f.name) == getattr(chart, f.name), f.name
    for one, other in zip(back.panels[0].layers, chart.panels[0].layers, strict=True):
        for f in dataclasses.fields(Layer):
            given, wanted = getattr(one, f.name), getattr(other, f.name)
            if isinstance(wanted, np.ndarray):
                np.testing.assert_allclose(given, wanted, rtol=2.0**-24)
            else:
                assert given == wanted, f.name
    assert (back.panels[0].scale, back.panels[0].limits) == ("log", (0.1, 10.0))


@pytest.mark.slow
def test_a_picture_of_the_ground_stays_below_its_limit() -> None:
    """Oracle: white noise, of which no JPEG is smaller, in the size that pages have."""
    noise = np.random.default_rng(1).integers(0, 256, (840, 1600, 3), dtype=np.uint8)
    jpeg = background_of(noise, (0.0, 0.0, 1.0, 1.0), "noise").jpeg
    assert is_jpeg(jpeg)
    assert len(base64.b64decode(jpeg)) < LARGEST_JPEG_BYTES
    assert not is_jpeg(jpeg[: len(jpeg) // 2 // 4 * 4])
    assert not is_jpeg("no picture")


def test_long_arrays_lose_less_than_one_can_see() -> None:
    """Oracle: a step of a page's height; a spike among small values keeps all digits of float32,
    and so do small values on a logarithmic scale.
    """
    rng = np.random.default_rng(2)
    time = np.linspace(0.0, 45.0, 1500)
    smooth = np.where(np.arange(1500) == 700, np.nan, 100.0 * np.sin(time))
    spiked = np.where(np.arange(1500) == 30, 1e6, rng.standard_normal(1500))
    decades = np.geomspace(1e-4, 1e3, 1500)
    layers = [Layer("line", time, y) for y in (smooth, spiked, decades)]
    chart = dataclasses.replace(_chart(), panels=(Panel("", layers),))
    text = encode_charts([chart])
    back = [layer.y for layer in decode_charts(text)[0].panels[0].layers]
    assert [isinstance(given, dict) for given in json.loads(text)["arrays"]] == [
        *(True, True, False, False)
    ]
    assert np.nanmax(np.abs(back[0] - smooth)) < 200.0 / 65534
    assert np.isnan(back[0]).nonzero()[0].tolist() == [700]
    for y, given in zip(back[1:], (spiked, decades), strict=True):
        np.testing.assert_allclose(y, given, rtol=2.0**-23)


def test_equal_arrays_stand_in_the_text_once() -> None:
    """Oracle: counting; of thirteen arrays of the chart six are different ones."""
    whole = json.loads(encode_charts([_chart()]))
    assert len(whole["arrays"]) == len(["x", "y", "x - 1", "x + 1", "rule", "none"])


@pytest.mark.parametrize("text", ["</script><b>.jpg", "<!--", "&amp;", "it's", "\u2028", 'say "x"'])
def test_no_text_leaves_its_script_element(text: str) -> None:
    """Oracle: the rules of HTML: within a script element "</" ends it and "<!--" changes it."""
    whole = encode_charts([_chart((text, "b", "c"))])
    assert not set("<>&'\u2028\u2029") & set(whole)
    assert decode_charts(whole)[0].panels[0].layers[2].texts[0] == text


def test_a_page_without_charts_or_with_others_is_refused() -> None:
    """Oracle: the house rule that a wrong input is named."""
    with pytest.raises(InputError, match="holds no charts"):
        in_page("<html></html>")
    with pytest.raises(InputError, match="cannot be read"):
        decode_charts('{"charts": 1}')
    page = f'<script type="application/json" id="charts">{encode_charts([_chart()], "cd")}</script>'
    charts, digest = in_page(page)
    assert (charts[0].name, digest) == ("motion", "cd")


def _long(diagnostics, eo, hours: float, images: int, fixes_hz: float = 10.0):
    """A run of that length: the report's 4000 rows and all images, every fix, noise throughout."""
    rng = np.random.default_rng(7)
    n, k = 4000 + images, int(hours * 3600.0 * fixes_hz)
    start, end = 205200.0, 205200.0 + 3600.0 * hours
    time = np.linspace(start, end, n)

    def noise(*shape: int) -> np.ndarray:
        return 0.01 * rng.standard_normal(shape)

    d = diagnostics(
        time=time,
        position=np.stack(
            [2000.0 * np.sin(time / 60.0), 2000.0 * np.cos(time / 47.0), np.full(n, -120.0)], axis=1
        )
        + noise(n, 3),
        velocity=10.0 + noise(n, 3),
        rpy=noise(n, 3),
        event=np.arange(4000, 4000 + images) - 2000,
        filter_sigma=0.1 + np.abs(noise(n, 9)),
        smoothed_sigma=0.02 + np.abs(noise(n, 9)),
        bias=noise(n, 6),
        bias_sigma=np.abs(noise(n, 6)),
        fix_time=np.linspace(start, end, k),
        innovation=noise(k, 3),
        innovation_sigma=0.01 + np.abs(noise(k, 3)),
        nis=rng.chisquare(3, k),
        used=np.ones(k, dtype=bool),
    )
    base = eo()
    rows = np.sort(rng.choice(n, images, replace=False))
    photographs = dataclasses.replace(
        base,
        images=tuple(f"DJI_20261123_{j:06d}.JPG" for j in range(images)),
        time=time[rows],
        position_m=d.position[rows],
        C_mc=np.tile(np.eye(3), (images, 1, 1)),
        cov=np.tile(np.diag(np.full(6, 1e-6)), (images, 1, 1)) * (1.0 + rng.random((images, 1, 1))),
        cross=None,
    )
    fixes = GnssFixes.from_degrees(
        d.fix_time,
        np.full(k, 46.0),
        np.full(k, 7.0),
        np.full(k, 500.0),
        sigma_m=(0.02, 0.02, 0.03),
        quality=np.where(np.arange(k) % 9 == 0, 2, 1),
    )
    series = fix_series(
        dataclasses.replace(
            fixes,
            satellites=np.round(12.0 + 300.0 * noise(k)),
            ratio=10.0 + noise(k),
            age_s=np.abs(noise(k)),
            pdop=2.0 + noise(k),
        )
    )
    return d, photographs, series


@pytest.mark.parametrize(("hours", "images"), [(0.75, 1500), (8.0, 10000)])
@pytest.mark.slow
def test_a_long_flight_makes_a_small_page(
    tmp_path: Path, diagnostics, eo, summary, hours: float, images: int
) -> None:
    """Oracle: the file's size. All series are noise, which is the worst that thinning can meet."""
    d, photographs, series = _long(diagnostics, eo, hours, images)
    path = write_report(tmp_path, summary(d, photographs), d, photographs, series)
    assert path.stat().st_size < SMALL
