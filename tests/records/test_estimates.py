"""How far data determine a constant, by its standard deviation before and after."""

import pytest

from insgnss.records.verdicts import Estimate

DEGREES = ("determined", "improved", "not determined")


@pytest.mark.parametrize(
    ("sigma", "degree"), [(0.33, 0), (0.34, 1), (0.89, 1), (0.91, 2), (1.2, 2)]
)
def test_a_third_of_the_prior_sigma_determines_and_nine_tenths_do_not(sigma, degree) -> None:
    """Oracle: the two limits by hand, for a prior sigma of 20 mm."""
    estimate = Estimate("antenna lever arm down", 0.1, 0.02 * sigma, 0.02)
    assert estimate.degree(*DEGREES) == DEGREES[degree]
    assert estimate.observed == (degree == 0)


def test_what_nobody_knew_before_is_determined_by_any_data() -> None:
    """Oracle: a prior sigma that is infinite."""
    assert Estimate("GNSS time offset", 0.0, 1e3).observed
