"""From a depth map to a mesh: cuts at silhouettes, continued planes, backs of objects, closed bodies."""
