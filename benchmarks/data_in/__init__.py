"""Files of other programs: what is read is what was written, nothing is guessed, and no bad file ends in a crash."""
