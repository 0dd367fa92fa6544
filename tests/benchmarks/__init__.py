"""Published tables, trials and comparisons, beside our own figures.

They are no part of what is installed. In a checkout this folder is `femupdate.benchmarks`: the
benchmark NAME runs as `femupdate benchmark NAME`, and from the checkout's root folder also as
`python -m femupdate.benchmarks NAME`.

A new benchmark is a line in `COMMANDS` and a module that holds its click command as `command`,
made with `command.benchmark_options`, which hands it a `Job` and prints its `Report`.
"""

# Name of a benchmark to the module here that holds its command, and its line in the help.
COMMANDS = {
    "all": (
        "regression.command",
        "Every command on fixed data, beside a reference: what has fallen is marked.",
    ),
    "solver": (
        "solver.command",
        "Element tests against published values; speed against OpenSees.",
    ),
    "shear4dof": (
        "shear4dof.command",
        "The posterior with four modes: published tables, and the exact posterior.",
    ),
    "calibration": (
        "calibration.command",
        "Whether posteriors hold the truth as often as they say.",
    ),
    "hidden-effects": (
        "hidden_effects.command",
        "What the effect finder makes of effects that were hidden.",
    ),
    "changes": (
        "changes.command",
        "Whether a changed story is named, and how often an unchanged one.",
    ),
    "frame-coverage": (
        "frame_coverage.command",
        "Whether intervals of frames hold the truth of another mesh or program.",
    ),
    "measured": (
        "measured.command",
        "How honest intervals are on measured events: each predicted from every other.",
    ),
}
