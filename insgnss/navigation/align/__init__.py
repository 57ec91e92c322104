"""The first attitude and its covariance, from the data alone, on the ground or in the air."""
