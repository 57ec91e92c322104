"""What the innovations of a solution say: their likelihood, the noise that explains them,
and whether the solution stays with its fixes.
"""
