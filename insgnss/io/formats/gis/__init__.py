"""Exterior orientations for geographic information systems and globes."""
