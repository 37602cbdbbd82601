"""Camera: drivers, frames, AprilTags and their poses."""
