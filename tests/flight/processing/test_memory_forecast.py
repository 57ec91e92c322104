"""A flight that memory does not hold is refused before it is filtered."""

import pytest

from insgnss.base.errors import DataError
from insgnss.flight.processing.estimation_problem import refuse_beyond_memory
from insgnss.navigation.filter.forecast import forecast

DAY = forecast(14_400_000, 290_000, 34, 1, 4000, 288_001)


def test_what_is_not_there_is_refused_in_one_line() -> None:
    """Oracle: its own numbers, in GB; a third beyond what is available passes, since a forecast may
    be off by that, and so does everything where the system says nothing.
    """
    assert DataError.exit_code == 4
    need = DAY.total
    refuse_beyond_memory(DAY, int(need / 1.3))
    with pytest.raises(DataError) as refused:
        refuse_beyond_memory(DAY, int(need / 1.4))
    line = str(refused.value)
    assert "\n" not in line
    assert line.startswith(f"some {need / 1e9:.1f} GB of memory needed, {need / 1.4e9:.1f} GB avai")
    assert "14400000 samples 0.8" in line
    assert line.endswith("; process parts of the flight with start_tow and end_tow")
    dense = forecast(14_400_000, 290_000, 34, 1, 4000, 14_400_000)
    with pytest.raises(DataError, match=r"; lower output\.trajectory_hz, or process parts"):
        refuse_beyond_memory(dense, int(1e9))


def test_it_passes_where_nothing_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: no refusal, however much is needed."""
    monkeypatch.setattr("insgnss.flight.processing.estimation_problem.available", lambda: None)
    refuse_beyond_memory(DAY)
