"""Force, displacement and stiffness in time, from a heating current."""
