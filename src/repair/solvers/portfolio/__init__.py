"""Several backends as one: the cheap one first, the others for what is still open."""
