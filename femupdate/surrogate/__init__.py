"""Networks that stand in for the response of one building: data, training, storage."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "network": "LatentMixture ModalDecoder Mvae NetworkSizes Visibility",
        "soap": "Soap",
        "storage": (
            "find_surrogate load_surrogate require_surrogate save_surrogate Surrogate "
            "SurrogateInfo TRAINED"
        ),
        "training": (
            "compute_dataset proposal reconstruction train_mvae TrainingSettings TrainingTask"
        ),
    },
)
