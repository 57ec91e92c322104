"""Noise models from recordings: moments, estimation, `insgnss tune`, and the deterministic
calibration from several positions.
"""
