"""Forces from the files of balances."""
