"""The time of camera events by the rover's clock."""
