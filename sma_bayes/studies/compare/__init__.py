"""The contenders on the same record: evidence, held-out data, correlation."""
