"""From samples and fixes to smoothed states, and which error model explains them."""
