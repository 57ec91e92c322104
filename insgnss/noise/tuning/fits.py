"""What tuning found of one axis, or of axes that share a model; `result.TuneResult` is of all."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...navigation.noise_model.model import AxisNoise
from ..estimation.gmwm import NoiseFit
from ..estimation.goodness import GoodnessOfFit
from ..estimation.inference import Inference
from .recordings import SENSOR_AXES
from .trend import AxisTrend

if TYPE_CHECKING:
    from ..estimation.near_stationarity import NearStationarity
    from ..estimation.selection import Ranking


@dataclass(frozen=True, eq=False)
class Tuned:
    """One model fitted to one axis of a sensor, or to its three axes jointly, over all recordings.

    axes : 0 to 2, whose curves stand in the order axis by axis, recording by recording.
    first : fit with the weights of the intervals.
    kept : the fit that is worth more, and `inference` of it; `how` says which and why.
    goodness : the J test of the efficient fit, which is the sharper, even where it was not kept;
        else that of the first.
    noise : what goes into the noise model.   remarks : what is to be said of it, a sentence each.
    """

    sensor: str
    axes: tuple[int, ...]
    first: NoiseFit
    kept: NoiseFit
    inference: Inference
    goodness: GoodnessOfFit
    how: str
    noise: AxisNoise
    remarks: tuple[str, ...] = ()
    ranking: "Ranking | None" = None
    stationarity: "NearStationarity | None" = None
    trends: tuple[tuple[str, int, AxisTrend], ...] = ()

    @property
    def name(self) -> str:
        """Sensor and axes, "gyro x" or "accel xyz"."""
        return f"{self.sensor} {''.join(SENSOR_AXES[k] for k in self.axes)}"

    @property
    def efficient(self) -> bool:
        """Whether the second step is what was kept."""
        return self.kept is not self.first
