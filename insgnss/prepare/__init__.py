"""One clock, one axis convention, every gap and outlier named."""
