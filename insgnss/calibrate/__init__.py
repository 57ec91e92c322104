"""What a recording says about its sensors: deterministic calibration of an IMU, and the bias at turn-on."""
