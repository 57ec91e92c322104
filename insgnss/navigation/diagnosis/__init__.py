"""The search for the error model that explains the innovations of a solution.

A filter whose models hold leaves innovations that are white and as large as it says. Where they are
not, this room looks for the cause: a time-correlated GNSS error, an antenna lever arm or a time
offset that differs from the flight file, turn-on biases that the noise model lacks. It takes an
estimation problem and a factory of state layouts, and gives back a solution, checks and messages;
it reads no file. The modules follow the way of the search:

    candidates       the error models that are tried
    evidence         the likelihood of the innovations under one of them
    time_correlated  the most likely time-correlated (Gauss-Markov) errors of the fixes
    sensor_dynamics  sensors that show the motion late or worse in turns
    variances        noise that is larger than its model says, and biases that it lacks
    decision         which candidate is adopted: `diagnose`
    failure          why a flight has no solution, and with which error model it has one
    drift            biases that warm up or drift; what larger noise smooths over
    advice           the notes for the user: checks against the flight file, a message
    remedies         the list of what is tried for a segment, in order: `REMEDIES`
    estimated        what a solution says of the constants and GNSS errors among its states
"""
