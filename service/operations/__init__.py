"""What operators need: health, metrics, log, shutdown and the TCP forwarder."""
