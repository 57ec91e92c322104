"""Numba kernels of the navigation core.

Mathematics, with the numbers of the equations that the kernels quote: `navigation.filter.strapdown`
(S), `error_model` here (E), `navigation.filter.filter` (K), `navigation.filter.smoother` (B).

============== ===================================================================
records        what kernels take and fill: intervals, epochs, models, scratch
strapdown      the nominal state from one epoch to the next
error_states   decay, mean, weight and biases of the states behind those of navigation
error_model    transition and process noise of the errors over the same interval
prediction     covariance, mean and columns of errors over the same interval
antenna        innovation and derivative of a fix, position and velocity
measurements   the same of every other kind of measured triple, and by kind
update         innovation gate, update with three scalars, covariance reset, feedback
forward        the filter over all epochs
backward       the smoother over all epochs
outage         the smoothed covariance between fixes that are far apart
transitions    errors between camera events, and from information about them to all epochs
copies         of vectors and matrices, element by element
blas           what multiplies matrices, without the package around it
============== ===================================================================

Everything is written into arrays that the callers own; nothing is allocated inside the epoch loops
but within outages.
`nav` is (10,): position, velocity in l and the quaternion q_lb; `x` (ns,) the other states' values;
`n` = 9 + ns. Which state stands where, and what the integers mean, is defined in
`navigation.filter.codes`.
"""
