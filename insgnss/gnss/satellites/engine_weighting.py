"""The engine's estimator: what a time-correlated delay makes of a position.

Its filter holds the rover's position, the clocks (by differences between satellites) and the
ambiguities of all phases; such a delay moves a position to where its gain times the innovation is
zero. With integer ambiguities that is the weighted least squares of the epoch: the prediction from
the last one carries no place of its own, and codes have 1/300^2 of the weight of phases. A
float ambiguity takes the delay up by itself: it is known from the positions that
the integers of the others have fixed, so that its satellite agrees with them, whatever they make of
the delay. It follows with

    tau = sqrt(R dt / q)                                                                       (E.1)

R = (7 mm)^2 of the phase, q = (1e-4 cycles)^2/s that the engine gives an ambiguity, dt the
interval: two minutes at 10 Hz. Such a satellite counts only while the delay changes and as long
after it, by a millimetre or two. So GLONASS is taken not to count (`gloarmode` fix-and-hold without
holds, as `options` has it), unless `rtklib_options` have its ambiguities resolved too. With rows A
= (-u, 1 for the clock of the system), u the direction in north, east, down, of each band of each
satellite whose ambiguities are integers, delays d of its phases and the engine's weights P = 1 / (1
+ 1 / sin^2 E), of GLONASS 1 / 1.5^2 of that,

    displacement = the first three of (A^T P A)^-1 A^T P d                                     (E.2)
"""

import numpy as np

from ...records import Array
from ..options import EngineOptions
from .visible_satellites import Sky, directions

GLONASS_WEIGHT = 1.0 / 1.5**2  # of a GLONASS phase against others
UNRESOLVED = {
    "R": ("pos2-gloarmode", "3", {"0", "off", "3", "fix-and-hold"}),
    "C": ("pos2-bdsarmode", "1", {"0", "off"}),
}
ARMODE, FIX_AND_HOLD, NO_INTEGERS = "pos2-armode", {"3", "fix-and-hold"}, {"0", "off"}
LARGEST_CONDITION = 1e8  # of normal equations: above it the satellites determine no position


def carrying_systems(options: EngineOptions) -> str:
    """Return letters of the systems whose ambiguities the engine resolves; all if it resolves none.

    They carry its positions.
    """
    options_by_name = {name: str(value) for name, value in options.rtklib_options.items()}
    mode = options_by_name.get(ARMODE, "1")
    float_systems = {
        system
        for system, (name, usual, unresolved) in UNRESOLVED.items()
        if options_by_name.get(name, usual) in unresolved
    }
    if mode in FIX_AND_HOLD and options_by_name.get("pos2-gloarmode", "3") in FIX_AND_HOLD:
        float_systems.discard("R")  # a hold has calibrated its receivers' biases
    carrying = "".join(letter for letter in options.systems if letter not in float_systems)
    return options.systems if mode in NO_INTEGERS or not carrying else carrying


def displacement(satellites: Sky, delay: Array, epochs: int) -> Array:
    """Return the displacement (epochs, 3) m, north, east, down, by delays (m,) m of phases (E.2).

    It is NaN where satellites are too few.
    """
    n = 3 + int(satellites.system.max(initial=0)) + 1
    sin = np.sin(satellites.elevation)
    A = np.zeros((satellites.epoch.size, n))
    A[:, :3] = -directions(satellites.azimuth, satellites.elevation)
    A[np.arange(satellites.epoch.size), 3 + satellites.system] = 1.0
    PA = A * (satellites.weight / (1.0 + sin**-2))[:, None]
    N = np.zeros((epochs, n, n))
    b = np.zeros((epochs, n))
    for j in range(n):
        b[:, j] = np.bincount(satellites.epoch, PA[:, j] * delay, epochs)
        for k in range(n):
            N[:, j, k] = np.bincount(satellites.epoch, PA[:, j] * A[:, k], epochs)
    for j in range(3, n):
        N[:, j, j] += N[:, j, j] == 0.0  # a system without satellites in the epoch has no clock
    out = np.full((epochs, 3), np.nan)
    ill_conditioned = np.linalg.cond(N) > LARGEST_CONDITION
    well_conditioned = ~ill_conditioned
    out[well_conditioned] = np.linalg.solve(N[well_conditioned], b[well_conditioned][:, :, None])[
        :, :3, 0
    ]
    return out
