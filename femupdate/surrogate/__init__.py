"""The amortised likelihood: data set, multimodal variational autoencoder, training."""
