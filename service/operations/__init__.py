"""What operators need: health, metrics and log, shutdown, forwarding."""
