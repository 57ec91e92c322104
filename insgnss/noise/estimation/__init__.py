"""Composite models from wavelet variances (GMWM): fit, standard errors, tests of fit, the choice
among models.
"""
