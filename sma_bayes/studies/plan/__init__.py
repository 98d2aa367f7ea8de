"""The verb `plan`: what to measure next, by what it is expected to tell per hour on the rig."""
