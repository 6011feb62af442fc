"""From a peak table to what may be said of the grasp, with its uncertainty."""
