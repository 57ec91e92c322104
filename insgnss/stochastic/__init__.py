"""IMU noise as sums of named processes: their units, their parameters in a file, their exact discretisation."""
