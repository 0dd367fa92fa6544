"""The trained surrogate: data set, multimodal variational autoencoder (MVAE), training."""
