"""The lever arm from camera to antenna, from a tripod, in flight, and from targets on both."""
