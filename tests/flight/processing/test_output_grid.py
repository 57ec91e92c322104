"""The rows of the output grid stand at the fixes where these are near."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.flight.processing.estimation_problem import output_grid
from insgnss.navigation.prepare.increments import merge_marks


def test_fixes_with_the_clock_of_the_receiver_share_their_epochs_with_the_grid():
    """Oracle: counted. PPK stamps its epochs by a clock that drifts from -3 to 9 ms off the grid;
    10 Hz fixes for 45 minutes were 53 846 epochs, of 27 001.
    """
    regular = 345_600.0 + np.arange(27_001) / 10.0
    fixes = regular - 0.003 + 0.012 * np.linspace(0.0, 1.0, regular.size)
    grid = output_grid(fixes[0], fixes[-1], 10.0, fixes)
    union, (at_fix, at_grid) = merge_marks(fixes, grid)
    assert union.size <= fixes.size + 1
    assert_array_equal(at_fix[: at_grid.size], at_grid)


def test_rows_far_from_every_fix_stay_where_they_are():
    """Oracle: a quarter of the step. Fixes once a second 20 ms late: nine rows of ten are regular;
    30 ms late all of them. At 20 Hz the grid is that of 10 Hz, and the rows between are recovered.
    """
    seconds = np.arange(20.0)
    for late, moved in ((0.02, True), (0.03, False)):
        fixes = np.concatenate([[0.0], seconds[1:] + late])
        grid = output_grid(0.0, 19.0, 20.0, fixes)
        regular = np.arange(191) / 10.0
        at_seconds = np.arange(191) % 10 == 0
        assert_allclose(grid[~at_seconds], regular[~at_seconds], rtol=0, atol=1e-12)
        expected = fixes if moved else seconds
        assert_allclose(grid[at_seconds], expected, rtol=0, atol=1e-12)


def test_rows_increase_whatever_the_fixes():
    """No fix takes two rows, whatever the rate of either."""
    random = np.random.default_rng(5)
    for _ in range(20):
        fixes = np.sort(random.uniform(0.0, 30.0, random.integers(2, 2000)))
        rate = random.uniform(0.2, 10.0)
        grid = output_grid(fixes[0], fixes[-1], rate, fixes)
        steps = np.diff(grid)
        assert (steps > 0.499 / rate).all()
        assert (steps < 1.501 / rate).all()
