"""How results show themselves where code is tried out: their text, and their charts as a figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..base.errors import UsageError, near
from .charts.chart import Chart
from .markup import escape

if TYPE_CHECKING:
    from .document import Document


class Shown:
    """A result whose text a notebook shows."""

    def summary(self) -> str:
        """Return the text for the terminal."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        """Return the text for a notebook."""
        return f"<pre>{escape(self.summary())}</pre>"


class Documented(Shown):
    """A result that makes a document, of which the terminal shows the text."""

    def document(self) -> "Document":
        """Return what the terminal and the page show of it."""
        raise NotImplementedError

    def summary(self) -> str:
        """Return the text for the terminal."""
        return self.document().text()


class Charted(Shown):
    """A result that has charts."""

    def charts(self) -> Sequence[Chart]:
        """Return its charts."""
        raise NotImplementedError

    def plot(self, only: Sequence[str] = ()) -> Any:
        """Draw the charts one below the other.

        Parameters
        ----------
        only : sequence of str
            Names of charts, or one name; all of them where empty.

        Returns
        -------
        matplotlib.figure.Figure
            The figure; ``figure.savefig("name.pdf")`` writes it.

        Raises
        ------
        UsageError
            A name that no chart has.
        """
        from .charts.drawn import figure_of

        charts = {chart.name: chart for chart in self.charts()}
        names = [only] if isinstance(only, str) else list(only) or list(charts)
        for name in names:
            if name not in charts:
                raise UsageError(f"plot: there is no chart {name!r}; {near(name, charts)}")
        return figure_of([[charts[name] for name in names]])
