"""Pure formulas: rotations, the WGS84 ellipsoid and its gravity, local frames, and GPS time."""
