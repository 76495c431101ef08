"""Effects of the vortices and the moving air behind a wing."""
