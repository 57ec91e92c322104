"""The reference twin: filter and smoother of the navigation core once more, written to be read.

The core (`insgnss.navigation.filter`) sees a whole flight in compiled kernels that are made for
speed. This room solves the same estimation problem the way a textbook writes it down, on plain
numpy and filterpy's `KalmanFilter`: one IMU sample after the other, matrices in full size, no
kernel of the core. It takes the very same problem and initial state, so that any difference between
the two is a defect of one of them. It is some hundred times slower. Read it from top to bottom:

`strapdown`     the nonlinear equations of motion, integrated over one IMU sample
`error_model`   their linear error model, and its transition and noise over an interval
`measurements`  what each sensor would measure, and its derivative by central differences
`linear`        Kalman filter and Rauch-Tung-Striebel smoother of a linear problem
`twin`          the extended Kalman filter with feedback, and the smoother, put together from these
`poses`         from the samples to the poses of the images by another way, in ECEF; nothing of
                `navigation`, so that Earth, increments, alignment and mounting are its own
`verify`        a part of a user's own flight by core, twin and these poses, and their differences

Symbols
-------
p, v, C_lb      position (m) and velocity (m/s) of the IMU in the local frame l; attitude, b into l
x               (ns,) IMU error states and errors of the GNSS fixes, `navigation.filter.layout`
state           p, v, C_lb and x at one instant: the *nominal*, about which errors are counted
error           (n,) = (dp, dv, psi, dx), truth minus nominal, psi in l; n = 9 + ns
Phi, Q          (n, n) transition and process noise of the error from one epoch to the next
H, z, R         measurement of the error about the nominal: z = H error + noise of covariance R
P               (n, n) covariance of the error

Frames, signs and units are those of the package (`insgnss`).
"""
