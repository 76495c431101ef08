"""Films: frames of one camera, one at a time, and the flashes of a strobe in them."""
