"""The spectrum of the IMU in straight flight: charts for the page."""

import numpy as np

from ....report.charts.chart import Chart
from .result import FlightTuning

LINES_SHOWN = 4  # strongest lines of a channel marked in its panel (chosen)


def spectra(tuning: FlightTuning) -> tuple[Chart, ...]:
    """Return the IMU's spectra in straight flight, none without one.

    White noise of the static model and of the model in flight stand beside them.
    """
    from ....report.figures.noise import SpectrumPanel, spectrum_charts

    s = tuning.straight
    if s is None:
        return ()
    panels = []
    for c in range(6):
        sensor, axis = ("gyro", "accel")[c // 3], c % 3
        static, in_flight = (
            getattr(model, sensor)[axis].white_noise for model in (tuning.static, tuning.model)
        )
        level = np.ones(s.frequency_hz.size)
        models = [("white noise, static model", static * level)] + (
            [("by the innovations", in_flight * level)] if in_flight != static else []
        )
        of_channel = sorted(
            (line for line in s.lines if line.channel == f"{sensor} {'xyz'[axis]}"),
            key=lambda line: -line.rms,
        )
        frequencies = [line.frequency_hz for line in of_channel[:LINES_SHOWN]]
        panels.append(
            SpectrumPanel(
                "gyro" if c < 3 else "accel",
                "xyz"[axis],
                s.frequency_hz,
                s.density[c],
                models,
                frequencies,
            )
        )
    return spectrum_charts(panels)
