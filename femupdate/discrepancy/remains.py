"""What a model still misses once its parameters are found: how much, and where."""

from dataclasses import replace

from femupdate.discrepancy.fit import Fit
from femupdate.inference.data import Remains
from femupdate.inference.likelihood import Likelihood


def remains(problem: Likelihood, fitted: Fit) -> Remains:
    """What a fit leaves beside noise, by the rows of the tables of errors that it took for true.

    Of several kinds of data, where most is left; the sentence tells of all.
    """
    error = fitted.likelihood.error
    parts = zip(
        problem.data, error.parts, fitted.likelihood.row, error.apart(fitted.raw[None]), strict=True
    )
    found = [data.remains(table, row, raw[0]) for data, table, row, raw in parts]
    sentences = dict.fromkeys(one.sentence for one in found if one.sentence)
    return replace(max(found, key=lambda one: one.size), sentence=" ".join(sentences))


__all__ = ["Remains", "remains"]
