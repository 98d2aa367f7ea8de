"""Storage and loss modulus against temperature and frequency, from exports of dynamic mechanical analysis."""
