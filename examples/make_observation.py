"""Makes examples/six_story_white_noise.csv, the observation that the examples and the demo use.

A synthetic white-noise run on the six-story wall-frame building, with three accelerometers a floor.
Its truth is written beside it. Run it to make the file again, or change the settings below to make
another one.
"""

from pathlib import Path

from femupdate.building.files import load_building
from femupdate.simulation.simulate import SimulationSettings, simulate_observation, write_simulation

BUILDING = "six_story_wall_frame"
FILE = "six_story_white_noise.csv"
SETTINGS = SimulationSettings(
    theta=(0.8, 1.1, 0.9, 1.3, 1.0, 0.7),
    zeta=0.02,
    mesh_size=0.08,  # the building's own model has 0.2 m, the effect finder's 0.13 m
    sensors=("X1-Y2", "X4-Y2", "X1-Y1"),
    duration_s=80.0,
    sampling_hz=200.0,
    rms_m_s2=0.3,
    band_hz=(0.5, 50.0),
    sensor_noise_m_s2=0.003,  # 1 % of the base motion
    quantisation_m_s2=0.0001,
    seed=2015,
)


def make(folder: Path) -> tuple[Path, Path]:
    """Write the observation and its truth into a folder and return their paths."""
    simulation = simulate_observation(load_building(BUILDING), SETTINGS)
    comment = "remade by examples/make_observation.py"
    written = write_simulation(simulation, folder / FILE, [comment])
    return written.observation, written.truth_file


if __name__ == "__main__":
    for path in make(Path(__file__).resolve().parent):
        print(path)
