"""IMU samples, one module a format; and published variances instead of a recording."""
