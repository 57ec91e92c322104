"""What bundle adjustments give back: adjusted poses of images, data_specs/returned.md."""
