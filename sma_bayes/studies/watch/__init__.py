"""`sma-bayes watch`: whether a spring is still the one that was fitted, told cycle by cycle."""
