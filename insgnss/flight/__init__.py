"""The flight file, the main job, first contact, exports, and the textbook twin."""
