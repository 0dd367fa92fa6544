"""What a latent space of fewer coordinates would lose."""
