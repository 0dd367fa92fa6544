"""The building as data: files, validation, mesh, and the matrices of shear buildings."""
