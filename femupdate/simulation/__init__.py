"""Synthetic observations: a building's own equations, seen by accelerometers."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "simulate": (
            "parse_effect simulate_observation SimulationSettings truth_path white_noise "
            "write_simulation"
        ),
        "truth": "fine_model truth_of",
    },
)
