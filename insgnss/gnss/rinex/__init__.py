"""RINEX files: observations, headers, navigation messages, camera events."""
