"""What a recording says about its sensors: of an IMU its deterministic calibration and the bias at
turn-on, and of the fixes their correlated errors, lever arm and clock, and whether the solution
stays with them. What camera poses say about the lever arm from camera to antenna."""
