"""IMU samples, one module a format; and published variances in the place of a recording."""
