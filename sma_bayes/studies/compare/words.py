"""Models and noises as people call them; what a user types, and what programs read, are the keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from sma_bayes.noise import NOISE_MODELS

SHORT: Final[Mapping[str, str]] = {
    "modified_sigmoid": "modified sigmoid",
    "modified_sigmoid_tied": "modified sigmoid, A2 = B2",
    "logistic_published": "logistic, published",
    "logistic_corrected": "logistic, corrected",
    "logistic_refitted": "logistic, refitted",
    "polynomial_published": "polynomial, published",
    "polynomial_corrected": "polynomial, corrected",
    "polynomial_refitted": "polynomial, refitted",
    "bounded_logistic": "bounded logistic",
}
"""Models of the paper and their variants, briefly."""


def short(name: str) -> str:
    """Name of a model in a row or a column.

    Examples
    --------
    >>> short("logistic_refitted")
    'logistic, refitted'
    """
    return SHORT.get(name, name.replace("_", " "))


def spoken(name: str) -> str:
    """Name of a model in a sentence.

    Examples
    --------
    >>> spoken("logistic_refitted")
    'refitted logistic'
    >>> spoken("modified_sigmoid_tied")
    'modified sigmoid with A2 = B2'
    """
    curve, _, variant = short(name).partition(", ")
    if not variant:
        return curve
    return f"{variant} {curve}" if variant.isalpha() else f"{curve} with {variant}"


def listed(names: Sequence[str]) -> str:
    """Models in a sentence, as a list with an "and" in it."""
    words = [spoken(name) for name in names]
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def same_curve(names: Sequence[str]) -> str:
    """That models are one curve, as the beginning of a sentence."""
    return f"{listed(names)} are the same curve of this channel"


def noise_words(name: str) -> str:
    """Title of a noise model; its name where it is one of a package that is not there.

    Examples
    --------
    >>> noise_words("ar1_student_t")
    'AR(1) in sample index with Student t innovations'
    """
    return NOISE_MODELS[name].title if name in NOISE_MODELS else name
