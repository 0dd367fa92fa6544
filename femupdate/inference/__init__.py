"""From likelihood to posterior: priors, likelihoods, the tempered sampler, metrics, storage."""

from femupdate.lazy import lazily

_PUBLIC = {
    "base_logs": "frf_data",
    "best_of_prior": "maxima",
    "COMPARING": "frf_data",
    "damping_parameter": "parameters",
    "DrawnBy": "posterior",
    "draws_about": "maxima",
    "EventErrors": "next_event",
    "EventScatter": "event_scatter",
    "forced_data": "frf_data",
    "found_from": "maxima",
    "identifiability": "diagnostics",
    "LatentLikelihood": "latent_likelihood",
    "learned_scatter": "event_scatter",
    "likelihood_of": "likelihood",
    "load_posterior": "posterior",
    "ModalErrors": "mode_data",
    "Parameter": "parameters",
    "Parameters": "parameters",
    "Posterior": "posterior",
    "predictive_check": "diagnostics",
    "PredictiveCheck": "diagnostics",
    "r_hat": "diagnostics",
    "reduction_target": "parameters",
    "save_posterior": "posterior",
    "settled": "maxima",
    "SmcSettings": "smc",
    "TemperedSmc": "smc",
    "theta_prior": "parameters",
    "Values": "parameters",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)
