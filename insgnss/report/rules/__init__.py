"""The rules that judge a run, and their words."""
