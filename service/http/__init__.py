"""What stands between a request and a route: limits, errors, problem details, answers in pieces, events."""
