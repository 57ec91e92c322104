"""One thread for linear algebra, set before numpy is loaded: the matrices are 30 x 30, and more
threads only wait for each other.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
