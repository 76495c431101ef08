"""Maximum-likelihood estimates, their covariance, and remarks on genes that are not identifiable."""
