"""Quantities with units against hand conversion and scipy's constants."""

import math

import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.base.units import UNITS, format_quantity, parse_quantity, parse_unit

DEG = math.pi / 180.0
G = 9.80665


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        ("100 deg/h", "rad/s", 100 * DEG / 3600),
        ("10.825 deg/h/sqrt(Hz)", "deg/h/sqrt(Hz)", 10.825 * DEG / 3600),
        ("0.24 deg/sqrt(h)", "deg/h/sqrt(Hz)", 0.24 * DEG / 60),  # 1/sqrt(Hz) is sqrt(s)
        ("4.943e-3 deg/s^2/sqrt(Hz)", "rad/s^2/sqrt(Hz)", 4.943e-3 * DEG),
        ("51.514 ug/sqrt(Hz)", "m/s^2/sqrt(Hz)", 51.514e-6 * G),
        ("51.514 \u00b5g/sqrt(Hz)", "m/s^2/sqrt(Hz)", 51.514e-6 * G),
        ("51.514 \u03bcg / sqrt( Hz )", "m/s^2/sqrt(Hz)", 51.514e-6 * G),
        ("0.018 m/s/sqrt(h)", "m/s^2/sqrt(Hz)", 0.018 / 60),
        ("2mg", "m/s^2", 2e-3 * G),
        ("3 mGal", "m/s^2", 3e-5),
        ("1 arcsec", "rad", DEG / 3600),
        ("1 arcmin", "rad", DEG / 60),
        ("250 urad", "rad", 2.5e-4),
        ("2 min", "s", 120.0),
        ("0.5 hr", "s", 1800.0),
        ("1 day", "s", 86400.0),
        ("1500 ppm", "1", 1.5e-3),
        ("0.15 %", "1", 1.5e-3),
        ("-3e-4 1", "1", -3e-4),
        ("0.5", "1", 0.5),
        ("+.5 km", "m", 500.0),
        ("4 rad*s^-1.5", "rad/s/sqrt(s)", 4.0),
        ("4 (cm/s)^2", "m*m/(s*s)", 4e-4),
        ("9 sqrt(m/s^2)*sqrt(m*s^-2)", "m/s^2", 9.0),
        ("5 1/s", "Hz", 5.0),
    ],
)
def test_quantity_in_si(text, dimension, si):
    """Oracle: conversion by hand; relative rounding."""
    assert_allclose(parse_quantity(text, dimension), si, rtol=1e-15)


def test_scales_are_those_of_scipy_constants():
    """Oracle: scipy.constants."""
    from scipy import constants

    for name, value in (
        ("deg", constants.degree),
        ("arcmin", constants.arcmin),
        ("arcsec", constants.arcsec),
        ("g", constants.g),
    ):
        assert_allclose(UNITS[name].scale, value, rtol=1e-15)
    for name, value in (("min", constants.minute), ("h", constants.hour), ("day", constants.day)):
        assert UNITS[name].scale == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("100", "has no unit; angle time\\^-1 is expected, as in '1 deg/h'"),
        (100.0, "has no unit; angle time\\^-1 is expected, as in '1 deg/h'"),
        ("deg/h", "does not start with a number"),
        ("nan deg/h", "does not start with a number"),
        ("1e999 deg/h", "is too large or too small"),
        ("100 degs/h", "unknown unit 'degs'; did you mean 'deg'"),
        ("100 xyzzy", "unknown unit 'xyzzy'; known are"),
        ("2 mg", "is of dimension length time\\^-2; angle time\\^-1 is expected, as in '1 deg/h'"),
        ("100 1/s", "is of dimension time\\^-1; angle"),  # an angle is not a pure number
        ("100 deg", "is of dimension angle; angle time\\^-1"),
        ("100 deg/h/sqrt(Hz)", "is of dimension angle time\\^-1/2;"),
        ("100 deg h", "'h' must be joined by"),
        ("100 deg//h", "a unit is expected where '/'"),
        ("100 deg/", "a unit is expected where 'the end'"),
        ("100 deg/sqrt h", "'\\(' expected, found 'h'"),
        ("100 deg/sqrt(h", "'\\)' expected, found 'the end'"),
        ("100 deg/s^x", "'x' is no exponent"),
        ("100 deg/h^999", "'999' is no exponent"),
        ("1" + "(" * 9000, "a unit of 9000 characters \\(limit 100\\)"),
        ("1,5 deg/h", "',5 deg/h' does not belong in a unit"),
        ("1 000 deg/h", "a unit is expected where '000'"),
    ],
)
def test_wrong_quantities_are_refused_in_one_line(text, message):
    """Oracle: by contract (design.md 4): a missing unit, an unknown one and another dimension are
    errors that say what is expected.
    """
    with pytest.raises(InputError, match=message) as caught:
        parse_quantity(text, "deg/h")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("unit", ["deg/h", "deg/sqrt(h)", "ug/s/sqrt(Hz)", "mg", "ppm", "s"])
def test_written_quantity_is_read_back_to_the_last_bit(unit):
    """Oracle: float equality after a round trip of random values and of zero."""
    import numpy as np

    for value in [0.0, *(10.0 ** np.random.default_rng(3).uniform(-9, 3, 200))]:
        assert parse_quantity(format_quantity(float(value), unit), unit) == value


def test_short_values_are_written_short():
    """Oracle: what a person would write."""
    assert format_quantity(parse_quantity("10.825 deg/h", "deg/h"), "deg/h") == "10.825 deg/h"
    assert format_quantity(parse_quantity("200 deg/h", "deg/h"), "deg/h") == "200 deg/h"


def test_products_commute_and_powers_undo_roots():
    """Oracle: algebra of units, by property."""
    assert parse_unit("m*deg/s").exponents == parse_unit("deg/s*m").exponents
    assert parse_unit("sqrt(h)^2") == parse_unit("h")
    assert parse_unit("sqrt(s)/s").dimension == "time^-1/2"
