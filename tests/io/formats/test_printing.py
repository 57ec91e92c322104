"""Tables of numbers printed by a kernel, byte by byte as Python prints them."""

import numpy as np
import pytest

from insgnss.io.formats.text import text
from insgnss.io.formats.text.text import format_rows

FORMS = ("%d,%.6f,%.10f,%.4f,%.5f\n", "%.3f %d %.1f %.0f %.9f\n", "%.2f;%.2f;%.2f;%.2f;%.15f\n")


def numbers(seed: int, count: int = 4000) -> np.ndarray:
    """Numbers of all sizes and signs, ties of decimals, whole ones, and those of no size."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(count, 5)) * 10.0 ** rng.integers(-12, 12, (count, 5))
    ties = rng.integers(-(10**6), 10**6, (count, 5)) / 2.0 ** rng.integers(0, 12, (count, 5))
    decimals = np.round(values, 3) + 5e-4
    kind = rng.integers(0, 5, (count, 5))
    values = np.choose(kind, [values, ties, decimals, np.rint(values), 0.0 * values])
    values[0] = [1e300, -1e22, 1e-300, -0.0, 0.0]
    values[1] = [2.0**53, 2.0**52 + 0.5, 4503599627370495.5, 0.5, -0.5]
    return values


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(3))
def test_bytes_are_pythons(monkeypatch: pytest.MonkeyPatch, form: str, seed: int) -> None:
    """Oracle: Python's % of each row."""
    monkeypatch.setattr(text, "PRINT_FROM", 0)
    table = numbers(seed)
    got = "".join(format_rows(form, table, chunk=333)).splitlines()
    assert got == [form[:-1] % tuple(row) for row in table.tolist()]


def test_what_is_no_number_is_printed_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: Python's nan and inf, and formats that a kernel does not print."""
    monkeypatch.setattr(text, "PRINT_FROM", 0)
    table = np.array([[1.0, np.nan], [np.inf, 2.0], [-np.inf, -3.0]])
    for form in ("%.3f,%.1f\n", "%8.3f,%.1f\n", "%.3f,%g\n", "x%.3f,%.1f\n", "%.3f,%.1f \n"):
        assert "".join(format_rows(form, table)) == "".join(
            form % tuple(row) for row in table.tolist()
        )
    assert "".join(format_rows("%.3f,%.1f\n", table[:0])) == ""
