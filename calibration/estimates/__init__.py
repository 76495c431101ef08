"""Maximum-likelihood estimates, their covariance, and what the data cannot separate."""
