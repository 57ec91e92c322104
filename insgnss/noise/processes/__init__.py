"""Realisations and discretisations of the processes of a noise model, their composition,
and the model as other programs read it.
"""
