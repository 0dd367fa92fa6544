"""From likelihood to posterior: priors, likelihoods, the tempered sampler, metrics, storage."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "diagnostics": "identifiability predictive_check PredictiveCheck r_hat",
        "event_scatter": "EventScatter learned_scatter",
        "frf_data": "base_logs forced_data frf_data",
        "latent_likelihood": "LatentLikelihood",
        "likelihood": "likelihood_of",
        "maxima": "best_of_prior draws_about found_from on_fewer_shapes settled",
        "mode_data": "ModalErrors",
        "model_error": "COARSE_ERROR STATED",
        "next_event": "EventErrors",
        "parameters": "damping_parameter Parameter Parameters reduction_target theta_prior Values",
        "posterior": "DrawnBy load_posterior Posterior save_posterior",
        "smc": "SmcSettings TemperedSmc",
    },
)
