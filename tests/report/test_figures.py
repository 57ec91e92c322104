"""Pictures: thinned lines keep what the eye looks for, and there is a picture of every run."""

import io
import itertools

import numpy as np
import pytest
from PIL import Image

from insgnss.report.figures.run import pictures
from insgnss.report.figures.style import MOST_POINTS, thin
from insgnss.report.figures.support import _normal_mixture
from insgnss.report.marks import OUTAGE_SHADE, STATIONARY_SHADE, marks_of

START = 205200.0
ALL = ["map", "motion", "sigmas", "innovations", "biases", "separation"]


def test_thinned_line_keeps_its_extremes() -> None:
    """Oracle: definition; single spikes, the ends and the extremes of each stretch survive."""
    y = np.random.default_rng(0).standard_normal(27013)
    y[[5000, 20001]] = 50.0, -50.0
    keep = thin(y)
    assert keep.size <= MOST_POINTS + 2
    assert (np.diff(keep) > 0).all()
    assert {0, 5000, 20001, y.size - 1} <= set(keep.tolist())
    stretch = np.searchsorted(keep, np.arange(0, y.size, 1000))
    assert all(
        y[keep[a:b]].max() > 1.5 for a, b in itertools.pairwise(stretch)
    )  # of 1000 normal numbers, surely


def test_thinned_line_stays_broken_where_it_was() -> None:
    """Oracle: definition; a stretch that is not determined keeps a point that is not."""
    y = np.ones(10000)
    y[4000:6000] = np.nan
    keep = thin(y)
    assert np.isnan(y[keep[(keep >= 4100) & (keep < 5900)]]).all()
    assert ((keep >= 4100) & (keep < 5900)).any()


def test_short_line_is_kept_whole() -> None:
    """Oracle: definition."""
    assert thin(np.arange(5.0)).tolist() == [0, 1, 2, 3, 4]


def test_expected_density_is_one_in_sum() -> None:
    """Oracle: closed form; a density integrates to one, and that of one normal variable is known at
    zero.
    """
    x = np.linspace(-2, 2, 4001)
    assert np.trapezoid(_normal_mixture(x, np.array([0.1, 0.2, 0.3])), x) == pytest.approx(
        1.0, abs=1e-6
    )
    assert _normal_mixture(np.zeros(1), np.full(500, 0.5))[0] == pytest.approx(
        1 / (0.5 * np.sqrt(2 * np.pi))
    )


def test_pictures_are_drawn(diagnostics, eo) -> None:
    """Oracle: Pillow reads them; each has the width that was asked for, and is not blank."""
    drawn = pictures(diagnostics(), eo())
    assert [picture.name for picture in drawn] == ALL
    for picture in drawn:
        image = Image.open(io.BytesIO(picture.png)).convert("L")
        assert image.width == 1000
        assert np.ptp(np.asarray(image)) > 200
        assert picture.reading.endswith(".")


@pytest.mark.slow
def test_every_run_has_its_pictures(odd_cases) -> None:
    """Oracle: by hand; what there is nothing to draw of is left out, the rest is there."""
    missing = {"no fix": "innovations", "separation undetermined": "separation"}
    for name in ("no camera", "everything rejected", *missing):
        d, images = odd_cases[name]
        assert [picture.name for picture in pictures(d, images)] == [
            p for p in ALL if p != missing.get(name)
        ], name


def test_marks_are_where_they_belong(block) -> None:
    """Oracle: by hand; minutes from the start of lines, of a rest that began before, of fixes
    lacking from 30 to 50 s, of two parts.
    """
    d = block()
    used = (d.fix_time <= START + 30) | (d.fix_time >= START + 50)
    parts = ((START, START + 60.0), (START + 90.0, START + 119.9))
    marks = marks_of(
        block(used=used, stationary=np.array([[START - 9, START + 6]]), segments=parts), None
    )
    assert 60 * marks.stationary == pytest.approx(np.array([[0.0, 6.0]]), abs=1e-6)
    assert 60 * marks.outages == pytest.approx(np.array([[30.0, 50.0]]), abs=1e-6)
    assert 60 * marks.nothing == pytest.approx(np.array([[60.0, 90.0]]), abs=1e-6)
    assert len(marks.lines) == 4
    assert [(part.start, part.stop) for part in marks.parts] == [(0, 750), (750, 1200)]
    assert [part.stop for part in marks.parts_of(np.array([0.1, 0.9, 1.6]))] == [2, 3]


@pytest.mark.slow
def test_stationary_periods_and_outages_are_shaded_in_every_figure_over_time(diagnostics) -> None:
    """Oracle: Pillow; pixels of the two shades are there where they were asked for, and only
    then.
    """
    d = diagnostics()
    used = (d.fix_time <= START + 60) | (d.fix_time >= START + 110)
    marked = pictures(diagnostics(used=used, stationary=np.array([[START, START + 30]])), None)
    for plain, shaded in zip(pictures(d, None), marked, strict=True):
        for shade in (STATIONARY_SHADE, OUTAGE_SHADE):
            assert _pixels(plain.png, shade) == 0, plain.name
            assert plain.name == "map" or _pixels(shaded.png, shade) > 2000, plain.name


def _pixels(png: bytes, colour: str) -> int:
    """Number of pixels of exactly that colour."""
    image = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
    return int((image == [int(colour[i : i + 2], 16) for i in (1, 3, 5)]).all(axis=2).sum())
