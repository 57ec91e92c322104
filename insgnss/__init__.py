"""insgnss: raw IMU and GNSS of a mapping drone to the exterior orientation of every image.

The data flow read -> prepare -> align -> filter -> smooth -> orient -> export; each step is a room
of this package and rooms hand each other the frozen records of :mod:`insgnss.records`. Importing
the package only sees to it that kernels can be compiled (:mod:`insgnss.base.caches`).

Conventions, stated here once
-----------------------------
Frames
    i inertial; e ECEF (WGS84); n local north-east-down at the point itself; l the flight's *local
    frame*: Cartesian, Earth-fixed, axes north-east-down at one reference point (`LocalFrame`); b
    body forward-right-down (FRD); c camera as computer vision has it (x image right, y image down,
    z viewing direction); m mapping: the tangent plane, Cartesian, Earth-fixed, axes east-north-up
    at its origin.
Rotations
    `C_nb` takes components in b into components in n; inner letters cancel: ``C_eb = C_en @ C_nb``,
    ``v_n = C_nb @ v_b``. Quaternions are (w, x, y, z), Hamilton, of the same direction as the
    matrix: ``q_lb`` belongs to ``C_lb``.
Vectors
    `r_ba_b` goes from the origin of b to a, written in the axes of b (the lever arm). `omega_ib_b`:
    rate of b with respect to i, in b.
Error state
    *truth = estimate + error*, for every state; for attitude ``C(true) = exp([psi x]) C(estimate)``
    with psi in the axes of the left-hand frame (l inside the filter, n in a trajectory, m in an
    exterior orientation).
Units
    SI and radians. Degrees only in files and on screen, and in names that say so (`heading_deg`).
    Noise densities are root power spectral densities and carry their unit in the name.
Time
    float64 seconds of one GPS week (GPST), the week beside it. Other scales and week roll-over are
    dealt with by readers. Past the week's end the seconds go on counting (they are not folded
    back).
"""

from .base.caches import settle

settle()

__version__ = "0.1.0"
