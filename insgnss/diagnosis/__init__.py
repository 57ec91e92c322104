"""Which error model explains the innovations of a solution: time-correlated GNSS errors, lever arm, time offset, turn-on biases."""
