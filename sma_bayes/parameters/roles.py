"""What a parameter of a response does to its curve: by its role, never by the letters of its name, it is found."""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """Part that a parameter plays in the curve of its channel.

    A model need not have every role, and a parameter need not have one. What is said of a role holds for all models:
    the span leads from the cold to the hot branch at the midpoint, whatever the shape of the way there.
    """

    SPAN = "span"
    """Distance from the cold to the hot phase's line at the midpoint [unit of the channel]."""
    RATE = "rate"
    """Rate of the transformation [1/unit of temperature]."""
    MIDPOINT = "midpoint"
    """Temperature about which the transformation is centred."""
    WIDTH = "width"
    """Range of temperature of the transformation."""
    OFFSET = "offset"
    """Value of the cold phase's line at the midpoint; where it has no slope, far below it [unit of the channel]."""
    LEVEL = "level"
    """Any other value of the channel: of the hot phase, or at a fixed temperature."""
    COLD_SLOPE = "cold_slope"
    """Slope of the phase that is stable below the transformation [unit of the channel/unit of temperature]."""
    HOT_SLOPE = "hot_slope"
    """Slope of the phase that is stable above it."""
    SLOPE = "slope"
    """Slope of the whole curve."""
    EFFECT = "effect"
    """What an input other than temperature adds [unit of the channel]."""
    SKEW = "skew"
    """Asymmetry of the transformation [1]; 0 for none."""
    TAIL = "tail"
    """How fast the transformation dies out far from its midpoint [1]; 1 as the logistic does, below 1 more slowly."""
    SHARE = "share"
    """Share of the first of two stages [1]."""
    GAP = "gap"
    """Distance of the midpoint of the second stage from that of the first [unit of temperature]."""
    SECOND_RATE = "second_rate"
    """Rate of the second stage [1/unit of temperature]."""
