"""Networks that stand in for the response of one building: data, training, storage."""

from femupdate.lazy import lazily

_PUBLIC = {
    "compute_dataset": "dataset",
    "DatasetPlan": "dataset",
    "find_surrogate": "storage",
    "LatentMixture": "network",
    "load_surrogate": "storage",
    "loss_terms": "training",
    "LossSettings": "training",
    "ModalDecoder": "network",
    "Mvae": "network",
    "NetworkSizes": "network",
    "proposal": "training",
    "reconstruction": "training",
    "require_surrogate": "storage",
    "save_surrogate": "storage",
    "Soap": "soap",
    "Surrogate": "storage",
    "SurrogateInfo": "storage",
    "train_mvae": "training",
    "TRAINED": "storage",
    "TrainingSettings": "training",
    "TrainingTask": "training",
    "Visibility": "network",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)
