"""Wavelet variances: of a record, with their degrees of freedom, and of a model, with their
covariance.
"""
