"""What to record next: proposals, what they cost, and how probably they settle which hypothesis is right."""
