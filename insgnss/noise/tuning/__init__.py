"""From recordings to a noise model: read, check, wavelet variances, fit, inference, verdict,
files.
"""
