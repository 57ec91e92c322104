"""What a tuning leaves: noise model, tables, figures, words."""
