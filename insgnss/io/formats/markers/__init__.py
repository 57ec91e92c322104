"""Image observations of ground points as other programs take them."""
