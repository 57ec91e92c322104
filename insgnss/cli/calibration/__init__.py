"""What `insgnss calibrate` does, one module a kind of calibration."""
