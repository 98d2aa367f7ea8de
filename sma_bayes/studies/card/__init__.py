"""A fit handed on: a constitutive card for solvers, and the stiffness for a controller."""
