"""From detections in the images of several cameras to tracks in space."""
