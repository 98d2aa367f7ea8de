"""Numbers of the normal distribution that several rooms need."""

from __future__ import annotations

import math
from typing import Final

HALF_LN_2PI: Final = 0.5 * math.log(2.0 * math.pi)
"""Minus the log density of a standard normal variable at zero."""
MAD_TO_SD: Final = 1.4826
"""Standard deviation over the median absolute deviation, to the digits that robust statistics has it."""
