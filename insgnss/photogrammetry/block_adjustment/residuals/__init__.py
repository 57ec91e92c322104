"""What residuals say together: of check points by their covariance, of images by their place."""
