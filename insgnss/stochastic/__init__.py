"""IMU noise as sums of named processes: their parameters in a file, their exact discretisation."""
