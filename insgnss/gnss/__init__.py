"""From RINEX of rover and base to antenna positions with an honest covariance, on an existing
engine (PPK).

RINEX is read by `rinex`, ambiguities are resolved by RTKLIB in a process of its own (`options`,
`preflight`, `engine`), and around it stand what it leaves open: orbits and velocities from phase,
the wet delay, calibrated covariances, events, quality and the order of it all.
"""
