"""The integers that kernels and Python share: where a state stands, and what a number stands for.

One definition for both sides. Numba takes these names as constants, slices included.
"""

# Error states. The navigation errors come first, in the axes of l; the other error states (of the
# IMU, then of the GNSS fixes and of a barometer) follow from `IMU0` on in the order of
# `layout.StateLayout`.
POS, VEL, PSI = slice(0, 3), slice(3, 6), slice(6, 9)  # m, m/s, rad
NAV = slice(0, 9)  # position, velocity, attitude
IMU_STATES = slice(9, None)  # all that follow
N_NAV = 9  # number of navigation error states
PX, PY, PZ, VX, VY, VZ, AX, AY, AZ = range(N_NAV)  # A: psi, the attitude error
VEL0, PSI0, IMU0 = VX, AX, N_NAV  # the first state of each group

# The nominal navigation state (10,): position and velocity stand where their errors do, then q_lb.
QUAT = slice(6, 10)
QW, QX, QY, QZ = 6, 7, 8, 9  # components of q_lb
N_NOMINAL = 10  # number of nominal values

# Channels of the IMU: gyro x y z, accelerometer x y z, body axes.
ACCEL0 = 3  # the first channel of the accelerometers
N_CHANNELS = 6  # number of channels

# What an error state is multiplied with before it adds to its channel; 0..5: that channel's rate.
BIAS = -1  # one
DRIFT_CODE = -2  # seconds since the start
AIDING_ERROR = -3  # nothing: an error of the fixes or of a barometer, in their measurement alone
TEMPERATURE_CODE = -4  # the temperature of the IMU above its mean, in its range over the recording
ABSENT = -1  # instead of the number of a state (or of a row, an event) that there is not

# Groups of fixes with error models of their own.
FIXED_GROUP = 0  # the usual: ambiguities fixed, or a recording in which all fixes are of one kind
UNFIXED_GROUP = 1  # float and code solutions, whose errors stay for a minute and more
VELOCITY_CODE = 2  # of the scales of white errors and of the time-correlated ones: the velocities

# Kinds of measured triples, in the order in which an epoch takes them.
POSITION_ROW = 0  # of the GNSS antenna (K.1)
VELOCITY_ROW = 1  # of the GNSS antenna (K.2)
VELOCITY_CONSTRAINT = 2  # ZUPT (K.8) or NHC (K.9)
ZARU = 3  # zero angular rate update (K.10)
BAROMETER_ROW = 4  # height (K.12)
N_KINDS = 5  # number of these; the k-th of `EstimationProblem.measurements` is N_KINDS + k

# A linearised measurement (K.13): what it is linearised about, and the columns of its derivative.
ABOUT_BIAS, ABOUT_STATES = 10, 13  # biases of the gyros, states of measurements, after the nominal
OF_BIAS, OF_STATES = 9, 12  # the same after the errors of navigation

# What is known of the velocity at an epoch without measuring it.
NO_CONSTRAINT = 0
ZUPT = 1  # zero-velocity update: the vehicle is stationary
NHC = 2  # non-holonomic constraint: no velocity across the forward axis

# What became of a triple.
NOT_MEASURED = 0
USED = 1  # in the update of the filter
REJECTED = 2  # by the innovation gate
COVARIANCE_RESET = 3  # used after the covariance was reset (K.7)
