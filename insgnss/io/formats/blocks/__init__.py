"""Image blocks: image observations, cameras and ground control of programs of photogrammetry."""
