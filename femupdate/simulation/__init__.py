"""Synthetic observations: a building's own equations, seen by accelerometers."""

from femupdate.lazy import lazily

_PUBLIC = {
    "fine_model": "truth",
    "parse_effect": "simulate",
    "simulate_observation": "simulate",
    "SimulationSettings": "simulate",
    "truth_of": "truth",
    "truth_path": "simulate",
    "white_noise": "simulate",
    "write_simulation": "simulate",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)
