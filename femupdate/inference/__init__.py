"""From likelihood to posterior: priors, likelihoods, the tempered sampler, metrics, storage."""
