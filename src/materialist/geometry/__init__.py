"""From a depth map to a mesh: cuts at silhouettes, continued planes, creases."""
