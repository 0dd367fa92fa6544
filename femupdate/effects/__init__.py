"""What a model may lack: the catalogue of effects, and what each adds to a structure."""
