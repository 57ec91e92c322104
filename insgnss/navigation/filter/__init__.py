"""The core: strapdown mechanization, error model, error-state Kalman filter and smoother."""
