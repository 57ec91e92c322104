"""The core: strapdown mechanization, error model, error-state filter and smoother, as kernels that see a whole flight."""
